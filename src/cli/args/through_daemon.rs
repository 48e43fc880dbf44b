//! Benchmarks that ask a daemon of their own.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

/// A benchmark of answers from memory.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchLatency {
    /// The assembly to plan [default: a bolted frame of 20 parts]
    pub(in crate::cli) assembly: Option<PathBuf>,
    /// Simultaneous clients
    #[arg(long, value_name = "N", default_value = "1")]
    pub(in crate::cli) clients: NonZeroUsize,
    /// Requests of each client
    #[arg(long, value_name = "N", default_value = "5000")]
    pub(in crate::cli) rounds: NonZeroUsize,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of changed questions.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchReplan {
    /// Folders or files of assemblies; a bolt of each is removed, moved, replaced and locked
    #[arg(value_name = "ASSEMBLY", required = true)]
    pub(in crate::cli) assemblies: Vec<PathBuf>,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of restarts.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchRestart {
    /// The assembly to plan [default: a bolted frame of 20 parts]
    pub(in crate::cli) assembly: Option<PathBuf>,
    /// Restarts of each kind
    #[arg(long, value_name = "N", default_value = "20")]
    pub(in crate::cli) rounds: NonZeroUsize,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of budgets.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchChurn {
    /// Number of assemblies
    #[arg(long, value_name = "N", default_value = "1000")]
    pub(in crate::cli) assemblies: NonZeroUsize,
    /// Memory budget of the daemon
    #[arg(long, value_name = "MB", default_value = "256")]
    pub(in crate::cli) memory_mb: u64,
    /// Disk budget of the daemon
    #[arg(long, value_name = "MB", default_value = "1024")]
    pub(in crate::cli) disk_mb: u64,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// The raw peer.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchRawPeer {
    #[arg(long)]
    pub(in crate::cli) runtime_dir: PathBuf,
    #[arg(long)]
    pub(in crate::cli) root: PathBuf,
    #[arg(long, value_delimiter = ',')]
    pub(in crate::cli) chunks: Vec<usize>,
}
