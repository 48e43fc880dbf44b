//! What is kept of a run: one line of `results.jsonl` each, appended as soon as the run ends.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::corpus::Category;
use super::{BenchError, RESULTS};

/// What a run's times depend on besides the run itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The version of sbdp.
    pub version: String,
    /// The hash of the executable: times of two builds do not belong into one file.
    pub build: String,
    /// After so long, verification not counted, a run was to answer.
    pub timeout_s: f64,
    /// After so long one path was given up.
    pub path_timeout_s: f64,
    /// The action set of all planners.
    pub actions: String,
    /// How blocking graphs were begun.
    #[serde(default = "before_there_was_a_choice")]
    pub dbg: String,
    /// Whether the state-based planners took parts that leave straight out without simulation.
    #[serde(default)]
    pub sweeps: bool,
    /// Which rotations those of rotated runs were.
    #[serde(default)]
    pub seed: u64,
    /// Threads of each run; 0 for all processors.
    pub threads: u32,
    /// How many runs went on at a time.
    pub jobs: usize,
    /// The name of the machine's processor; empty in records of older builds.
    #[serde(default)]
    pub processor: String,
    /// How many processors (cores, with hardware threads) the run could use.
    pub processors: usize,
}

fn before_there_was_a_choice() -> String {
    "sliding".to_owned()
}

impl Settings {
    /// Whether runs belong into one table. Machines may differ, as those of shards do.
    #[must_use]
    pub fn comparable(&self, other: &Self) -> bool {
        let key = |s: &Self| {
            (
                s.version.clone(),
                s.timeout_s.to_bits(),
                s.path_timeout_s.to_bits(),
                s.actions.clone(),
                s.dbg.clone(),
                s.sweeps,
                s.seed,
                s.threads,
            )
        };
        key(self) == key(other)
    }

    /// Whether a benchmark with these may go on where one with those stopped.
    #[must_use]
    pub fn resumes(&self, other: &Self) -> bool {
        self.comparable(other) && self.build == other.build
    }
}

impl std::fmt::Display for Settings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let threads = if self.threads == 0 { "all".to_owned() } else { self.threads.to_string() };
        let Self { version, build, timeout_s, path_timeout_s, actions, dbg, .. } = self;
        let seed = if self.seed == 0 { String::new() } else { format!(", seed {}", self.seed) };
        let sweeps = if self.sweeps { ", sweeps" } else { "" };
        write!(
            f,
            "version {version}, build {build}, timeout {timeout_s} s ({path_timeout_s} s per path), actions {actions}{sweeps}, dbg {dbg}{seed}, threads {threads}"
        )
    }
}

/// One run: one assembly, as given or rotated, one planner, one engine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// The assembly's name in the corpus.
    pub assembly: String,
    /// 0: as given; else the number of the random rotation it was planned under.
    #[serde(default)]
    pub rotation: u32,
    /// How many parts it has.
    pub parts: usize,
    /// `pair`, `small`, `medium` or `large`.
    pub category: String,
    /// When the run began, UTC (RFC 3339); empty in records of older builds.
    #[serde(default)]
    pub date: String,
    /// The planner.
    pub planner: String,
    /// The engine.
    pub engine: String,
    /// A plan's status, or `killed` (did not end in time), `crashed`, `failed` (refused or gave up
    /// in good order).
    pub status: String,
    /// Why it is not `complete`.
    pub reason: Option<String>,
    /// Transition functions computed (the paper's Sim).
    pub simulations: u64,
    /// Removals by a straight sweep, which are no simulations.
    #[serde(default)]
    pub swept: u64,
    /// States kept.
    pub states: u64,
    /// The simulations that were used, each on its thread (the paper's PT).
    pub path_time_s: f64,
    /// Everything from the healed meshes on but thinning and verification, which the paper's
    /// planners do not do (its DT).
    pub total_time_s: f64,
    /// Distance fields; a part of the total.
    pub sdf_time_s: f64,
    /// Static analysis; a part of the total.
    pub static_analysis_time_s: f64,
    /// Thinning and verification; no part of the total.
    pub verify_time_s: f64,
    /// The process from start to end, reading and healing included.
    pub wall_time_s: f64,
    /// The most memory that the process had (VmHWM), in KiB; looked up while it ran, so what it took
    /// in the last fiftieth of its time may be missing.
    #[serde(default)]
    pub peak_memory_kib: u64,
    /// Removals.
    pub steps: usize,
    /// Every step passed verification, and all that is wanted is out if the status says so.
    pub verified: bool,
    /// What it was run with.
    #[serde(flatten)]
    pub settings: Settings,
}

