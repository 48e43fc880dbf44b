//! `sbdp tools`: which tool turns the fasteners that a plan takes off.

use std::process::ExitCode;

use serde::Serialize;

use super::args::ToolsArguments;
use super::error::CliError;
use super::subject::Subject;
use super::table::{TextTable, length, listed};
use super::{interrupt, show};
use crate::fasteners::Drive;
use crate::search::Termination;
use crate::service::FastenerTools;
use crate::tools::{ToolKind, ToolRoom};

/// The version of the document.
const SCHEMA: &str = "sbdp-tools/1";
/// The exit code where a fastener has no tool: that of a plan that is not complete.
const NO_TOOL: u8 = 3;

/// What `--json` writes. Names are those of the plan, lengths are in its units, angles in degrees.
#[derive(Debug, Serialize)]
struct ToolsDocument<'a> {
    schema: &'static str,
    units: Option<&'a str>,
    steps: Vec<FastenerDocument<'a>>,
}

/// A step that takes a fastener off.
#[derive(Debug, Serialize)]
struct FastenerDocument<'a> {
    step: usize,
    part: &'a str,
    drive: &'static str,
    across_flats: f64,
    tools: Vec<ToolDocument<'a>>,
}

#[derive(Debug, Serialize)]
struct ToolDocument<'a> {
    tool: &'static str,
    swing: f64,
    needs: f64,
    fits: bool,
    blocked_by: Vec<&'a str>,
}

pub(super) fn run(arguments: &ToolsArguments) -> Result<ExitCode, CliError> {
    let subject = Subject::read(&arguments.plan, arguments.meshes.as_deref())?;
    let (service, id) = subject.admitted_with_parts_of_plan()?;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let found = service.tools(id, &subject.passing_steps()?, &termination)?;
    let found = found.ok_or_else(|| CliError::Failed("interrupted".to_owned()))?;
    let plan = &subject.plan;
    let name = |part: usize| plan.parts.get(part).map_or("?", String::as_str);
    let steps =
        found.iter().enumerate().filter_map(|(step, found)| Some(described(step, found.as_ref()?, name)));
    let document = ToolsDocument { schema: SCHEMA, units: plan.units.as_deref(), steps: steps.collect() };
    let has_tool = |step: &FastenerDocument<'_>| step.tools.iter().any(|tool| tool.fits);
    let is_missing = arguments.required && !document.steps.iter().all(has_tool);
    let exit_code = if is_missing { ExitCode::from(NO_TOOL) } else { ExitCode::SUCCESS };
    show(arguments.json.as_deref(), &document, "tools", || table(&document))?;
    Ok(exit_code)
}

fn described<'a>(
    step: usize,
    found: &FastenerTools,
    name: impl Fn(usize) -> &'a str,
) -> FastenerDocument<'a> {
    let tool = |room: &ToolRoom| ToolDocument {
        tool: room.kind.name(),
        swing: room.swing.to_degrees(),
        needs: room.kind.least_swing().to_degrees(),
        fits: room.is_enough(),
        blocked_by: room.blocked_by.iter().map(|&part| name(part)).collect(),
    };
    let drive = match found.drive {
        Drive::Hexagon => "hexagon",
        Drive::HexagonSocket => "hexagon_socket",
    };
    let tools = found.rooms.iter().map(tool).collect();
    FastenerDocument { step, part: name(found.part), drive, across_flats: found.across_flats, tools }
}

fn table(document: &ToolsDocument<'_>) -> String {
    if document.steps.is_empty() {
        return "No step takes off a part that is a nut or a screw by its hexagon.\n".to_owned();
    }
    let kinds = [ToolKind::Socket, ToolKind::RingSpanner, ToolKind::OpenEndWrench, ToolKind::HexKey];
    let title = |kind: ToolKind| kind.name().replace('_', " ");
    let header: Vec<String> = kinds.map(title).into();
    let header: Vec<&str> =
        ["step", "takes off", "size"].into_iter().chain(header.iter().map(String::as_str)).collect();
    let mut table = TextTable::new(&[&header[..], &["blocked by"]].concat());
    for step in &document.steps {
        let cell = |kind: ToolKind| {
            let tool = step.tools.iter().find(|tool| tool.tool == kind.name());
            tool.map_or_else(|| "–".to_owned(), swing)
        };
        let mut blockers: Vec<&str> =
            step.tools.iter().flat_map(|tool| tool.blocked_by.iter().copied()).collect();
        blockers.sort_unstable();
        blockers.dedup();
        let first =
            [(step.step + 1).to_string(), step.part.to_owned(), length(step.across_flats, document.units)];
        table.row(first.into_iter().chain(kinds.map(cell)).chain([listed(&blockers)]));
    }
    let without: Vec<&str> = document
        .steps
        .iter()
        .filter(|step| !step.tools.iter().any(|tool| tool.fits))
        .map(|step| step.part)
        .collect();
    let verdict = match without[..] {
        [] => "Each of these has a tool that can turn it.".to_owned(),
        _ => format!("No tool can turn: {}.", without.join(", ")),
    };
    format!("{}\n{verdict}\n", table.render())
}

/// How far a tool swings.
fn swing(tool: &ToolDocument<'_>) -> String {
    match tool.swing {
        0.0 => "no way to it".to_owned(),
        360.0.. => "all around".to_owned(),
        swing if tool.fits => format!("{swing:.0}°"),
        swing => format!("{swing:.0}°, too little"),
    }
}
