//! `sbdp plan`.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use sbdp_client::ConnectOptions;
use sbdp_ipc::document::FloorDocument;
use sbdp_ipc::plan::{Gravity, Reports};

use super::args::{GroupsArgument, PlanArguments, ReportArgument};
use super::backend::{Backend, CommandQuestion, Embedded};
use super::daemon::{Daemon, concluded, went_away};
use super::error::{CliError, exit_code};
use super::listener::Listener;
use super::part_names::{part_named, resolve};
use super::staging::staging;
use super::subject::{Subject, further, only_mesh};
use super::{STDOUT, cache, interrupt, print, report, written};
use crate::bench::end_with_benchmark;
use crate::cache::CacheSettings;
use crate::document::{PlanDocument, SourceDocument};
use crate::document::{absolute, content_of, source, with_files};
use crate::files::{LoadOptions, customary_up, load};
use crate::geometry::{Floor, Revision, SourceAssembly, content_hash, pose_from_waypoint};
use crate::search::{PlanRequest, Planner, SteadyOrder, Termination};
use crate::simulation::PenaltyParameters;

pub(super) fn run(arguments: &PlanArguments) -> Result<ExitCode, CliError> {
    end_with_benchmark();
    let planned = planned(arguments)?;
    write_files(arguments, &planned)?;
    if !arguments.quiet && arguments.json.as_deref() != Some(Path::new(STDOUT)) {
        print(&report::plan(&planned.revised, &planned.subject.plan, arguments.verbose))?;
    }
    Ok(exit_code(&planned.subject.plan))
}

/// A plan with all that is needed to show it.
pub(super) struct Planned {
    /// The assembly that it is about, with what differs.
    revised: SourceAssembly,
    /// The plan in the words of its contract, with the assembly before what differs.
    pub(super) subject: Subject,
}

/// Plans as the arguments say, wherever they say.
pub(super) fn planned(arguments: &PlanArguments) -> Result<Planned, CliError> {
    let deadline = arguments.timeout.and_then(|t| Instant::now().checked_add(t));
    let termination = Termination::new(deadline);
    let reading = interrupt::end_on_interrupt()?;
    let started = Instant::now();
    let options = load_options(arguments);
    let mut assembly = load(&arguments.input.assembly, &options)?;
    let read = started.elapsed();
    let content = content_hash(&assembly);
    if let Some(rotation) = &arguments.rotate {
        assembly.rotate(rotation);
    }
    let mut revision = revision(arguments, &assembly, &further(&options))?;
    let floor = arguments.floor.then(|| floor_under(arguments, &assembly, &revision)).transpose()?;
    revision.added.extend(floor.map(|floor| floor.part()));
    let revised = assembly.revised(&revision);
    let request = request(arguments, &revised)?;
    let reports = reports(arguments);
    let gravity = gravity(arguments, &revised);
    interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
    reading.store(false, Ordering::Relaxed);
    let backend = choose_backend(arguments, &termination)?;
    let question = CommandQuestion {
        assembly: &assembly,
        revision,
        revised: &revised,
        read,
        request,
        reports,
        gravity,
        deadline,
        termination,
    };
    let names = revised.parts.iter().map(|part| part.name.clone());
    let mut listener = Listener::new(arguments.trace.as_deref(), arguments.quiet, names)?;
    let plan = backend.plan(&question, &mut listener);
    listener.finish()?;
    let plan = plan?;
    let revision = question.revision;
    let source = SourceDocument {
        floor: floor.map(|floor| FloorDocument {
            up: (*floor.up).into(),
            centre: floor.centre.into(),
            side: floor.side,
        }),
        ..source_of(arguments, content_of(&content, &revision))
    };
    let document = with_files(plan, &assembly, source);
    Ok(Planned { revised, subject: Subject::new(assembly, revision, document) })
}

/// Where the meshes are, for who reads the plan later and elsewhere.
fn source_of(arguments: &PlanArguments, content: String) -> SourceDocument {
    let input = &arguments.input;
    let read = source(&input.assembly, content, input.split, &input.ignore, input.deflection);
    let replaced = arguments.replaced.iter().map(|(part, file)| (part.clone(), absolute(file)));
    SourceDocument {
        rotate: arguments.rotate.map(|q| [q.w, q.i, q.j, q.k]),
        replaced: replaced.collect(),
        added: arguments.added.iter().map(|path| absolute(path)).collect(),
        ..read
    }
}

/// The floor under an assembly with what differs from it.
fn floor_under(
    arguments: &PlanArguments,
    assembly: &SourceAssembly,
    revision: &Revision,
) -> Result<Floor, CliError> {
    let revised = assembly.revised(revision);
    let refused = |words: &str| CliError::Refused(format!("--floor: {words}"));
    if revised.parts.iter().any(|part| part.name == Floor::NAME) {
        return Err(refused("the assembly has a part `floor` already; name it by --keep-out"));
    }
    let up = arguments.up.unwrap_or_else(|| customary_up(assembly));
    Floor::under(&revised, up).ok_or_else(|| refused("the assembly has no finite size"))
}

