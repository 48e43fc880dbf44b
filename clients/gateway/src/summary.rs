//! What ends a plan, as messages.

use sbdp_client::{Blocked, FreeGroup, Overlap, PlanStatus, Stats, Summary, Warning};

use crate::answer::{motion, vector};
use crate::proto;

pub(crate) fn summary(summary: Summary) -> proto::Summary {
    proto::Summary {
        status: status(summary.status).into(),
        reason: summary.reason,
        assembly: summary.assembly,
        planner: summary.planner,
        engine: summary.engine,
        units: summary.units,
        steps: summary.steps,
        parts: summary.parts,
        removed: summary.removed,
        targets: summary.targets.map(part_list),
        fixed: summary.fixed,
        keep: summary.keep,
        base: summary.base.parts,
        base_reason: summary.base.reason,
        remaining: summary.remaining,
        kept_together: summary.kept_together.into_iter().map(part_list).collect(),
        free_together: summary.free_together.into_iter().map(free_group).collect(),
        poses: summary
            .poses
            .into_iter()
            .map(|(part, pose)| proto::MovedPart { part, motion: Some(motion(pose)) })
            .collect(),
        blocked: summary.blocked.into_iter().map(blocked).collect(),
        overlaps: summary.overlaps.into_iter().map(overlap).collect(),
        warnings: summary.warnings.into_iter().map(warning).collect(),
        stats: Some(stats(&summary.stats)),
    }
}

fn status(status: PlanStatus) -> proto::PlanStatus {
    match status {
        PlanStatus::Complete => proto::PlanStatus::Complete,
        PlanStatus::Partial => proto::PlanStatus::Partial,
        PlanStatus::Infeasible => proto::PlanStatus::Infeasible,
        PlanStatus::Timeout => proto::PlanStatus::Timeout,
        PlanStatus::Cancelled => proto::PlanStatus::Cancelled,
        PlanStatus::Exhausted => proto::PlanStatus::Exhausted,
    }
}

fn part_list(parts: Vec<u32>) -> proto::PartList {
    proto::PartList { parts }
}

fn free_group(group: FreeGroup) -> proto::FreeGroup {
    proto::FreeGroup { parts: group.parts, direction: Some(vector(group.direction)) }
}

fn blocked(blocked: Blocked) -> proto::Blocked {
    proto::Blocked { part: blocked.part, by: blocked.by, action: blocked.action }
}

fn overlap(overlap: Overlap) -> proto::Overlap {
    let [first, second] = overlap.parts;
    proto::Overlap { first, second, depth: overlap.depth }
}

fn warning(warning: Warning) -> proto::Warning {
    proto::Warning { part: warning.part, message: warning.message }
}

fn stats(stats: &Stats) -> proto::Stats {
    proto::Stats {
        simulations: stats.simulations,
        simulations_run: stats.simulations_run,
        sweeps: stats.sweeps,
        states: stats.states,
        sdf_time_s: stats.sdf_time_s,
        static_analysis_time_s: stats.static_analysis_time_s,
        path_time_s: stats.path_time_s,
        verify_time_s: stats.verify_time_s,
        total_time_s: stats.total_time_s,
        sdf_hits: stats.sdf_hits,
        blocking_hits: stats.blocking_hits,
        graph_hits: stats.graph_hits,
        motion_hits: stats.motion_hits,
        plan_hit: stats.plan_hit != 0,
    }
}
