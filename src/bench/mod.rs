//! Benchmarks over whole corpora: `sbdp bench`.
//!
//! Data flow: folders of assemblies (`corpus`) → one process per run (`runner`) → one line per
//! run (`record`) → the paper's measures (`statistics`) → `tables.md` and the coverage figure
//! (`tables`, `figure`). Only `runner` starts anything; whatever comes after it works on the
//! records alone, so that shards of several machines can be put together later.
//!
//! Benchmarks of the daemon, which start ones of their own, are in `through_daemon`; `cancel` measures
//! planning in this process.

mod cancel;
mod corpus;
mod estimate;
pub(crate) mod families;
mod figure;
mod machine;
mod markdown;
mod record;
mod rotated;
mod rotation;
mod runner;
mod scale;
mod statistics;
mod tables;
#[cfg(test)]
mod tests;
mod through_daemon;
mod unit;

use std::collections::HashSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Duration;

pub use cancel::{CancelRecord, CancelRequest, cancel};
pub use corpus::{Category, CorpusProblem, Shard, find};
pub use families::Family;
pub use record::{Record, RunKey, Settings, Store, read};
pub use runner::run_unit;
pub use scale::{Growth, PARTS, ScaleRequest, scale};
pub use through_daemon::{
    Churn, ChurnRequest, ChurnSample, Cost, DaemonFigures, Kind, KindFigures, Latency, LatencyRequest, Load,
    LoadClient, LoadRequest, Percentiles, Phase, ProcessFootprint, ReplanRecord, Restart, Role, Soak,
    SoakRequest, churn, latency, load, load_client, replan, restart, serve_raw, soak,
};
pub use unit::Unit;

use estimate::Estimate;
use runner::Runner;
pub(crate) use runner::end_with_benchmark;
use statistics::EngineResults;

/// The planners, in the order of the tables. PDP* never runs by itself: it is what PDP_t solved and, of the
/// rest, what PDP_r solved.
pub const PLANNERS: [&str; 7] = ["sbdp-star", "sbdp", PDP_STAR, "pdp-r", PDP_T, "bk-rrt", "rrt"];
/// Those of the paper's tables.
pub const PAPER_PLANNERS: [&str; 5] = ["sbdp-star", "sbdp", PDP_STAR, "pdp-r", PDP_T];
/// The simulations.
pub const ENGINES: [&str; 2] = ["sliding", "penalty"];

const PDP_STAR: &str = "pdp-star";
const PDP_T: &str = "pdp-t";
/// What PDP* is put together from, the translational one first.
const PDP_STAR_IS: [&str; 2] = [PDP_T, "pdp-r"];
/// The paper's limit for one path.
pub const PATH_TIMEOUT: Duration = Duration::from_secs(360);
/// The paper's limit for a problem.
pub const TIMEOUT: Duration = Duration::from_secs(2 * 3600);

/// The records in an output folder.
const RESULTS: &str = "results.jsonl";
/// Files of processes that run.
const SCRATCH: &str = "running";

/// Why a benchmark ended without its results. What was recorded before stays.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// What was asked for makes no sense.
    #[error("{0}")]
    Refused(String),
    /// Another benchmark writes there.
    #[error("{0}: another benchmark is writing it")]
    Busy(PathBuf),
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}

impl BenchError {
    fn file(path: &Path, error: &io::Error) -> Self {
        Self::Failed(format!("{}: {error}", path.display()))
    }

    fn failed(error: impl std::fmt::Display) -> Self {
        Self::Failed(error.to_string())
    }
}

/// What to run and how.
#[derive(Debug, Clone)]
pub struct Request {
    /// Folders of assemblies.
    pub corpora: Vec<PathBuf>,
    /// Of [`PLANNERS`].
    pub planners: Vec<String>,
    /// Of [`ENGINES`].
    pub engines: Vec<String>,
    /// After so much planning a run is to answer; verification does not count.
    pub timeout: Duration,
    /// When one motion, or one part's search of a baseline, is given up.
    pub path_timeout: Duration,
    /// The action set of all planners: their search spaces compare only then.
    pub actions: &'static str,
    /// How their blocking graphs are begun.
    pub dbg: &'static str,
    /// Whether the state-based planners take parts that leave straight out without simulation.
    pub sweeps: bool,
    /// How long after `timeout` a run is ended.
    pub grace: Duration,
    /// Threads of each run; 0 for all processors.
    pub threads: u32,
    /// Runs at a time. With more than one they take processor time from each other.
    pub jobs: usize,
    /// The largest number of parts of an assembly that is run.
    pub parts_up_to: Option<usize>,
    /// Beside as it is, under how many random rotations every assembly is planned.
    pub rotations: u32,
    /// Which rotations.
    pub seed: u64,
    /// Which part of the corpus, after what else limits it.
    pub shard: Shard,
    /// Where the results go.
    pub out: PathBuf,
    /// The program whose `plan` command is run.
    pub program: PathBuf,
}

