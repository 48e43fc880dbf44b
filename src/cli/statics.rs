//! `sbdp statics`: what stands by itself after each step of a plan, and what has to be held.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::ExitCode;

use nalgebra::{Unit, Vector3};
use serde::Serialize;

use super::args::StaticsArguments;
use super::error::CliError;
use super::subject::Subject;
use super::table::TextTable;
use super::{STDOUT, interrupt, print, written};
use crate::document::{Placements, PlanDocument, StepDocument, reordered};
use crate::geometry::{Pose, pose_from_waypoint};
use crate::plan::{PlanKind, StepEnd};
use crate::search::Termination;
use crate::service::{JointKind, OrderedStep, StandingState, StaticsQuery};
use crate::statics::{Stability, StaticsOptions};
use crate::view::{Up, kind_of};

/// The version of the document.
const SCHEMA: &str = "sbdp-statics/1";

/// What `--json` writes. Names are those of the plan; vectors are unit vectors in its frame.
#[derive(Debug, Serialize)]
struct StaticsDocument<'a> {
    schema: &'static str,
    up: [f64; 3],
    friction: f64,
    stays: &'a [String],
    joined: Vec<JointDocument<'a>>,
    states: Vec<StateDocument<'a>>,
}

/// Two parts that are one body while both stand.
#[derive(Debug, Serialize)]
struct JointDocument<'a> {
    parts: [&'a str; 2],
    by: &'static str,
}

/// The state after a number of steps, 0 at first.
#[derive(Debug, Serialize)]
struct StateDocument<'a> {
    after: usize,
    standing: Vec<&'a str>,
    needs_friction: f64,
    margin: Option<f64>,
    unstable: Vec<UnstableDocument<'a>>,
    unknown: Vec<&'a str>,
}

#[derive(Debug, Serialize)]
struct UnstableDocument<'a> {
    falls: Vec<FallDocument<'a>>,
    hold: Vec<Vec<&'a str>>,
    needs_clamping: bool,
}

#[derive(Debug, Serialize)]
struct FallDocument<'a> {
    part: &'a str,
    direction: [f64; 3],
}

pub(super) fn run(arguments: &StaticsArguments) -> Result<ExitCode, CliError> {
    let subject = Subject::read(&arguments.plan, arguments.meshes.as_deref())?;
    let up = match (arguments.up, subject.up()) {
        (Some(up), _) => Unit::new_normalize(Vector3::from(up)),
        (None, Up::Y) => Vector3::y_axis(),
        (None, Up::Z) => Vector3::z_axis(),
    };
    let options =
        StaticsOptions { up, friction: arguments.friction, gap: arguments.gap, margin: arguments.margin };
    let mut plan = subject.plan.clone();
    let stays = stays(&plan, &arguments.stays)?;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let mut query = StaticsQuery {
        options,
        states: states(&plan, &stays)?,
        screwed: screwed(&plan),
        join: pairs(&plan, "--join", &arguments.join)?,
        apart: pairs(&plan, "--apart", &arguments.apart)?,
    };
    let (service, id) = subject.admitted()?;
    let assembly = service.assembly(id)?;
    if assembly.parts.iter().map(|part| &part.name).ne(&plan.parts) {
        return Err(CliError::Refused("the assembly has other parts than the plan".to_owned()));
    }
    let interrupted = || CliError::Failed("interrupted".to_owned());
    if let Some(file) = &arguments.reorder {
        let steps = ordered_steps(&plan)?;
        let order = service.steady_order(id, &query, &steps, &termination)?.ok_or_else(interrupted)?;
        if order.len() < plan.steps.len() {
            let reason = "--reorder: steps of the plan require each other, or some that it does not have";
            return Err(CliError::Refused(reason.to_owned()));
        }
        plan = reordered(&plan, &order);
        let text =
            plan.to_json().map_err(|e| CliError::Failed(format!("cannot write the plan as JSON: {e}")))?;
        written(file, format!("{text}\n").as_bytes())?;
        query.states = states(&plan, &stays)?;
    }
    let plan = &plan;
    let answer = service.statics(id, &query, &termination)?.ok_or_else(interrupted)?;
    let name = |part: usize| plan.parts.get(part).map_or("?", String::as_str);
    let document = StaticsDocument {
        schema: SCHEMA,
        up: up.into_inner().into(),
        friction: query.options.friction,
        stays: &stays,
        joined: answer
            .joints
            .iter()
            .map(|(pair, kind)| JointDocument { parts: pair.map(name), by: reason(*kind) })
            .collect(),
        states: query
            .states
            .iter()
            .zip(&answer.states)
            .enumerate()
            .map(|(after, (state, found))| described(after, state, found, name))
            .collect(),
    };
    if let Some(file) = &arguments.json {
        let text = serde_json::to_string_pretty(&document)
            .map_err(|e| CliError::Failed(format!("cannot write the states as JSON: {e}")))?;
        if file == Path::new(STDOUT) {
            print(&format!("{text}\n"))?;
            return Ok(ExitCode::SUCCESS);
        }
        written(file, text.as_bytes())?;
    }
    print(&table(plan, &document))?;
    print(&format!("\n{}\n", hands(&answer.states)))?;
    Ok(ExitCode::SUCCESS)
}

