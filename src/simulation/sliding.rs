//! The engine `sliding`: motion in the limit of no inertia.
//!
//! At each step the wanted twist is projected onto what contact allows, in the metric of the
//! part's mass (rotation weighed by the squared radius of gyration), and the pose advances by the
//! result. Linear constraints are exact only at the pose where they were made, so the result is
//! checked at the trial pose against the triangles; what enters there adds constraints linearised
//! at that pose, and the step is projected again (sequential quadratic programming); a step
//! that still enters is halved. In free space the step is the certified clearance.

use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};

use crate::geometry::{Pose, interpolate};
use crate::termination::{Interrupt, Termination};

use super::contact::{Contact, Mover, Near, reduced};
use super::projection::{Projected, Row, project};
use super::{Action, End, Motion, Scene, Surroundings, TransitionFunction, exit_direction};

/// A pair may get this much deeper than its allowance, in the planning frame.
const DEPTH_TOLERANCE: f64 = 3e-4;
/// A motion that follows less than this share of the action (cos² of the angle between them) is
/// stuck.
const LEAST_SHARE: f64 = 0.05;
/// Longest contact step and longest step in free space, in the planning frame.
const CONTACT_STEP: f64 = 0.12;
pub(super) const FREE_STEP: f64 = 0.5;
/// How far the arc of one turning step may bulge from its chord.
const LARGEST_BULGE: f64 = 1e-3;
/// A pair may get this much deeper than its allowance half-way through a turning step.
const BULGE_TOLERANCE: f64 = 2.0 * DEPTH_TOLERANCE;
/// A free turn is at most so many contact steps long: exits show only at the ends of steps.
const LONGEST_FREE_TURN: f64 = 4.0;
const EAGER_ROUNDS: usize = 6;
const LAZY_ROUNDS: usize = 12;
/// Steps that the static analysis of a pair looks ahead (the paper's five extensions).
const STATIC_STEPS: usize = 5;
const HALVINGS: usize = 3;
const MOST_STEPS: usize = 8000;
/// Travel per turn below which a turning part is going nowhere.
const LEAST_TRAVEL: f64 = 0.01;

/// The engine.
#[derive(Debug, Clone, Copy, Default)]
pub struct SlidingEngine;

impl TransitionFunction for SlidingEngine {
    fn name(&self) -> &'static str {
        "sliding"
    }

    fn depth_tolerance(&self) -> f64 {
        DEPTH_TOLERANCE
    }

    fn simulate(
        &self,
        scene: &Scene,
        surroundings: &Surroundings,
        part: usize,
        start: &Pose,
        action: Action,
        termination: &Termination,
    ) -> Result<Motion, Interrupt> {
        let drive = Drive::new(scene, part, start, action);
        let mut mover = Mover::new(scene, part, *start);
        let mut path = vec![*start];
        let mut exit = None;
        let mut turning = Turning::new(&mover);
        let gather = |mover: &Mover<'_>| mover.near(surroundings, drive.step);
        let mut near = gather(&mover);
        for _ in 0..MOST_STEPS {
            termination.check()?;
            match drive.advance(&mover, &near, &gather) {
                Step::Stuck { with } => return Ok(Motion { path, end: End::Collision { with } }),
                Step::Moved { pose, turned, touching, near: there } => {
                    mover.pose = pose;
                    near = there;
                    path.push(pose);
                    if let Some(d) = exit_direction(scene, surroundings, part, &pose, exit) {
                        return Ok(Motion { path, end: End::Disassembled(d) });
                    }
                    exit = exit.or_else(|| Some(-action.force()).filter(|f| f.norm() > 0.5));
                    if turning.is_idle(&mover, turned, &touching) {
                        let touched = turning.all_touched;
                        let reason = "a whole turn brought neither travel nor new contact";
                        return Ok(Motion { path, end: End::Undecided { reason, touched } });
                    }
                }
            }
        }
        let touched = turning.all_touched;
        Ok(Motion { path, end: End::Undecided { reason: "the motion has too many steps", touched } })
    }
}

