//! `sbdp clearance`: how near the moving parts of a plan pass the others.

use std::process::ExitCode;

use serde::Serialize;

use super::args::ClearanceArguments;
use super::error::CliError;
use super::report_lines::pass;
use super::subject::Subject;
use super::table::{TextTable, length, listed};
use super::{interrupt, show};
use crate::document::{ClearanceDocument, ClosestDocument, PartNames, PlanDocument};
use crate::report::{clearance_record, closest_record, passing_steps};
use crate::search::Termination;
use crate::service::{ClearanceQuery, StepClearance};

/// The version of the document.
const SCHEMA: &str = "sbdp-clearance/1";
/// The exit code where something comes nearer than is wanted: that of a plan that is not complete.
const NOT_KEPT: u8 = 3;

/// What `--json` writes. Names are those of the plan; lengths and points are in its units and frame.
#[derive(Debug, Serialize)]
struct ClearancesDocument<'a> {
    schema: &'static str,
    units: Option<&'a str>,
    wanted: Option<f64>,
    steps: Vec<StepClearanceDocument<'a>>,
}

#[derive(Debug, Serialize)]
struct StepClearanceDocument<'a> {
    step: usize,
    parts: &'a [String],
    #[serde(flatten)]
    clearance: ClearanceDocument,
    short: Vec<ClosestDocument>,
}

pub(super) fn run(arguments: &ClearanceArguments) -> Result<ExitCode, CliError> {
    let subject = Subject::read(&arguments.plan, arguments.meshes.as_deref())?;
    let (service, id) = subject.admitted_with_parts_of_plan()?;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let steps = passing_steps(&subject.plan).map_err(CliError::Refused)?;
    let query = ClearanceQuery { steps, wanted: arguments.at_least };
    let found = service.clearance(id, &query, &termination)?;
    let found = found.ok_or_else(|| CliError::Failed("interrupted".to_owned()))?;
    let document = document(&subject.plan, &found, arguments.at_least);
    let is_kept = document.steps.iter().all(|step| step.short.is_empty());
    let exit_code = if is_kept { ExitCode::SUCCESS } else { ExitCode::from(NOT_KEPT) };
    show(arguments.json.as_deref(), &document, "clearances", || table(&document))?;
    Ok(exit_code)
}

fn document<'a>(
    plan: &'a PlanDocument,
    found: &[StepClearance],
    wanted: Option<f64>,
) -> ClearancesDocument<'a> {
    let names = PartNames(&plan.parts);
    let steps =
        plan.steps.iter().zip(found).enumerate().map(|(number, (step, found))| StepClearanceDocument {
            step: number,
            parts: &step.parts,
            clearance: names.clearance(&clearance_record(found)),
            short: found.short.iter().map(|pair| names.closest(&closest_record(pair))).collect(),
        });
    ClearancesDocument { schema: SCHEMA, units: plan.units.as_deref(), wanted, steps: steps.collect() }
}

fn table(document: &ClearancesDocument<'_>) -> String {
    let units = document.units;
    let mut table =
        TextTable::new(&["step", "moves", "nearest", "certain", "to", "on the way", "touches at first"]);
    for step in &document.steps {
        let moves = listed(step.parts);
        let [distance, certain, to, at] = match &step.clearance.closest {
            None => ["–"; 4].map(str::to_owned),
            Some(closest) => [
                length(closest.distance, units),
                length(closest.at_least, units),
                if step.parts.len() > 1 {
                    format!("{} from {}", closest.standing, closest.moving)
                } else {
                    closest.standing.clone()
                },
                format!("{}, {:.0} %", closest.segment + 1, closest.share * 100.0),
            ],
        };
        table.row([
            (step.step + 1).to_string(),
            moves,
            distance,
            certain,
            to,
            at,
            listed(&step.clearance.touching),
        ]);
    }
    let mut text = table.render();
    text.push_str(
        "\nNearest: the least distance on the way, from parts that are not touched at first. Certain: no part comes nearer. \
         On the way: the segment of the path, and how far along it.\n",
    );
    if let Some(wanted) = document.wanted {
        text.push_str(&format!("\n{}\n", verdict(document, wanted)));
    }
    text
}

/// Which pairs of parts do not keep the distance that is wanted.
fn verdict(document: &ClearancesDocument<'_>, wanted: f64) -> String {
    let units = document.units;
    let short = document.steps.iter().flat_map(|step| step.short.iter().map(move |pair| (step.step, pair)));
    let line = |(step, pair): (usize, &ClosestDocument)| format!("{}\n", pass(step, pair, units));
    let lines: String = short.map(line).collect();
    if lines.is_empty() {
        format!("All parts keep {}, or what they have as they stand.", length(wanted, units))
    } else {
        format!(
            "Not certain to keep {}, or what they have as they stand:\n{}",
            length(wanted, units),
            lines.trim_end()
        )
    }
}
