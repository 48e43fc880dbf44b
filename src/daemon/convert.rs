//! The only place that sees both wire types and working types.

use std::time::Duration;

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::{Assembly, Part};
use sbdp_ipc::plan as wire;
use sbdp_ipc::progress::{ProgressSample, STAGE_SDF, STAGE_SEARCH, STAGE_TRANSFER, TRIED_TURNS};
use sbdp_ipc::revision as wire_revision;
use sbdp_ipc::summary::report::Report;
use sbdp_ipc::summary::{NO_PART, OverlapRecord, Stats, SummaryParts};

use crate::blocking_graph::StaticAnalysis;
use crate::geometry::{
    GeometryError, Pose, Revision, SourceAssembly, SourceMesh, SourcePart, pose_from_waypoint,
};
use crate::plan::{MotionKind, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd};
use crate::search::{ActionSet, Engine, PlanRequest, Planner, Progress, Stage, Staging, SteadyOrder, Tried};
use crate::service::{AssemblyId, ServiceError};
use crate::simulation::PenaltyParameters;
use crate::termination::Interrupt;

/// What a wire request asks; the handle and the deadline are handled by the dispatcher.
pub(crate) fn plan_request(
    request: &wire::PlanRequest,
    most_threads: usize,
) -> Result<PlanRequest, WireError> {
    let indices = |list: &[u32]| list.iter().map(|i| *i as usize).collect::<Vec<_>>();
    Ok(PlanRequest {
        planner: planner(request.planner)?,
        engine: engine(request.engine)?,
        actions: actions(request.actions)?,
        sweeps: request.sweeps,
        end_gap: request.end_gap,
        clearance: request.clearance,
        up: request.up,
        seed: request.seed,
        max_simulations: request.max_simulations,
        path_timeout: request.path_timeout_ns.map(Duration::from_nanos),
        planning_timeout: request.planning_timeout_ns.map(Duration::from_nanos),
        static_analysis: static_analysis(request.static_analysis)?,
        penalty: penalty(&request.penalty)?,
        threads: threads(request.threads as usize, most_threads),
        fixed: indices(&request.fixed),
        removed: indices(&request.removed),
        targets: request.targets.as_deref().map(indices),
        base: indices(&request.base),
        keep: indices(&request.keep),
        keep_out: indices(&request.keep_out),
        groups: request.groups.iter().map(|group| indices(group)).collect(),
        steady: request.steady.map(|steady| SteadyOrder {
            up: request.gravity.up,
            friction: request.gravity.friction,
            hands: steady.hands,
        }),
        assembly: request.assembly.as_ref().map(staging),
        no_cache: request.no_cache,
    })
}

fn staging(staging: &wire::Staging) -> Staging {
    let place = |m: &wire::MovedPart| (m.part as usize, m.motion);
    match staging {
        wire::Staging::None => Staging::None,
        wire::Staging::Beside(given) => Staging::Beside(given.iter().map(place).collect()),
    }
}

/// What a plan request moves, and a revision on the wire, as the geometry stage takes it.
pub(crate) fn moved(parts: &[wire::MovedPart]) -> Vec<(usize, Pose)> {
    parts.iter().map(|m| (m.part as usize, pose_from_waypoint(&m.motion))).collect()
}

/// A revision and the assembly that it revises. The bytes are a private copy.
pub(crate) fn revision(bytes: &AlignedBytes) -> Result<(AssemblyId, Revision), WireError> {
    let wire = wire_revision::Revision::decode(bytes.as_slice())
        .map_err(|e| WireError::new(ErrorCode::Malformed, format!("revision: {e}")))?;
    let replaced = wire.replaced.iter().map(|(place, part)| (*place as usize, source_mesh(part)));
    let revision = Revision {
        replaced: replaced.collect(),
        moved: moved(&wire.moved),
        added: wire.added.iter().map(source_part).collect(),
    };
    Ok((AssemblyId(wire.base), revision))
}

/// 0 stands for all on both sides; the configuration is the upper bound.
fn threads(asked: usize, most: usize) -> usize {
    match (asked, most) {
        (0, most) => most,
        (asked, 0) => asked,
        (asked, most) => asked.min(most),
    }
}