/// Pairs of parts that an option names.
fn pairs(plan: &PlanDocument, option: &str, named: &[String]) -> Result<Vec<[usize; 2]>, CliError> {
    let number = |name: &String| {
        let number = plan.parts.iter().position(|part| part == name);
        number.ok_or_else(|| CliError::Refused(format!("{option}: the plan has no part `{name}`")))
    };
    let pair = |pair: &[String; 2]| Ok([number(&pair[0])?, number(&pair[1])?]);
    named.as_chunks().0.iter().map(pair).collect()
}

fn reason(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Named => "named",
        JointKind::Overlap => "overlap",
        JointKind::Fastener => "fastener",
        JointKind::Thread => "thread",
    }
}

/// What stays: as named, or as the plan has it.
fn stays(plan: &PlanDocument, named: &[String]) -> Result<Vec<String>, CliError> {
    if let Some(unknown) = named.iter().find(|name| !plan.parts.contains(name)) {
        return Err(CliError::Refused(format!("--stays: the plan has no part `{unknown}`")));
    }
    let stays: Vec<String> = match named {
        [] => {
            plan.parts.iter().filter(|p| plan.fixed.contains(p) || plan.base.contains(p)).cloned().collect()
        }
        named => named.to_vec(),
    };
    if stays.is_empty() {
        let reason = "the plan has neither a base nor fixed parts; name what stays with --stays";
        return Err(CliError::Refused(reason.to_owned()));
    }
    Ok(stays)
}

/// The parts that a step turns by more than half a turn: threads, as far as their contacts show one.
fn screwed(plan: &PlanDocument) -> BTreeSet<usize> {
    let turned = |step: &&StepDocument| {
        let turns = step.path.windows(2).map(|pair| {
            let [from, to] = [&pair[0], &pair[1]].map(pose_from_waypoint);
            from.rotation.angle_to(&to.rotation)
        });
        turns.sum::<f64>() > std::f64::consts::PI
    };
    let steps = plan.steps.iter().filter(turned);
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    steps.flat_map(|step| &step.parts).filter_map(number).collect()
}

/// The steps as far as the order among them goes.
fn ordered_steps(plan: &PlanDocument) -> Result<Vec<OrderedStep>, CliError> {
    let refused = |reason: &str| Err(CliError::Refused(format!("--reorder: {reason}")));
    if kind_of(plan) == PlanKind::Assembly {
        return refused(
            "parts of an assembly plan wait for their turn in the way of others; plan the disassembly",
        );
    }
    if plan.steps.iter().any(|step| step.ends == StepEnd::Aside.name()) {
        return refused("the plan moves parts aside, where they are in the way of others");
    }
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    let ordered = |(i, step): (usize, &StepDocument)| {
        let parts: Vec<usize> = step.parts.iter().filter_map(number).collect();
        let requires = step.requires.iter().copied();
        match (step.of, &parts[..]) {
            // How a group lies matters to its own parts alone, which keep their order.
            (Some(_), _) => {
                let siblings = (0..i).filter(|&other| plan.steps[other].of == step.of);
                OrderedStep { parts: Vec::new(), requires: requires.chain(siblings).collect(), end: None }
            }
            (None, [_]) => {
                let end = step.path.last().map(pose_from_waypoint);
                OrderedStep { requires: requires.collect(), end, parts }
            }
            // A group is out where it ends once all is gone that goes before it.
            (None, _) => OrderedStep { requires: (0..i).collect(), end: None, parts },
        }
    };
    Ok(plan.steps.iter().enumerate().map(ordered).collect())
}

/// The states of what stands in the assembly: at first, and after each step.
fn states(plan: &PlanDocument, stays: &[String]) -> Result<Vec<StandingState>, CliError> {
    let kind = kind_of(plan);
    let placements = Placements::new(kind, plan).map_err(CliError::Refused)?;
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    let mut standing: BTreeMap<usize, Pose> = (0..plan.parts.len()).map(|p| (p, Pose::identity())).collect();
    plan.initial.removed.iter().filter_map(number).for_each(|part| _ = standing.remove(&part));
    let stays: Vec<usize> = stays.iter().filter_map(number).collect();
    let state = |standing: &BTreeMap<usize, Pose>| StandingState {
        parts: standing.iter().map(|(part, pose)| (*part, *pose)).collect(),
        stays: stays.clone(),
    };
    let mut states = vec![state(&standing)];
    for turn in 0..plan.steps.len() {
        // An assembly plan is walked backwards.
        let step = match kind {
            PlanKind::Disassembly => turn,
            PlanKind::Assembly => plan.steps.len() - 1 - turn,
        };
        let (step, frame) = (&plan.steps[step], &placements.steps[step]);
        if step.of.is_none() {
            let far = match kind {
                PlanKind::Disassembly => step.path.last(),
                PlanKind::Assembly => step.path.first(),
            };
            let far = far.map(pose_from_waypoint).unwrap_or_default();
            for (name, pose) in step.parts.iter().zip(&frame.standing) {
                let Some(part) = number(name) else { continue };
                match frame.ends {
                    StepEnd::Aside => _ = standing.insert(part, far * pose),
                    StepEnd::Out | StepEnd::In => _ = standing.remove(&part),
                }
            }
        }
        states.push(state(&standing));
    }
    if kind == PlanKind::Assembly {
        states.reverse();
    }
    Ok(states)
}

