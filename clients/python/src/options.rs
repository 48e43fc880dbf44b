//! The options of a plan request, from keyword arguments.

use std::num::NonZeroU32;
use std::time::Duration;

use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString};
use sbdp_client::{
    ActionSet, Engine, Gravity, PenaltyParameter, PlanOptions, Planner, Reports, Staging, StaticAnalysis,
    Steady, Waypoint,
};

use crate::assembly::Data;

/// The value of a keyword that has a few words.
fn one_of<T: Copy>(key: &str, value: &Bound<'_, PyAny>, words: &[(&str, T)]) -> PyResult<T> {
    let text: String = value.extract()?;
    let found = words.iter().find(|(word, _)| *word == text);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let all: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        PyValueError::new_err(format!("{key}: `{text}` is none of {}", all.join(", ")))
    })
}

/// Seconds as a time; `None` for no limit.
pub(crate) fn seconds(key: &str, value: &Bound<'_, PyAny>) -> PyResult<Option<Duration>> {
    let Some(seconds) = value.extract::<Option<f64>>()? else { return Ok(None) };
    let time = Duration::try_from_secs_f64(seconds);
    time.map(Some).map_err(|_| PyValueError::new_err(format!("{key}: {seconds} is no time in seconds")))
}

/// Part numbers of names; one name may stand alone.
pub(crate) fn parts(data: &Data, value: &Bound<'_, PyAny>) -> PyResult<Vec<u32>> {
    let py = value.py();
    let names: Vec<String> = match value.cast::<PyString>() {
        Ok(name) => vec![name.extract()?],
        Err(_) => value.try_iter()?.map(|name| name?.extract()).collect::<PyResult<_>>()?,
    };
    let mut parts = names.iter().map(|name| data.part(py, name)).collect::<PyResult<Vec<u32>>>()?;
    parts.sort_unstable();
    parts.dedup();
    Ok(parts)
}

/// A rigid motion: `[x, y, z]` or `[x, y, z, qw, qx, qy, qz]`.
pub(crate) fn pose(value: &Bound<'_, PyAny>) -> PyResult<Waypoint> {
    let numbers: Vec<f64> = value.try_iter()?.map(|number| number?.extract()).collect::<PyResult<_>>()?;
    match numbers[..] {
        [x, y, z] => Ok([x, y, z, 1.0, 0.0, 0.0, 0.0]),
        [x, y, z, w, i, j, k] => {
            let length = (w * w + i * i + j * j + k * k).sqrt();
            if (length - 1.0).abs() > 1e-6 {
                return Err(PyValueError::new_err(format!("the quaternion of {numbers:?} has not length 1")));
            }
            Ok([x, y, z, w, i, j, k])
        }
        _ => Err(PyValueError::new_err("a pose is [x, y, z] or [x, y, z, qw, qx, qy, qz]")),
    }
}

fn poses(data: &Data, value: &Bound<'_, PyAny>) -> PyResult<Vec<(u32, Waypoint)>> {
    let py = value.py();
    let entries = value.cast::<PyDict>()?.iter();
    entries.map(|(name, motion)| Ok((data.part(py, &name.extract::<String>()?)?, pose(&motion)?))).collect()
}

/// One of the six axes by name, or a vector; `None` leaves it to the daemon.
fn direction(value: &Bound<'_, PyAny>) -> PyResult<Option<[f64; 3]>> {
    if value.is_none() {
        return Ok(None);
    }
    if value.cast::<PyString>().is_err() {
        return value.extract().map(Some);
    }
    let axes = [
        ("+x", [1.0, 0.0, 0.0]),
        ("-x", [-1.0, 0.0, 0.0]),
        ("+y", [0.0, 1.0, 0.0]),
        ("-y", [0.0, -1.0, 0.0]),
        ("+z", [0.0, 0.0, 1.0]),
        ("-z", [0.0, 0.0, -1.0]),
    ];
    one_of("up", value, &axes).map(Some)
}