/// Assembly, rotation, planner and engine.
pub type RunKey<'a> = (&'a str, u32, &'a str, &'a str);

impl Record {
    /// Whether the problem counts as solved.
    #[must_use]
    pub fn solved(&self) -> bool {
        self.status == "complete" && self.verified
    }

    /// What the run was: no two records of a results file share it.
    #[must_use]
    pub fn key(&self) -> RunKey<'_> {
        (&self.assembly, self.rotation, &self.planner, &self.engine)
    }

    /// The group of problems it belongs to.
    #[must_use]
    pub fn group(&self) -> Category {
        Category::of(self.parts)
    }
}

/// A results file that is being written; nobody else writes it meanwhile.
#[derive(Debug)]
pub struct Store {
    path: PathBuf,
    file: File,
}

impl Store {
    /// Opens the results in a folder, or begins them, and returns what is there. A line that an
    /// interrupted process left half-written is cut off.
    ///
    /// # Errors
    /// The file cannot be read or written, another process writes it, or a line is no record.
    pub fn open(folder: &Path) -> Result<(Self, Vec<Record>), BenchError> {
        let path = folder.join(RESULTS);
        let failed = |e: std::io::Error| BenchError::file(&path, &e);
        let mut options = File::options();
        let mut file =
            options.read(true).write(true).create(true).truncate(false).open(&path).map_err(failed)?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => return Err(BenchError::Busy(path)),
            Err(TryLockError::Error(e)) => return Err(failed(e)),
            Ok(()) => {}
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed)?;
        let whole = whole_lines(&bytes);
        let records = parse(&path, whole)?;
        file.set_len(whole.len() as u64).map_err(failed)?;
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        Ok((Self { path, file }, records))
    }

    /// Adds a record; it is with the system when this returns.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn append(&mut self, record: &Record) -> Result<(), BenchError> {
        let failed = |e: std::io::Error| BenchError::file(&self.path, &e);
        self.file.write_all(line(record)?.as_bytes()).map_err(failed)
    }

    /// Replaces the file by the given records, at once.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn replace(self, records: &[Record]) -> Result<(), BenchError> {
        let beside = self.path.with_extension("jsonl.new");
        let text = records.iter().map(line).collect::<Result<String, _>>()?;
        std::fs::write(&beside, text).map_err(|e| BenchError::file(&beside, &e))?;
        std::fs::rename(&beside, &self.path).map_err(|e| BenchError::file(&self.path, &e))
    }
}

/// The records of a folder, also while a benchmark still adds to them.
///
/// # Errors
/// There is no readable results file, or a line is no record.
pub fn read(folder: &Path) -> Result<Vec<Record>, BenchError> {
    let path = folder.join(RESULTS);
    let bytes = std::fs::read(&path).map_err(|e| BenchError::file(&path, &e))?;
    parse(&path, whole_lines(&bytes))
}

fn line(record: &Record) -> Result<String, BenchError> {
    let text = serde_json::to_string(record);
    text.map(|t| t + "\n").map_err(|e| BenchError::Failed(format!("cannot write a record: {e}")))
}

/// What comes up to the last line break; the rest was being written when the process ended.
fn whole_lines(bytes: &[u8]) -> &[u8] {
    let end = bytes.iter().rposition(|&b| b == b'\n').map_or(0, |at| at + 1);
    &bytes[..end]
}

fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Record>, BenchError> {
    let lines = (1..).zip(bytes.split(|&b| b == b'\n')).filter(|(_, l)| !l.trim_ascii().is_empty());
    let record = |(number, line): (usize, &[u8])| {
        serde_json::from_slice(line)
            .map_err(|e| BenchError::Failed(format!("{}:{number}: not a record: {e}", path.display())))
    };
    lines.map(record).collect()
}
