//! `sbdp precedence`: which step of a plan comes before which, for other programs.

use std::collections::HashSet;
use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use super::args::PrecedenceArguments;
use super::error::CliError;
use super::subject::plan_in;
use super::written;
use crate::document::PlanDocument;

/// The version of the document.
const SCHEMA: &str = "sbdp-precedence/1";

/// What goes into a `.json` file. Steps are numbered as in the plan, from 0.
#[derive(Debug, Serialize)]
struct PrecedenceDocument<'a> {
    schema: &'static str,
    steps: Vec<PrecedingDocument<'a>>,
}

#[derive(Debug, Serialize)]
struct PrecedingDocument<'a> {
    step: usize,
    parts: &'a [String],
    /// The steps right before it: what these come after comes before it, too.
    after: Vec<usize>,
    wave: usize,
}

pub(super) fn run(arguments: &PrecedenceArguments) -> Result<ExitCode, CliError> {
    let plan = plan_in(&arguments.plan)?;
    let file = &arguments.output;
    let extension = file.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let after = steps_before(&plan);
    match extension.to_ascii_lowercase().as_str() {
        "dot" => written(file, dot(&plan, &after).as_bytes())?,
        "json" => {
            let text = serde_json::to_string(&document(&plan, &after));
            let text = text.map_err(|e| CliError::Failed(format!("cannot write the steps as JSON: {e}")))?;
            written(file, format!("{text}\n").as_bytes())?;
        }
        "pddl" => {
            let stem = file.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
            written(&file.with_file_name(format!("{stem}-domain.pddl")), domain(&plan, &after).as_bytes())?;
            written(file, problem(&plan).as_bytes())?;
        }
        _ => return Err(unknown(file)),
    }
    Ok(ExitCode::SUCCESS)
}

fn unknown(file: &Path) -> CliError {
    CliError::Refused(format!("`{}`: name a .dot, .json or .pddl file", file.display()))
}

/// By step, those that it requires, but for such as others of these require in turn.
fn steps_before(plan: &PlanDocument) -> Vec<Vec<usize>> {
    let requires = |step: usize| &plan.steps[step].requires;
    let direct = |step: usize| {
        let mut further: HashSet<usize> = HashSet::new();
        let mut open: Vec<usize> =
            requires(step).iter().flat_map(|&before| requires(before)).copied().collect();
        while let Some(before) = open.pop() {
            if further.insert(before) {
                open.extend(requires(before));
            }
        }
        requires(step).iter().copied().filter(|before| !further.contains(before)).collect()
    };
    (0..plan.steps.len()).map(direct).collect()
}

fn document<'a>(plan: &'a PlanDocument, after: &[Vec<usize>]) -> PrecedenceDocument<'a> {
    let steps = plan.steps.iter().zip(after).enumerate().map(|(step, (found, after))| PrecedingDocument {
        step,
        parts: &found.parts,
        after: after.clone(),
        wave: found.wave,
    });
    PrecedenceDocument { schema: SCHEMA, steps: steps.collect() }
}

fn dot(plan: &PlanDocument, after: &[Vec<usize>]) -> String {
    let quoted = |text: &str| text.replace('\\', "\\\\").replace('"', "\\\"").replace(['\n', '\r'], " ");
    let mut text = "digraph precedence {\n  node [shape=box];\n".to_owned();
    for (i, step) in plan.steps.iter().enumerate() {
        let of = step.of.map_or_else(String::new, |of| format!(" of step {}", of + 1));
        let label = quoted(&format!("{}: {}{of}", i + 1, step.parts.join(", ")));
        let _ = writeln!(text, "  s{} [label=\"{label}\"];", i + 1);
    }
    for (i, before) in after.iter().enumerate() {
        for before in before {
            let _ = writeln!(text, "  s{} -> s{};", before + 1, i + 1);
        }
    }
    text + "}\n"
}

/// A domain of STRIPS with an action for each step.
fn domain(plan: &PlanDocument, after: &[Vec<usize>]) -> String {
    let mut text = "(define (domain sbdp-steps)\n  (:requirements :strips)\n  (:predicates".to_owned();
    (1..=plan.steps.len()).for_each(|i| _ = write!(text, " (done-{i})"));
    text.push_str(")\n");
    for (i, (step, before)) in plan.steps.iter().zip(after).enumerate() {
        let parts = step.parts.join(", ").replace(['\n', '\r'], " ");
        let before: String = before.iter().map(|before| format!(" (done-{})", before + 1)).collect();
        let _ = write!(
            text,
            "  ; {parts}\n  (:action step-{number}\n    :parameters ()\n    :precondition (and{before})\n    \
             :effect (and (done-{number})))\n",
            number = i + 1,
        );
    }
    text + ")\n"
}

fn problem(plan: &PlanDocument) -> String {
    let goal: String = (1..=plan.steps.len()).map(|i| format!(" (done-{i})")).collect();
    format!("(define (problem sbdp-plan)\n  (:domain sbdp-steps)\n  (:init)\n  (:goal (and{goal})))\n")
}
