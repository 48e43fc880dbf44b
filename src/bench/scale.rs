//! How planning grows with the number of parts: `sbdp bench scale`.
//!
//! Members of [`Family`] are written as folders of meshes and run like any corpus, each in a process of
//! its own. What comes out are time and peak memory per member, and per family the exponents of
//! time and memory over parts: the slopes of straight lines through the logarithms (least squares).

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use serde::Serialize;

use super::{BenchError, BenchObserver, Family, PATH_TIMEOUT, Record, Request, Shard, Summary, grace, read};

/// Numbers of parts unless asked otherwise.
pub const PARTS: [usize; 5] = [10, 30, 100, 300, 1000];
/// Below, what does not grow with the parts outweighs what does: such members are not fitted.
const LEAST_FITTED: usize = 30;
/// Where the members are written, and the two results.
const MEMBERS: &str = "assemblies";
const TABLE: &str = "scale.md";
const LINES: &str = "scale.jsonl";

/// What to run and how.
#[derive(Debug, Clone)]
pub struct ScaleRequest {
    /// Which families.
    pub families: Vec<Family>,
    /// Numbers of parts.
    pub parts: Vec<usize>,
    /// When a run is to answer.
    pub timeout: Duration,
    /// Whether parts that leave straight are taken out without simulation.
    pub sweeps: bool,
    /// Threads of each run; 0 for all processors.
    pub threads: u32,
    /// Where members and results go.
    pub out: PathBuf,
    /// The program whose `plan` command is run.
    pub program: PathBuf,
}

/// How a family grows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Growth {
    /// Its name.
    pub family: String,
    /// Numbers of parts of the members that were fitted, ascending.
    pub parts: Vec<usize>,
    /// Exponent of the time of the process from start to end.
    pub time_exponent: Option<f64>,
    /// Exponent of its peak memory.
    pub memory_exponent: Option<f64>,
}

/// Writes the members, runs what the output folder has no record of, and writes `scale.md` and
/// `scale.jsonl` beside what every benchmark writes.
///
/// # Errors
/// As [`super::run`]; a family has no member of so few parts.
pub fn scale(
    request: &ScaleRequest,
    cancel: &AtomicBool,
    observer: &mut dyn BenchObserver,
) -> Result<Summary, BenchError> {
    if let Some(few) = request.parts.iter().find(|n| **n < Family::LEAST) {
        let least = Family::LEAST;
        return Err(BenchError::Refused(format!("members have {least} parts and more, not {few}")));
    }
    let mut corpora = Vec::new();
    for family in &request.families {
        for parts in &request.parts {
            let folder = request.out.join(MEMBERS).join(member_name(*family, *parts));
            family.write(*parts, &folder)?;
            corpora.push(folder);
        }
    }
    let run = Request {
        corpora,
        planners: vec!["sbdp-star".to_owned()],
        engines: vec!["sliding".to_owned()],
        timeout: request.timeout,
        path_timeout: PATH_TIMEOUT,
        actions: "extended",
        dbg: "sliding",
        sweeps: request.sweeps,
        grace: grace(request.timeout),
        threads: request.threads,
        jobs: 1,
        parts_up_to: None,
        rotations: 0,
        seed: 0,
        shard: Shard::WHOLE,
        out: request.out.clone(),
        program: request.program.clone(),
    };
    let summary = super::run(&run, cancel, observer)?;
    evaluate(&request.families, &request.out)?;
    Ok(summary)
}

fn member_name(family: Family, parts: usize) -> String {
    format!("{}-{parts}", family.name())
}

/// Over all records of the folder, those of earlier calls included.
fn evaluate(families: &[Family], out: &Path) -> Result<(), BenchError> {
    let records = read(out)?;
    let mut growths = Vec::new();
    let mut table = String::from(
        "# Growth with the number of parts\n\nTime is that of the process from start to end, in s; memory its \
         peak (VmHWM), in MiB.\n\n| family | parts | status | steps | simulations | sweeps | fields | static \
         analysis | search | verification | time | memory |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for family in families {
        let members = members(*family, &records);
        for record in &members {
            row(&mut table, family.name(), record);
        }
        growths.push(growth(family.name(), &members));
    }
    table.push_str("\n| family | fitted over | exponent of time | exponent of memory |\n|---|---|---|---|\n");
    for g in &growths {
        let parts: Vec<_> = g.parts.iter().map(ToString::to_string).collect();
        let number = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), |x| format!("{x:.2}"));
        let (time, memory) = (number(g.time_exponent), number(g.memory_exponent));
        // Writing to a string cannot fail.
        let _ = writeln!(table, "| {} | {} parts | {time} | {memory} |", g.family, parts.join(", "));
    }
    let mut lines = String::new();
    for g in &growths {
        let line = serde_json::to_string(g).map_err(|e| BenchError::Failed(format!("{LINES}: {e}")))?;
        lines += &line;
        lines.push('\n');
    }
    for (name, text) in [(TABLE, table), (LINES, lines)] {
        let path = out.join(name);
        std::fs::write(&path, text).map_err(|e| BenchError::file(&path, &e))?;
    }
    Ok(())
}

