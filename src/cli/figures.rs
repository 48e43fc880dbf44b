//! The figures of a running daemon, from the JSON that `sbdp status --json` prints.

use std::collections::BTreeMap;

use sbdp_client::ClientError;
use serde::Deserialize;

use super::daemon::Daemon;
use crate::service::MemoryStatistics;

/// Those that the command line shows.
#[derive(Debug, Deserialize)]
pub(super) struct DaemonFigures {
    pub(super) version: String,
    pub(super) protocol: u32,
    pub(super) pid: u32,
    pub(super) uptime_s: f64,
    pub(super) workers: u32,
    pub(super) running: u32,
    pub(super) queued: u32,
    pub(super) queue_limit: u32,
    pub(super) clients: usize,
    pub(super) connections: usize,
    pub(super) resident_bytes: Option<u64>,
    pub(super) shared_memory_free_bytes: Option<u64>,
    pub(super) requests: u64,
    pub(super) done: u64,
    pub(super) plans_remembered: u64,
    pub(super) cancelled: u64,
    pub(super) expired: u64,
    pub(super) refused: u64,
    pub(super) failed: u64,
    pub(super) uploads: u64,
    /// By kind of request.
    pub(super) latency: BTreeMap<String, LatencyFigures>,
    pub(super) answers: AnswerFigures,
    pub(super) remembered: Option<MemoryStatistics>,
}

/// Of one kind of request, seconds.
#[derive(Debug, Deserialize)]
pub(super) struct LatencyFigures {
    pub(super) count: u64,
    pub(super) p50_s: f64,
    pub(super) p90_s: f64,
    pub(super) p99_s: f64,
}

/// Of the responses that are kept.
#[derive(Debug, Deserialize)]
pub(super) struct AnswerFigures {
    pub(super) entries: usize,
    pub(super) bytes: u64,
}

impl DaemonFigures {
    pub(super) fn of(daemon: &Daemon) -> Result<Self, ClientError> {
        serde_json::from_str(&daemon.metrics()?)
            .map_err(|e| ClientError::Protocol(format!("the daemon's figures: {e}")))
    }
}