fn request(arguments: &PlanArguments, assembly: &SourceAssembly) -> Result<PlanRequest, CliError> {
    let fixed = [&assembly.fixed[..], &arguments.fixed[..]].concat();
    let targets = resolve(assembly, "--target", &arguments.target)?;
    let base = if arguments.base.is_empty() { &assembly.base } else { &arguments.base };
    let keep = if arguments.keep.is_empty() { &assembly.keep } else { &arguments.keep };
    let mut keep_out =
        if arguments.keep_out.is_empty() { &assembly.keep_out } else { &arguments.keep_out }.clone();
    keep_out.extend(arguments.floor.then(|| Floor::NAME.to_owned()));
    let planner = Planner::from(arguments.planner);
    Ok(PlanRequest {
        planner,
        engine: arguments.engine.into(),
        actions: arguments.actions.map_or_else(|| planner.default_actions(), Into::into),
        static_analysis: arguments.dbg.map(Into::into).unwrap_or_default(),
        sweeps: arguments.sweeps.asked(),
        end_gap: arguments.end_gap,
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
        keep: resolve(assembly, "--keep", keep)?,
        keep_out: resolve(assembly, "--keep-out", &keep_out)?,
        groups: preferred_groups(arguments, assembly)?,
        targets: (!arguments.target.is_empty()).then_some(targets),
        steady: steady(arguments, assembly),
        assembly: arguments.together.then(|| staging(assembly, &arguments.staging)).transpose()?,
        no_cache: arguments.no_cache,
    })
}

fn steady(arguments: &PlanArguments, assembly: &SourceAssembly) -> Option<SteadyOrder> {
    let Gravity { up, friction } = gravity(arguments, assembly);
    let is_wanted = arguments.steady || arguments.hands.is_some();
    is_wanted.then_some(SteadyOrder { up, friction, hands: arguments.hands })
}

fn gravity(arguments: &PlanArguments, assembly: &SourceAssembly) -> Gravity {
    let up = arguments.up.unwrap_or_else(|| customary_up(assembly));
    Gravity { up, friction: arguments.friction }
}

fn reports(arguments: &PlanArguments) -> Reports {
    let has = |what| arguments.report.contains(&what);
    Reports {
        stability: has(ReportArgument::Stability),
        clearance: has(ReportArgument::Clearance),
        tools: has(ReportArgument::Tools),
    }
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
fn choose_backend<'a>(
    arguments: &'a PlanArguments,
    termination: &Termination,
) -> Result<Box<dyn Backend + 'a>, CliError> {
    if arguments.embedded || arguments.cache_dir.is_some() {
        return Ok(Box::new(embedded(arguments)));
    }
    // Who insists on a daemon waits for the next one; planning here is sooner.
    let reconnect = if arguments.daemon { ConnectOptions::default().reconnect } else { Duration::ZERO };
    match Daemon::connect_for_plans(&termination.cancel_flag(), reconnect) {
        Ok(daemon) if arguments.daemon => Ok(Box::new(daemon)),
        Ok(daemon) => Ok(Box::new(DaemonFirst { daemon, arguments })),
        Err(error) if arguments.daemon => Err(CliError::Failed(error.to_string())),
        Err(error) => {
            // That none runs is normal; that one runs and cannot be used is worth a word.
            if !error.is_no_daemon() {
                eprintln!("warning: {error}; planning in this process");
            }
            Ok(Box::new(embedded(arguments)))
        }
    }
}

fn embedded(arguments: &PlanArguments) -> Embedded {
    Embedded::new((!arguments.no_cache).then(|| cache::embedded(arguments.cache_dir.as_deref())))
}

/// The daemon as long as it is there, then this process.
struct DaemonFirst<'a> {
    daemon: Daemon,
    arguments: &'a PlanArguments,
}

impl Backend for DaemonFirst<'_> {
    fn plan(
        &self,
        question: &CommandQuestion<'_>,
        listener: &mut Listener,
    ) -> Result<PlanDocument, CliError> {
        let answer = self.daemon.answer(question, listener);
        if matches!(&answer, Err(error) if went_away(error)) {
            eprintln!("warning: the daemon went away before it had answered; planning in this process");
            listener.begin_anew();
            return embedded(self.arguments).plan(question, listener);
        }
        concluded(question, answer)
    }
}

/// Writes the plan to the files that the arguments name.
pub(super) fn write_files(arguments: &PlanArguments, planned: &Planned) -> Result<(), CliError> {
    if let Some(file) = &arguments.glb {
        written(file, &planned.subject.glb()?)?;
    }
    let Some(file) = &arguments.json else { return Ok(()) };
    let document = &planned.subject.plan;
    let json = if arguments.pretty { document.to_pretty_json() } else { document.to_json() };
    let text = json.map_err(|e| CliError::Failed(format!("cannot write the plan as JSON: {e}")))? + "\n";
    if file == Path::new(STDOUT) { print(&text) } else { written(file, text.as_bytes()) }
}
