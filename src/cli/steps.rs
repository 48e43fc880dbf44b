//! `sbdp steps`: a plan as instructions in words.

use std::process::ExitCode;

use super::args::StepsArguments;
use super::error::CliError;
use super::print;
use super::subject::{Subject, plan_in};
use crate::plan::export::PlanDocument;
use crate::view::equal_parts;
use crate::view::steps::markdown;

pub(super) fn run(arguments: &StepsArguments) -> Result<ExitCode, CliError> {
    let plan = plan_in(&arguments.plan)?;
    let classes = match classes(&plan, arguments) {
        Ok(classes) => Some(classes),
        // What was asked for must be; what was tried may fail.
        Err(error) if arguments.meshes.is_some() => return Err(error),
        Err(error) => {
            eprintln!("note: {error}; parts are taken for equal whose names differ in a number only");
            None
        }
    };
    print(&markdown(&plan, classes.as_deref()))?;
    Ok(ExitCode::SUCCESS)
}

/// Of each part of a plan, its class: parts of one class are equal.
fn classes(plan: &PlanDocument, arguments: &StepsArguments) -> Result<Vec<usize>, CliError> {
    let assembly = Subject::of(plan.clone(), arguments.meshes.as_deref())?.assembly()?;
    let classes = equal_parts(&assembly);
    let class = |name: &String| {
        let part = assembly.parts.iter().position(|p| p.name == *name);
        part.map(|p| classes[p])
            .ok_or_else(|| CliError::Refused(format!("the assembly has no part `{name}`")))
    };
    plan.parts.iter().map(class).collect()
}
