//! The reports of a plan in lines for people: what has to be held, what passes near, what has no tool.

use super::table::{length, listed};
use crate::document::{ClosestDocument, PlanDocument, StabilityDocument, UnstableDocument};
use crate::view::{direction, tool_name};

/// What has to be held before the first step and after each step.
pub(super) fn stability(plan: &PlanDocument) -> Vec<String> {
    let states: Vec<&StabilityDocument> =
        plan.initial.stability.iter().chain(plan.steps.iter().filter_map(|s| s.stability.as_ref())).collect();
    if states.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![hands(&states)];
    let friction = states.iter().map(|state| state.needs_friction).fold(0.0, f64::max);
    if friction > 0.0 {
        lines.push(format!("The rest stands with a coefficient of friction of at least {friction:.3}."));
    }
    for (after, state) in states.iter().enumerate() {
        let line = |u: &UnstableDocument| format!("{}: hold {}, or else {}", when(after), hold(u), fall(u));
        lines.extend(state.unstable.iter().map(line));
        if !state.unknown.is_empty() {
            lines.push(format!("{}: not known whether {} stand", when(after), listed(&state.unknown)));
        }
    }
    lines
}

/// Where the plan passes other parts the nearest; or, if it is `verbose`, where each step does.
pub(super) fn clearance(plan: &PlanDocument, verbose: bool) -> Vec<String> {
    let units = plan.units.as_deref();
    let mut passing: Vec<_> = plan
        .steps
        .iter()
        .enumerate()
        .filter_map(|(number, step)| Some((number, step.clearance.as_ref()?.closest.as_ref()?)))
        .collect();
    if !verbose {
        passing.sort_by(|(_, a), (_, b)| a.at_least.total_cmp(&b.at_least));
        passing.truncate(1);
    }
    passing.iter().map(|(number, closest)| pass(*number, closest, units)).collect()
}

/// How near one part passes another in a step.
pub(super) fn pass(step: usize, closest: &ClosestDocument, units: Option<&str>) -> String {
    format!(
        "step {}: {} passes {} at {} (certain is {}), as assembled {}",
        step + 1,
        closest.moving,
        closest.standing,
        length(closest.distance, units),
        length(closest.at_least, units),
        length(closest.assembled, units)
    )
}

/// The fasteners that no tool can turn.
pub(super) fn tools(plan: &PlanDocument) -> Vec<String> {
    let fasteners = || plan.steps.iter().filter(|step| step.tools.as_ref().is_some_and(|t| !t.is_empty()));
    let count = fasteners().count();
    let mut lines = Vec::new();
    for step in fasteners() {
        let tools = step.tools.as_deref().unwrap_or_default();
        if !tools.iter().any(|tool| tool.fits) {
            let tried: Vec<String> = tools
                .iter()
                .map(|tool| format!("{} (blocked by {})", tool_name(&tool.tool), listed(&tool.blocked_by)))
                .collect();
            lines.push(format!("{}: no tool can turn it: {}", step.parts.join(", "), tried.join(", ")));
        }
    }
    if count > 0 && lines.is_empty() {
        lines.push(format!("{count} nuts and screws: each has a tool that can turn it"));
    }
    lines
}

/// How many parts have to be held at once, and when first. The states begin with the one before the first step.
pub(super) fn hands(states: &[&StabilityDocument]) -> String {
    let count = |state: &StabilityDocument| {
        state.unstable.iter().filter_map(|u| u.hold.first()).map(Vec::len).sum::<usize>()
    };
    let most =
        states.iter().enumerate().max_by_key(|(after, state)| (count(state), std::cmp::Reverse(*after)));
    match most.map(|(after, state)| (after, count(state))) {
        Some((after, count)) if count > 0 => {
            let parts = if count == 1 { "part has" } else { "parts have" };
            format!("At most {count} {parts} to be held at once, first {}.", when(after))
        }
        _ => "Nothing has to be held.".to_owned(),
    }
}

fn when(after: usize) -> String {
    if after == 0 { "before the first step".to_owned() } else { format!("after step {after}") }
}

/// The parts that are enough to hold.
pub(super) fn hold(unstable: &UnstableDocument) -> String {
    unstable.hold.first().map_or_else(String::new, |set| set.join(" and "))
}

/// What falls, and where to.
pub(super) fn fall(unstable: &UnstableDocument) -> String {
    let names: Vec<&str> = unstable.falls.iter().map(|fall| fall.part.as_str()).collect();
    let to = unstable
        .falls
        .first()
        .map_or_else(String::new, |fall| format!(" along {}", direction(&fall.direction.into())));
    let pressed = if unstable.needs_clamping { ", as nothing presses it" } else { "" };
    format!("{} {}{to}{pressed}", listed(&names), if names.len() == 1 { "falls" } else { "fall" })
}
