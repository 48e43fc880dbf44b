//! `sbdp plan`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use super::args::{GroupsArgument, PlanArguments};
use super::backend::{Backend, CommandQuestion, Embedded};
use super::daemon::Daemon;
use super::error::{CliError, exit_code};
use super::listener::Listener;
use super::part_names::{part_named, resolve};
use super::staging::staging;
use super::subject::{Subject, content_of, further, only_mesh};
use super::{cache, interrupt, print, report, written};
use crate::bench::end_with_benchmark;
use crate::cache::CacheSettings;
use crate::files::{LoadOptions, load};
use crate::geometry::{Revision, SourceAssembly, SourceGroup, content_hash, pose_from_waypoint};
use crate::plan::export::{GroupDocument, PlanDocument, SourceDocument};
use crate::plan::{Plan, Warning};
use crate::search::{PlanRequest, Planner, Termination};
use crate::simulation::PenaltyParameters;

pub(super) fn run(arguments: &PlanArguments) -> Result<ExitCode, CliError> {
    end_with_benchmark();
    let planned = planned(arguments)?;
    write_files(arguments, &planned)?;
    if arguments.json.as_deref() != Some(Path::new(STDOUT)) {
        print(&report::plan(&planned.revised, &planned.plan, arguments.verbose))?;
    }
    Ok(exit_code(planned.plan.status))
}

/// The name of the file that is stdout.
const STDOUT: &str = "-";

/// A plan with all that is needed to show it.
pub(super) struct Planned {
    /// The plan.
    pub(super) plan: Plan,
    /// The assembly that it is about, with what differs.
    revised: SourceAssembly,
    /// The plan in the words of its contract, with the assembly before what differs.
    pub(super) subject: Subject,
}

/// Plans as the arguments say, wherever they say.
pub(super) fn planned(arguments: &PlanArguments) -> Result<Planned, CliError> {
    let deadline = arguments.timeout.and_then(|t| Instant::now().checked_add(t));
    let termination = Termination::new(deadline);
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    let started = Instant::now();
    let options = load_options(arguments);
    let mut assembly = load(&arguments.input.assembly, &options)?;
    let read = started.elapsed();
    let content = content_hash(&assembly);
    if let Some(rotation) = &arguments.rotate {
        assembly.rotate(rotation);
    }
    let revision = revision(arguments, &assembly, &further(&options))?;
    let revised = assembly.revised(&revision);
    let request = request(arguments, &revised)?;
    let backend = choose_backend(arguments)?;
    let question = CommandQuestion {
        assembly: &assembly,
        revision,
        revised: &revised,
        read,
        request,
        deadline,
        termination,
    };
    let mut listener = Listener::new(arguments.trace.as_deref())?;
    let plan = backend.plan(&question, &mut listener);
    listener.finish()?;
    let mut plan = plan?;
    let notes = assembly.notes.iter().map(|note| Warning { part: None, message: note.clone() });
    plan.warnings.splice(0..0, notes);
    let revision = question.revision;
    let source = source(arguments, content_of(&content, &revision));
    let group = |g: &SourceGroup| GroupDocument { name: g.name.clone(), parts: g.parts.clone() };
    let groups = assembly.groups.iter().map(group).collect();
    let document = PlanDocument { source: Some(source), groups, ..PlanDocument::new(&plan) };
    Ok(Planned { plan, revised, subject: Subject::new(assembly, revision, document) })
}

/// Where the meshes are, for who reads the plan later and elsewhere.
fn source(arguments: &PlanArguments, content: String) -> SourceDocument {
    let absolute =
        |path: &PathBuf| path.canonicalize().unwrap_or_else(|_| path.clone()).display().to_string();
    let replaced = arguments.replaced.iter().map(|(part, file)| (part.clone(), absolute(file)));
    SourceDocument {
        assembly: absolute(&arguments.input.assembly),
        content,
        rotate: arguments.rotate.map(|q| [q.w, q.i, q.j, q.k]),
        replaced: replaced.collect(),
        added: arguments.added.iter().map(absolute).collect(),
        split: arguments.input.split.map(|split| split.to_string()),
        ignore: arguments.input.ignore.iter().map(|pattern| pattern.as_str().to_owned()).collect(),
        deflection: arguments.input.deflection,
    }
}