/// What a benchmark has to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Workload {
    /// All runs.
    pub total: usize,
    /// Of these, runs that had been done before.
    pub done: usize,
    /// The longest planning time of a run.
    pub timeout: Duration,
    /// Runs at a time.
    pub jobs: usize,
}

impl Workload {
    /// How long planning takes if every run needs all its time; verification may take as long again.
    #[must_use]
    pub fn worst_case(&self) -> Duration {
        let turns = self.total.saturating_sub(self.done).div_ceil(self.jobs.max(1));
        self.timeout.saturating_mul(u32::try_from(turns).unwrap_or(u32::MAX))
    }
}

/// Receives the progress of a benchmark.
pub trait BenchObserver {
    /// What is to be done.
    fn begun(&mut self, workload: &Workload);
    /// A run ended and is recorded; `left` is an estimate for all that is still to do.
    fn ran(&mut self, record: &Record, done: usize, left: Option<Duration>);
}

/// What came out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Records that the tables are over.
    pub records: usize,
    /// Runs that are still to be done.
    pub missing: usize,
    /// Records left aside because another shard had the same run already.
    pub repeated: usize,
}

/// The time after its timeout that a run is given to end: writing, and as long again for verification, which the
/// timeout leaves out.
#[must_use]
pub fn grace(timeout: Duration) -> Duration {
    Duration::from_secs(30).saturating_add(timeout)
}

/// Runs what the output folder has no record of, and writes tables and figures. Once `cancel` is
/// set, what runs is ended unrecorded and the rest left for the next call.
///
/// # Errors
/// The request makes no sense, the folder has results of other settings, or a file or process
/// failed. What was recorded stays and is not run again.
pub fn run(
    request: &Request,
    cancel: &AtomicBool,
    observer: &mut dyn BenchObserver,
) -> Result<Summary, BenchError> {
    let units = units(request)?;
    let settings = settings(request)?;
    std::fs::create_dir_all(&request.out).map_err(|e| BenchError::file(&request.out, &e))?;
    let (store, mut records) = Store::open(&request.out)?;
    check_resumable(&settings, &records, &request.out)?;
    let missing = run_missing(request, &settings, &units, store, &mut records, cancel, observer)?;
    write_evaluation(&request.out, &records)?;
    Ok(Summary { records: records.len(), missing, repeated: 0 })
}

/// All runs of a benchmark: problem by problem, so that an interrupted one has problems that all planners ran on.
///
/// # Errors
/// As [`run`].
pub fn units(request: &Request) -> Result<Vec<Unit>, BenchError> {
    let planners = planners_to_run(&request.planners)?;
    let engines = known("engine", &ENGINES, &request.engines)?;
    let mut problems = find(&request.corpora)?;
    problems.retain(|p| request.parts_up_to.is_none_or(|most| p.parts <= most));
    let settings = settings(request)?;
    let mut units = Vec::new();
    for CorpusProblem { name, folder, parts } in request.shard.select(problems) {
        for rotation in 0..=request.rotations {
            for engine in &engines {
                units.extend(planners.iter().map(|planner| Unit {
                    assembly: name.clone(),
                    folder: folder.clone(),
                    parts,
                    rotation,
                    planner: (*planner).to_owned(),
                    engine: (*engine).to_owned(),
                    settings: settings.clone(),
                }));
            }
        }
    }
    Ok(units)
}

