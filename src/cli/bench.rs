//! `sbdp bench`.

mod load;
mod through_daemon;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use super::args::{BenchArguments, BenchCommand, BenchReport, BenchRun, BenchScale, BenchUnit};
use super::error::CliError;
use super::table::duration;
use super::{interrupt, print};
use crate::bench::{
    self, BenchError, BenchObserver, Record, Request, ScaleRequest, Shard, Summary, Unit, Workload,
};
use crate::blocking_graph::StaticAnalysis;
use crate::search;

/// This very file, also after a newer build took its place: one benchmark is of one build.
pub(super) const THIS_PROGRAM: &str = "/proc/self/exe";
/// As of a cancelled plan.
const INTERRUPTED: u8 = 5;

pub(super) fn run(arguments: &BenchArguments) -> Result<ExitCode, CliError> {
    match (&arguments.command, &arguments.run) {
        (Some(BenchCommand::Units(units)), _) => print_units(&units.run),
        (Some(BenchCommand::RunUnit(unit)), _) => run_unit(unit),
        (Some(BenchCommand::Report(report)), _) => report_on(report),
        (Some(BenchCommand::Scale(scale)), _) => measure_growth(scale),
        (Some(BenchCommand::Latency(latency)), _) => through_daemon::latency(latency),
        (Some(BenchCommand::Replan(replan)), _) => through_daemon::replan(replan),
        (Some(BenchCommand::Load(arguments)), _) => load::load(arguments),
        (Some(BenchCommand::Soak(arguments)), _) => load::soak(arguments),
        (Some(BenchCommand::Cancel(arguments)), _) => load::cancel(arguments),
        (Some(BenchCommand::LoadClient(client)), _) => load::client(client),
        (Some(BenchCommand::Restart(restart)), _) => through_daemon::restart(restart),
        (Some(BenchCommand::Churn(churn)), _) => through_daemon::churn(churn),
        (Some(BenchCommand::RawPeer(peer)), _) => through_daemon::raw_peer(peer),
        (None, Some(run)) => measure(run),
        (None, None) => Err(CliError::Refused("give folders of assemblies, or `report`".to_owned())),
    }
}

fn measure(arguments: &BenchRun) -> Result<ExitCode, CliError> {
    let request = request(arguments);
    watched(|cancel, display| bench::run(&request, cancel, display), &files(&request.out))
}

