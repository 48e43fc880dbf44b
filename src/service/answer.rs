//! From a search's outcome in the planning frame to a plan in the input's units.

use std::time::Duration;

use crate::cache::Reused;
use crate::geometry::{Assembly, Pose, Waypoint, waypoint_from_pose};
use crate::plan::{Blocked, MotionKind, Overlap, Plan, PlanStats, PlanStatus, PlanStep, Warning};
use crate::search::{BlockedAction, Outcome, PlanRequest, Removal};

/// Turns below this are rounding.
const NO_TURN: f64 = 1e-9;

/// A removal as a step of a plan.
pub(super) fn step(assembly: &Assembly, removal: &Removal) -> PlanStep {
    let start = removal.path.first().copied().unwrap_or_default();
    let motions: Vec<Pose> = removal.path.iter().map(|p| motion(assembly, &start, p)).collect();
    let turns = motions.iter().any(|m| waypoint_from_pose(m)[3] < 1.0);
    let moved = assembly.parts[removal.part].moved;
    // What was given where it stands keeps its numbers.
    let of_mesh = |m: &Pose| if moved == Pose::identity() { *m } else { m * moved };
    let path = motions.iter().map(|m| waypoint_from_pose(&of_mesh(m))).collect();
    PlanStep {
        part: removal.part,
        motion: if turns { MotionKind::Rotation } else { MotionKind::Translation },
        path,
        verified_depth: removal.depth / assembly.scale,
        waited_for: removal.waited_for.clone(),
    }
}

/// The transform of the assembled mesh that brings it from `start` to `pose`, in input units.
fn motion(assembly: &Assembly, start: &Pose, pose: &Pose) -> Pose {
    let mut moved = pose * start.inverse();
    if start.rotation.angle_to(&pose.rotation) < NO_TURN {
        moved = Pose::from(pose.translation.vector - start.translation.vector);
    }
    moved.translation.vector /= assembly.scale;
    moved.rotation.renormalize();
    moved
}

/// The parts that stand elsewhere than where they were given.
fn poses(assembly: &Assembly) -> Vec<(usize, Waypoint)> {
    let moved = assembly.parts.iter().enumerate().filter(|(_, part)| part.moved != Pose::identity());
    moved.map(|(i, part)| (i, waypoint_from_pose(&part.moved))).collect()
}

pub(super) fn overlaps(assembly: &Assembly, found: &[(usize, usize, f64)]) -> Vec<Overlap> {
    found.iter().map(|&(a, b, d)| Overlap { parts: [a, b], depth: d / assembly.scale }).collect()
}

pub(super) fn warnings(assembly: &Assembly) -> Vec<Warning> {
    let warning = |(part, message): &(usize, String)| Warning { part: Some(*part), message: message.clone() };
    assembly.findings.iter().map(warning).collect()
}

/// Everything that is known before the search.
pub(super) struct Frame<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) request: &'a PlanRequest,
    pub(super) fixed: Vec<usize>,
    pub(super) removed: Vec<usize>,
    pub(super) overlaps: Vec<Overlap>,
    /// What else the reader of the plan should know.
    pub(super) notes: Vec<String>,
}

/// What of an answer was there already.
#[derive(Default)]
pub(super) struct Found {
    /// Distance fields.
    pub(super) fields: u64,
    pub(super) pieces: Reused,
    /// The whole.
    pub(super) plan: bool,
}

/// What a request spent its time on, beside its search.
#[derive(Default)]
pub(super) struct Times {
    pub(super) fields: Duration,
    pub(super) overlaps: Duration,
    /// Its search included.
    pub(super) total: Duration,
}

impl Frame<'_> {
    /// The plan of a finished search.
    pub(super) fn plan(self, outcome: Outcome, times: &Times, found: &Found) -> Plan {
        let c = outcome.counters;
        let stats = PlanStats {
            simulations: c.simulations,
            simulations_run: c.simulations - c.recalled,
            sweeps: c.sweeps,
            states: c.states,
            sdf_time_s: times.fields.as_secs_f64(),
            overlap_time_s: Some(times.overlaps.as_secs_f64()),
            static_analysis_time_s: c.static_analysis.as_secs_f64(),
            path_time_s: c.simulation.as_secs_f64(),
            verify_time_s: c.verification.as_secs_f64(),
            total_time_s: times.total.as_secs_f64(),
            sdf_hits: found.fields,
            blocking_hits: found.pieces.overlaps + found.pieces.blocking,
            motion_hits: found.pieces.motions,
            verdict_hits: Some(found.pieces.verdicts),
            plan_hit: found.plan,
            ..PlanStats::default()
        };
        let steps = outcome.removals.iter().map(|r| step(self.assembly, r)).collect();
        let blocked = outcome.blocked.into_iter().map(|BlockedAction { part, action, by }| Blocked {
            part,
            by,
            action,
        });
        let (status, reason) = (outcome.status, outcome.reason);
        Plan {
            steps,
            remaining: outcome.remaining,
            blocked: blocked.collect(),
            stats,
            ..self.empty(status, reason)
        }
    }

    /// A plan without steps, for a request that ended before its search began.
    pub(super) fn empty(self, status: PlanStatus, reason: Option<String>) -> Plan {
        let count = self.assembly.parts.len();
        let mut warnings = warnings(self.assembly);
        warnings.extend(self.notes.into_iter().map(|message| Warning { part: None, message }));
        Plan {
            status,
            reason,
            planner: self.request.planner.name().to_owned(),
            engine: self.request.engine.name().to_owned(),
            units: self.assembly.units.clone(),
            parts: self.assembly.parts.iter().map(|p| p.name.clone()).collect(),
            remaining: (0..count).filter(|p| !self.removed.contains(p)).collect(),
            poses: poses(self.assembly),
            removed: self.removed,
            targets: self.request.targets.clone(),
            fixed: self.fixed,
            steps: Vec::new(),
            blocked: Vec::new(),
            overlaps: self.overlaps,
            warnings,
            stats: PlanStats::default(),
        }
    }
}