/// A report about each step.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ReportKind {
    Stability,
    Clearance,
    Tools,
}

/// The reports that are wanted; one word may stand alone.
fn report_kinds(value: &Bound<'_, PyAny>) -> PyResult<Vec<ReportKind>> {
    let words = [
        ("stability", ReportKind::Stability),
        ("clearance", ReportKind::Clearance),
        ("tools", ReportKind::Tools),
    ];
    match value.cast::<PyString>() {
        Ok(word) => Ok(vec![one_of("report", word, &words)?]),
        Err(_) => value.try_iter()?.map(|word| one_of("report", &word?, &words)).collect(),
    }
}

/// The groups that the assembly's files name.
fn groups(py: Python<'_>, data: &Data) -> PyResult<Vec<Vec<u32>>> {
    let named = data.files().map(|(assembly, _)| &assembly.groups[..]).unwrap_or_default();
    if named.is_empty() {
        return Err(PyValueError::new_err("groups: the assembly names none"));
    }
    let numbers = |group: &sbdp::geometry::SourceGroup| {
        let mut parts = group.parts.iter().map(|part| data.part(py, part)).collect::<PyResult<Vec<u32>>>()?;
        parts.sort_unstable();
        Ok(parts)
    };
    named.iter().map(numbers).collect()
}

fn penalty(value: &Bound<'_, PyAny>) -> PyResult<Vec<(PenaltyParameter, f64)>> {
    let words: Vec<(&str, PenaltyParameter)> = PenaltyParameter::ALL.iter().map(|p| (p.name(), *p)).collect();
    let entries = value.cast::<PyDict>()?.iter();
    entries.map(|(name, number)| Ok((one_of("penalty", &name, &words)?, number.extract()?))).collect()
}

