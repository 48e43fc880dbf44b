//! `sbdp graph`: blocking graphs as pictures.

use std::process::ExitCode;

use super::args::GraphArguments;
use super::error::CliError;
use super::part_names::resolve;
use super::{interrupt, print, written};
use crate::search::Termination;
use crate::service::Service;
use crate::simulation::{Action, Axis};
use crate::view::picture::Picture;

pub(super) fn run(arguments: &GraphArguments) -> Result<ExitCode, CliError> {
    let draw = form(arguments)?;
    let assembly = arguments.input.read()?;
    assembly.notes.iter().for_each(|note| eprintln!("warning: {note}"));
    let removed = resolve(&assembly, "--removed", &arguments.removed)?;
    let service = Service::default();
    let id = service.admit(&assembly)?.id;
    let termination = Termination::default();
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let axes = axes(&arguments.direction);
    let graphs = service.blocking_graphs(id, axes.as_deref(), &removed, &termination)?;
    let mut graphs = graphs.ok_or_else(|| CliError::Failed("interrupted".to_owned()))?;
    if axes.is_some() {
        graphs.retain(|g| arguments.direction.contains(&g.direction));
    }
    let parts: Vec<String> = assembly.parts.iter().map(|p| p.name.clone()).collect();
    let present: Vec<usize> = (0..parts.len()).filter(|p| removed.binary_search(p).is_err()).collect();
    let picture = Picture { name: &assembly.name, parts: &parts, present: &present, graphs: &graphs };
    written(&arguments.output, draw(&picture).as_bytes())?;
    let edges: usize = graphs.iter().map(|g| g.edges.len()).sum();
    print(&format!(
        "{}: parts {}, directions {}, edges {edges}\n",
        arguments.output.display(),
        present.len(),
        graphs.len()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// What the file's name asks for.
fn form(arguments: &GraphArguments) -> Result<fn(&Picture<'_>) -> String, CliError> {
    let extension = arguments.output.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "svg" => Ok(|p| p.svg()),
        "dot" | "gv" => Ok(|p| p.dot()),
        _ => Err(CliError::Refused(format!(
            "{}: name the picture .svg or .dot, which says what it is to be",
            arguments.output.display()
        ))),
    }
}

/// The axes of some directions, each once; none given: none.
fn axes(directions: &[Action]) -> Option<Vec<Axis>> {
    let mut axes = Vec::new();
    for direction in directions {
        if let Action::Push(axis, _) = direction
            && !axes.contains(axis)
        {
            axes.push(*axis);
        }
    }
    (!axes.is_empty()).then_some(axes)
}
