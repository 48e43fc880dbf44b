//! `sbdp explain`: a search in words, from its trace.

use std::fmt::Write;
use std::process::ExitCode;

use super::args::ExplainArguments;
use super::error::CliError;
use super::print;
use crate::search::{BlockedBy, PlanningPhase, TraceEvent};

pub(super) fn run(arguments: &ExplainArguments) -> Result<ExitCode, CliError> {
    let file = arguments.trace.display();
    let text =
        std::fs::read_to_string(&arguments.trace).map_err(|e| CliError::Refused(format!("{file}: {e}")))?;
    let mut account = Account::default();
    for (i, line) in text.lines().enumerate() {
        let event = serde_json::from_str(line).map_err(|e| {
            CliError::Refused(format!("{file}: line {}: not an event of a trace: {e}", i + 1))
        })?;
        account.tell(&event);
    }
    print(&account.text)?;
    Ok(ExitCode::SUCCESS)
}

/// The account so far.
#[derive(Default)]
struct Account {
    parts: Vec<String>,
    text: String,
    excluded: usize,
}

impl Account {
    fn tell(&mut self, event: &TraceEvent) {
        let line = self.line(event);
        // Writing to a string cannot fail.
        let _ = writeln!(self.text, "{line}");
    }

    fn line(&mut self, event: &TraceEvent) -> String {
        match event {
            TraceEvent::Start { parts, planner, engine } => {
                self.parts.clone_from(parts);
                format!("{planner} with {engine} on {} parts: {}", parts.len(), parts.join(", "))
            }
            TraceEvent::Analysed { state, part, blocked } => {
                format!("  static analysis of {}: {}", self.place(*part, *state), self.edges(blocked))
            }
            TraceEvent::Pass { phase, depth_limit } => {
                let kind = match phase {
                    PlanningPhase::Translation => "translational",
                    PlanningPhase::Rotation => "rotational",
                };
                let limit =
                    depth_limit.map(|d| format!(", at most {d} motions per part")).unwrap_or_default();
                format!("{kind} planning{limit}")
            }
            TraceEvent::Expanded { state, part, evaluation, excluded, .. } => {
                self.excluded += excluded.len();
                let place = self.place(*part, *state);
                let values = evaluation.map(|[c, a]| format!(" (f_c {c}, f_a {a})")).unwrap_or_default();
                if excluded.is_empty() {
                    format!("  expand {place}{values}")
                } else {
                    format!("  expand {place}{values}; excluded: {}", self.edges(excluded))
                }
            }
            TraceEvent::Simulated { state, part, action, end, with, poses, leads_to } => {
                let place = self.place(*part, *state);
                let met = if with.is_empty() { String::new() } else { format!(" with {}", self.names(with)) };
                let to = match leads_to {
                    Some(s) => format!(", new state s{s}"),
                    None if end == "disassembled" => String::new(),
                    None => ", no new state".to_owned(),
                };
                format!("    {place} {action}: {end}{met} after {poses} poses{to}")
            }
            TraceEvent::Swept { state, part, action } => {
                let place = self.place(*part, *state);
                format!("    {place} {action}: leaves straight, by a sweep without simulation")
            }
            TraceEvent::CellsSearched { part, cells, leaves } => {
                let end = if *leaves { "a way out was found" } else { "no way out" };
                format!(
                    "    {}: {cells} cells of places reached by casts along the axes, {end}",
                    self.name(*part)
                )
            }
            TraceEvent::Refuted { part, action, by } => format!(
                "    the path of {} by {action} enters {} on the triangles: refused",
                self.name(*part),
                self.names(by)
            ),
            TraceEvent::GroupTried { parts, leaves } => {
                let end = if *leaves { "they can leave" } else { "no way out" };
                format!("    {} together, as one body: {end}", self.names(parts))
            }
            TraceEvent::PlacesSearched { places, leaves } => {
                let end = if *leaves { "some leave after moves of others" } else { "nothing leaves" };
                format!("    {places} places of all parts: {end}")
            }
            TraceEvent::MovedAside { parts, requires } => {
                let after = match requires.as_slice() {
                    [] => String::new(),
                    parts => format!(", after {} moved", self.names(parts)),
                };
                format!("=== {} moved aside{after}", self.names(parts))
            }
            TraceEvent::GroupOpened { parts } => {
                format!("=== the group of {} is taken apart", self.names(parts))
            }
            TraceEvent::Removed { parts, requires } => {
                let after = match requires.as_slice() {
                    [] => String::new(),
                    parts => format!(", which requires {} to have moved", self.names(parts)),
                };
                let (are, their) = if parts.len() > 1 { ("are", "their") } else { ("is", "its") };
                format!(
                    "=== {} {are} out{after}; {their} edges are deleted from all graphs",
                    self.names(parts)
                )
            }
            TraceEvent::End { status, reason, remaining, simulations, sweeps } => {
                let text = reason.as_ref().map(|r| r.text(remaining, |part| self.name(part)));
                let why = text.map(|text| format!(": {text}")).unwrap_or_default();
                format!(
                    "{status}{why}\n{simulations} simulations counted, {sweeps} parts out by straight sweeps; where states were expanded, the graphs \
                     excluded {} actions",
                    self.excluded
                )
            }
        }
    }

    fn place(&self, part: usize, state: usize) -> String {
        format!("{} at s{state}", self.name(part))
    }

    fn name(&self, part: usize) -> String {
        self.parts.get(part).cloned().unwrap_or_else(|| format!("part {part}"))
    }

    fn names(&self, parts: &[usize]) -> String {
        parts.iter().map(|&p| self.name(p)).collect::<Vec<_>>().join(", ")
    }

    fn edges(&self, blocked: &[BlockedBy]) -> String {
        if blocked.is_empty() {
            return "nothing blocks it".to_owned();
        }
        let one = |b: &BlockedBy| format!("{} by {}", b.action, self.names(&b.parts));
        blocked.iter().map(one).collect::<Vec<_>>().join("; ")
    }
}
