//! `sbdp status`.

use std::process::ExitCode;
use std::time::Duration;

use clap::Args;
use sbdp_client::{Handle, Status};

use super::daemon::Daemon;
use super::error::CliError;
use super::print;

/// Arguments of `sbdp status`.
#[derive(Debug, Args)]
pub(super) struct StatusArguments {
    /// Everything, as one JSON object to which fields may be added
    #[arg(long)]
    json: bool,
}

pub(super) fn run(arguments: &StatusArguments) -> Result<ExitCode, CliError> {
    let failed = |e: sbdp_client::ClientError| CliError::Failed(e.to_string());
    let daemon = Daemon::connect().map_err(failed)?;
    if arguments.json {
        print(&format!("{}\n", daemon.metrics().map_err(failed)?))?;
        return Ok(ExitCode::SUCCESS);
    }
    print(&describe(&daemon.status().map_err(failed)?))?;
    Ok(ExitCode::SUCCESS)
}

fn describe(status: &Status) -> String {
    let n = &status.numbers;
    let uptime = Duration::from_nanos(n.uptime_ns).as_secs();
    let mut text = format!(
        "sbdpd {} (protocol {}), pid {}, up {uptime} s\n\
         workers   {}, {} busy; {} of {} requests wait\n\
         requests  {}: {} answered ({} of them from memory), {} cancelled, {} expired, {} refused, {} failed\n\
         graphs    {} states' blocking graphs answered from memory\n\
         uploads   {}; all figures: `sbdp status --json`\n",
        status.version,
        n.protocol,
        n.pid,
        n.workers,
        n.running,
        n.queued,
        n.queue_limit,
        n.requests,
        n.done,
        n.remembered,
        n.cancelled,
        n.expired,
        n.refused,
        n.failed,
        n.graphs_remembered,
        n.uploads
    );
    for (name, handle) in &status.preloaded {
        text.push_str(&format!("preloaded {name} {}\n", Handle(*handle)));
    }
    text
}
