//! The daemon as a backend: requests of the command line as the client crate has them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::{Duration, Instant};

use sbdp_client as client;
use sbdp_client::{Client, ClientError, ConnectOptions, ErrorCode, Event, PlanOptions, PlanStream};

use super::backend::{Backend, CommandQuestion, unplanned};
use super::error::CliError;
use super::listener::Listener;
use crate::blocking_graph::StaticAnalysis;
use crate::document::PlanDocument;
use crate::exchange::{wire_assembly, wire_mesh, wire_part};
use crate::geometry::{Revision, SourceAssembly, heal, waypoint_from_pose};
use crate::plan::PlanStatus;
use crate::search::{ActionSet, Engine, PlanSink as _, Planner, Progress, Stage, Staging, Tried};
use crate::simulation::PenaltyParameters;

/// How long Ctrl-C may go unnoticed while the daemon has nothing to say.
const CANCEL_POLL: Duration = Duration::from_millis(50);
/// How long the daemon may take for the plan so far after Ctrl-C. It stops within tens of milliseconds, unless it hangs;
/// half of this would give up daemons on machines that are busy, twice as much keeps the user waiting.
const CANCEL_PATIENCE: Duration = Duration::from_secs(2);

/// A connection to the daemon.
pub(super) struct Daemon {
    client: Client,
}

impl Daemon {
    pub(super) fn connect() -> Result<Self, ClientError> {
        Ok(Self { client: Client::connect()? })
    }

    /// A connection for plans. `reconnect` is how long to wait for another daemon when this one is gone.
    pub(super) fn connect_for_plans(
        cancel: &Arc<AtomicBool>,
        reconnect: Duration,
    ) -> Result<Self, ClientError> {
        let interrupt = Some(Arc::clone(cancel).into());
        let options = ConnectOptions { reconnect, interrupt, ..ConnectOptions::default() };
        Ok(Self { client: Client::connect_with(options)? })
    }

    pub(super) fn status(&self) -> Result<client::Status, ClientError> {
        self.client.status()
    }

    pub(super) fn metrics(&self) -> Result<String, ClientError> {
        self.client.metrics()
    }

    /// Asks; what the client says if there is no plan.
    pub(super) fn answer(
        &self,
        question: &CommandQuestion<'_>,
        listener: &mut Listener,
    ) -> Result<PlanDocument, ClientError> {
        let answer = self.ask(question, listener);
        if matches!(&answer, Err(e) if e.code() == Some(ErrorCode::UnknownHandle)) {
            // Evicted between the two requests.
            return self.ask(question, listener);
        }
        answer
    }

    fn ask(
        &self,
        question: &CommandQuestion<'_>,
        listener: &mut Listener,
    ) -> Result<PlanDocument, ClientError> {
        let mut handle = self.client.upload(&wire_assembly(question.assembly))?;
        if !question.revision.is_empty() {
            handle = self.client.revise(handle, &change(&question.revision))?;
        }
        let mut stream = self.client.plan(handle, &options(question, listener.traces()))?;
        receive(&mut stream, question, listener)
    }
}

impl Backend for Daemon {
    fn plan(
        &self,
        question: &CommandQuestion<'_>,
        listener: &mut Listener,
    ) -> Result<PlanDocument, CliError> {
        concluded(question, self.answer(question, listener))
    }
}

/// What the command makes of the daemon's answer.
pub(super) fn concluded(
    question: &CommandQuestion<'_>,
    answer: Result<PlanDocument, ClientError>,
) -> Result<PlanDocument, CliError> {
    answer.or_else(|error| match (&error, error.code()) {
        (ClientError::Interrupted, _) | (_, Some(ErrorCode::Cancelled)) => {
            Ok(unplanned(question, PlanStatus::Cancelled, error.to_string()))
        }
        (_, Some(ErrorCode::Expired)) => Ok(unplanned(question, PlanStatus::Timeout, error.to_string())),
        (_, Some(ErrorCode::Geometry)) => Err(refusal(question.revised, &error)),
        (_, Some(ErrorCode::NoSuchPart | ErrorCode::Unsupported)) => {
            Err(CliError::Refused(error.to_string()))
        }
        _ => Err(CliError::Failed(error.to_string())),
    })
}

/// Whether an answer failed because the daemon is gone, or about to be.
pub(super) fn went_away(error: &ClientError) -> bool {
    error.is_no_daemon() || error.code() == Some(ErrorCode::ShuttingDown)
}

/// The daemon does not know the files that an upload came from: the same check here does.
fn refusal(assembly: &SourceAssembly, error: &ClientError) -> CliError {
    let here = assembly.parts.iter().find_map(|part| heal(part).err());
    here.map_or_else(|| CliError::Refused(error.to_string()), CliError::from)
}

