//! `sbdp graph`: blocking graphs as pictures.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use super::args::GraphArguments;
use super::error::CliError;
use super::part_names::resolve;
use super::{interrupt, print, written};
use crate::blocking_graph::DirectionalGraph;
use crate::search::Termination;
use crate::service::Service;
use crate::simulation::{Action, Axis};
use crate::view::equal_parts;
use crate::view::picture::Picture;

pub(super) fn run(arguments: &GraphArguments) -> Result<ExitCode, CliError> {
    let form = form(arguments)?;
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
    let classes = equal_parts(&service.assembly(id)?);
    let picture = Picture {
        name: &assembly.name,
        parts: &parts,
        present: &present,
        classes: &classes,
        graphs: &graphs,
    };
    let save = |file: &Path, text: &str, graphs: &[DirectionalGraph]| {
        written(file, text.as_bytes())?;
        let edges: usize = graphs.iter().map(|g| g.edges.len()).sum();
        print(&format!(
            "{}: parts {}, directions {}, edges {edges}\n",
            file.display(),
            present.len(),
            graphs.len()
        ))
    };
    match (form, &graphs[..]) {
        (Form::Dot, graphs) => save(&arguments.output, &picture.dot(), graphs)?,
        (Form::Svg, [only]) => save(&arguments.output, &picture.svg(only), std::slice::from_ref(only))?,
        (Form::Svg, graphs) => {
            for graph in graphs {
                save(&file_of(&arguments.output, graph), &picture.svg(graph), std::slice::from_ref(graph))?;
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// What a graph is written as.
#[derive(Clone, Copy)]
enum Form {
    Dot,
    Svg,
}

/// What the file's name asks for.
fn form(arguments: &GraphArguments) -> Result<Form, CliError> {
    let extension = arguments.output.extension().and_then(|e| e.to_str()).unwrap_or_default();
    match extension.to_ascii_lowercase().as_str() {
        "svg" => Ok(Form::Svg),
        "dot" | "gv" => Ok(Form::Dot),
        _ => Err(CliError::Refused(format!(
            "{}: name the picture .svg or .dot, which says what it is to be",
            arguments.output.display()
        ))),
    }
}

/// The file of one of several directions: `graph+x.svg` beside `graph.svg`.
fn file_of(output: &Path, graph: &DirectionalGraph) -> PathBuf {
    let stem = output.file_stem().unwrap_or_default().to_string_lossy();
    let direction = graph.direction.to_string().replace(['[', ']'], "").replace(',', "_");
    output.with_file_name(format!("{stem}{direction}.svg"))
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