fn request(arguments: &PlanArguments, assembly: &SourceAssembly) -> Result<PlanRequest, CliError> {
    let fixed = [&assembly.fixed[..], &arguments.fixed[..]].concat();
    let targets = resolve(assembly, "--target", &arguments.target)?;
    let base = if arguments.base.is_empty() { &assembly.base } else { &arguments.base };
    let planner = Planner::from(arguments.planner);
    Ok(PlanRequest {
        planner,
        engine: arguments.engine.into(),
        actions: arguments.actions.map_or_else(|| planner.default_actions(), Into::into),
        static_analysis: arguments.dbg.map(Into::into).unwrap_or_default(),
        sweeps: arguments.sweeps.asked(),
        clearance: arguments.clearance,
        up: arguments.up,
        seed: arguments.seed,
        max_simulations: arguments.max_simulations,
        path_timeout: arguments.path_timeout,
        planning_timeout: arguments.planning_timeout,
        penalty: penalty(&arguments.penalty)?,
        threads: arguments.threads as usize,
        fixed: resolve(assembly, "--fixed", &fixed)?,
        removed: resolve(assembly, "--removed", &arguments.removed)?,
        base: resolve(assembly, "--base", base)?,
        groups: preferred_groups(arguments, assembly)?,
        targets: (!arguments.target.is_empty()).then_some(targets),
        assembly: arguments.together.then(|| staging(assembly, &arguments.staging)).transpose()?,
        no_cache: arguments.no_cache,
    })
}

/// The groups that the assembly names, if they are preferred.
fn preferred_groups(
    arguments: &PlanArguments,
    assembly: &SourceAssembly,
) -> Result<Vec<Vec<usize>>, CliError> {
    if arguments.groups == GroupsArgument::Needed {
        return Ok(Vec::new());
    }
    if assembly.groups.is_empty() {
        return Err(CliError::Refused(format!(
            "--groups prefer: `{}` names no groups; they come from the tree of a STEP or glTF file, or from `groups` in \
             assembly.json",
            assembly.name
        )));
    }
    assembly.groups.iter().map(|group| resolve(assembly, "--groups", &group.parts)).collect()
}

/// How the files are read, and where converted ones are remembered.
fn load_options(arguments: &PlanArguments) -> LoadOptions {
    let folder = arguments.cache_dir.clone().or_else(CacheSettings::default_folder);
    arguments.input.options(folder.filter(|_| !arguments.no_cache))
}

/// What differs from the files; `options` is how further files are read.
fn revision(
    arguments: &PlanArguments,
    assembly: &SourceAssembly,
    options: &LoadOptions,
) -> Result<Revision, CliError> {
    let moved = arguments
        .moved
        .iter()
        .map(|(name, motion)| Ok((part_named(assembly, "--moved", name)?, pose_from_waypoint(motion))));
    let replaced = arguments.replaced.iter().map(|(name, file)| {
        Ok((part_named(assembly, "--replaced", name)?, only_mesh(file, "--replaced", options)?))
    });
    let added = arguments.added.iter().map(|path| Ok(load(path, options)?.parts));
    Ok(Revision {
        moved: moved.collect::<Result<_, CliError>>()?,
        replaced: replaced.collect::<Result<_, CliError>>()?,
        added: added.collect::<Result<Vec<_>, CliError>>()?.concat(),
    })
}

/// The paper's parameters, but for those given.
fn penalty(given: &[String]) -> Result<PenaltyParameters, CliError> {
    let refused = |e: String| CliError::Refused(format!("--penalty: {e}"));
    let parsed = given.iter().map(|text| {
        let (name, value) = text.split_once('=')?;
        Some((name.trim(), value.trim().parse().ok()?))
    });
    let not_parsed = || refused("a parameter is given as NAME=VALUE, as `stiffness=1e5`".to_owned());
    let parsed: Vec<(&str, f64)> = parsed.collect::<Option<_>>().ok_or_else(not_parsed)?;
    PenaltyParameters::with(parsed).map_err(refused)
}

/// The daemon if one runs, else this process; or what the user insists on.
fn choose_backend(arguments: &PlanArguments) -> Result<Box<dyn Backend>, CliError> {
    let embedded = || {
        let cache = (!arguments.no_cache).then(|| cache::embedded(arguments.cache_dir.as_deref()));
        Box::new(Embedded::new(cache))
    };
    if arguments.embedded || arguments.cache_dir.is_some() {
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

/// Writes the plan to the files that the arguments name.
pub(super) fn write_files(arguments: &PlanArguments, planned: &Planned) -> Result<(), CliError> {
    if let Some(file) = &arguments.glb {
        written(file, &planned.subject.glb()?)?;
    }
    let Some(file) = &arguments.json else { return Ok(()) };
    let json = planned.subject.plan.to_json();
    let text = json.map_err(|e| CliError::Failed(format!("cannot write the plan as JSON: {e}")))? + "\n";
    if file == Path::new(STDOUT) { print(&text) } else { written(file, text.as_bytes()) }
}
