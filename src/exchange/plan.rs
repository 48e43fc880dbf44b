//! A plan received from the daemon.

use sbdp_client as client;

use crate::plan::{
    Base, Blocked, FreeGroup, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd,
    Warning,
};

/// Converts a step for the planning modules.
#[must_use]
pub fn plan_step(step: &client::Step) -> PlanStep {
    let step = step.view();
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

/// Converts a plan for the planning modules.
#[must_use]
pub fn plan(s: client::Summary, steps: Vec<PlanStep>) -> Plan {
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
