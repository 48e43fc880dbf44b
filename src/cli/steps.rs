//! `sbdp steps`: a plan as instructions, in words and in pictures.

use std::path::Path;
use std::process::ExitCode;

use super::args::StepsArguments;
use super::error::CliError;
use super::subject::{Subject, plan_in};
use super::{print, written};
use crate::document::PlanDocument;
use crate::view::sheet::sheet;
use crate::view::steps::markdown;
use crate::view::{Illustration, Instructions, PlanScene, equal_parts, illustrations};

pub(super) fn run(arguments: &StepsArguments) -> Result<ExitCode, CliError> {
    let plan = plan_in(&arguments.plan)?;
    if arguments.pictures.is_some() || arguments.html.is_some() {
        return drawn(plan, arguments);
    }
    let instructions = match instructions(&plan, arguments) {
        Ok(instructions) => instructions,
        // Meshes that the user names must be there; those that the plan names may be missing.
        Err(error) if arguments.meshes.is_some() => return Err(error),
        Err(error) => {
            eprintln!("note: {error}; parts are taken for equal whose names differ in a number only");
            Instructions::of(&plan, None)
        }
    };
    print(&markdown(&instructions))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes pictures, for which there must be meshes.
fn drawn(plan: PlanDocument, arguments: &StepsArguments) -> Result<ExitCode, CliError> {
    let subject = Subject::of(plan, arguments.meshes.as_deref())?;
    let assembly = subject.assembly()?;
    let instructions = subject.instructions(&assembly)?;
    let scene = PlanScene::new(&assembly, subject.up(), &subject.plan)?;
    let pictures = illustrations(&scene, &instructions)?;
    if let Some(folder) = &arguments.pictures {
        write_pictures(folder, &pictures)?;
    }
    if let Some(file) = &arguments.html {
        let equal = equal_parts(&assembly);
        let is_shown = |part: &usize| scene.parts.iter().any(|p| p.name == assembly.parts[*part].name);
        let classes: Vec<usize> =
            (0..assembly.parts.len()).filter(is_shown).map(|part| equal[part]).collect();
        let html = sheet(&scene, &classes, &instructions, &pictures);
        written(file, html.as_bytes())?;
        let size = html.len().div_ceil(1000);
        print(&format!("{}: instructions {}, {size} kB\n", file.display(), instructions.list.len()))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn write_pictures(folder: &Path, pictures: &[Illustration]) -> Result<(), CliError> {
    std::fs::create_dir_all(folder).map_err(|e| CliError::Failed(format!("{}: {e}", folder.display())))?;
    for picture in pictures {
        written(&folder.join(format!("{}.png", picture.name)), &picture.png)?;
    }
    let size: usize = pictures.iter().map(|p| p.png.len()).sum();
    print(&format!("{}: pictures {}, {} kB\n", folder.display(), pictures.len(), size.div_ceil(1000)))
}

fn instructions(plan: &PlanDocument, arguments: &StepsArguments) -> Result<Instructions, CliError> {
    let subject = Subject::of(plan.clone(), arguments.meshes.as_deref())?;
    subject.instructions(&subject.assembly()?)
}