/// Puts the results of several folders together, writes the merged records, tables and figures.
///
/// # Errors
/// A folder has no readable results, they were made with different settings, or the output folder
/// has records that the given ones lack.
pub fn report(folders: &[PathBuf], out: &Path) -> Result<Summary, BenchError> {
    let mut records: Vec<Record> = Vec::new();
    let (mut keys, mut repeated) = (HashSet::new(), 0);
    for folder in folders {
        for record in read(folder)? {
            if records.first().is_some_and(|first| !first.settings.comparable(&record.settings)) {
                return Err(different(&records[0].settings, &record.settings, folder));
            }
            let (assembly, rotation, planner, engine) = record.key();
            if keys.insert((assembly.to_owned(), rotation, planner.to_owned(), engine.to_owned())) {
                records.push(record);
            } else {
                repeated += 1;
            }
        }
    }
    std::fs::create_dir_all(out).map_err(|e| BenchError::file(out, &e))?;
    if folders != [out] {
        write_merged(out, &records)?;
    }
    write_evaluation(out, &records)?;
    Ok(Summary { records: records.len(), missing: 0, repeated })
}

/// Never at the cost of a record that was there.
fn write_merged(out: &Path, records: &[Record]) -> Result<(), BenchError> {
    let (store, present) = Store::open(out)?;
    let merged: HashSet<_> = records.iter().map(Record::key).collect();
    if present.iter().any(|r| !merged.contains(&r.key())) {
        let reason = "has results that would be lost; choose another folder or report it too";
        return Err(BenchError::Refused(format!("{} {reason}", out.display())));
    }
    store.replace(records)
}

fn write_evaluation(out: &Path, records: &[Record]) -> Result<(), BenchError> {
    let engines: Vec<EngineResults<'_>> = EngineResults::by_engine(records);
    let write = |name: &str, text: String| {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| BenchError::file(&path, &e))
    };
    write("tables.md", tables::document(records, &engines))?;
    if let [first, second] = &engines[..] {
        write("engines.md", tables::engines_by_problem(first, second))?;
    }
    engines.iter().try_for_each(|results| figure::write(out, results))
}

/// A planner as the paper writes it.
fn title(planner: &str) -> &str {
    match planner {
        "sbdp-star" => "SBDP*",
        "sbdp" => "SBDP",
        PDP_STAR => "PDP*",
        "pdp-r" => "PDP_r",
        PDP_T => "PDP_t",
        "bk-rrt" => "BK-RRT",
        "rrt" => "RRT",
        other => other,
    }
}

