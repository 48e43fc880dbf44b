//! How the steps of a plan are done by hand: with which tool, and what has to be held meanwhile. It is in words if the plan
//! has these reports.

use super::words::{lengths, part_words};
use crate::document::{PlanDocument, StabilityDocument, StepDocument, ToolDocument};

/// The name of a tool in words.
pub(crate) fn tool_name(tool: &str) -> String {
    if tool == "open_end_wrench" { "open-end wrench".to_owned() } else { tool.replace('_', " ") }
}

/// The tool for the fastener that a step takes off: the first one that fits. `None` if there is no fastener, or no tool.
fn tool(step: &StepDocument) -> Option<&ToolDocument> {
    step.tools.as_deref()?.iter().find(|tool| tool.fits)
}

/// Whether two steps are done with the same tool.
pub(super) fn has_same_tool(a: &StepDocument, b: &StepDocument) -> bool {
    let named = |step| tool(step).map(|tool| (&tool.tool, tool.size));
    let is_fastener = |step: &StepDocument| step.tools.as_ref().is_some_and(|tools| !tools.is_empty());
    named(a) == named(b) && is_fastener(a) == is_fastener(b)
}

/// With which tool steps are done that are done with the same one, after a comma; empty if they take no fastener off.
pub(super) fn with_tool(steps: &[&StepDocument], units: Option<&str>) -> String {
    if steps.iter().all(|step| step.tools.as_ref().is_none_or(Vec::is_empty)) {
        return String::new();
    }
    let tools: Vec<&ToolDocument> = steps.iter().filter_map(|step| tool(step)).collect();
    let Some(first) = tools.first() else { return ", for which no tool has room".to_owned() };
    let swing = tools.iter().map(|tool| tool.swing).fold(360.0, f64::min);
    let at_a_time = if swing < 360.0 { format!(", {swing:.0}° at a time") } else { String::new() };
    format!(", with a {} {}{at_a_time}", lengths((first.size, first.size), units), tool_name(&first.tool))
}

/// The parts that have to be held in a state, in the order of the plan's parts.
pub(super) fn held<'p>(plan: &'p PlanDocument, states: &[&StabilityDocument]) -> Vec<&'p String> {
    let sets = states.iter().flat_map(|state| &state.unstable).filter_map(|unstable| unstable.hold.first());
    let held: Vec<&String> = sets.flatten().collect();
    plan.parts.iter().filter(|part| held.contains(part)).collect()
}

/// What has to be held while steps are done, after a semicolon; empty if nothing has to be.
pub(super) fn holding(plan: &PlanDocument, steps: &[&StepDocument]) -> String {
    let states: Vec<&StabilityDocument> = steps.iter().filter_map(|step| step.stability.as_ref()).collect();
    let held = held(plan, &states);
    if held.is_empty() { String::new() } else { format!("; hold {}", part_words(&held, " and ")) }
}
