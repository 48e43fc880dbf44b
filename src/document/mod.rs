//! Plans as documents: a plan in the words of the contract `sbdp-plan/2` (JSON.md), with what is known of the files that it
//! is about, and where the parts stand while it is carried out.

mod files;
mod placements;

use std::collections::BTreeMap;

pub use files::{absolute, content_of, source, with_files};
pub(crate) use placements::MOTION_ROUNDING;
pub use placements::{Placements, StepFrame, StepParts};
pub use sbdp_ipc::document::{
    BlockedDocument, CacheDocument, ClearanceDocument, ClosestDocument, FallDocument, FreeGroupDocument,
    GroupDocument, InitialDocument, OverlapDocument, PartNames, PlanDocument, SCHEMA, SourceDocument,
    StabilityDocument, StatsDocument, StepDocument, ToolDocument, UnstableDocument, WarningDocument,
};

use crate::geometry::Waypoint;
use crate::plan::{Blocked, FreeGroup, Overlap, Plan, PlanKind, PlanStats, PlanStep, Warning};

/// What a plan does, whose kind is one that is known.
#[must_use]
pub fn kind_of(plan: &PlanDocument) -> PlanKind {
    if plan.kind == PlanKind::Assembly.name() { PlanKind::Assembly } else { PlanKind::Disassembly }
}

impl From<&Plan> for PlanDocument {
    fn from(plan: &Plan) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            kind: plan.kind.name().to_owned(),
            source: None,
            status: plan.status.name().to_owned(),
            reason: plan.reason.clone(),
            planner: plan.planner.clone(),
            engine: plan.engine.clone(),
            units: plan.units.clone(),
            parts: plan.parts.clone(),
            groups: Vec::new(),
            initial: InitialDocument {
                removed: plan.names(&plan.removed),
                poses: poses(plan),
                stability: None,
            },
            targets: plan.targets.as_ref().map(|t| plan.names(t)),
            fixed: plan.names(&plan.fixed),
            keep: plan.names(&plan.keep),
            base: plan.names(&plan.base.parts),
            base_reason: plan.base.reason.clone(),
            steps: plan.steps.iter().map(|s| step(plan, s)).collect(),
            remaining: plan.names(&plan.remaining),
            kept_together: plan.kept_together.iter().map(|group| plan.names(group)).collect(),
            free_together: plan.free_together.iter().map(|group| free_group(plan, group)).collect(),
            blocked: plan.blocked.iter().map(|b| blocked(plan, b)).collect(),
            overlaps: plan.overlaps.iter().map(|o| overlap(plan, o)).collect(),
            warnings: plan.warnings.iter().map(|w| warning(plan, w)).collect(),
            stats: stats(&plan.stats),
        }
    }
}

fn poses(plan: &Plan) -> BTreeMap<String, Waypoint> {
    plan.poses.iter().map(|(part, pose)| (plan.part_name(*part).to_owned(), *pose)).collect()
}

fn step(plan: &Plan, step: &PlanStep) -> StepDocument {
    StepDocument {
        parts: plan.names(&step.parts),
        of: step.of,
        ends: step.ends.name().to_owned(),
        motion: step.motion.name().to_owned(),
        path: step.path.clone(),
        verified_depth: step.verified_depth,
        requires: step.requires.clone(),
        wave: step.wave,
        direction: step.direction,
        stability: None,
        clearance: None,
        tools: None,
    }
}

fn free_group(plan: &Plan, group: &FreeGroup) -> FreeGroupDocument {
    FreeGroupDocument { parts: plan.names(&group.parts), direction: group.direction }
}

fn blocked(plan: &Plan, blocked: &Blocked) -> BlockedDocument {
    BlockedDocument {
        part: plan.part_name(blocked.part).to_owned(),
        by: plan.names(&blocked.by),
        action: blocked.action.clone(),
    }
}

fn overlap(plan: &Plan, overlap: &Overlap) -> OverlapDocument {
    OverlapDocument { parts: overlap.parts.map(|p| plan.part_name(p).to_owned()), depth: overlap.depth }
}

fn warning(plan: &Plan, warning: &Warning) -> WarningDocument {
    WarningDocument {
        part: warning.part.map(|p| plan.part_name(p).to_owned()),
        message: warning.message.clone(),
    }
}

