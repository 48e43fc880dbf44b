//! One run: a process of its own, so that neither a crash nor a hang reaches the benchmark.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rustix::process::{Signal, getppid, set_parent_process_death_signal};

use super::corpus::Category;
use super::machine::{now, processor, processors};
use super::record::{Record, Settings};
use super::rotation::random_rotation;
use super::unit::Unit;
use super::{BenchError, Scratch, build_of, grace};
use crate::document::{PlanDocument, StepDocument};
use crate::plan::StepEnd;

/// `sbdp plan` exits with these when it has written a plan.
const PLAN_CODES: [i32; 3] = [0, 3, 4];
/// It was asked to stop.
const CANCELLED: i32 = 5;
/// It said why there is no plan: wrong usage or refused input, and anything else in good order.
const REFUSALS: [i32; 2] = [1, 2];
/// How much of what a process said is looked at.
const LAST_WORDS: usize = 4096;

/// Environment variable of a process that a benchmark runs: the number of the process that reads its plan.
const READER: &str = "SBDP_BENCH_READER";

/// If a benchmark runs this process, it ends with that: a killed benchmark ends nothing itself, and what went on would take
/// processor time from the next one.
pub(crate) fn end_with_benchmark() {
    let Ok(reader) = std::env::var(READER) else { return };
    // Without the signal, a benchmark's process only runs for longer than it must.
    let _ = set_parent_process_death_signal(Some(Signal::KILL));
    let parent = getppid().map(|parent| parent.as_raw_nonzero().to_string());
    if parent.is_none_or(|parent| parent != reader) {
        // It ended before the signal was asked for.
        std::process::exit(CANCELLED);
    }
}

/// Runs units one after the other; several may work side by side, each with its own files.
pub(super) struct Runner<'a> {
    pub(super) program: &'a Path,
    pub(super) settings: &'a Settings,
    pub(super) timeout: Duration,
    pub(super) grace: Duration,
    /// Any of these ends what runs.
    pub(super) ended_by: [&'a AtomicBool; 2],
    /// Where a process writes its plan and what it says.
    pub(super) scratch: PathBuf,
    pub(super) number: usize,
}

/// How a process ended.
enum End {
    Exited(ExitStatus),
    Overstayed,
    Cancelled,
}

/// Runs a unit with `program` to its record; `None` once `cancel` is set.
///
/// # Errors
/// Its assembly is not on this machine, it was made by another build, or a file or process failed. There is no record
/// then: another machine may do better.
pub fn run_unit(unit: Unit, program: &Path, cancel: &AtomicBool) -> Result<Option<Record>, BenchError> {
    let build = build_of(program)?;
    let (its, version) = (&unit.settings.build, &unit.settings.version);
    if *its != build {
        return Err(BenchError::Refused(format!(
            "the unit was made by sbdp {version}, build {its}, and this is build {build}: use one binary on all machines"
        )));
    }
    if !unit.folder.is_dir() {
        return Err(BenchError::Refused(format!(
            "{}: there is no such folder on this machine",
            unit.folder.display()
        )));
    }
    let settings =
        Settings { jobs: 1, processor: processor(), processors: processors(), ..unit.settings.clone() };
    let unit = Unit { settings, ..unit };
    let folder = tempfile::Builder::new().prefix("sbdp-unit-").tempdir().map_err(BenchError::failed)?;
    let scratch = Scratch::new(folder.path())?;
    // Checked where it was read; a unit that was made otherwise runs for as long as it can.
    let timeout = Duration::try_from_secs_f64(unit.settings.timeout_s).unwrap_or(Duration::MAX);
    let runner = Runner {
        program,
        settings: &unit.settings,
        timeout,
        grace: grace(timeout),
        ended_by: [cancel, cancel],
        scratch: scratch.own().to_owned(),
        number: 0,
    };
    runner.run(&unit)
}

