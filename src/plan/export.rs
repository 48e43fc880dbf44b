//! Plans as JSON: the contract `sbdp-plan/2`, written by `sbdp plan ASSEMBLY --json FILE` and
//! described in `src/plan/JSON.md`. Parts go by their names. Later versions may add fields; those that
//! are here keep their meaning.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    Blocked, FreeGroup, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd,
    Warning,
};
use crate::geometry::Waypoint;

/// The name and version of the contract.
pub const SCHEMA: &str = "sbdp-plan/2";

/// A plan as the contract describes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanDocument {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// `disassembly` or `assembly`.
    #[serde(default = "disassembly")]
    pub kind: String,
    /// Where the meshes are, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceDocument>,
    /// `complete`, `partial`, `infeasible`, `timeout`, `cancelled` or `exhausted`.
    pub status: String,
    /// Why it is not complete.
    pub reason: Option<String>,
    /// The planner, as `sbdp-star`.
    pub planner: String,
    /// The engine, as `sliding`.
    pub engine: String,
    /// The unit of all lengths, if known.
    pub units: Option<String>,
    /// All parts, in natural order.
    pub parts: Vec<String>,
    /// Groups that the input names, outer ones before inner ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupDocument>,
    /// The state at the start.
    pub initial: InitialDocument,
    /// Parts that must come out, or all.
    pub targets: Option<Vec<String>>,
    /// Parts that may not move.
    pub fixed: Vec<String>,
    /// The part that the rest is taken off, or built up on; empty where parts are fixed, or where it had to leave.
    pub base: Vec<String>,
    /// Why it was chosen.
    pub base_reason: Option<String>,
    /// The removals, or insertions, in order.
    pub steps: Vec<StepDocument>,
    /// Parts that are in the assembly at the end (in an assembly plan: from the start).
    pub remaining: Vec<String>,
    /// Groups that left together and were not taken apart: this was not required, or no way was found.
    pub kept_together: Vec<Vec<String>>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<FreeGroupDocument>,
    /// What blocks the parts that should have come off.
    pub blocked: Vec<BlockedDocument>,
    /// Overlaps at the assembled pose.
    pub overlaps: Vec<OverlapDocument>,
    /// Findings about the input.
    pub warnings: Vec<WarningDocument>,
    /// Counters and times.
    pub stats: StatsDocument,
}

/// The kind of a document without one.
fn disassembly() -> String {
    PlanKind::Disassembly.name().to_owned()
}

/// The files of the meshes, and what was done to them before planning, except `initial.poses`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceDocument {
    /// The file or folder of the assembly.
    pub assembly: String,
    /// A hash of all meshes as they were read, to recognise them.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub content: String,
    /// The quaternion `[w, x, y, z]` by which everything was rotated about the origin (`--rotate`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<[f64; 4]>,
    /// Parts with the mesh of another file (`--replaced`).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub replaced: BTreeMap<String, String>,
    /// Files and folders of further parts (`--added`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<String>,
    /// What counted as a part in files that hold several (`--split`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<String>,
    /// Patterns of the names of parts and files that were left out (`--ignore`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignore: Vec<String>,
    /// mm: how far triangles made of STEP files may be from the surfaces (`--deflection`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deflection: Option<f64>,
}

/// A group that the input names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroupDocument {
    /// The group's name; for nested groups, after the names of the outer ones, separated by slashes.
    pub name: String,
    /// All parts in it, including those of nested groups.
    pub parts: Vec<String>,
}

/// The state that planning began with, where it differs from the assembly as given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct InitialDocument {
    /// Parts that were removed before.
    pub removed: Vec<String>,
    /// Parts that stood elsewhere, and where. In an assembly plan also those that waited for their turn.
    pub poses: BTreeMap<String, Waypoint>,
}

/// Parts that move as one rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepDocument {
    /// The parts that move.
    pub parts: Vec<String>,
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts belong;
    /// null for parts that leave the assembly. A group is taken apart as it stood in the assembly.
    pub of: Option<usize>,
    /// `out`: clear of everything that they stood with; `aside`: elsewhere among the others; `in`: in their places
    /// (assembly plans).
    pub ends: String,
    /// `translation`, or `rotation` if any waypoint is turned against the first.
    pub motion: String,
    /// Rigid transforms x′ = q·x + t, `[x, y, z, qw, qx, qy, qz]`, of the parts as they stand when the step begins (of
    /// an assembly plan: when it ends), so that the first (the last) is the identity; between two, the centre of the
    /// box of all these parts, axis-aligned as they stand then, moves on a line, and the rotation slerps.
    pub path: Vec<Waypoint>,
    /// Deepest penetration along the path beyond the pair's assembled depth.
    pub verified_depth: f64,
    /// Numbers of the steps, from 0, that must be done before this exact path is free, ascending: necessary, and
    /// sufficient with what these require in turn.
    pub requires: Vec<usize>,
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: usize,
    /// The unit vector along which the middle of the part's box moves on the last leg of the path; null where it does
    /// not.
    pub direction: Option<[f64; 3]>,
}

