//! The arguments of benchmarks that put a daemon under load, or end what it does.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::bench;

/// A benchmark of many clients at once.
#[derive(Debug, Args)]
pub(in super::super) struct BenchLoad {
    /// The assembly to plan [default: a bolted frame of 20 parts]
    pub(in super::super) assembly: Option<PathBuf>,
    /// Simultaneous clients, each a process of its own (the daemon serves 40)
    #[arg(long, value_name = "N", default_value = "16")]
    pub(in super::super) clients: NonZeroUsize,
    /// Number of requests in all
    #[arg(long, value_name = "N", default_value = "20000")]
    pub(in super::super) requests: NonZeroUsize,
    /// Different requests of each kind
    #[arg(long, value_name = "N", default_value = "64")]
    pub(in super::super) variety: u64,
    /// Seed of the requests
    #[arg(long, value_name = "N", default_value = "1")]
    pub(in super::super) seed: u64,
    /// Repeat it beside three more clients: one stopped, one that floods, one that never reads
    #[arg(long)]
    pub(in super::super) disturb: bool,
    /// Runtime folder of a running daemon [default: starts one, `sbdpd` beside `sbdp`]
    #[arg(long, value_name = "DIR")]
    pub(in super::super) runtime_dir: Option<PathBuf>,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in super::super) json: Option<PathBuf>,
}

/// A test of endurance.
#[derive(Debug, Args)]
pub(in super::super) struct BenchSoak {
    /// The assembly to plan [default: a bolted frame of 20 parts]
    pub(in super::super) assembly: Option<PathBuf>,
    /// Simultaneous clients
    #[arg(long, value_name = "N", default_value = "4")]
    pub(in super::super) clients: NonZeroUsize,
    /// Number of clients to kill and replace
    #[arg(long, value_name = "N", default_value = "200")]
    pub(in super::super) client_kills: u32,
    /// Number of daemons to kill and restart
    #[arg(long, value_name = "N", default_value = "50")]
    pub(in super::super) daemon_kills: u32,
    /// Requests of each client that is not killed before
    #[arg(long, value_name = "N", default_value = "300")]
    pub(in super::super) requests: NonZeroUsize,
    /// Seed of the moments and of which process is killed
    #[arg(long, value_name = "N", default_value = "1")]
    pub(in super::super) seed: u64,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in super::super) json: Option<PathBuf>,
}

/// A benchmark of ending plans.
#[derive(Debug, Args)]
pub(in super::super) struct BenchCancel {
    /// Folders or files of assemblies
    #[arg(value_name = "ASSEMBLY", required = true)]
    pub(in super::super) assemblies: Vec<PathBuf>,
    /// Number of moments at which each plan is cancelled
    #[arg(long, value_name = "N", default_value = "200")]
    pub(in super::super) samples: u32,
    /// Worker threads [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(in super::super) threads: usize,
    /// Write the figures to a file as JSON
    #[arg(long, value_name = "FILE")]
    pub(in super::super) json: Option<PathBuf>,
}

/// A client of `load`.
#[derive(Debug, Args)]
pub(in super::super) struct BenchLoadClient {
    #[arg(long)]
    pub(in super::super) assembly: Option<PathBuf>,
    #[arg(long)]
    pub(in super::super) runtime_dir: PathBuf,
    #[arg(long, value_enum)]
    pub(in super::super) role: Role,
    #[arg(long)]
    pub(in super::super) requests: usize,
    #[arg(long)]
    pub(in super::super) seed: u64,
    #[arg(long)]
    pub(in super::super) variety: u64,
}

/// What such a client does.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in super::super) enum Role {
    Asking,
    Stopped,
    Flooding,
    Deaf,
}

impl From<Role> for bench::Role {
    fn from(role: Role) -> Self {
        match role {
            Role::Asking => Self::Asking,
            Role::Stopped => Self::Stopped,
            Role::Flooding => Self::Flooding,
            Role::Deaf => Self::Deaf,
        }
    }
}