impl Runner<'_> {
    pub(super) fn is_ended(&self) -> bool {
        self.ended_by.iter().any(|flag| flag.load(Ordering::Relaxed))
    }

    /// Runs a unit to its record, or `None` if it was cancelled.
    pub(super) fn run(&self, unit: &Unit) -> Result<Option<Record>, BenchError> {
        let (plan, said) = (self.file("json"), self.file("stderr"));
        // A plan of the run before must not pass for this one's.
        remove(&plan)?;
        let (started, date) = (Instant::now(), now());
        let mut process = self.start(unit, &plan, &said)?;
        let mut peak = 0;
        let end = self.wait(&mut process, started, &mut peak);
        let end = end.map_err(|e| BenchError::file(self.program, &e))?;
        let wall = started.elapsed();
        let record = match end {
            End::Cancelled => None,
            End::Overstayed => {
                Some(self.record(unit, wall, "killed", format!("did not end within {} s", wall.as_secs())))
            }
            End::Exited(status) => self.ended(unit, wall, status, &plan, &said),
        };
        remove(&plan)?;
        remove(&said)?;
        Ok(record.map(|record| Record { peak_memory_kib: peak, date, ..record }))
    }

    fn file(&self, extension: &str) -> PathBuf {
        self.scratch.join(format!("{}.{extension}", self.number))
    }

    fn start(&self, unit: &Unit, plan: &Path, said: &Path) -> Result<Process, BenchError> {
        let stderr = File::create(said).map_err(|e| BenchError::file(said, &e))?;
        let mut command = Command::new(self.program);
        command.arg("plan").arg(&unit.folder).args(["--embedded", "--no-cache"]);
        command.args(["--planner", &unit.planner, "--engine", &unit.engine]);
        command.args(["--planning-timeout", &self.timeout.as_secs_f64().to_string()]);
        command.args(["--path-timeout", &self.settings.path_timeout_s.to_string()]);
        command.args(["--actions", &self.settings.actions, "--dbg", &self.settings.dbg]);
        command.arg(if self.settings.sweeps { "--sweeps" } else { "--no-sweeps" });
        if unit.rotation > 0 {
            let q = random_rotation(self.settings.seed, &unit.assembly, unit.rotation);
            // As one word: it may begin with a minus.
            command.arg(format!("--rotate={},{},{},{}", q.w, q.i, q.j, q.k));
        }
        if self.settings.threads > 0 {
            command.args(["--threads", &self.settings.threads.to_string()]);
        }
        command.arg("--json").arg(plan);
        command.env(READER, std::process::id().to_string());
        // Into a file, for a full pipe would stop the process.
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        command.spawn().map(Process).map_err(|e| BenchError::file(self.program, &e))
    }

    fn wait(&self, process: &mut Process, started: Instant, peak: &mut u64) -> io::Result<End> {
        let most = self.timeout.saturating_add(self.grace);
        loop {
            if let Some(status) = process.0.try_wait()? {
                return Ok(End::Exited(status));
            }
            if self.is_ended() {
                return Ok(End::Cancelled);
            }
            *peak = peak_memory_kib(process.0.id()).unwrap_or(*peak);
            let elapsed = started.elapsed();
            if elapsed > most {
                return Ok(End::Overstayed);
            }
            // Short runs are noticed at once, long ones are left in peace.
            std::thread::sleep((elapsed / 50).clamp(Duration::from_millis(1), Duration::from_millis(50)));
        }
    }

    fn ended(
        &self,
        unit: &Unit,
        wall: Duration,
        status: ExitStatus,
        plan: &Path,
        said: &Path,
    ) -> Option<Record> {
        let problem = |name: &str, what: String| Some(self.record(unit, wall, name, what));
        match status.code() {
            Some(CANCELLED) => None,
            Some(code) if PLAN_CODES.contains(&code) => match read_plan(plan) {
                Ok(document) => Some(self.planned(unit, wall, &document)),
                Err(reason) => problem("crashed", format!("{status}, but {reason}")),
            },
            Some(code) if REFUSALS.contains(&code) => problem("failed", last_words(said)),
            _ => problem("crashed", format!("{status}: {}", last_words(said))),
        }
    }

    fn planned(&self, unit: &Unit, wall: Duration, plan: &PlanDocument) -> Record {
        let s = &plan.stats;
        Record {
            parts: plan.parts.len(),
            category: Category::of(plan.parts.len()).name().to_owned(),
            reason: plan.reason.clone(),
            simulations: s.simulations_run,
            swept: s.sweeps,
            states: s.states,
            path_time_s: s.path_time_s,
            total_time_s: (s.total_time_s - s.verify_time_s).max(0.0),
            sdf_time_s: s.sdf_time_s,
            static_analysis_time_s: s.static_analysis_time_s,
            verify_time_s: s.verify_time_s,
            steps: plan.steps.len(),
            verified: verified(plan),
            ..self.record(unit, wall, &plan.status, String::new())
        }
    }

    fn record(&self, unit: &Unit, wall: Duration, status: &str, reason: String) -> Record {
        Record {
            assembly: unit.assembly.clone(),
            rotation: unit.rotation,
            parts: unit.parts,
            category: unit.category().name().to_owned(),
            date: String::new(),
            planner: unit.planner.clone(),
            engine: unit.engine.clone(),
            status: status.to_owned(),
            reason: Some(reason),
            simulations: 0,
            swept: 0,
            states: 0,
            path_time_s: 0.0,
            total_time_s: 0.0,
            sdf_time_s: 0.0,
            static_analysis_time_s: 0.0,
            verify_time_s: 0.0,
            wall_time_s: wall.as_secs_f64(),
            peak_memory_kib: 0,
            steps: 0,
            verified: false,
            settings: self.settings.clone(),
        }
    }
}