fn known(what: &str, list: &[&'static str], names: &[String]) -> Result<Vec<&'static str>, BenchError> {
    let refused =
        |n: &String| BenchError::Refused(format!("there is no {what} `{n}`, only {}", list.join(", ")));
    let unknown = names.iter().find(|n| !list.contains(&n.as_str()));
    match unknown {
        Some(name) => Err(refused(name)),
        None => Ok(list.iter().copied().filter(|l| names.iter().any(|n| n == l)).collect()),
    }
}

/// PDP* stands for the two that it is put together from.
fn planners_to_run(names: &[String]) -> Result<Vec<&'static str>, BenchError> {
    let mut asked = known("planner", &PLANNERS, names)?;
    if asked.contains(&PDP_STAR) {
        asked.extend(PDP_STAR_IS);
    }
    Ok(PLANNERS.into_iter().filter(|p| *p != PDP_STAR && asked.contains(p)).collect())
}

/// The hash of an executable.
fn build_of(program: &Path) -> Result<String, BenchError> {
    let bytes = std::fs::read(program).map_err(|e| BenchError::file(program, &e))?;
    Ok(blake3::hash(&bytes).to_hex()[..12].to_owned())
}

fn settings(request: &Request) -> Result<Settings, BenchError> {
    Ok(Settings {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        build: build_of(&request.program)?,
        timeout_s: request.timeout.as_secs_f64(),
        path_timeout_s: request.path_timeout.as_secs_f64(),
        actions: request.actions.to_owned(),
        dbg: request.dbg.to_owned(),
        sweeps: request.sweeps,
        seed: request.seed,
        threads: request.threads,
        jobs: request.jobs,
        processor: machine::processor(),
        processors: machine::processors(),
    })
}

fn check_resumable(settings: &Settings, records: &[Record], out: &Path) -> Result<(), BenchError> {
    match records.iter().find(|r| !settings.resumes(&r.settings)) {
        Some(record) => Err(different(settings, &record.settings, out)),
        None => Ok(()),
    }
}

fn different(here: &Settings, there: &Settings, folder: &Path) -> BenchError {
    BenchError::Refused(format!(
        "{} has results of other settings, which do not compare: {there}; here {here}",
        folder.display()
    ))
}

/// Runs what has no record; how many runs are missing in the end.
fn run_missing(
    request: &Request,
    settings: &Settings,
    units: &[Unit],
    store: Store,
    records: &mut Vec<Record>,
    cancel: &AtomicBool,
    observer: &mut dyn BenchObserver,
) -> Result<usize, BenchError> {
    let present: HashSet<_> = records.iter().map(Record::key).collect();
    let to_do: Vec<&Unit> = units.iter().filter(|unit| !present.contains(&unit.key())).collect();
    let mut estimate = Estimate::default();
    for record in records.iter() {
        estimate.took(record.group(), &record.planner, &record.engine, record.wall_time_s);
    }
    to_do.iter().for_each(|unit| estimate.expect(unit.category(), &unit.planner, &unit.engine));
    let (done, jobs) = (units.len() - to_do.len(), request.jobs);
    observer.begun(&Workload { total: units.len(), done, timeout: request.timeout, jobs });
    let mut ledger = Ledger { store, records, observer, estimate, done, jobs };
    let scratch = Scratch::new(&request.out)?;
    run_side_by_side(request, settings, &scratch.own, &to_do, cancel, &mut ledger)?;
    Ok(units.len() - ledger.done)
}

/// The folder that processes write to. Each benchmark has one of its own: a process that outlived
/// a benchmark that was killed must not write into its successor's.
struct Scratch {
    all: PathBuf,
    own: PathBuf,
}

impl Scratch {
    fn new(out: &Path) -> Result<Self, BenchError> {
        let all = out.join(SCRATCH);
        let own = all.join(std::process::id().to_string());
        let scratch = Self { all, own };
        scratch.clear();
        std::fs::create_dir_all(&scratch.own).map_err(|e| BenchError::file(&scratch.own, &e))?;
        Ok(scratch)
    }

    fn own(&self) -> &Path {
        &self.own
    }

    /// What is left there is of no use to anybody, but no reason to fail either.
    fn clear(&self) {
        let _ = std::fs::remove_dir_all(&self.all);
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        self.clear();
    }
}

/// What one thread alone does with ended runs.
struct Ledger<'a> {
    store: Store,
    records: &'a mut Vec<Record>,
    observer: &'a mut dyn BenchObserver,
    estimate: Estimate,
    done: usize,
    jobs: usize,
}

impl Ledger<'_> {
    fn enter(&mut self, unit: &Unit, record: Record) -> Result<(), BenchError> {
        self.store.append(&record)?;
        self.done += 1;
        self.estimate.done(unit.category(), &unit.planner, &unit.engine);
        self.estimate.took(unit.category(), &unit.planner, &unit.engine, record.wall_time_s);
        let left = self.estimate.left().map(|t| t / self.jobs.max(1) as u32);
        self.observer.ran(&record, self.done, left);
        self.records.push(record);
        Ok(())
    }
}

/// Several runners take units in order; the first error stops them all.
fn run_side_by_side(
    request: &Request,
    settings: &Settings,
    scratch: &Path,
    to_do: &[&Unit],
    cancel: &AtomicBool,
    ledger: &mut Ledger<'_>,
) -> Result<(), BenchError> {
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, ended) = mpsc::channel();
    std::thread::scope(|scope| {
        for number in 0..request.jobs.clamp(1, to_do.len().max(1)) {
            let (sender, next, stop) = (sender.clone(), &next, &stop);
            let runner = Runner {
                program: &request.program,
                settings,
                timeout: request.timeout,
                grace: request.grace,
                ended_by: [cancel, stop],
                scratch: scratch.to_owned(),
                number,
            };
            scope.spawn(move || {
                while let Some(&unit) = to_do.get(next.fetch_add(1, Ordering::Relaxed)) {
                    // Nobody listens any more after an error.
                    if runner.is_ended() || sender.send((unit, runner.run(unit))).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        let mut enter = |(unit, result): (&Unit, Result<Option<Record>, BenchError>)| match result? {
            Some(record) => ledger.enter(unit, record),
            None => Ok(()),
        };
        let result = ended.into_iter().try_for_each(&mut enter);
        stop.store(true, Ordering::Relaxed);
        result
    })
}