fn stats(stats: &PlanStats) -> StatsDocument {
    StatsDocument {
        simulations: stats.simulations,
        simulations_run: stats.simulations_run,
        sweeps: stats.sweeps,
        states: stats.states,
        load_time_s: stats.load_time_s,
        sdf_time_s: stats.sdf_time_s,
        overlap_time_s: stats.overlap_time_s,
        static_analysis_time_s: stats.static_analysis_time_s,
        path_time_s: stats.path_time_s,
        verify_time_s: stats.verify_time_s,
        transfer_time_s: stats.transfer_time_s,
        total_time_s: stats.total_time_s,
        cache: CacheDocument {
            sdf_hits: stats.sdf_hits,
            blocking_hits: stats.blocking_hits,
            graph_hits: stats.graph_hits,
            motion_hits: stats.motion_hits,
            verdict_hits: stats.verdict_hits,
            plan_hit: stats.plan_hit,
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{Base, MotionKind, PlanStatus, StepEnd};

    fn plan() -> Plan {
        Plan {
            kind: PlanKind::Disassembly,
            status: PlanStatus::Infeasible,
            reason: Some("nothing moves".into()),
            planner: "sbdp-star".into(),
            engine: "sliding".into(),
            units: Some("mm".into()),
            parts: vec!["0".into(), "1".into(), "2".into(), "10".into()],
            removed: vec![3],
            poses: vec![(1, [0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0])],
            targets: Some(vec![1]),
            fixed: vec![0],
            keep: vec![2],
            base: Base { parts: vec![1], reason: Some("it is the largest".into()) },
            steps: vec![PlanStep {
                parts: vec![2],
                of: None,
                ends: StepEnd::Out,
                motion: MotionKind::Rotation,
                path: vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0]],
                verified_depth: 0.001,
                requires: vec![],
                wave: 0,
                direction: Some([0.0, 1.0, 0.0]),
            }],
            remaining: vec![0, 1],
            kept_together: vec![vec![2, 3]],
            free_together: vec![FreeGroup { parts: vec![0, 1], direction: [1.0, 0.0, 0.0] }],
            blocked: vec![Blocked { part: 1, by: vec![0], action: "+x".into() }],
            overlaps: vec![Overlap { parts: [0, 1], depth: 0.25 }],
            warnings: vec![
                Warning { part: Some(2), message: "open".into() },
                Warning { part: None, message: "small".into() },
            ],
            stats: PlanStats {
                simulations: 7,
                overlap_time_s: Some(0.5),
                plan_hit: true,
                ..Default::default()
            },
        }
    }

    #[test]
    fn the_shape_is_the_contract_to_the_letter() {
        let expected = concat!(
            r#"{"schema":"sbdp-plan/2","kind":"disassembly","status":"infeasible","reason":"nothing moves","#,
            r#""planner":"sbdp-star","engine":"sliding","units":"mm","parts":["0","1","2","10"],"#,
            r#""initial":{"removed":["10"],"poses":{"1":[0.0,0.5,0.0,1.0,0.0,0.0,0.0]}},"targets":["1"],"fixed":["0"],"keep":["2"],"#,
            r#""base":["1"],"base_reason":"it is the largest","#,
            r#""steps":[{"parts":["2"],"of":null,"ends":"out","motion":"rotation","#,
            r#""path":[[0.0,0.0,0.0,1.0,0.0,0.0,0.0],[0.0,0.5,0.0,0.0,1.0,0.0,0.0]],"verified_depth":0.001,"requires":[],"wave":0,"direction":[0.0,1.0,0.0]}],"#,
            r#""remaining":["0","1"],"kept_together":[["2","10"]],"#,
            r#""free_together":[{"parts":["0","1"],"direction":[1.0,0.0,0.0]}],"blocked":[{"part":"1","by":["0"],"action":"+x"}],"#,
            r#""overlaps":[{"parts":["0","1"],"depth":0.25}],"#,
            r#""warnings":[{"part":"2","message":"open"},{"part":null,"message":"small"}],"#,
            r#""stats":{"simulations":7,"simulations_run":0,"sweeps":0,"states":0,"load_time_s":null,"#,
            r#""sdf_time_s":0.0,"overlap_time_s":0.5,"#,
            r#""static_analysis_time_s":0.0,"path_time_s":0.0,"verify_time_s":0.0,"transfer_time_s":null,"total_time_s":0.0,"#,
            r#""cache":{"sdf_hits":0,"blocking_hits":0,"graph_hits":0,"motion_hits":0,"verdict_hits":null,"plan_hit":true}}}"#,
        );
        assert_eq!(PlanDocument::from(&plan()).to_json().unwrap(), expected);
    }

    #[test]
    fn what_is_absent_is_null() {
        let bare = Plan { reason: None, units: None, targets: None, ..plan() };
        let json: serde_json::Value =
            serde_json::from_str(&PlanDocument::from(&bare).to_json().unwrap()).unwrap();
        for key in ["reason", "units", "targets"] {
            assert!(json[key].is_null());
        }
    }

    #[test]
    fn a_document_reads_back() {
        let document = PlanDocument::from(&plan());
        assert_eq!(PlanDocument::from_json(&document.to_json().unwrap()).unwrap(), document);
    }
}