/// What the system says of a process that runs; nothing once it has ended.
fn peak_memory_kib(process: u32) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}

/// Ended by its handle when dropped, whatever happened meanwhile.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing to do.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn remove(file: &Path) -> Result<(), BenchError> {
    match fs::remove_file(file) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(BenchError::file(file, &e)),
        _ => Ok(()),
    }
}

fn read_plan(file: &Path) -> Result<PlanDocument, String> {
    let text = fs::read_to_string(file).map_err(|_| "wrote no plan".to_owned())?;
    PlanDocument::from_json(&text).map_err(|e| format!("its plan cannot be read: {e}"))
}

/// The plan's own word on each step, and a count of its own that what should be out is out.
fn verified(plan: &PlanDocument) -> bool {
    let checked = plan.steps.iter().all(|s| s.verified_depth.is_finite() && !s.path.is_empty());
    let movable = plan.remaining.iter().filter(|p| !plan.fixed.contains(p)).count();
    // A last part has nothing to leave; fixed ones stay.
    let all_out = (movable == 0 || plan.remaining.len() <= 1) && plan.kept_together.is_empty();
    let leaves = |s: &&StepDocument| s.of.is_none() && s.ends == StepEnd::Out.name();
    let out: usize = plan.steps.iter().filter(leaves).map(|s| s.parts.len()).sum();
    let counted = out + plan.remaining.len() == plan.parts.len();
    checked && counted && if plan.status == "complete" { all_out } else { !plan.steps.is_empty() }
}

/// The line that says what went wrong: the first that is marked as an error, else the last.
fn last_words(file: &Path) -> String {
    let bytes = fs::read(file).unwrap_or_default();
    let text = String::from_utf8_lossy(&bytes[bytes.len().saturating_sub(LAST_WORDS)..]).into_owned();
    let hint = |l: &&str| !l.is_empty() && !l.starts_with("note: run with");
    let mut lines = text.lines().map(str::trim).filter(hint);
    let marked = lines.clone().find(|l| l.starts_with("error:"));
    marked.or_else(|| lines.next_back()).unwrap_or("said nothing").to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::unit::tests::unit;
    use super::*;

    fn words(text: &str) -> String {
        let file = tempfile::NamedTempFile::new().unwrap();
        fs::write(file.path(), text).unwrap();
        last_words(file.path())
    }

    #[test]
    fn this_process_has_had_some_memory() {
        let before = peak_memory_kib(std::process::id()).unwrap();
        let filled = std::hint::black_box(vec![1u8; 64 << 20]);
        assert!(peak_memory_kib(std::process::id()).unwrap() >= before.max(filled.len() as u64 / 1024));
        assert_eq!(peak_memory_kib(u32::MAX), None);
    }

    #[test]
    fn the_telling_line_is_kept() {
        let refusal = "error: invalid value 'x' for '--planner'\n  [possible values: y]\n\ntry '--help'.\n";
        assert_eq!(words(refusal), "error: invalid value 'x' for '--planner'");
        let panic =
            "thread 'main' panicked at a.rs:1:1:\nindex 3 out of bounds\nnote: run with `RUST_BACKTRACE=1`\n";
        assert_eq!(words(panic), "index 3 out of bounds");
        assert_eq!(words(&format!("{}\nlast", "x".repeat(100_000))), "last");
        assert_eq!(words(" \n"), "said nothing");
    }

    #[test]
    fn a_unit_of_another_build_or_without_its_folder_has_no_record() {
        let program = Path::new("/proc/self/exe");
        let run = |unit| run_unit(unit, program, &AtomicBool::new(false)).unwrap_err().to_string();
        assert!(run(unit()).contains("use one binary on all machines"));
        let mut here = unit();
        here.settings.build = build_of(program).unwrap();
        assert!(run(here).contains("/corpus/hinge"));
    }
}