/// Parts that can begin to move together where nothing leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreeGroupDocument {
    /// The parts.
    pub parts: Vec<String>,
    /// The unit vector along which they begin.
    pub direction: [f64; 3],
}

/// A part that remains and what blocks it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockedDocument {
    /// The part.
    pub part: String,
    /// The parts that block it.
    pub by: Vec<String>,
    /// The action that they blocked, as `+x`.
    pub action: String,
}

/// An overlap at the assembled pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverlapDocument {
    /// The pair.
    pub parts: [String; 2],
    /// Its depth.
    pub depth: f64,
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct WarningDocument {
    /// The part that it is about, if any.
    pub part: Option<String>,
    /// What was found, and what was done about it.
    pub message: String,
}

/// Counters, and times in seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StatsDocument {
    /// Uses of the transition function, remembered ones included.
    pub simulations: u64,
    /// Uses of the transition function that were computed.
    pub simulations_run: u64,
    /// Straight sweeps that proved a removal.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Reading and healing, before the total begins; null where the daemon planned.
    #[serde(default)]
    pub load_time_s: Option<f64>,
    /// Distance fields.
    pub sdf_time_s: f64,
    /// Overlaps at the assembled pose; null where the daemon planned.
    #[serde(default)]
    pub overlap_time_s: Option<f64>,
    /// Blocking graphs.
    pub static_analysis_time_s: f64,
    /// Simulation.
    pub path_time_s: f64,
    /// Shortening and verification.
    pub verify_time_s: f64,
    /// Paths to where insertions begin; null where there are none, or the daemon planned.
    #[serde(default)]
    pub transfer_time_s: Option<f64>,
    /// The total.
    pub total_time_s: f64,
    /// What was remembered.
    pub cache: CacheDocument,
}

/// What was found in the cache.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheDocument {
    /// Distance fields.
    pub sdf_hits: u64,
    /// Overlaps and blocking relations of pairs, and planes that parts touch.
    pub blocking_hits: u64,
    /// States whose blocking graphs needed no analysis.
    #[serde(default)]
    pub graph_hits: u64,
    /// Motions.
    pub motion_hits: u64,
    /// Verified paths; null where the daemon planned.
    #[serde(default)]
    pub verdict_hits: Option<u64>,
    /// The whole plan.
    pub plan_hit: bool,
}

impl PlanKind {
    /// The kind as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Disassembly => "disassembly",
            Self::Assembly => "assembly",
        }
    }
}

impl PlanStatus {
    /// The status as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Partial => "partial",
            Self::Infeasible => "infeasible",
            Self::Exhausted => "exhausted",
            Self::Timeout => "timeout",
            Self::Cancelled => "cancelled",
        }
    }
}

impl MotionKind {
    /// The kind of motion as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Translation => "translation",
            Self::Rotation => "rotation",
        }
    }
}

impl StepEnd {
    /// The end as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Out => "out",
            Self::Aside => "aside",
            Self::In => "in",
        }
    }
}

impl Plan {
    /// The name of a part.
    #[must_use]
    pub fn part_name(&self, part: usize) -> &str {
        self.parts.get(part).map_or("?", String::as_str)
    }

    fn names(&self, parts: &[usize]) -> Vec<String> {
        parts.iter().map(|&p| self.part_name(p).to_owned()).collect()
    }
}

impl PlanDocument {
    /// The document of a plan.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
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
            initial: InitialDocument { removed: plan.names(&plan.removed), poses: poses(plan) },
            targets: plan.targets.as_ref().map(|t| plan.names(t)),
            fixed: plan.names(&plan.fixed),
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

    /// The document as JSON, on one line.
    ///
    /// # Errors
    /// None that is known: all keys are text.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }

    /// Reads a document.
    ///
    /// # Errors
    /// It is no JSON, or does not fit the contract.
    pub fn from_json(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
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
    use crate::plan::Base;

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
            r#""initial":{"removed":["10"],"poses":{"1":[0.0,0.5,0.0,1.0,0.0,0.0,0.0]}},"targets":["1"],"fixed":["0"],"#,
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
        assert_eq!(PlanDocument::new(&plan()).to_json().unwrap(), expected);
    }

    #[test]
    fn what_is_absent_is_null() {
        let bare = Plan { reason: None, units: None, targets: None, ..plan() };
        let json: serde_json::Value =
            serde_json::from_str(&PlanDocument::new(&bare).to_json().unwrap()).unwrap();
        for key in ["reason", "units", "targets"] {
            assert!(json[key].is_null());
        }
    }

    #[test]
    fn a_document_reads_back() {
        let document = PlanDocument::new(&plan());
        assert_eq!(PlanDocument::from_json(&document.to_json().unwrap()).unwrap(), document);
    }
}
