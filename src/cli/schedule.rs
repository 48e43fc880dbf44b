//! `sbdp schedule`: when which arm carries out which step of a plan.

use std::ops::Range;
use std::path::Path;
use std::process::ExitCode;

use nalgebra::Point3;
use serde::Serialize;

use super::args::ScheduleArguments;
use super::error::CliError;
use super::standing::{StandingPlan, check_order_is_free};
use super::table::{TextTable, listed};
use super::{interrupt, show};
use crate::document::{PlanDocument, StepDocument, kind_of};
use crate::files::metres;
use crate::geometry::{Assembly, Bounds, Pose, interpolate, pose_from_waypoint, transformed};
use crate::plan::PlanKind;
use crate::schedule::{Held, MotionTimes, Operation, Schedule, ScheduleError, schedule, stations};
use crate::search::Termination;
use crate::service::StandingSession;
use crate::statics::Stability;

/// The version of the document.
const SCHEMA: &str = "sbdp-schedule/1";
/// The same with `--stations`.
const LINE_SCHEMA: &str = "sbdp-line/1";

/// What `--json` writes. Times are in seconds, steps are numbered as in the plan, from 0.
#[derive(Debug, Serialize)]
struct ScheduleDocument<'a> {
    schema: &'static str,
    arms: usize,
    times: MotionTimes,
    seconds: f64,
    /// Of all steps, one after the other.
    work: f64,
    critical: &'a [usize],
    steps: Vec<ScheduledDocument<'a>>,
}

/// What `--json` writes with `--stations`.
#[derive(Debug, Serialize)]
struct LineDocument<'a> {
    schema: &'static str,
    times: MotionTimes,
    /// Of the slowest station.
    cycle: f64,
    /// Of all steps, one after the other.
    work: f64,
    stations: Vec<StationDocument<'a>>,
}

#[derive(Debug, Serialize)]
struct StationDocument<'a> {
    steps: Vec<usize>,
    parts: Vec<&'a [String]>,
    seconds: f64,
    /// To move parts and to hold others; null with `--weightless`.
    hands: Option<usize>,
}

#[derive(Debug, Serialize)]
struct ScheduledDocument<'a> {
    step: usize,
    parts: &'a [String],
    arm: usize,
    begin: f64,
    end: f64,
    held: usize,
}

pub(super) fn run(arguments: &ScheduleArguments) -> Result<ExitCode, CliError> {
    let times = times(arguments.times.as_deref())?;
    let StandingPlan { plan, service, id, query, .. } = StandingPlan::read(&arguments.standing, false)?;
    if arguments.stations.is_none() {
        check_order_is_free(&plan, "schedule")?;
    }
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let interrupted = || CliError::Failed("interrupted".to_owned());
    let operations = operations(&plan, &service.assembly(id)?, &times);
    if let Some(count) = arguments.stations {
        let states = if arguments.weightless {
            None
        } else {
            Some(service.statics(id, &query, &termination)?.ok_or_else(interrupted)?.states)
        };
        let document = line(&plan, &operations, count.get(), times, states.as_deref());
        show(arguments.json.as_deref(), &document, "line", || line_table(&document))?;
        return Ok(ExitCode::SUCCESS);
    }
    let standing: Vec<usize> =
        query.states.first().into_iter().flat_map(|state| &state.parts).map(|(part, _)| *part).collect();
    let arms = arguments.arms.get();
    let found = if arguments.weightless {
        schedule(&operations, arms, standing, &mut |_| Ok(Held::default()))
    } else {
        let ask = |session: &mut StandingSession<'_>| {
            schedule(&operations, arms, standing, &mut |standing| {
                let found = session.stability(standing)?;
                Ok(Held { arms: found.trouble(), falling: found.falling() })
            })
        };
        service.with_standing(id, &query, &termination, ask)?.ok_or_else(interrupted)?
    };
    let found = match found {
        Ok(found) => found,
        Err(ScheduleError::Interrupted(_)) => return Err(interrupted()),
        Err(ScheduleError::NoOrder) => {
            let reason = "steps of the plan require each other, or some that it does not have";
            return Err(CliError::Refused(reason.to_owned()));
        }
        Err(ScheduleError::TooFewArms { operation, needed }) => {
            let parts = plan.steps.get(operation).map(|step| step.parts.join(", ")).unwrap_or_default();
            return Err(CliError::Refused(format!(
                "--arms {arms} is too few: of all that could come next, step {} ({parts}) needs the fewest, {needed}: 1 to \
                 move and {} to hold; `sbdp plan --steady` may find an order that needs fewer",
                operation + 1,
                needed - 1
            )));
        }
    };
    let document = document(&plan, &found, &operations, arms, times);
    show(arguments.json.as_deref(), &document, "schedule", || table(&document, &plan))?;
    Ok(ExitCode::SUCCESS)
}