fn receive(
    stream: &mut PlanStream,
    question: &CommandQuestion<'_>,
    listener: &mut Listener,
) -> Result<PlanDocument, ClientError> {
    let cancel = question.termination.cancel_flag();
    let mut steps = Vec::new();
    let mut cancelled = None;
    loop {
        if cancel.load(Ordering::Relaxed) {
            stream.cancel();
            if cancelled.get_or_insert_with(Instant::now).elapsed() > CANCEL_PATIENCE {
                return Err(ClientError::Interrupted);
            }
        }
        let Poll::Ready(event) = stream.poll_event(CANCEL_POLL)? else { continue };
        match event {
            Some(Event::Progress(p)) => listener.progress(progress(p)),
            Some(Event::Step(step)) => {
                listener.step_found();
                steps.push(step);
            }
            Some(Event::Trace(lines)) => {
                for line in lines.lines() {
                    let event = serde_json::from_str(line);
                    listener.traced(event.map_err(|e| ClientError::Protocol(format!("trace: {e}")))?);
                }
            }
            Some(Event::Restarted) => {
                eprintln!("the daemon was restarted: the plan begins anew");
                steps.clear();
                listener.begin_anew();
            }
            Some(Event::Done(summary)) => return Ok(summary.document(&steps)),
            None => return Err(ClientError::Protocol("the plan ended without its summary".into())),
        }
    }
}

fn change(revision: &Revision) -> client::Change<'_> {
    client::Change {
        replaced: revision
            .replaced
            .iter()
            .map(|(place, mesh)| (*place as u32, wire_mesh("", mesh)))
            .collect(),
        added: revision.added.iter().map(wire_part).collect(),
        moved: revision.moved.iter().map(|(p, pose)| (*p as u32, waypoint_from_pose(pose))).collect(),
    }
}

fn options(question: &CommandQuestion<'_>, trace: bool) -> PlanOptions {
    let request = &question.request;
    let numbers = |parts: &[usize]| parts.iter().map(|&p| p as u32).collect::<Vec<u32>>();
    PlanOptions {
        planner: match request.planner {
            Planner::SbdpStar => client::Planner::SbdpStar,
            Planner::Sbdp => client::Planner::Sbdp,
            Planner::PdpT => client::Planner::PdpT,
            Planner::PdpR => client::Planner::PdpR,
            Planner::PdpStar => client::Planner::PdpStar,
            Planner::Rrt => client::Planner::Rrt,
            Planner::BkRrt => client::Planner::BkRrt,
        },
        engine: match request.engine {
            Engine::Sliding => client::Engine::Sliding,
            Engine::Penalty => client::Engine::Penalty,
        },
        actions: match request.actions {
            ActionSet::Paper => client::ActionSet::Paper,
            ActionSet::Extended => client::ActionSet::Extended,
        },
        static_analysis: match request.static_analysis {
            StaticAnalysis::Sliding => client::StaticAnalysis::Sliding,
            StaticAnalysis::Paper => client::StaticAnalysis::Paper,
        },
        penalty: penalty(&request.penalty),
        path_timeout: request.path_timeout,
        planning_timeout: request.planning_timeout,
        trace,
        timeout: question.deadline.map(|d| d.saturating_duration_since(Instant::now())),
        end_gap: request.end_gap,
        clearance: request.clearance,
        up: request.up,
        seed: request.seed,
        max_simulations: request.max_simulations,
        threads: u32::try_from(request.threads).unwrap_or(0),
        fixed: numbers(&request.fixed),
        removed: numbers(&request.removed),
        targets: request.targets.as_deref().map(numbers),
        base: numbers(&request.base),
        keep: numbers(&request.keep),
        keep_out: numbers(&request.keep_out),
        groups: request.groups.iter().map(|group| numbers(group)).collect(),
        sweeps: request.sweeps,
        no_cache: request.no_cache,
        batch: false,
        moved: Vec::new(),
        assembly: request.assembly.as_ref().map(staging),
        reports: question.reports,
        steady: request.steady.map(|steady| client::Steady { hands: steady.hands }),
        gravity: question.gravity,
    }
}

/// The parameters that differ from the paper's.
fn penalty(parameters: &PenaltyParameters) -> Vec<(client::PenaltyParameter, f64)> {
    let usual = PenaltyParameters::default().named();
    let differ =
        parameters.named().into_iter().zip(usual).map(|((_, value), (_, usual))| (value, value != usual));
    let given = client::PenaltyParameter::ALL.into_iter().zip(differ);
    given.filter_map(|(parameter, (value, differs))| differs.then_some((parameter, value))).collect()
}

fn staging(staging: &Staging) -> client::Staging {
    match staging {
        Staging::None => client::Staging::None,
        Staging::Beside(given) => {
            client::Staging::Beside(given.iter().map(|(part, place)| (*part as u32, *place)).collect())
        }
    }
}

fn progress(p: client::Progress) -> Progress {
    let stage = match p.stage {
        client::Stage::Sdf => Stage::Sdf,
        client::Stage::Search => Stage::Search,
        client::Stage::Transfer => Stage::Transfer,
    };
    let tried = p.tried.map(|tried| Tried { part: tried.part as usize, turns: tried.turns });
    Progress { stage, done: p.done, total: p.total, simulations: p.simulations, tried }
}