/// The options of a request: those that the assembly's files give, and the keywords, which are named as on the command
/// line.
pub(crate) fn options(
    py: Python<'_>,
    data: &Data,
    keywords: Option<&Bound<'_, PyDict>>,
) -> PyResult<PlanOptions> {
    let mut options = PlanOptions::default();
    let (mut actions, mut together, mut staging) = (None, false, None);
    let (mut steady, mut hands) = (false, None::<NonZeroU32>);
    let (mut reported, mut friction) = (Vec::new(), Gravity::default().friction);
    for (key, value) in keywords.into_iter().flatten() {
        let key: String = key.extract()?;
        match key.as_str() {
            "planner" => {
                let words = [
                    ("sbdp-star", Planner::SbdpStar),
                    ("sbdp", Planner::Sbdp),
                    ("pdp-t", Planner::PdpT),
                    ("pdp-r", Planner::PdpR),
                    ("pdp-star", Planner::PdpStar),
                    ("rrt", Planner::Rrt),
                    ("bk-rrt", Planner::BkRrt),
                ];
                options.planner = one_of(&key, &value, &words)?;
            }
            "engine" => {
                let words = [("sliding", Engine::Sliding), ("penalty", Engine::Penalty)];
                options.engine = one_of(&key, &value, &words)?;
            }
            "actions" => {
                let words = [("paper", ActionSet::Paper), ("extended", ActionSet::Extended)];
                actions = Some(one_of(&key, &value, &words)?);
            }
            "dbg" => {
                let words = [("sliding", StaticAnalysis::Sliding), ("paper", StaticAnalysis::Paper)];
                options.static_analysis = one_of(&key, &value, &words)?;
            }
            "penalty" => options.penalty = penalty(&value)?,
            "sweeps" => options.sweeps = value.extract()?,
            "timeout" => options.timeout = seconds(&key, &value)?,
            "planning_timeout" => options.planning_timeout = seconds(&key, &value)?,
            "path_timeout" => options.path_timeout = seconds(&key, &value)?,
            "seed" => options.seed = value.extract()?,
            "end_gap" => options.end_gap = value.extract()?,
            "clearance" => options.clearance = value.extract()?,
            "max_simulations" => options.max_simulations = value.extract()?,
            "threads" => options.threads = value.extract()?,
            "fixed" => options.fixed = parts(data, &value)?,
            "removed" => options.removed = parts(data, &value)?,
            "targets" if value.is_none() => {}
            "targets" => options.targets = Some(parts(data, &value)?),
            "base" => options.base = parts(data, &value)?,
            "keep" => options.keep = parts(data, &value)?,
            "keep_out" => options.keep_out = parts(data, &value)?,
            "moved" => options.moved = poses(data, &value)?,
            "assembly" => together = value.extract()?,
            "staging" => staging = Some(value),
            "up" => options.up = direction(&value)?,
            "report" => reported = report_kinds(&value)?,
            "friction" => friction = value.extract()?,
            "steady" => steady = value.extract()?,
            "hands" => {
                let none = || PyValueError::new_err("hands: one is needed to move a part");
                let given = value.extract::<Option<u32>>()?;
                hands = given.map(|hands| NonZeroU32::new(hands).ok_or_else(none)).transpose()?;
            }
            "groups" => {
                if one_of(&key, &value, &[("needed", false), ("prefer", true)])? {
                    options.groups = groups(py, data)?;
                }
            }
            "no_cache" => options.no_cache = value.extract()?,
            "batch" => options.batch = value.extract()?,
            _ => return Err(PyTypeError::new_err(format!("there is no option `{key}`"))),
        }
    }
    options.actions = actions.unwrap_or(match options.planner {
        Planner::SbdpStar => ActionSet::Extended,
        _ => ActionSet::Paper,
    });
    // The description of an assembly gives options of the request.
    for name in data.fixed() {
        options.fixed.push(data.part(py, name)?);
    }
    options.fixed.sort_unstable();
    options.fixed.dedup();
    if let Some((files, _)) = data.files() {
        let described = [
            (&mut options.base, &files.base),
            (&mut options.keep, &files.keep),
            (&mut options.keep_out, &files.keep_out),
        ];
        for (list, described) in described {
            if list.is_empty() {
                *list = described.iter().map(|name| data.part(py, name)).collect::<PyResult<_>>()?;
                list.sort_unstable();
                list.dedup();
            }
        }
    }
    let up = options.up.unwrap_or_else(|| {
        data.files().map_or([0.0, 0.0, 1.0], |(assembly, _)| sbdp::files::customary_up(assembly))
    });
    options.gravity = Gravity { up, friction };
    options.steady = (steady || hands.is_some()).then_some(Steady { hands });
    options.reports = Reports {
        stability: reported.contains(&ReportKind::Stability),
        clearance: reported.contains(&ReportKind::Clearance),
        tools: reported.contains(&ReportKind::Tools),
    };
    if staging.is_some() && !together {
        return Err(PyValueError::new_err("staging: only assembly plans have it; give assembly=True"));
    }
    if together {
        options.assembly = Some(staging_of(py, data, staging.as_ref())?);
    }
    Ok(options)
}

/// `auto` (where the files say, else beside the assembly), `none`, or poses by part.
fn staging_of(py: Python<'_>, data: &Data, given: Option<&Bound<'_, PyAny>>) -> PyResult<Staging> {
    match given {
        Some(given) if given.cast::<PyDict>().is_ok() => Ok(Staging::Beside(poses(data, given)?)),
        Some(given) if one_of("staging", given, &[("auto", false), ("none", true)])? => Ok(Staging::None),
        _ => {
            let waiting = data.files().map(|(files, _)| &files.waiting[..]).unwrap_or_default();
            let place = |(name, pose): &(String, sbdp::geometry::Pose)| {
                Ok((data.part(py, name)?, sbdp::geometry::waypoint_from_pose(pose)))
            };
            Ok(Staging::Beside(waiting.iter().map(place).collect::<PyResult<_>>()?))
        }
    }
}
