//! Benchmarks that ask a daemon of their own.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

/// A benchmark of answers from memory.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchLatency {
    /// What is planned [default: a bolted frame of 20 parts]
    pub(in crate::cli) assembly: Option<PathBuf>,
    /// How many clients ask at the same time
    #[arg(long, value_name = "N", default_value = "1")]
    pub(in crate::cli) clients: NonZeroUsize,
    /// How often each asks
    #[arg(long, value_name = "N", default_value = "5000")]
    pub(in crate::cli) rounds: NonZeroUsize,
    /// Write the figures there as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of changed questions.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchReplan {
    /// Folders or files of assemblies; of each, a bolt is removed, moved, replaced and locked
    #[arg(value_name = "ASSEMBLY", required = true)]
    pub(in crate::cli) assemblies: Vec<PathBuf>,
    /// Write the figures there as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of restarts.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchRestart {
    /// What is planned [default: a bolted frame of 20 parts]
    pub(in crate::cli) assembly: Option<PathBuf>,
    /// Restarts of each kind
    #[arg(long, value_name = "N", default_value = "20")]
    pub(in crate::cli) rounds: NonZeroUsize,
    /// Write the figures there as JSON
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// A benchmark of budgets.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchChurn {
    /// How many assemblies
    #[arg(long, value_name = "N", default_value = "1000")]
    pub(in crate::cli) assemblies: NonZeroUsize,
    /// The daemon's budget of memory
    #[arg(long, value_name = "MB", default_value = "256")]
    pub(in crate::cli) memory_mb: u64,
    /// Its budget on disk
    #[arg(long, value_name = "MB", default_value = "1024")]
    pub(in crate::cli) disk_mb: u64,
    /// Write the figures there as JSON
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
