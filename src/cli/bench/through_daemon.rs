//! Benchmarks that ask a daemon of their own.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde::Serialize;

use super::super::args::{BenchChurn, BenchLatency, BenchRawPeer, BenchReplan, BenchRestart};
use super::super::error::CliError;
use super::super::print;
use super::THIS_PROGRAM;
use crate::bench::{self, ChurnRequest, Cost, Family, LatencyRequest, Percentiles, ReplanRecord};
use crate::files::load_assembly;
use crate::geometry::{SourceAssembly, SourcePart};

/// Parts of the assembly that is planned by default.
const PARTS: usize = 20;

pub(super) fn latency(arguments: &BenchLatency) -> Result<ExitCode, CliError> {
    let request = LatencyRequest {
        assembly: assembly(arguments.assembly.as_deref())?,
        clients: arguments.clients.get(),
        rounds: arguments.rounds.get(),
        program: PathBuf::from(THIS_PROGRAM),
    };
    let latency = bench::latency(&request)?;
    let (raw, repeated) = (latency.raw_event_rtt_us, latency.repeat_plan_us);
    let (raw_woken, woken) = (latency.raw_after_pause_us, latency.plan_after_pause_us);
    print(&format!(
        "{} clients, {} rounds each, {} bytes an answer; planned first in {:.1} ms\n\
         {:<22}{:>10}{:>10}\n{}{}{:<22}{:>10.2}{:>10.2}\nafter a pause\n{}{}",
        latency.clients,
        latency.rounds,
        latency.payload_bytes,
        latency.first_plan_us / 1e3,
        "microseconds",
        "p50",
        "p99",
        row("raw round trip", 22, raw),
        row("the same plan again", 22, repeated),
        "ratio",
        repeated.p50 / raw.p50,
        repeated.p99 / raw.p99,
        row("raw round trip", 22, raw_woken),
        row("the same plan again", 22, woken),
    ))?;
    written(arguments.json.as_deref(), &latency)
}

pub(super) fn replan(arguments: &BenchReplan) -> Result<ExitCode, CliError> {
    eprintln!(
        "assembly, part, change: cold s (simulations); changed, and changed after the daemon was left alone, s \
         (simulations, share of the time, share of the simulations); same plan"
    );
    let records = bench::replan(&arguments.assemblies, |r| eprintln!("{}", line(r)))?;
    written(arguments.json.as_deref(), &records)
}

fn line(r: &ReplanRecord) -> String {
    let shares = |cost: Cost| {
        format!(
            "{:.4} ({}, {:.1} %, {:.1} %)",
            cost.time_s,
            cost.simulations,
            100.0 * cost.time_s / r.cold.time_s,
            100.0 * cost.simulations as f64 / r.cold.simulations.max(1) as f64
        )
    };
    format!(
        "{}, {}, {}: {:.4} ({}); {}; {}; {}",
        r.assembly,
        r.part,
        r.change,
        r.cold.time_s,
        r.cold.simulations,
        shares(r.changed),
        shares(r.speculated),
        if r.verified { "the same plan" } else { "NOT the same plan" }
    )
}

pub(super) fn restart(arguments: &BenchRestart) -> Result<ExitCode, CliError> {
    let restart = bench::restart(&assembly(arguments.assembly.as_deref())?, arguments.rounds.get())?;
    let heading = format!("{:<36}{:>10}{:>10}\n", "microseconds, first answers", "p50", "p99");
    let rows = [
        ("the same plan, from memory", restart.repeat_plan_us),
        ("the same plan, started again", restart.restarted_plan_us),
        ("a part moved, from memory", restart.changed_us),
        ("a part moved, started again", restart.restarted_changed_us),
        ("a part moved, two seconds later", restart.prepared_changed_us),
    ];
    print(&rows.map(|(what, times)| row(what, 36, times)).into_iter().fold(heading, |all, row| all + &row))?;
    let (found, built) = (restart.fields_found, restart.fields_built);
    print(&format!("a part moved, started again: {found} distance fields from disk, {built} built\n"))?;
    written(arguments.json.as_deref(), &restart)
}

pub(super) fn churn(arguments: &BenchChurn) -> Result<ExitCode, CliError> {
    let request = ChurnRequest {
        assemblies: arguments.assemblies.get(),
        memory_mb: arguments.memory_mb,
        disk_mb: arguments.disk_mb,
    };
    eprintln!("assemblies: anonymous and resident memory, files, disk");
    let churn = bench::churn(&request, |s| {
        eprintln!(
            "{}: {:.1} MB, {:.1} MB, {}, {:.1} MB",
            s.assemblies, s.private_mb, s.resident_mb, s.descriptors, s.disk_mb
        );
    })?;
    print(&format!("{} answered, {} refused\n", churn.answered, churn.refused))?;
    print(&churn.reasons.iter().fold(String::new(), |all, reason| format!("{all}{reason}\n")))?;
    written(arguments.json.as_deref(), &churn)
}

fn row(what: &str, width: usize, p: Percentiles) -> String {
    format!("{what:<width$}{:>10.1}{:>10.1}\n", p.p50, p.p99)
}

/// The one that is named, or the default one.
fn assembly(path: Option<&Path>) -> Result<SourceAssembly, CliError> {
    Ok(path.map(load_assembly).transpose()?.unwrap_or_else(frame))
}

pub(super) fn raw_peer(arguments: &BenchRawPeer) -> Result<ExitCode, CliError> {
    let end = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&end)).map_err(|e| CliError::Failed(e.to_string()))?;
    }
    bench::serve_raw(&arguments.runtime_dir, &arguments.root, &arguments.chunks, &end)?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn frame() -> SourceAssembly {
    let part = |(name, mesh)| SourcePart { name, origin: "benchmark".to_owned(), mesh };
    let parts = Family::BoltedFrame.member(PARTS).into_iter().map(part).collect();
    SourceAssembly {
        name: "bolted-frame".to_owned(),
        units: Some("mm".to_owned()),
        parts,
        ..SourceAssembly::default()
    }
}

pub(super) fn written(file: Option<&Path>, figures: &impl Serialize) -> Result<ExitCode, CliError> {
    let Some(file) = file else { return Ok(ExitCode::SUCCESS) };
    let failed = |e: String| CliError::Failed(format!("{}: {e}", file.display()));
    let mut text = serde_json::to_string_pretty(figures).map_err(|e| failed(e.to_string()))?;
    text.push('\n');
    std::fs::write(file, text).map_err(|e| failed(e.to_string()))?;
    Ok(ExitCode::SUCCESS)
}