/// The records of a family, by size.
fn members(family: Family, records: &[Record]) -> Vec<&Record> {
    let is_member = |r: &&Record| {
        let number = r.assembly.strip_prefix(family.name()).and_then(|rest| rest.strip_prefix('-'));
        number.is_some_and(|n| n.parse::<usize>().is_ok())
    };
    let mut out: Vec<_> = records.iter().filter(is_member).collect();
    out.sort_by_key(|r| r.parts);
    out
}

fn row(table: &mut String, family: &str, r: &Record) {
    let mib = r.peak_memory_kib as f64 / 1024.0;
    let _ = writeln!(
        table,
        "| {family} | {} | {} | {} | {} | {} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {mib:.0} |",
        r.parts,
        if r.status == "complete" && !r.verified { "unverified" } else { &r.status },
        r.steps,
        r.simulations,
        r.swept,
        r.sdf_time_s,
        r.static_analysis_time_s,
        r.path_time_s,
        r.verify_time_s,
        r.wall_time_s,
    );
}

fn growth(family: &str, members: &[&Record]) -> Growth {
    let fitted: Vec<_> = members.iter().filter(|r| r.solved() && r.parts >= LEAST_FITTED).collect();
    let points = |value: &dyn Fn(&Record) -> f64| -> Vec<(f64, f64)> {
        fitted.iter().map(|r| (r.parts as f64, value(r))).collect()
    };
    Growth {
        family: family.to_owned(),
        parts: fitted.iter().map(|r| r.parts).collect(),
        time_exponent: exponent(&points(&|r| r.wall_time_s)),
        memory_exponent: exponent(&points(&|r| r.peak_memory_kib as f64)),
    }
}

/// The slope of the straight line through the logarithms that is nearest by least squares.
fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<_> = points.iter().filter(|p| p.1 > 0.0).map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logs.len() as f64;
    let mean = |value: &dyn Fn(&(f64, f64)) -> f64| logs.iter().map(value).sum::<f64>() / count;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = mean(&|p| (p.0 - mx).powi(2));
    (logs.len() > 1 && spread > 0.0).then(|| mean(&|p| (p.0 - mx) * (p.1 - my)) / spread)
}

#[cfg(test)]
mod tests {
    use super::super::tests::record;
    use super::*;

    fn member(parts: usize, seconds: f64, kib: u64) -> Record {
        let name = member_name(Family::Rack, parts);
        let r = record((&name, parts), "sbdp-star", Ok((0, 0.0, 0.0)));
        Record { wall_time_s: seconds, peak_memory_kib: kib, ..r }
    }

    #[test]
    fn a_power_law_gives_its_exponent_and_one_point_none() {
        let law = |n: f64| (n, 0.3 * n.powf(1.25));
        let found = exponent(&[law(10.0), law(30.0), law(1000.0)]).unwrap();
        assert!((found - 1.25).abs() < 1e-12, "{found}");
        assert_eq!(exponent(&[law(10.0)]), None);
        assert_eq!(exponent(&[law(10.0), law(10.0)]), None);
    }

    #[test]
    fn only_solved_members_of_some_size_are_fitted() {
        let mut failed = member(1000, 1e6, 1);
        failed.status = "timeout".to_owned();
        let records = [member(10, 9.0, 9), member(100, 2.0, 2000), member(400, 16.0, 8000), failed];
        let g = growth("rack", &members(Family::Rack, &records));
        assert_eq!(g.parts, [100, 400]);
        assert!((g.time_exponent.unwrap() - 1.5).abs() < 1e-12);
        assert!((g.memory_exponent.unwrap() - 1.0).abs() < 1e-12);
        assert!(members(Family::GearTrain, &records).is_empty());
    }
}