/// The times in a file, or the default.
fn times(file: Option<&Path>) -> Result<MotionTimes, CliError> {
    let Some(file) = file else { return Ok(MotionTimes::default()) };
    let refused = |reason: &dyn std::fmt::Display| CliError::Refused(format!("{}: {reason}", file.display()));
    let text = std::fs::read_to_string(file).map_err(|e| refused(&e))?;
    let times: MotionTimes = toml::from_str(&text).map_err(|e| refused(&e))?;
    match times.out_of_range() {
        Some("speed") => Err(refused(&"`speed` must be a finite number above 0")),
        Some(name) => Err(refused(&format!("`{name}` must be a finite number from 0 up"))),
        None => Ok(times),
    }
}

/// The steps of a plan as operations.
fn operations(plan: &PlanDocument, assembly: &Assembly, times: &MotionTimes) -> Vec<Operation> {
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    let unit = plan.units.as_deref().and_then(metres).map_or(1.0, |metres| metres * 1e3);
    let operation = |step: &StepDocument| {
        let parts: Vec<usize> = step.parts.iter().filter_map(number).collect();
        let points: Vec<Point3<f64>> = parts.iter().flat_map(|&part| hull(assembly, part)).collect();
        let path: Vec<Pose> = step.path.iter().map(pose_from_waypoint).collect();
        let seconds = times.of(&path, &Bounds::of(&points).centre(), unit);
        let is_in_assembly = step.of.is_none();
        Operation {
            swept: is_in_assembly.then(|| swept(&points, &path)),
            parts: if is_in_assembly { parts } else { Vec::new() },
            requires: step.requires.clone(),
            seconds,
        }
    };
    plan.steps.iter().map(operation).collect()
}

/// Points with the convex hull of a part as it stands assembled, in the input's frame.
fn hull(assembly: &Assembly, part: usize) -> Vec<Point3<f64>> {
    let part = &assembly.parts[part];
    let shape = &assembly.shapes[part.shape];
    transformed(&shape.hull, &part.planning_from_shape).iter().map(|p| p / assembly.scale).collect()
}

/// The box of all that points sweep along a path.
fn swept(points: &[Point3<f64>], path: &[Pose]) -> Bounds {
    /// Radians between two poses. Between them points on a circle are at most 1 - cos of half of it, 0.002 of the radius,
    /// outside of the box of both; at half, a quarter of that, at double four times as much.
    const TURN: f64 = 0.125;
    let centre = Bounds::of(points).centre();
    let mut bounds = Bounds::of(points);
    for pair in path.windows(2) {
        let count = (pair[0].rotation.angle_to(&pair[1].rotation) / TURN).ceil().max(1.0) as usize;
        for i in 0..=count {
            let pose = interpolate(&pair[0], &pair[1], &centre, i as f64 / count as f64);
            bounds = bounds.union(&Bounds::of(&transformed(points, &pose)));
        }
    }
    bounds
}

