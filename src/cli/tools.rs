//! `sbdp tools`: which tool turns the fasteners that a plan takes off.

use std::process::ExitCode;

use serde::Serialize;

use super::args::ToolsArguments;
use super::error::CliError;
use super::subject::Subject;
use super::table::{TextTable, length, listed};
use super::{interrupt, show};
use crate::document::{PartNames, ToolDocument};
use crate::report::{fastener_record, passing_steps};
use crate::search::Termination;
use crate::service::FastenerTools;
use crate::tools::ToolKind;

/// The version of the document.
const SCHEMA: &str = "sbdp-tools/2";
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
    /// The width across its flats.
    size: f64,
    tools: Vec<ToolDocument>,
}

pub(super) fn run(arguments: &ToolsArguments) -> Result<ExitCode, CliError> {
    let subject = Subject::read(&arguments.plan, arguments.meshes.as_deref())?;
    let (service, id) = subject.admitted_with_parts_of_plan()?;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let steps = passing_steps(&subject.plan).map_err(CliError::Refused)?;
    let found = service.tools(id, &steps, &termination)?;
    let found = found.ok_or_else(|| CliError::Failed("interrupted".to_owned()))?;
    let plan = &subject.plan;
    let described = |(step, found): (usize, &Option<FastenerTools>)| {
        let found = found.as_ref()?;
        let tools = PartNames(&plan.parts).tools(&fastener_record(found));
        Some(FastenerDocument { step, part: plan.parts.get(found.part)?, size: found.across_flats, tools })
    };
    let steps = found.iter().enumerate().filter_map(described);
    let document = ToolsDocument { schema: SCHEMA, units: plan.units.as_deref(), steps: steps.collect() };
    let has_tool = |step: &FastenerDocument<'_>| step.tools.iter().any(|tool| tool.fits);
    let is_missing = arguments.required && !document.steps.iter().all(has_tool);
    let exit_code = if is_missing { ExitCode::from(NO_TOOL) } else { ExitCode::SUCCESS };
    show(arguments.json.as_deref(), &document, "tools", || table(&document))?;
    Ok(exit_code)
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
        let mut blockers: Vec<&String> = step.tools.iter().flat_map(|tool| &tool.blocked_by).collect();
        blockers.sort_unstable();
        blockers.dedup();
        let first = [(step.step + 1).to_string(), step.part.to_owned(), length(step.size, document.units)];
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
fn swing(tool: &ToolDocument) -> String {
    match tool.swing {
        0.0 => "no way to it".to_owned(),
        360.0.. => "all around".to_owned(),
        swing if tool.fits => format!("{swing:.0}°"),
        swing => format!("{swing:.0}°, too little"),
    }
}