/// For each action, whether `other` alone keeps `part` at `pose` from following it by more than
/// `least`: the static analysis that suits this engine, which excludes nothing that could slide.
#[must_use]
pub fn pair_blocks(
    scene: &Scene,
    part: usize,
    pose: &Pose,
    other: usize,
    actions: &[Action],
    least: f64,
) -> Vec<bool> {
    let start = Mover::new(scene, part, *pose);
    let Some(first) = actions.first() else { return Vec::new() };
    let reach = Drive::new(scene, part, pose, *first).step;
    let gather = |mover: &Mover<'_>| {
        let mut near = Near { contacts: Vec::new(), clearance: f64::INFINITY };
        mover.near_pair(other, reach, &mut near);
        near
    };
    let near = gather(&start);
    if near.contacts.is_empty() {
        return vec![false; actions.len()];
    }
    let blocked = |action: &Action| {
        let drive = Drive::new(scene, part, pose, *action);
        let mut step = drive.advance(&start, &near, &gather);
        for _ in 0..STATIC_STEPS {
            let Step::Moved { pose: there, near, .. } = step else { return true };
            let mover = Mover::new(scene, part, there);
            if (mover.centre() - start.centre()).norm() > least {
                return false;
            }
            step = drive.advance(&mover, &near, &gather);
        }
        false
    };
    actions.iter().map(blocked).collect()
}

/// Sees when a part turns for ever: a whole turn that took it no further from where it started
/// than it had been, and brought no new contact. A thread gets further with every turn.
struct Turning {
    angle: f64,
    start: nalgebra::Point3<f64>,
    farthest: f64,
    farthest_before: f64,
    new_contact: bool,
    all_touched: Vec<usize>,
}

impl Turning {
    fn new(mover: &Mover<'_>) -> Self {
        Self {
            angle: 0.0,
            start: mover.centre(),
            farthest: 0.0,
            farthest_before: 0.0,
            new_contact: false,
            all_touched: Vec::new(),
        }
    }

    fn is_idle(&mut self, mover: &Mover<'_>, turned: f64, touching: &[usize]) -> bool {
        for &t in touching {
            if let Err(at) = self.all_touched.binary_search(&t) {
                self.all_touched.insert(at, t);
                self.new_contact = true;
            }
        }
        self.farthest = self.farthest.max((mover.centre() - self.start).norm());
        self.angle += turned;
        if self.angle < std::f64::consts::TAU {
            return false;
        }
        let idle = self.farthest - self.farthest_before < LEAST_TRAVEL && !self.new_contact;
        self.angle = 0.0;
        self.farthest_before = self.farthest;
        self.new_contact = false;
        idle
    }
}