fn print_units(arguments: &BenchRun) -> Result<ExitCode, CliError> {
    for unit in bench::units(&request(arguments))? {
        print(&json_line(&unit)?)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn run_unit(arguments: &BenchUnit) -> Result<ExitCode, CliError> {
    let mut line = String::new();
    let line = match &arguments.unit {
        Some(unit) => unit,
        None => {
            let read = std::io::stdin().read_line(&mut line);
            read.map_err(|e| CliError::Refused(format!("stdin: {e}")))?;
            &line
        }
    };
    let cancel = Arc::new(AtomicBool::new(false));
    interrupt::cancel_on_interrupt(&cancel)?;
    let record = bench::run_unit(Unit::from_json(line)?, Path::new(THIS_PROGRAM), &cancel)?;
    let Some(record) = record else { return Ok(ExitCode::from(INTERRUPTED)) };
    print(&json_line(&record)?)?;
    Ok(ExitCode::SUCCESS)
}

fn json_line(value: &impl Serialize) -> Result<String, CliError> {
    let json = serde_json::to_string(value).map_err(|e| CliError::Failed(e.to_string()))?;
    Ok(json + "\n")
}

fn measure_growth(arguments: &BenchScale) -> Result<ExitCode, CliError> {
    let request = ScaleRequest {
        families: arguments.families.iter().copied().map(Into::into).collect(),
        parts: arguments.parts.clone(),
        timeout: arguments.timeout,
        sweeps: arguments.sweeps.asked().unwrap_or(true),
        threads: arguments.threads,
        out: arguments.out.clone(),
        program: PathBuf::from(THIS_PROGRAM),
    };
    let files = format!("{}, growth in {}/scale.md", files(&arguments.out), arguments.out.display());
    watched(|cancel, display| bench::scale(&request, cancel, display), &files)
}

/// Runs a benchmark that Ctrl-C ends and a display follows.
fn watched(
    run: impl FnOnce(&AtomicBool, &mut BenchDisplay) -> Result<Summary, BenchError>,
    files: &str,
) -> Result<ExitCode, CliError> {
    let cancel = Arc::new(AtomicBool::new(false));
    interrupt::cancel_on_interrupt(&cancel)?;
    let mut display = BenchDisplay::new();
    let summary = run(&cancel, &mut display);
    drop(display);
    let summary = summary?;
    print(&format!("{} records in {files}\n", summary.records))?;
    if summary.missing == 0 {
        return Ok(ExitCode::SUCCESS);
    }
    print(&format!("{} runs are left: the same command goes on with them\n", summary.missing))?;
    Ok(ExitCode::from(INTERRUPTED))
}

fn request(arguments: &BenchRun) -> Request {
    let actions = search::ActionSet::from(arguments.actions);
    Request {
        corpora: arguments.corpora.clone(),
        planners: arguments.planners.clone(),
        engines: arguments.engines.clone(),
        timeout: arguments.timeout,
        path_timeout: arguments.path_timeout,
        actions: actions.name(),
        dbg: StaticAnalysis::from(arguments.dbg).name(),
        sweeps: arguments.sweeps().asked().unwrap_or_else(|| actions.default_sweeps()),
        grace: bench::grace(arguments.timeout),
        threads: arguments.threads,
        jobs: arguments.jobs.get(),
        parts_up_to: arguments.parts_up_to,
        rotations: arguments.rotations,
        seed: arguments.seed,
        shard: arguments.shard.unwrap_or(Shard::WHOLE),
        // Only `units` goes without.
        out: arguments.out.clone().unwrap_or_default(),
        program: PathBuf::from(THIS_PROGRAM),
    }
}

fn report_on(arguments: &BenchReport) -> Result<ExitCode, CliError> {
    let out = match (&arguments.out, &arguments.results[..]) {
        (Some(out), _) => out,
        (None, [only]) => only,
        _ => return Err(CliError::Refused("several folders: say with --out where they go".to_owned())),
    };
    let summary = bench::report(&arguments.results, out)?;
    print(&format!("{} records in {}\n", summary.records, files(out)))?;
    if summary.repeated > 0 {
        print(&format!("{} runs were there twice; the first one counts\n", summary.repeated))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn files(out: &Path) -> String {
    format!("{0}/results.jsonl, evaluated in {0}/tables.md", out.display())
}

/// What is to be done, and how long it may take at worst.
fn outlook(workload: &Workload) -> String {
    let Workload { total, done, timeout, jobs } = workload;
    let left = total - done;
    if left == 0 {
        return format!("{done} of {total} runs were done before");
    }
    let [each, all] = [*timeout, workload.worst_case()].map(|time| duration(time.as_secs_f64()));
    let before = if *done > 0 { format!("; {done} of {total} runs were done before") } else { String::new() };
    format!(
        "{left} runs, timeout {each}; worst case: {left} × {each} / {jobs} at a time = {all} of planning, \
         and as long again for verification{before}"
    )
}

/// A bar on a terminal, else a line per run.
struct BenchDisplay {
    bar: Option<ProgressBar>,
    total: usize,
    solved: usize,
}

impl BenchDisplay {
    fn new() -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(0);
            bar.set_draw_target(ProgressDrawTarget::stderr());
            // A template that does not parse would only cost the looks.
            if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} [{elapsed}] {wide_msg}") {
                bar.set_style(style);
            }
            bar.enable_steady_tick(Duration::from_secs(1));
            bar
        });
        Self { bar, total: 0, solved: 0 }
    }
}

impl BenchObserver for BenchDisplay {
    fn begun(&mut self, workload: &Workload) {
        self.total = workload.total;
        let text = outlook(workload);
        if let Some(bar) = &self.bar {
            bar.suspend(|| eprintln!("{text}"));
            bar.set_length(workload.total as u64);
            bar.set_position(workload.done as u64);
        } else {
            eprintln!("{text}");
        }
    }

    fn ran(&mut self, record: &Record, done: usize, left: Option<Duration>) {
        self.solved += usize::from(record.solved());
        let left = left.map_or_else(|| "?".to_owned(), |t| HumanDuration(t).to_string());
        let Record { assembly, rotation, planner, engine, status, wall_time_s, .. } = record;
        let turned = if *rotation == 0 { String::new() } else { format!(" rotation {rotation}") };
        let last = format!("{assembly}{turned} {planner} {engine}: {status} after {wall_time_s:.1} s");
        match &self.bar {
            Some(bar) => {
                bar.set_position(done as u64);
                bar.set_message(format!("about {left} left, {} solved, {last}", self.solved));
            }
            None => eprintln!("{done}/{}, about {left} left: {last}", self.total),
        }
    }
}

impl Drop for BenchDisplay {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
