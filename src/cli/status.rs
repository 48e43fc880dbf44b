//! `sbdp status`.

use std::process::ExitCode;

use clap::Args;
use sbdp_client::{Handle, Status};

use super::daemon::Daemon;
use super::error::CliError;
use super::figures::{DaemonFigures, LatencyFigures};
use super::print;
use super::table::{TextTable, bytes, duration};
use crate::service::MemoryStatistics;

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
    let figures = DaemonFigures::of(&daemon).map_err(failed)?;
    print(&describe(&figures, &daemon.status().map_err(failed)?))?;
    Ok(ExitCode::SUCCESS)
}

fn describe(figures: &DaemonFigures, status: &Status) -> String {
    let DaemonFigures { version, protocol, pid, uptime_s, .. } = figures;
    let up = duration(*uptime_s);
    let mut table = TextTable::default();
    let mut line = |subject: &str, text: String| table.row([subject.to_owned(), text]);
    line("workers", workers(figures));
    line("clients", clients(figures));
    line("requests", requests(figures));
    line("uploads", figures.uploads.to_string());
    for (kind, latency) in &figures.latency {
        line(&format!("{} time", kind.replace('_', " ")), self::latency(latency));
    }
    line("memory", memory(figures));
    if let Some(MemoryStatistics { records, .. }) = &figures.remembered {
        let stored = records.file_bytes + records.field_file_bytes;
        let on_disk = |folder: &std::path::PathBuf| {
            format!("{}: {}, {} records", folder.display(), bytes(stored), records.disk_records())
        };
        let folder = records.folder.as_ref().filter(|_| records.on_disk);
        line("cache", folder.map_or_else(|| "in memory only".to_owned(), on_disk));
    }
    for (name, handle) in &status.preloaded {
        line("preloaded", format!("{name} {}", Handle(*handle)));
    }
    format!("sbdpd {version}, protocol {protocol}, pid {pid}, up {up}\n{}", table.render())
}

fn workers(figures: &DaemonFigures) -> String {
    let DaemonFigures { workers, running, queued, queue_limit, .. } = figures;
    format!("{workers}, {running} busy; {queued} requests wait, at most {queue_limit}")
}

fn clients(figures: &DaemonFigures) -> String {
    let DaemonFigures { clients, connections, .. } = figures;
    format!("{clients}, with {connections} connections (this command is one)")
}

/// What is not zero of how requests ended.
fn requests(figures: &DaemonFigures) -> String {
    let ends = [
        (figures.cancelled, "cancelled"),
        (figures.expired, "expired"),
        (figures.refused, "refused"),
        (figures.failed, "failed"),
    ];
    let ends = ends.into_iter().filter(|(count, _)| *count > 0);
    let ends: String = ends.map(|(count, end)| format!(", {count} {end}")).collect();
    let DaemonFigures { requests, done, plans_remembered, .. } = figures;
    format!("{requests}: {done} answered ({plans_remembered} from memory){ends}")
}

fn latency(latency: &LatencyFigures) -> String {
    let LatencyFigures { count, p50_s, p90_s, p99_s } = latency;
    let [half, most, nearly_all] = [p50_s, p90_s, p99_s].map(|s| duration(*s));
    format!("median {half}, 90 % within {most}, 99 % within {nearly_all} (of {count})")
}

fn memory(figures: &DaemonFigures) -> String {
    let mut parts = Vec::new();
    parts.extend(figures.resident_bytes.map(|resident| format!("{} in all", bytes(resident))));
    if let Some(MemoryStatistics { assemblies, records }) = &figures.remembered {
        parts.push(format!("{} in {} assemblies", bytes(assemblies.bytes), assemblies.assemblies));
        parts.push(format!("{} in records", bytes(records.memory_bytes)));
    }
    parts.push(format!("{} in {} answers", bytes(figures.answers.bytes), figures.answers.entries));
    parts.extend(figures.shared_memory_free_bytes.map(|free| format!("{} free in /dev/shm", bytes(free))));
    parts.join(", ")
}
