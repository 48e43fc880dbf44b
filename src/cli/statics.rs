//! `sbdp statics`: what stands by itself after each step of a plan, and what has to be held.

use std::process::ExitCode;

use serde::Serialize;

use super::args::StaticsArguments;
use super::error::CliError;
use super::report_lines::{fall, hands, hold};
use super::standing::StandingPlan;
use super::table::{TextTable, listed};
use super::{interrupt, show};
use crate::document::{PartNames, PlanDocument, StabilityDocument};
use crate::report::stability_record;
use crate::search::Termination;
use crate::service::JointKind;
use crate::view::direction;

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
    margin: Option<f64>,
    #[serde(flatten)]
    stability: StabilityDocument,
}

pub(super) fn run(arguments: &StaticsArguments) -> Result<ExitCode, CliError> {
    let asked = StandingPlan::read(&arguments.standing, arguments.margin)?;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let interrupted = || CliError::Failed("interrupted".to_owned());
    let StandingPlan { plan, stays, service, id, query } = &asked;
    let answer = service.statics(*id, query, &termination)?.ok_or_else(interrupted)?;
    let name = |part: usize| plan.parts.get(part).map_or("?", String::as_str);
    let document = StaticsDocument {
        schema: SCHEMA,
        up: query.options.up.into_inner().into(),
        friction: query.options.friction,
        stays,
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
            .map(|(after, (state, found))| StateDocument {
                after,
                standing: state.parts.iter().map(|(part, _)| name(*part)).collect(),
                margin: found.margin,
                stability: PartNames(&plan.parts).stability(&stability_record(found)),
            })
            .collect(),
    };
    let text = || {
        let states: Vec<&StabilityDocument> = document.states.iter().map(|state| &state.stability).collect();
        format!("{}\n{}\n", table(plan, &document), hands(&states))
    };
    show(arguments.json.as_deref(), &document, "states", text)?;
    Ok(ExitCode::SUCCESS)
}

fn reason(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Named => "named",
        JointKind::Overlap => "overlap",
        JointKind::Fastener => "fastener",
        JointKind::Thread => "thread",
    }
}

fn table(plan: &PlanDocument, document: &StaticsDocument<'_>) -> String {
    let stays = document.stays.join(", ");
    let mut text =
        format!("{stays} stays; up is {}; friction {}\n", direction(&document.up.into()), document.friction);
    let joined: Vec<String> = document.joined.iter().map(|joint| joint.parts.join(" and ")).collect();
    if !joined.is_empty() {
        let joined = listed(&joined);
        text.push_str(&format!("as one body while both stand: {joined}\n"));
    }
    text.push('\n');
    let mut table =
        TextTable::new(&["after", "moved", "standing", "needs friction", "margin", "hold", "or else"]);
    for state in &document.states {
        let moved = match state.after.checked_sub(1).and_then(|step| plan.steps.get(step)) {
            Some(step) => listed(&step.parts),
            None => "–".to_owned(),
        };
        let stability = &state.stability;
        let hold: Vec<String> = stability.unstable.iter().map(hold).collect();
        let mut falls: Vec<String> = stability.unstable.iter().map(fall).collect();
        if !stability.unknown.is_empty() {
            falls.push(format!("not known: {}", listed(&stability.unknown)));
        }
        table.row([
            state.after.to_string(),
            moved,
            state.standing.len().to_string(),
            if stability.needs_friction > 0.0 {
                format!("{:.3}", stability.needs_friction)
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
