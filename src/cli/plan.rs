//! `sbdp plan`.

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use super::args::PlanArguments;
use super::backend::{Backend, Embedded, Question};
use super::daemon::Daemon;
use super::error::{CliError, exit_code};
use super::listener::Listener;
use super::part_names::{part_named, resolve};
use super::staging::staging;
use super::{cache, interrupt, print, report};
use crate::geometry::{Revision, SourceAssembly, load_assembly, pose_from_waypoint};
use crate::plan::Plan;
use crate::plan::export::PlanDocument;
use crate::search::{PlanRequest, Planner, Termination};
use crate::simulation::PenaltyParameters;

pub(super) fn run(arguments: &PlanArguments) -> Result<ExitCode, CliError> {
    let deadline = arguments.timeout.and_then(|t| Instant::now().checked_add(t));
    let termination = Termination::new(deadline);
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let started = Instant::now();
    let mut assembly = load_assembly(&arguments.assembly)?;
    let read = started.elapsed();
    if let Some(rotation) = &arguments.rotate {
        assembly.rotate(rotation);
    }
    let revision = revision(arguments, &assembly)?;
    let revised = assembly.revised(&revision);
    let request = request(arguments, &revised)?;
    let backend = choose_backend(arguments)?;
    let question =
        Question { assembly: &assembly, revision, revised: &revised, read, request, deadline, termination };
    let mut listener = Listener::new(arguments.trace.as_deref())?;
    let plan = backend.plan(&question, &mut listener);
    listener.finish()?;
    let plan = plan?;
    write_results(arguments.json.as_deref(), &revised, &plan)?;
    Ok(exit_code(plan.status))
}

fn request(arguments: &PlanArguments, assembly: &SourceAssembly) -> Result<PlanRequest, CliError> {
    let fixed = [&assembly.fixed[..], &arguments.fixed[..]].concat();
    let targets = resolve(assembly, "--target", &arguments.target)?;
    let planner = Planner::from(arguments.planner);
    Ok(PlanRequest {
        planner,
        engine: arguments.engine.into(),
        actions: arguments.actions.map_or_else(|| planner.default_actions(), Into::into),
        static_analysis: arguments.dbg.map(Into::into).unwrap_or_default(),
        sweeps: arguments.sweeps.asked(),
        max_simulations: arguments.max_simulations,
        path_timeout: arguments.path_timeout,
        penalty: penalty(&arguments.penalty)?,
        threads: arguments.threads as usize,
        fixed: resolve(assembly, "--fixed", &fixed)?,
        removed: resolve(assembly, "--removed", &arguments.removed)?,
        targets: (!arguments.target.is_empty()).then_some(targets),
        assembly: arguments.together.then(|| staging(assembly, &arguments.staging)).transpose()?,
        no_cache: arguments.no_cache,
    })
}

/// What differs from the files.
fn revision(arguments: &PlanArguments, assembly: &SourceAssembly) -> Result<Revision, CliError> {
    let moved = arguments
        .moved
        .iter()
        .map(|(name, motion)| Ok((part_named(assembly, "--moved", name)?, pose_from_waypoint(motion))));
    let replaced = arguments.replaced.iter().map(|(name, file)| {
        let place = part_named(assembly, "--replaced", name)?;
        let mut parts = load_assembly(file)?.parts;
        match (parts.pop(), parts.len()) {
            (Some(part), 0) => Ok((place, part.mesh)),
            (_, rest) => Err(CliError::Refused(format!(
                "--replaced: `{}` has {} parts where one is wanted",
                file.display(),
                rest + 1
            ))),
        }
    });
    let added = arguments.added.iter().map(|path| Ok(load_assembly(path)?.parts));
    Ok(Revision {
        moved: moved.collect::<Result<_, CliError>>()?,
        replaced: replaced.collect::<Result<_, CliError>>()?,
        added: added.collect::<Result<Vec<_>, CliError>>()?.concat(),
    })
}

/// The paper's parameters, but for those given.
fn penalty(given: &[String]) -> Result<PenaltyParameters, CliError> {
    let refused = |e: String| CliError::Refused(format!("--penalty: {}", e.trim_end()));
    let parameters: PenaltyParameters =
        toml::from_str(&given.join("\n")).map_err(|e| refused(e.to_string()))?;
    parameters.validate().map_err(refused)?;
    Ok(parameters)
}

/// The daemon if one runs, else this process; or what the user insists on.
fn choose_backend(arguments: &PlanArguments) -> Result<Box<dyn Backend>, CliError> {
    let only_here = arguments.trace.is_some()
        || arguments.cache_dir.is_some()
        || arguments.path_timeout.is_some()
        || arguments.dbg.is_some()
        || !arguments.penalty.is_empty();
    let embedded = || {
        let cache = (!arguments.no_cache).then(|| cache::embedded(arguments.cache_dir.as_deref()));
        Box::new(Embedded::new(cache))
    };
    if arguments.embedded || only_here {
        return Ok(embedded());
    }
    match Daemon::connect() {
        Ok(daemon) => Ok(Box::new(daemon)),
        Err(error) if arguments.daemon => Err(CliError::Failed(error.to_string())),
        Err(error) => {
            // That none runs is normal; that one runs and cannot be used is worth a word.
            if !error.is_no_daemon() {
                eprintln!("warning: {error}; planning in this process");
            }
            Ok(embedded())
        }
    }
}

fn write_results(json: Option<&Path>, assembly: &SourceAssembly, plan: &Plan) -> Result<(), CliError> {
    let Some(file) = json else { return print(&report::plan(assembly, plan)) };
    let mut text = PlanDocument::new(plan)
        .to_json()
        .map_err(|e| CliError::Failed(format!("cannot write the plan as JSON: {e}")))?;
    text.push('\n');
    if file == Path::new("-") {
        return print(&text);
    }
    std::fs::write(file, text).map_err(|e| CliError::Failed(format!("{}: {e}", file.display())))?;
    print(&report::plan(assembly, plan))
}
