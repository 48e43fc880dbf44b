//! A run as a unit of its own, so that anything can hand the runs of a benchmark out to machines: `sbdp bench units`
//! prints one line of JSON per run, `sbdp bench run-unit` takes one and prints its record.

use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::corpus::Category;
use super::record::{RunKey, Settings};
use super::{BenchError, ENGINES, PLANNERS, known};

/// One assembly, as given or rotated, one planner, one engine, and how they are run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unit {
    /// The assembly's name in the corpus.
    pub assembly: String,
    /// Where it is; a machine that runs the unit has it there, too.
    pub folder: PathBuf,
    /// How many meshes it has.
    pub parts: usize,
    /// 0: as given; else the number of the random rotation that it is planned under.
    pub rotation: u32,
    /// The planner.
    pub planner: String,
    /// The engine.
    pub engine: String,
    /// What it is run with.
    #[serde(flatten)]
    pub settings: Settings,
}

impl Unit {
    /// As [`Record::key`](super::Record::key) of its record.
    #[must_use]
    pub fn key(&self) -> RunKey<'_> {
        (&self.assembly, self.rotation, &self.planner, &self.engine)
    }

    /// The group of problems that it belongs to.
    #[must_use]
    pub fn category(&self) -> Category {
        Category::of(self.parts)
    }

    /// Reads a line of `sbdp bench units`.
    ///
    /// # Errors
    /// It is none, or names a planner or an engine that there is not.
    pub fn from_json(line: &str) -> Result<Self, BenchError> {
        let refused = |e: &dyn std::fmt::Display| {
            BenchError::Refused(format!("no unit, as `sbdp bench units` prints it: {e}"))
        };
        let unit: Self = serde_json::from_str(line).map_err(|e| refused(&e))?;
        known("planner", &PLANNERS, std::slice::from_ref(&unit.planner))?;
        known("engine", &ENGINES, std::slice::from_ref(&unit.engine))?;
        for seconds in [unit.settings.timeout_s, unit.settings.path_timeout_s] {
            Duration::try_from_secs_f64(seconds).map_err(|e| refused(&format!("{seconds} s: {e}")))?;
        }
        Ok(unit)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in super::super) fn unit() -> Unit {
        let settings = Settings {
            version: "0".into(),
            build: "b".into(),
            timeout_s: 1.5,
            path_timeout_s: 2.0,
            actions: "paper".into(),
            dbg: "sliding".into(),
            sweeps: false,
            seed: 7,
            threads: 1,
            jobs: 1,
            processor: "Fast 9000".into(),
            processors: 2,
        };
        Unit {
            assembly: "corpus/hinge".into(),
            folder: "/corpus/hinge".into(),
            parts: 3,
            rotation: 2,
            planner: "sbdp".into(),
            engine: "sliding".into(),
            settings,
        }
    }

    #[test]
    fn a_unit_is_one_line_and_comes_back() {
        let line = serde_json::to_string(&unit()).unwrap();
        assert!(!line.contains('\n') && line.contains(r#""timeout_s":1.5"#), "{line}");
        assert_eq!(Unit::from_json(&line).unwrap(), unit());
    }

    #[test]
    fn what_is_no_unit_is_refused() {
        let line = serde_json::to_string(&unit()).unwrap();
        for (from, to, words) in [
            (r#""planner":"sbdp""#, r#""planner":"magic""#, "there is no planner `magic`"),
            (r#""engine":"sliding""#, r#""engine":"x""#, "there is no engine `x`"),
            (r#""timeout_s":1.5"#, r#""timeout_s":-1"#, "no unit"),
            (r#""parts":3,"#, "", "missing field `parts`"),
        ] {
            let changed = line.replace(from, to);
            assert_ne!(changed, line);
            let error = Unit::from_json(&changed).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
