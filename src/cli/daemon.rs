//! The daemon as a backend: the client crate's types on one side, the planning modules' on the
//! other.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use sbdp_client as client;
use sbdp_client::{Client, ClientError, ErrorCode, Event, PlanOptions, PlanStream, Summary};

use super::backend::{Backend, CommandQuestion};
use super::error::CliError;
use crate::blocking_graph::StaticAnalysis;
use crate::geometry::{Revision, SourceAssembly, heal, waypoint_from_pose};
use crate::plan::{
    Base, Blocked, FreeGroup, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd,
    Warning,
};
use crate::search::{ActionSet, Engine, PlanSink, Planner, Progress, Stage, Staging};
use crate::simulation::PenaltyParameters;
use crate::upload::{wire_assembly, wire_mesh, wire_part};

/// How long Ctrl-C may go unnoticed while the daemon has nothing to say.
const CANCEL_POLL: Duration = Duration::from_millis(100);

/// A connection to the daemon.
pub(super) struct Daemon {
    client: Client,
}

impl Daemon {
    pub(super) fn connect() -> Result<Self, ClientError> {
        Ok(Self { client: Client::connect()? })
    }

    pub(super) fn status(&self) -> Result<client::Status, ClientError> {
        self.client.status()
    }

    pub(super) fn metrics(&self) -> Result<String, ClientError> {
        self.client.metrics()
    }

    fn ask(&self, question: &CommandQuestion<'_>, sink: &mut dyn PlanSink) -> Result<Plan, ClientError> {
        let mut handle = self.client.upload(&wire_assembly(question.assembly))?;
        if !question.revision.is_empty() {
            handle = self.client.revise(handle, &change(&question.revision))?;
        }
        let mut stream = self.client.plan(handle, &options(question, sink.traces()))?;
        receive(&mut stream, question, sink)
    }
}

impl Backend for Daemon {
    fn plan(&self, question: &CommandQuestion<'_>, sink: &mut dyn PlanSink) -> Result<Plan, CliError> {
        let mut answer = self.ask(question, sink);
        if matches!(&answer, Err(e) if e.code() == Some(ErrorCode::UnknownHandle)) {
            // Evicted between the two requests.
            answer = self.ask(question, sink);
        }
        answer.or_else(|error| match error.code() {
            Some(ErrorCode::Expired) => Ok(unplanned(question, PlanStatus::Timeout, &error)),
            Some(ErrorCode::Cancelled) => Ok(unplanned(question, PlanStatus::Cancelled, &error)),
            Some(ErrorCode::Geometry) => Err(refusal(question.revised, &error)),
            Some(ErrorCode::NoSuchPart | ErrorCode::Unsupported) => Err(CliError::Refused(error.to_string())),
            _ => Err(CliError::Failed(error.to_string())),
        })
    }
}

/// The daemon does not know the files that an upload came from: the same check here does.
fn refusal(assembly: &SourceAssembly, error: &ClientError) -> CliError {
    let here = assembly.parts.iter().find_map(|part| heal(part).err());
    here.map_or_else(|| CliError::Refused(error.to_string()), CliError::from)
}

