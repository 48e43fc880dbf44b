//! From a search's outcome in the planning frame to a plan in the input's units.

use std::time::Duration;

use nalgebra::{Point3, Vector3};

use crate::assembling::Insertion;
use crate::geometry::{Assembly, Part, Pose, Repetition, Waypoint, pose_from_waypoint, waypoint_from_pose};
use crate::plan::{
    Base, Blocked, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd, Warning,
};
use crate::search::{BlockedAction, Outcome, PlanRequest, Removal};
use crate::tolerances::DEEP_OVERLAP;

/// Turns below this are rounding.
const NO_TURN: f64 = 1e-9;
/// Length in the planning frame. A shorter shift is rounding: coordinates up to 10 have errors of 1e-15, and the shortest
/// leg that a search makes is a million times this. Half and double change nothing.
const NO_SHIFT: f64 = 1e-9;

/// A removal as a step of a plan.
pub(super) fn removal(assembly: &Assembly, removal: &Removal) -> PlanStep {
    let Removal { parts, of, aside, path, depth, requires, wave } = removal;
    let ends = if *aside { StepEnd::Aside } else { StepEnd::Out };
    let stands = &path[0];
    Moved { parts, of: *of, ends, path, stands, depth: *depth, requires, wave: *wave }.step(assembly)
}

/// An insertion as a step of a plan.
pub(super) fn insertion(assembly: &Assembly, insertion: &Insertion) -> PlanStep {
    let Insertion { parts, of, aside, path, depth, requires, wave } = insertion;
    let ends = if *aside { StepEnd::Aside } else { StepEnd::In };
    let stands = &path[path.len() - 1];
    Moved { parts, of: *of, ends, path, stands, depth: *depth, requires, wave: *wave }.step(assembly)
}

/// A step in the planning frame.
struct Moved<'a> {
    parts: &'a [usize],
    of: Option<usize>,
    ends: StepEnd,
    /// Poses of the part's shape, or of the body of all parts.
    path: &'a [Pose],
    /// The pose that the path of the step is relative to.
    stands: &'a Pose,
    depth: f64,
    requires: &'a [usize],
    wave: usize,
}

impl Moved<'_> {
    fn step(&self, assembly: &Assembly) -> PlanStep {
        // A body of several parts has the middle of their box as origin, and is not turned.
        let middle = match *self.parts {
            [part] => {
                let Part { planning_from_shape, bounds, .. } = &assembly.parts[part];
                planning_from_shape.inverse_transform_point(&bounds.centre())
            }
            _ => Point3::origin(),
        };
        let waypoint = |pose| waypoint_from_pose(&motion(assembly, self.stands, pose));
        let path: Vec<Waypoint> = self.path.iter().map(waypoint).collect();
        let turns = path.iter().any(|w| w[3..] != path[0][3..]);
        PlanStep {
            parts: self.parts.to_vec(),
            of: self.of,
            ends: self.ends,
            motion: if turns { MotionKind::Rotation } else { MotionKind::Translation },
            path,
            verified_depth: self.depth / assembly.scale,
            requires: self.requires.to_vec(),
            wave: self.wave,
            direction: last_direction(self.path, &middle).map(Into::into),
        }
    }
}

/// The unit vector along which a point moves on the last leg of a path, unless it stays where it is.
fn last_direction(path: &[Pose], point: &Point3<f64>) -> Option<Vector3<f64>> {
    let [.., from, to] = path else { return None };
    (to * point - from * point).try_normalize(NO_SHIFT)
}

/// The transform of a part's mesh from where it was given to where a pose of its shape puts it.
pub(super) fn waypoint(assembly: &Assembly, part: usize, pose: &Pose) -> Waypoint {
    let part = &assembly.parts[part];
    let motion = motion(assembly, &part.planning_from_shape, pose);
    // What was given where it stands keeps its numbers.
    waypoint_from_pose(&if part.moved == Pose::identity() { motion } else { motion * part.moved })
}