fn described<'a>(
    after: usize,
    state: &StandingState,
    stability: &Stability,
    name: impl Fn(usize) -> &'a str,
) -> StateDocument<'a> {
    let names = |parts: &[usize]| parts.iter().map(|&part| name(part)).collect::<Vec<_>>();
    let unstable = stability.unstable.iter().map(|unstable| UnstableDocument {
        falls: unstable
            .falls
            .iter()
            .map(|fall| FallDocument { part: name(fall.part), direction: fall.direction })
            .collect(),
        hold: unstable.hold.iter().map(|set| names(set)).collect(),
        needs_clamping: unstable.needs_clamping,
    });
    StateDocument {
        after,
        standing: state.parts.iter().map(|(part, _)| name(*part)).collect(),
        needs_friction: stability.needs_friction,
        margin: stability.margin,
        unstable: unstable.collect(),
        unknown: names(&stability.unknown),
    }
}

fn table(plan: &PlanDocument, document: &StaticsDocument<'_>) -> String {
    let stays = document.stays.join(", ");
    let mut text = format!("{stays} stays; up is {}; friction {}\n", vector(&document.up), document.friction);
    let joined: Vec<String> = document.joined.iter().map(|joint| joint.parts.join(" and ")).collect();
    if !joined.is_empty() {
        let joined = listed(&joined.iter().map(String::as_str).collect::<Vec<_>>());
        text.push_str(&format!("as one body while both stand: {joined}\n"));
    }
    text.push('\n');
    let mut table =
        TextTable::new(&["after", "moved", "standing", "needs friction", "margin", "hold", "or else"]);
    for state in &document.states {
        let moved = match state.after.checked_sub(1).and_then(|step| plan.steps.get(step)) {
            Some(step) => listed(&step.parts.iter().map(String::as_str).collect::<Vec<_>>()),
            None => "–".to_owned(),
        };
        let first =
            |u: &UnstableDocument<'_>| u.hold.first().map_or_else(String::new, |set| set.join(" and "));
        let hold: Vec<String> = state.unstable.iter().map(first).collect();
        let mut falls: Vec<String> = state.unstable.iter().map(fall).collect();
        if !state.unknown.is_empty() {
            falls.push(format!("not known: {}", listed(&state.unknown)));
        }
        table.row([
            state.after.to_string(),
            moved,
            state.standing.len().to_string(),
            if state.needs_friction > 0.0 {
                format!("{:.3}", state.needs_friction)
            } else {
                "none".to_owned()
            },
            state.margin.map_or_else(|| "–".to_owned(), |margin| format!("{margin:.2}")),
            hold.join(", "),
            falls.join("; "),
        ]);
    }
    text.push_str(&table.render());
    text
}

/// How many parts have to be held at once, and when first.
fn hands(states: &[Stability]) -> String {
    match states.iter().enumerate().max_by_key(|(after, state)| (state.hands(), std::cmp::Reverse(*after))) {
        Some((after, state)) if state.hands() > 0 => {
            let parts = if state.hands() == 1 { "part has" } else { "parts have" };
            let when =
                if after == 0 { "before the first step".to_owned() } else { format!("after step {after}") };
            format!("At most {} {parts} to be held at once, first {when}.", state.hands())
        }
        _ => "Nothing has to be held.".to_owned(),
    }
}

/// What falls, and where to.
fn fall(unstable: &UnstableDocument<'_>) -> String {
    let names: Vec<&str> = unstable.falls.iter().map(|fall| fall.part).collect();
    let to =
        unstable.falls.first().map_or_else(String::new, |fall| format!(" along {}", vector(&fall.direction)));
    let pressed = if unstable.needs_clamping { ", as nothing presses it" } else { "" };
    format!("{} {}{to}{pressed}", listed(&names), if names.len() == 1 { "falls" } else { "fall" })
}

/// A few names, and how many there are besides.
fn listed(names: &[&str]) -> String {
    /// Count of names. At half, pairs look like many; at double, the table is wider than most terminals.
    const NAMED: usize = 3;
    match names.get(..NAMED) {
        Some(few) if names.len() > NAMED => format!("{} and {} more", few.join(", "), names.len() - NAMED),
        _ => names.join(", "),
    }
}

fn vector(vector: &[f64; 3]) -> String {
    let axes = ["x", "y", "z"];
    match vector.iter().position(|x| x.abs() > 0.999) {
        Some(axis) => format!("{}{}", if vector[axis] > 0.0 { "+" } else { "-" }, axes[axis]),
        None => format!("({:.2}, {:.2}, {:.2})", vector[0], vector[1], vector[2]),
    }
}