fn receive(
    stream: &mut PlanStream<'_>,
    question: &CommandQuestion<'_>,
    sink: &mut dyn PlanSink,
) -> Result<Plan, ClientError> {
    let cancel = question.termination.cancel_flag();
    let mut steps = Vec::new();
    loop {
        if cancel.load(Ordering::Relaxed) {
            stream.cancel();
        }
        match stream.next_event_within(CANCEL_POLL) {
            Ok(Some(Event::Progress(p))) => sink.progress(progress(p)),
            Ok(Some(Event::Step(step))) => {
                steps.push(plan_step(&step));
                steps.last().into_iter().for_each(|s| sink.step(s));
            }
            Ok(Some(Event::Trace(lines))) => {
                for line in lines.lines() {
                    let event = serde_json::from_str(line);
                    sink.traced(event.map_err(|e| ClientError::Protocol(format!("trace: {e}")))?);
                }
            }
            Ok(Some(Event::Restarted)) => {
                eprintln!("the daemon was restarted: the plan begins anew");
                steps.clear();
            }
            Ok(Some(Event::Done(summary))) => {
                return Ok(plan(summary, steps));
            }
            Ok(None) => return Err(ClientError::Protocol("the plan ended without its summary".into())),
            Err(ClientError::Timeout { .. }) => {}
            Err(error) => return Err(error),
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
        clearance: request.clearance,
        up: request.up,
        seed: request.seed,
        max_simulations: request.max_simulations,
        threads: u32::try_from(request.threads).unwrap_or(0),
        fixed: numbers(&request.fixed),
        removed: numbers(&request.removed),
        targets: request.targets.as_deref().map(numbers),
        base: numbers(&request.base),
        groups: request.groups.iter().map(|group| numbers(group)).collect(),
        sweeps: request.sweeps,
        no_cache: request.no_cache,
        batch: false,
        moved: Vec::new(),
        assembly: request.assembly.as_ref().map(staging),
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
    Progress { stage, done: p.done, total: p.total, simulations: p.simulations }
}

fn plan_step(step: &client::Step<'_>) -> PlanStep {
    PlanStep {
        parts: indices(step.parts),
        of: step.of.map(|number| number as usize),
        ends: match step.ends {
            client::StepEnd::Out => StepEnd::Out,
            client::StepEnd::Aside => StepEnd::Aside,
            client::StepEnd::In => StepEnd::In,
        },
        motion: if step.rotates { MotionKind::Rotation } else { MotionKind::Translation },
        path: step.path.to_vec(),
        verified_depth: step.verified_depth,
        requires: indices(step.requires),
        wave: step.wave as usize,
        direction: step.direction,
    }
}

fn plan(s: Summary, steps: Vec<PlanStep>) -> Plan {
    Plan {
        kind: if s.assembly { PlanKind::Assembly } else { PlanKind::Disassembly },
        status: status(s.status),
        reason: s.reason,
        planner: s.planner,
        engine: s.engine,
        units: s.units,
        parts: s.parts,
        removed: indices(&s.removed),
        poses: s.poses.into_iter().map(|(part, pose)| (part as usize, pose)).collect(),
        targets: s.targets.as_deref().map(indices),
        fixed: indices(&s.fixed),
        base: Base { parts: indices(&s.base.parts), reason: s.base.reason },
        steps,
        remaining: indices(&s.remaining),
        kept_together: s.kept_together.iter().map(|group| indices(group)).collect(),
        free_together: s
            .free_together
            .iter()
            .map(|g| FreeGroup { parts: indices(&g.parts), direction: g.direction })
            .collect(),
        blocked: s
            .blocked
            .into_iter()
            .map(|b| Blocked { part: b.part as usize, by: indices(&b.by), action: b.action })
            .collect(),
        overlaps: s
            .overlaps
            .into_iter()
            .map(|o| Overlap { parts: o.parts.map(|p| p as usize), depth: o.depth })
            .collect(),
        warnings: s
            .warnings
            .into_iter()
            .map(|w| Warning { part: w.part.map(|p| p as usize), message: w.message })
            .collect(),
        stats: stats(&s.stats),
    }
}

fn status(status: client::PlanStatus) -> PlanStatus {
    match status {
        client::PlanStatus::Complete => PlanStatus::Complete,
        client::PlanStatus::Partial => PlanStatus::Partial,
        client::PlanStatus::Infeasible => PlanStatus::Infeasible,
        client::PlanStatus::Timeout => PlanStatus::Timeout,
        client::PlanStatus::Cancelled => PlanStatus::Cancelled,
        client::PlanStatus::Exhausted => PlanStatus::Exhausted,
    }
}

fn stats(s: &client::Stats) -> PlanStats {
    PlanStats {
        simulations: s.simulations,
        simulations_run: s.simulations_run,
        sweeps: s.sweeps,
        states: s.states,
        // The wire has no room for these.
        load_time_s: None,
        overlap_time_s: None,
        transfer_time_s: None,
        verdict_hits: None,
        sdf_time_s: s.sdf_time_s,
        static_analysis_time_s: s.static_analysis_time_s,
        path_time_s: s.path_time_s,
        verify_time_s: s.verify_time_s,
        total_time_s: s.total_time_s,
        sdf_hits: s.sdf_hits,
        blocking_hits: s.blocking_hits,
        graph_hits: s.graph_hits,
        motion_hits: s.motion_hits,
        plan_hit: s.plan_hit != 0,
    }
}

fn indices(parts: &[u32]) -> Vec<usize> {
    parts.iter().map(|&p| p as usize).collect()
}

/// The answer to a question that the daemon let go before planning began: everything stands
/// where it stood.
fn unplanned(question: &CommandQuestion<'_>, status: PlanStatus, error: &ClientError) -> Plan {
    let request = &question.request;
    let parts: Vec<String> = question.revised.parts.iter().map(|p| p.name.clone()).collect();
    let remaining = (0..parts.len()).filter(|p| !request.removed.contains(p)).collect();
    Plan {
        kind: if request.assembly.is_some() { PlanKind::Assembly } else { PlanKind::Disassembly },
        status,
        reason: Some(error.to_string()),
        planner: request.planner.name().to_owned(),
        engine: request.engine.name().to_owned(),
        units: question.assembly.units.clone(),
        parts,
        removed: request.removed.clone(),
        poses: Vec::new(),
        targets: request.targets.clone(),
        fixed: request.fixed.clone(),
        base: Base::default(),
        steps: Vec::new(),
        remaining,
        kept_together: Vec::new(),
        free_together: Vec::new(),
        blocked: Vec::new(),
        overlaps: Vec::new(),
        warnings: Vec::new(),
        stats: PlanStats::default(),
    }
}