fn planner(index: u32) -> Result<Planner, WireError> {
    chosen("planner", index, &Planner::ALL, &wire::PLANNERS)
}

fn engine(index: u32) -> Result<Engine, WireError> {
    chosen("engine", index, &Engine::ALL, &wire::ENGINES)
}

fn actions(index: u32) -> Result<ActionSet, WireError> {
    chosen("action set", index, &ActionSet::ALL, &wire::ACTION_SETS)
}

fn static_analysis(index: u32) -> Result<StaticAnalysis, WireError> {
    chosen("static analysis", index, &StaticAnalysis::ALL, &wire::STATIC_ANALYSES)
}

fn penalty(given: &[wire::PenaltyRecord]) -> Result<PenaltyParameters, WireError> {
    let named = |r: &wire::PenaltyRecord| {
        let name = wire::PENALTY_PARAMETERS.get(r.parameter as usize).copied();
        Ok((name.ok_or_else(|| unsupported("penalty parameter", r.parameter, &[]))?, r.value))
    };
    let named = given.iter().map(named).collect::<Result<Vec<_>, WireError>>()?;
    PenaltyParameters::with(named)
        .map_err(|e| WireError::new(ErrorCode::Unsupported, format!("penalty: {e}")))
}

fn chosen<T: Copy>(what: &str, index: u32, all: &[T], names: &[&str]) -> Result<T, WireError> {
    all.get(index as usize).copied().ok_or_else(|| unsupported(what, index, names))
}

fn unsupported(what: &str, index: u32, names: &[&str]) -> WireError {
    let name = names.get(index as usize).map_or_else(|| format!("number {index}"), |n| format!("`{n}`"));
    WireError::new(ErrorCode::Unsupported, format!("this daemon does not offer the {what} {name}"))
}

/// A step as it travels.
pub(crate) fn step(step: &PlanStep) -> wire::Step {
    wire::Step {
        parts: numbers(&step.parts),
        of: step.of.map(|number| number as u32),
        ends: match step.ends {
            StepEnd::Out => wire::StepEnd::Out,
            StepEnd::Aside => wire::StepEnd::Aside,
            StepEnd::In => wire::StepEnd::In,
        },
        rotates: step.motion == MotionKind::Rotation,
        path: step.path.clone(),
        verified_depth: step.verified_depth,
        requires: numbers(&step.requires),
        wave: step.wave as u32,
        direction: step.direction,
    }
}

fn numbers(list: &[usize]) -> Vec<u32> {
    list.iter().map(|i| *i as u32).collect()
}

/// Everything of a plan but its steps, as it travels, with the report about it and what its making took this time.
pub(crate) fn summary(plan: &Plan, report: Option<&Report>, spent: &PlanStats) -> Vec<u8> {
    SummaryParts {
        assembly: plan.kind == PlanKind::Assembly,
        status: status(plan.status),
        steps: plan.steps.len() as u32,
        reason: plan.reason.as_deref(),
        planner: &plan.planner,
        engine: &plan.engine,
        units: plan.units.as_deref(),
        parts: plan.parts.iter().map(String::as_str).collect(),
        overlaps: plan
            .overlaps
            .iter()
            .map(|o| OverlapRecord { parts: o.parts.map(|p| p as u32), depth: o.depth })
            .collect(),
        blocked: plan.blocked.iter().map(|b| (b.part as u32, numbers(&b.by), b.action.as_str())).collect(),
        warnings: plan
            .warnings
            .iter()
            .map(|w| (w.part.map_or(NO_PART, |p| p as u32), w.message.as_str()))
            .collect(),
        removed: numbers(&plan.removed),
        targets: plan.targets.as_deref().map(numbers),
        fixed: numbers(&plan.fixed),
        keep: numbers(&plan.keep),
        base: (numbers(&plan.base.parts), plan.base.reason.as_deref()),
        remaining: numbers(&plan.remaining),
        kept_together: plan.kept_together.iter().map(|group| numbers(group)).collect(),
        free_together: plan.free_together.iter().map(|g| (numbers(&g.parts), g.direction)).collect(),
        poses: plan
            .poses
            .iter()
            .map(|(part, pose)| wire::MovedPart { part: *part as u32, reserved: 0, motion: *pose })
            .collect(),
        report: report.cloned(),
        stats: stats(spent),
    }
    .encode()
}