/// What is near a mover's pose.
type Gather<'a> = &'a dyn Fn(&Mover<'_>) -> Near;

enum Step {
    /// What is near the new pose comes along: it was gathered to check that pose.
    Moved {
        pose: Pose,
        turned: f64,
        touching: Vec<usize>,
        near: Near,
    },
    Stuck {
        with: Vec<usize>,
    },
}

/// The wanted twist of an action for one part, and the metric.
struct Drive {
    /// Wanted twist (linear part first) of one contact step.
    wanted: Vector6<f64>,
    /// Square roots of the metric's diagonal: 1 for translation, the radius of gyration for rotation.
    metric: Vector6<f64>,
    gyration: f64,
    step: f64,
    turns: bool,
}

impl Drive {
    fn new(scene: &Scene, part: usize, start: &Pose, action: Action) -> Self {
        let shape = &scene.bodies[part].shape;
        let gyration = shape.mass.gyration_squared.sqrt();
        let smallest = shape.bounds().extents().min();
        let (force, torque) = (action.force(), action.torque());
        // Turning about the torque's axis keeps it the same in the shape.
        let axis = start.rotation.inverse() * torque;
        let radius = shape.radius_about(&shape.mass.centre, &axis);
        let mut step = (smallest * 0.5).clamp(0.03, CONTACT_STEP);
        if action.turns() && radius > 0.0 {
            // An arc of this length bulges by s²/8r.
            step = step.min((8.0 * radius * LARGEST_BULGE).sqrt());
        }
        // A force of half the torque over the part's radius, without inertia: v/ω = ρ²/(2r).
        let (v, turn) = match action {
            Action::Push(..) | Action::Drag(..) | Action::Turn(..) => (force, torque),
            Action::Screw(..) => (force * (gyration * gyration / (2.0 * shape.reach)), torque),
        };
        let fastest = v.norm() + turn.norm() * radius;
        let (v, turn) = (v * (step / fastest), turn * (step / fastest));
        Self {
            wanted: Vector6::new(v.x, v.y, v.z, turn.x, turn.y, turn.z),
            metric: Vector6::new(1.0, 1.0, 1.0, gyration, gyration, gyration),
            gyration,
            step,
            turns: action.turns(),
        }
    }

    /// One step from the mover's pose; `gather` finds what is near a pose.
    fn advance(&self, mover: &Mover<'_>, near: &Near, gather: Gather<'_>) -> Step {
        if near.contacts.is_empty() {
            let factor = (near.clearance.min(FREE_STEP) / self.step).max(1.0);
            let twist = self.wanted * if self.turns { factor.min(LONGEST_FREE_TURN) } else { factor };
            let there = Mover { pose: self.displaced(mover, &twist), ..*mover };
            return Self::moved(&there, gather(&there), &twist, Vec::new());
        }
        let mut with = Vec::new();
        for start in [Start::Certain, Start::Lazy] {
            for halving in 0..=HALVINGS {
                let wanted = self.wanted / f64::from(1u32 << halving);
                match self.attempt(mover, near, &wanted, start, gather) {
                    Attempt::Moved(step) => return step,
                    Attempt::Stuck(by) => {
                        with = by;
                        // A shorter step would be stopped by the same constraints.
                        break;
                    }
                    Attempt::Entered(by) => with = by,
                }
            }
        }
        Step::Stuck { with }
    }

    /// Projects the wanted twist until the trial pose is free of entry.
    fn attempt(
        &self,
        mover: &Mover<'_>,
        near: &Near,
        wanted: &Vector6<f64>,
        start: Start,
        gather: Gather<'_>,
    ) -> Attempt {
        let target = wanted.component_mul(&self.metric);
        let (mut rows, mut working) = (Vec::new(), Vec::new());
        if start != Start::Lazy {
            (rows, working) = self.chosen(mover, near, wanted);
        }
        let mut entered = Vec::new();
        for round in 0..if start == Start::Lazy { LAZY_ROUNDS } else { EAGER_ROUNDS } {
            let Some(result) = self.projected(&target, &rows, round == 0) else { break };
            let touching = others(&result.active, &rows);
            let share = result.w.dot(&target) / target.norm_squared();
            if share < LEAST_SHARE {
                return Attempt::Stuck(touching);
            }
            let twist = result.w.component_div(&self.metric);
            let trial = Mover { pose: self.displaced(mover, &twist), ..*mover };
            // From the second round on, those behind the constraints first: most of what enters is
            // among them.
            let mut violated = Vec::new();
            if round > 0 {
                violated = self.violations(&trial, &working, &twist);
            }
            if violated.is_empty() {
                let there = gather(&trial);
                violated = there.contacts.iter().filter(|c| c.gap < -DEPTH_TOLERANCE).copied().collect();
                if violated.is_empty() {
                    if self.turns && !self.is_clear_between(mover, near, &trial, &there, &twist) {
                        return Attempt::Entered(touching);
                    }
                    return Attempt::Moved(Self::moved(&trial, there, &twist, touching));
                }
            }
            tracing::trace!(
                contacts = near.contacts.len(),
                rows = rows.len(),
                round,
                share,
                violated = violated.len(),
                "entered"
            );
            entered = touching;
            entered.extend(violated.iter().map(|c| c.other));
            entered.sort_unstable();
            entered.dedup();
            let mut options = Vec::new();
            let deeper = violated.iter().filter_map(|c| {
                let row = self.freed(trial.way_out(c, &mut options)?);
                // Linearised at the trial pose: gap(u) ≈ gap(u₀) + a·(u − u₀) ≥ 0.
                let row = Row { b: row.b - row.a.dot(&twist), ..row };
                // A plane that the sample was beyond already at the start does not separate it.
                let separates = row.b >= -2.0 * DEPTH_TOLERANCE;
                if separates {
                    return Some(row);
                }
                let at_start = mover.remeasured(c, f64::INFINITY)?;
                mover.way_out(&at_start, &mut options).map(|r| self.freed(r))
            });
            let (worst, kept) = reduced(deeper, self.gyration);
            rows.extend(worst);
            working.extend(kept.into_iter().map(|i| violated[i]));
        }
        Attempt::Entered(entered)
    }

    /// Whether a turn that is clear at both ends is so on the way: points move on arcs, which
    /// bulge. Contacts further off at both ends than twice the bulge are not asked.
    fn is_clear_between(
        &self,
        from: &Mover<'_>,
        near: &Near,
        to: &Mover<'_>,
        there: &Near,
        twist: &Vector6<f64>,
    ) -> bool {
        let centre = from.scene.centre_in_shape(from.part);
        let middle = Mover { pose: interpolate(&from.pose, &to.pose, &centre, 0.5), ..*from };
        let turn = twist.fixed_rows::<3>(3).norm();
        let close = |c: &&Contact| c.gap < 0.25 * turn * turn * from.arm(c).norm();
        let mut closest = near.contacts.iter().chain(&there.contacts).filter(close);
        closest.all(|c| middle.remeasured(c, 0.0).is_none_or(|c| c.gap >= -BULGE_TOLERANCE))
    }

    /// One constraint per contact, reduced, and which contacts they come from. Where a contact
    /// leaves a choice of planes, the one is taken along which the motion gets furthest that the
    /// contacts without a choice allow: at the rim of a hole, that is the hole's wall.
    fn chosen(&self, mover: &Mover<'_>, near: &Near, wanted: &Vector6<f64>) -> (Vec<Row>, Vec<Contact>) {
        let mut options = Vec::with_capacity(near.contacts.len() * 2);
        let mut ends = Vec::with_capacity(near.contacts.len());
        for contact in &near.contacts {
            mover.options(contact, wanted, &mut options);
            ends.push(options.len());
        }
        for row in &mut options {
            *row = self.freed(*row);
        }
        let starts = std::iter::once(&0).chain(&ends);
        let groups: Vec<&[Row]> = starts.zip(&ends).map(|(a, b)| &options[*a..*b]).collect();
        let certain = groups.iter().filter(|g| g.len() == 1).map(|g| g[0]);
        let (certain, _) = reduced(certain, self.gyration);
        let likely = self.projected(&wanted.component_mul(&self.metric), &certain, true);
        let motion = likely.map_or(*wanted, |p| p.w.component_div(&self.metric));
        let best = |group: &&[Row]| {
            let mut best = group[0];
            for row in &group[1..] {
                if row.b + row.a.dot(&motion) > best.b + best.a.dot(&motion) + 1e-12 {
                    best = *row;
                }
            }
            best
        };
        let (rows, kept) = reduced(groups.iter().map(best), self.gyration);
        (rows, kept.into_iter().map(|i| near.contacts[i]).collect())
    }

    /// A row without the freedoms that the action does not give.
    fn freed(&self, mut row: Row) -> Row {
        if !self.turns {
            row.a.fixed_rows_mut::<3>(3).fill(0.0);
        }
        row
    }

    /// Projects in the metric. Rows that are slightly violated at the start ask to be left; if that
    /// is impossible, they are only kept from getting worse.
    fn projected(&self, target: &Vector6<f64>, rows: &[Row], first: bool) -> Option<Projected> {
        let scaled = |floor: f64| -> Vec<Row> {
            let scale = |r: &Row| Row { a: r.a.component_div(&self.metric), b: r.b.max(floor), ..*r };
            rows.iter().map(scale).collect()
        };
        let result = project(target, &scaled(f64::NEG_INFINITY));
        if result.is_none() && first { project(target, &scaled(0.0)) } else { result }
    }

    /// Of some contacts, those that are too deep at the trial pose, measured there.
    fn violations(&self, trial: &Mover<'_>, contacts: &[Contact], twist: &Vector6<f64>) -> Vec<Contact> {
        contacts
            .iter()
            .filter(|c| c.gap - trial.displacement(c, twist) < -DEPTH_TOLERANCE)
            .filter_map(|c| trial.remeasured(c, self.step))
            .filter(|c| c.gap < -DEPTH_TOLERANCE)
            .collect()
    }

    fn moved(there: &Mover<'_>, near: Near, twist: &Vector6<f64>, touching: Vec<usize>) -> Step {
        Step::Moved { pose: there.pose, turned: twist.fixed_rows::<3>(3).norm(), touching, near }
    }

    /// The pose after a twist about the centre of mass.
    fn displaced(&self, mover: &Mover<'_>, twist: &Vector6<f64>) -> Pose {
        let v: Vector3<f64> = twist.fixed_rows::<3>(0).into();
        if !self.turns {
            return Translation3::from(v) * mover.pose;
        }
        let turn: Vector3<f64> = twist.fixed_rows::<3>(3).into();
        let rotation = UnitQuaternion::from_scaled_axis(turn);
        let c = mover.centre();
        let mut pose = mover.pose;
        pose.append_rotation_wrt_point_mut(&rotation, &c);
        pose.append_translation_mut(&Translation3::from(v));
        pose.rotation.renormalize();
        pose
    }
}

/// What the first projection of a step knows of the contacts; tried in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Start {
    /// One plane each: the one along which the motion gets furthest that contacts without a choice
    /// allow.
    Certain,
    /// None: constraints come only from what enters at a trial, linearised there. Finds the way
    /// where every plane chosen before the motion is the wrong one of a corner's.
    Lazy,
}

enum Attempt {
    Moved(Step),
    /// The linear constraints alone stop it.
    Stuck(Vec<usize>),
    /// No allowed pose was found at this length of step.
    Entered(Vec<usize>),
}

/// The parts behind active rows, ascending; rows that hardly push are left out.
fn others(active: &[(usize, f64)], rows: &[Row]) -> Vec<usize> {
    let strongest = active.iter().map(|(_, m)| *m).fold(0.0, f64::max);
    let mut out: Vec<_> =
        active.iter().filter(|(_, m)| *m > 1e-6 * strongest).map(|(i, _)| rows[*i].other).collect();
    out.sort_unstable();
    out.dedup();
    out
}