fn document<'a>(
    plan: &'a PlanDocument,
    found: &'a Schedule,
    operations: &[Operation],
    arms: usize,
    times: MotionTimes,
) -> ScheduleDocument<'a> {
    let steps = found.operations.iter().filter_map(|scheduled| {
        Some(ScheduledDocument {
            step: scheduled.operation,
            parts: &plan.steps.get(scheduled.operation)?.parts,
            arm: scheduled.arm,
            begin: scheduled.begin,
            end: scheduled.end,
            held: scheduled.held,
        })
    });
    ScheduleDocument {
        schema: SCHEMA,
        arms,
        times,
        seconds: found.seconds,
        work: operations.iter().map(|operation| operation.seconds).sum(),
        critical: &found.critical,
        steps: steps.collect(),
    }
}

/// The steps of a plan on a line of stations. `states` are those of the plan, the one before the first step included.
fn line<'a>(
    plan: &'a PlanDocument,
    operations: &[Operation],
    count: usize,
    times: MotionTimes,
    states: Option<&[Stability]>,
) -> LineDocument<'a> {
    let seconds: Vec<f64> = operations.iter().map(|operation| operation.seconds).collect();
    // While a step moves its parts, what falls without them is held.
    let held = |states: &[Stability], step: usize| match kind_of(plan) {
        PlanKind::Disassembly => states[step + 1].trouble(),
        PlanKind::Assembly => states[step].trouble(),
    };
    let station = |steps: Range<usize>| StationDocument {
        parts: plan.steps[steps.clone()].iter().map(|step| &step.parts[..]).collect(),
        seconds: seconds[steps.clone()].iter().sum(),
        hands: states.map(|states| steps.clone().map(|step| 1 + held(states, step)).max().unwrap_or(0)),
        steps: steps.collect(),
    };
    let stations: Vec<StationDocument<'a>> = stations(&seconds, count).into_iter().map(station).collect();
    LineDocument {
        schema: LINE_SCHEMA,
        times,
        cycle: stations.iter().map(|station| station.seconds).fold(0.0, f64::max),
        work: seconds.iter().sum(),
        stations,
    }
}

fn line_table(document: &LineDocument<'_>) -> String {
    let mut table = TextTable::new(&["station", "steps", "parts", "seconds", "hands"]);
    for (number, station) in document.stations.iter().enumerate() {
        let steps = match station.steps[..] {
            [] => "–".to_owned(),
            [only] => (only + 1).to_string(),
            [first, .., last] => format!("{}–{}", first + 1, last + 1),
        };
        table.row([
            (number + 1).to_string(),
            steps,
            listed(&station.parts.concat()),
            format!("{:.1}", station.seconds),
            station.hands.map_or_else(|| "–".to_owned(), |hands| hands.to_string()),
        ]);
    }
    format!(
        "{}\nA product leaves the line every {:.1} s; all steps one after the other take {:.1} s.\n",
        table.render(),
        document.cycle,
        document.work
    )
}

fn table(document: &ScheduleDocument<'_>, plan: &PlanDocument) -> String {
    let mut table = TextTable::new(&["begin", "end", "arm", "step", "parts", "held meanwhile"]);
    for step in &document.steps {
        let held = if step.held == 0 { String::new() } else { step.held.to_string() };
        table.row([
            format!("{:.1}", step.begin),
            format!("{:.1}", step.end),
            (step.arm + 1).to_string(),
            (step.step + 1).to_string(),
            step.parts.join(", "),
            held,
        ]);
    }
    let chain: f64 = {
        let length =
            |step: &usize| document.steps.iter().find(|s| s.step == *step).map_or(0.0, |s| s.end - s.begin);
        document.critical.iter().map(length).sum()
    };
    let names: Vec<String> = document
        .critical
        .iter()
        .filter_map(|&step| plan.steps.get(step))
        .map(|step| step.parts.join(", "))
        .collect();
    let arms = if document.arms == 1 { "1 arm".to_owned() } else { format!("{} arms", document.arms) };
    format!(
        "{}\n{arms}: {:.1} s; all steps one after the other: {:.1} s; the longest chain: {chain:.1} s ({})\n",
        table.render(),
        document.seconds,
        document.work,
        names.join(" > ")
    )
}