fn status(status: PlanStatus) -> u32 {
    match status {
        PlanStatus::Complete => 0,
        PlanStatus::Partial => 1,
        PlanStatus::Infeasible => 2,
        PlanStatus::Timeout => 3,
        PlanStatus::Cancelled => 4,
        PlanStatus::Exhausted => 5,
    }
}

fn stats(s: &PlanStats) -> Stats {
    Stats {
        simulations: s.simulations,
        simulations_run: s.simulations_run,
        sweeps: s.sweeps,
        states: s.states,
        sdf_time_s: s.sdf_time_s,
        static_analysis_time_s: s.static_analysis_time_s,
        path_time_s: s.path_time_s,
        verify_time_s: s.verify_time_s,
        total_time_s: s.total_time_s,
        sdf_hits: s.sdf_hits,
        blocking_hits: s.blocking_hits,
        graph_hits: s.graph_hits,
        motion_hits: s.motion_hits,
        plan_hit: u64::from(s.plan_hit),
    }
}

/// Progress as it is published.
pub(crate) fn progress(client: [u64; 2], request: u64, progress: Progress) -> ProgressSample {
    ProgressSample {
        client,
        request,
        simulations: progress.simulations,
        stage: match progress.stage {
            Stage::Sdf => STAGE_SDF,
            Stage::Search => STAGE_SEARCH,
            Stage::Transfer => STAGE_TRANSFER,
        },
        done: progress.done,
        total: progress.total,
        tried: progress.tried.map_or(0, tried),
    }
}

/// A part that does not fit is not named: what is tried is for display only.
fn tried(tried: Tried) -> u32 {
    let part = u32::try_from(tried.part).ok().filter(|part| *part < TRIED_TURNS - 1);
    part.map_or(0, |part| (part + 1) | if tried.turns { TRIED_TURNS } else { 0 })
}

/// An upload as the geometry stage takes it. The bytes are a private copy.
pub(crate) fn source_assembly(bytes: &AlignedBytes) -> Result<SourceAssembly, WireError> {
    let upload = Assembly::decode(bytes.as_slice())
        .map_err(|e| WireError::new(ErrorCode::Malformed, format!("upload: {e}")))?;
    Ok(SourceAssembly {
        name: upload.name.to_owned(),
        units: upload.units.map(str::to_owned),
        fixed: upload.fixed.iter().map(|n| (*n).to_owned()).collect(),
        parts: upload.parts.iter().map(source_part).collect(),
        ..SourceAssembly::default()
    })
}

fn source_part(part: &Part<'_>) -> SourcePart {
    SourcePart { name: part.name.to_owned(), origin: "upload".to_owned(), mesh: source_mesh(part) }
}

fn source_mesh(part: &Part<'_>) -> SourceMesh {
    SourceMesh { vertices: part.vertices.iter().collect(), triangles: part.triangles.to_vec() }
}

/// Why nothing was planned, with its stable code.
pub(crate) fn service_error(error: &ServiceError) -> WireError {
    let code = match error {
        ServiceError::UnknownAssembly => ErrorCode::UnknownHandle,
        ServiceError::NoSuchPart { .. } => ErrorCode::NoSuchPart,
        ServiceError::TargetStays { .. }
        | ServiceError::FixedAndKept { .. }
        | ServiceError::NoLength { .. }
        | ServiceError::NoDirection { .. }
        | ServiceError::NoFriction { .. }
        | ServiceError::NoGroups { .. } => ErrorCode::Unsupported,
        ServiceError::Geometry(GeometryError::Interrupted(Interrupt::Cancelled)) => ErrorCode::Cancelled,
        ServiceError::Geometry(GeometryError::Interrupted(Interrupt::DeadlinePassed)) => ErrorCode::Expired,
        ServiceError::Geometry(_) => ErrorCode::Geometry,
        ServiceError::Threads(_) => ErrorCode::Failed,
    };
    WireError::new(code, error.to_string())
}