/// The pose of a part's shape that a transform of its mesh from where it was given leads to.
pub(super) fn pose(assembly: &Assembly, part: usize, waypoint: &Waypoint) -> Pose {
    let part = &assembly.parts[part];
    let mut motion = pose_from_waypoint(waypoint) * part.moved.inverse();
    motion.translation.vector *= assembly.scale;
    motion * part.planning_from_shape
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

/// Overlaps so deep that a part is likely in a wrong place. Of parts that are given twice it is known why.
pub(super) fn deep_overlaps(assembly: &Assembly, found: &[(usize, usize, f64)]) -> Vec<String> {
    let thickness = |part: usize| assembly.parts[part].bounds.extents().min();
    let doubt = |&(a, b, depth): &(usize, usize, f64)| {
        let (smaller, larger) = if thickness(a) <= thickness(b) { (a, b) } else { (b, a) };
        let share = depth / thickness(smaller);
        let [smaller, larger] = [smaller, larger].map(|part| &assembly.parts[part].name);
        (share >= DEEP_OVERLAP).then(|| {
            let percent = 100.0 * share;
            format!("{smaller} is in {larger} by {percent:.0} % of its smallest side as assembled: check where it stands")
        })
    };
    let is_repeated = |a: usize, b: usize| {
        let has_both =
            |repetition: &Repetition| [a, b].iter().all(|part| repetition.parts().any(|p| p == *part));
        assembly.repetitions.iter().any(has_both)
    };
    found.iter().filter(|&&(a, b, _)| !is_repeated(a, b)).filter_map(doubt).collect()
}

/// The findings about the input. The one about parts that are given twice is left out if enough of them are removed.
pub(super) fn warnings(assembly: &Assembly, is_gone: impl Fn(usize) -> bool) -> Vec<Warning> {
    let finding = |(part, message): &(usize, String)| Warning { part: Some(*part), message: message.clone() };
    let twice = assembly.repetitions.iter().filter_map(|r| r.without(&is_gone));
    let twice = twice.map(|r| Warning { part: None, message: r.message(|part| &assembly.parts[part].name) });
    assembly.findings.iter().map(finding).chain(twice).collect()
}

/// Everything that is known before the search.
pub(super) struct PlanFrame<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) request: &'a PlanRequest,
    pub(super) fixed: Vec<usize>,
    pub(super) removed: Vec<usize>,
    /// Parts that were given as the base and are there.
    pub(super) base: Vec<usize>,
    /// Parts that are to be kept and are there.
    pub(super) keep: Vec<usize>,
    pub(super) overlaps: Vec<Overlap>,
    /// What else the reader of the plan should know.
    pub(super) notes: Vec<String>,
}

/// What of an answer was there already.
#[derive(Default)]
pub(super) struct CacheHits {
    /// Distance fields.
    pub(super) fields: u64,
    /// Overlaps and blocking relations of pairs, and planes that parts touch.
    pub(super) blocking: u64,
    pub(super) motions: u64,
    pub(super) verdicts: u64,
    /// The whole.
    pub(super) plan: bool,
}

/// What a request spent its time on, beside its search.
#[derive(Default)]
pub(super) struct StageTimes {
    pub(super) fields: Duration,
    pub(super) overlaps: Duration,
    /// Its search included.
    pub(super) total: Duration,
}

/// What a search found, in the planning frame, now or before.
pub(super) struct SearchAnswer {
    pub(super) outcome: Outcome,
    pub(super) times: StageTimes,
    pub(super) found: CacheHits,
}

impl PlanFrame<'_> {
    /// The plan of a finished search.
    pub(super) fn plan(self, answer: SearchAnswer) -> Plan {
        let SearchAnswer { outcome, times, found } = answer;
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
            blocking_hits: found.blocking,
            graph_hits: c.graphs_recalled,
            motion_hits: found.motions,
            verdict_hits: Some(found.verdicts),
            plan_hit: found.plan,
            ..PlanStats::default()
        };
        let kept_together = outcome.kept_together();
        let is_gone = |part: &usize| outcome.remaining.binary_search(part).is_err();
        let left = |parts: &[usize], message: &str| {
            let left = parts.iter().copied().filter(is_gone);
            left.map(|part| Warning { part: Some(part), message: message.to_owned() }).collect::<Vec<_>>()
        };
        let base_left = left(&self.base, "it was given as a base, and left: nothing else did any more");
        let kept_left = left(&self.keep, "it was to be kept, and left: others could not leave otherwise");
        let steps = outcome.removals.iter().map(|r| removal(self.assembly, r)).collect();
        let blocked = outcome.blocked.into_iter().map(|BlockedAction { part, action, by }| Blocked {
            part,
            by,
            action,
        });
        let name = |part: usize| self.assembly.parts[part].name.clone();
        let reason = outcome.reason.map(|reason| reason.text(&outcome.unfinished, name));
        let status = outcome.status;
        let empty = self.empty(status, reason);
        Plan {
            steps,
            base: outcome.base,
            remaining: outcome.remaining,
            kept_together,
            free_together: outcome.free_together,
            blocked: blocked.collect(),
            stats,
            warnings: empty.warnings.into_iter().chain(base_left).chain(kept_left).collect(),
            ..empty
        }
    }

    /// A plan without steps, for a request that ended before its search began.
    pub(super) fn empty(self, status: PlanStatus, reason: Option<String>) -> Plan {
        let count = self.assembly.parts.len();
        let mut warnings = warnings(self.assembly, |part| self.removed.contains(&part));
        warnings.extend(self.notes.into_iter().map(|message| Warning { part: None, message }));
        let kind = match self.request.assembly {
            Some(_) => PlanKind::Assembly,
            None => PlanKind::Disassembly,
        };
        Plan {
            kind,
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
            keep: self.keep,
            base: Base::default(),
            steps: Vec::new(),
            kept_together: Vec::new(),
            free_together: Vec::new(),
            blocked: Vec::new(),
            overlaps: self.overlaps,
            warnings,
            stats: PlanStats::default(),
        }
    }
}
