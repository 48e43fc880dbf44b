//! One step of a motion: the wanted twist, projected until nothing enters.
//!
//! Linear constraints are exact only at the pose where they were made, so the result of a
//! projection is checked at the trial pose against the triangles; what enters there adds
//! constraints linearised at that pose, and the step is projected again (sequential quadratic
//! programming); a step that still enters is halved.

use crate::budgets::{EAGER_ROUNDS, LAZY_ROUNDS, STEP_HALVINGS, STEPS_PER_POLL};

mod clearance;
mod release;
#[cfg(test)]
mod tests;

use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};

use crate::contact::constraint::VelocityConstraint;
use crate::contact::sampled::{Contact, ContactSet, ContactSource, MovingBody};
use crate::geometry::{Pose, Shape, interpolate};
use crate::scene::Scene;
use crate::termination::{Interrupt, Poll, try_all};
use crate::tolerances::{
    BULGE_TOLERANCE, CONTACT_REACH, CONTACT_STEP, DEPTH_TOLERANCE, FREE_STEP, FREE_TURN_STEPS, PRESSED_SHARE,
    SHORTEST_CONTACT_STEP, STEP_BULGE, STEP_OVERSHOOT, STEP_STRETCH, STUCK_SHARE,
};

use super::super::Action;
use super::super::projection::{Projected, project};
use super::super::reduction::reduced;
use release::FreeStep;

/// What a step came to.
pub(super) enum Step {
    Moved(Moved),
    Stuck { with: Vec<usize> },
}

/// A step that was made.
pub(super) struct Moved {
    pub(super) pose: Pose,
    /// The angle by which it turned, in radians.
    pub(super) turned: f64,
    pub(super) touching: Vec<usize>,
    /// The contacts at the new pose, which were gathered to check it.
    pub(super) near: ContactSet,
    /// Twists against what holds the part back, of any length.
    pub(super) pressing: Vec<Vector6<f64>>,
    /// The poses on the way, if the step was not straight.
    pub(super) via: Vec<Pose>,
}

/// The wanted twist of an action for a part, and the metric.
pub(super) struct Drive {
    /// Wanted twist (linear part first) of one contact step.
    wanted: Vector6<f64>,
    /// Square roots of the metric's diagonal: 1 for translation, the radius of gyration for rotation.
    metric: Vector6<f64>,
    gyration: f64,
    step: f64,
    turns: bool,
    /// Whether it slides along what it is pressed to in the longest steps. A part that is pulled and turned at once
    /// finds its thread in short steps.
    takes_long_steps: bool,
}

impl Drive {
    pub(super) fn new(scene: &Scene, part: usize, start: &Pose, action: Action) -> Self {
        let shape = &scene.bodies[part].shape;
        let gyration = shape.mass.gyration_squared.sqrt();
        let (force, torque) = (action.force(), action.torque());
        // Turning about the torque's axis keeps it the same in the shape.
        let axis = start.rotation.inverse() * torque;
        let radius = shape.radius_about(&shape.mass.centre, &axis);
        let mut step = contact_step(shape);
        if action.turns() && radius > 0.0 {
            // An arc of this length bulges by s²/8r.
            step = step.min((8.0 * radius * STEP_BULGE).sqrt());
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
            takes_long_steps: matches!(action, Action::Drag(..) | Action::Turn(..)),
        }
    }

    /// The length of a step in contact.
    pub(super) fn step(&self) -> f64 {
        self.step
    }

    /// The reach within which contacts are gathered.
    pub(super) fn reach(&self) -> f64 {
        self.step * CONTACT_REACH
    }

    /// The start of a step, as in [`Self::advance`].
    pub(super) fn constraints(
        &self,
        mover: &MovingBody<'_>,
        near: &ContactSet,
    ) -> Result<KnownConstraints, Interrupt> {
        self.chosen(mover, near, &self.wanted)
    }

    /// The first projection of a step.
    pub(super) fn solved(&self, known: &KnownConstraints) -> Option<Projected> {
        self.projected(&self.wanted.component_mul(&self.metric), &known.rows, true)
    }

    /// One step from the mover's pose.
    pub(super) fn advance(
        &self,
        mover: &MovingBody<'_>,
        near: &mut ContactSet,
        around: &mut dyn ContactSource,
    ) -> Result<Step, Interrupt> {
        if near.contacts.is_empty() && near.clearance >= self.step {
            let factor = (near.clearance.min(FREE_STEP) / self.step).max(1.0);
            let twist = self.wanted * if self.turns { factor.min(FREE_TURN_STEPS) } else { factor };
            let there = MovingBody { pose: self.displaced(mover, &twist), ..*mover };
            let near = around.near(&there)?;
            return Ok(Step::Moved(Self::moved(&there, near, &twist, Vec::new(), Vec::new())));
        }
        let mut with = Vec::new();
        for start in [FirstGuess::Certain, FirstGuess::Lazy] {
            for halving in 0..=STEP_HALVINGS {
                let wanted = self.wanted / f64::from(1u32 << halving);
                let known = match start {
                    FirstGuess::Certain => self.chosen(mover, near, &wanted)?,
                    FirstGuess::Lazy => {
                        KnownConstraints { rows: Vec::new(), working: Vec::new(), rounds: LAZY_ROUNDS }
                    }
                };
                let is_first = start == FirstGuess::Certain && halving == 0;
                if let Some(longer) = is_first.then(|| self.stretched(mover, &known)).flatten() {
                    let attempt = self.attempt(mover, near, (&longer, true), known.clone(), around)?;
                    if let Attempt::Moved(step) = attempt {
                        return Ok(Step::Moved(step));
                    }
                }
                match self.attempt(mover, near, (&wanted, false), known, around)? {
                    Attempt::Moved(step) => return Ok(Step::Moved(step)),
                    Attempt::Stuck(by) => {
                        with = by;
                        // The same constraints would stop a shorter step.
                        break;
                    }
                    Attempt::Entered(by) => with = by,
                }
                around.add_known(mover, near)?;
            }
        }
        // The wall of a slot may also be taken for a wall that stops the pull: then nothing stops it.
        Ok(self.pulled_free(mover, near, around)?.map_or(Step::Stuck { with }, Step::Moved))
    }

    /// The wanted twist, lengthened so that the motion that contacts allow is as long as a contact step; `None` if it
    /// nearly is. Without inertia the part goes the same way in fewer steps.
    fn stretched(&self, mover: &MovingBody<'_>, known: &KnownConstraints) -> Option<Vector6<f64>> {
        if !self.takes_long_steps || known.rows.is_empty() {
            return None;
        }
        let target = self.wanted.component_mul(&self.metric);
        let result = self.solved(known)?;
        let share = result.w.dot(&target) / target.norm_squared();
        let stretch = self.longest(mover, &result.w.component_div(&self.metric));
        let is_worth_it = share >= STUCK_SHARE && stretch >= STEP_STRETCH.start;
        is_worth_it.then(|| self.wanted * stretch.min(STEP_STRETCH.end))
    }

    /// How many times as long as a twist a contact step may be: by the travel of points, and by the bulge of their
    /// arcs.
    fn longest(&self, mover: &MovingBody<'_>, twist: &Vector6<f64>) -> f64 {
        let shape = &mover.body.shape;
        let (v, turn): (Vector3<f64>, Vector3<f64>) =
            (twist.fixed_rows::<3>(0).into(), twist.fixed_rows::<3>(3).into());
        let by_travel = |arc: f64| contact_step(shape) / (v.norm() + arc);
        let Some(axis) = (mover.pose.rotation.inverse() * turn).try_normalize(0.0) else {
            return by_travel(0.0);
        };
        let radius = shape.radius_about(&shape.mass.centre, &axis);
        let arc = turn.norm() * radius;
        // An arc of length s bulges by s²/8r.
        by_travel(arc).min((8.0 * radius * STEP_BULGE).sqrt() / arc)
    }

    /// Projects the wanted twist until nothing enters at the trial pose. A lengthened motion is no longer than a
    /// contact step.
    fn attempt(
        &self,
        mover: &MovingBody<'_>,
        near: &ContactSet,
        (wanted, is_stretched): (&Vector6<f64>, bool),
        known: KnownConstraints,
        around: &mut dyn ContactSource,
    ) -> Result<Attempt, Interrupt> {
        let target = wanted.component_mul(&self.metric);
        let KnownConstraints { mut rows, mut working, rounds } = known;
        let mut entered = Vec::new();
        for round in 0..rounds {
            mover.check()?;
            // Constraints that nearly contradict each other meet far away; nothing on the way there would be checked.
            let is_near = |p: &Projected| p.w.norm_squared() <= STEP_OVERSHOOT * target.norm_squared();
            let Some(result) = self.projected(&target, &rows, round == 0).filter(is_near) else { break };
            let touching = result.others(&rows);
            let share = result.w.dot(&target) / target.norm_squared();
            if share < STUCK_SHARE {
                return Ok(Attempt::Stuck(touching));
            }
            let mut twist = result.w.component_div(&self.metric);
            if is_stretched {
                twist *= self.longest(mover, &twist).min(1.0);
            }
            let trial = MovingBody { pose: self.displaced(mover, &twist), ..*mover };
            // From the second round on, the contacts behind the constraints come first: most of what enters is among
            // them.
            let mut violated = Vec::new();
            if round > 0 {
                violated = self.violations(&trial, &working, &twist);
            }
            if violated.is_empty() {
                let there = around.near(&trial)?;
                violated = there.contacts.iter().filter(|c| c.gap < -DEPTH_TOLERANCE).copied().collect();
                if violated.is_empty() {
                    if self.turns
                        && !self.is_clear_between((mover, near), (&trial, &there), &twist, around)?
                    {
                        return Ok(Attempt::Entered(touching));
                    }
                    let taken = FreeStep {
                        mover,
                        near,
                        twist: &twist,
                        result: &result,
                        rows: &rows,
                        contacts: &working,
                    };
                    if let Some(released) = self.released(&taken, around)? {
                        return Ok(Attempt::Moved(released));
                    }
                    let pressing = self.pressing(&target, &result, &rows);
                    return Ok(Attempt::Moved(Self::moved(&trial, there, &twist, touching, pressing)));
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
                let row = VelocityConstraint { b: row.b - row.a.dot(&twist), ..row };
                // A plane that the sample was below at the start already does not separate it.
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
        Ok(Attempt::Entered(entered))
    }

    /// Whether a turn whose ends are free is free in between: points move on arcs, which bulge, and a part that is
    /// also pulled may turn before it is out. Contacts that are further off at both ends than twice the bulge are
    /// left out.
    fn is_clear_between(
        &self,
        (from, near): (&MovingBody<'_>, &ContactSet),
        (to, there): (&MovingBody<'_>, &ContactSet),
        twist: &Vector6<f64>,
        around: &mut dyn ContactSource,
    ) -> Result<bool, Interrupt> {
        let centre = from.scene.centre_in_shape(from.part);
        let turn = twist.fixed_rows::<3>(3).norm();
        let close = |c: &&Contact| c.gap < 0.25 * turn * turn * from.arm(c).norm();
        let places: &[f64] = if self.is_pulled(twist) { &[0.5, 0.25, 0.75] } else { &[0.5] };
        try_all(places, |&place| {
            let between = MovingBody { pose: interpolate(&from.pose, &to.pose, &centre, place), ..*from };
            let mut closest = near.contacts.iter().chain(&there.contacts).filter(close);
            Ok(closest.all(|c| between.remeasured(c, 0.0).is_none_or(|c| c.gap >= -BULGE_TOLERANCE))
                && around.is_clear_at(&between)?)
        })
    }

    /// One constraint for each contact, reduced, and the contacts that they come from. If a contact has several
    /// planes, the constraint is of the plane along which the motion gets furthest, as far as the contacts with one
    /// plane allow: at the rim of a hole, that is the wall of the hole.
    fn chosen(
        &self,
        mover: &MovingBody<'_>,
        near: &ContactSet,
        wanted: &Vector6<f64>,
    ) -> Result<KnownConstraints, Interrupt> {
        let poll = Poll::every(STEPS_PER_POLL, mover.termination);
        let mut options = Vec::with_capacity(near.contacts.len() * 2);
        let mut ends = Vec::with_capacity(near.contacts.len());
        for contact in &near.contacts {
            poll.check()?;
            mover.options(contact, wanted, &mut options);
            ends.push(options.len());
        }
        for row in &mut options {
            *row = self.freed(*row);
        }
        let starts = std::iter::once(&0).chain(&ends);
        let groups: Vec<&[VelocityConstraint]> = starts.zip(&ends).map(|(a, b)| &options[*a..*b]).collect();
        let certain = groups.iter().filter(|g| g.len() == 1).map(|g| g[0]);
        let (certain, _) = reduced(certain, self.gyration);
        let likely = self.projected(&wanted.component_mul(&self.metric), &certain, true);
        let motion = likely.map_or(*wanted, |p| p.w.component_div(&self.metric));
        let best = |group: &&[VelocityConstraint]| {
            let mut best = group[0];
            for row in &group[1..] {
                if row.b + row.a.dot(&motion) > best.b + best.a.dot(&motion) + 1e-12 {
                    best = *row;
                }
            }
            best
        };
        mover.check()?;
        let (rows, kept) = reduced(groups.iter().map(best), self.gyration);
        let working = kept.into_iter().map(|i| near.contacts[i]).collect();
        Ok(KnownConstraints { rows, working, rounds: EAGER_ROUNDS })
    }

    /// A constraint without the freedoms that the action does not have.
    fn freed(&self, mut row: VelocityConstraint) -> VelocityConstraint {
        if !self.turns {
            row.a.fixed_rows_mut::<3>(3).fill(0.0);
        }
        row
    }

    /// Projects in the metric. Constraints that are slightly violated at the start are to be left; if that is
    /// impossible, they must not get worse.
    fn projected(
        &self,
        target: &Vector6<f64>,
        rows: &[VelocityConstraint],
        first: bool,
    ) -> Option<Projected> {
        let scaled = |floor: f64| -> Vec<VelocityConstraint> {
            let scale = |r: &VelocityConstraint| VelocityConstraint {
                a: r.a.component_div(&self.metric),
                b: r.b.max(floor),
                ..*r
            };
            rows.iter().map(scale).collect()
        };
        let result = project(target, &scaled(f64::NEG_INFINITY));
        if result.is_none() && first { project(target, &scaled(0.0)) } else { result }
    }

    /// The contacts that are too deep at the trial pose, measured there.
    fn violations(&self, trial: &MovingBody<'_>, contacts: &[Contact], twist: &Vector6<f64>) -> Vec<Contact> {
        contacts
            .iter()
            .filter(|c| c.gap - trial.displacement(c, twist) < -DEPTH_TOLERANCE)
            .filter_map(|c| trial.remeasured(c, self.step))
            .filter(|c| c.gap < -DEPTH_TOLERANCE)
            .collect()
    }

    /// The directions in which contact holds a projected motion back: of a translation, each contact alone; of a
    /// motion that may turn, all that contact takes away, as its points of contact change all the time.
    fn pressing(
        &self,
        target: &Vector6<f64>,
        result: &Projected,
        rows: &[VelocityConstraint],
    ) -> Vec<Vector6<f64>> {
        let lost = target - result.w;
        if lost.norm_squared() < PRESSED_SHARE * target.norm_squared() {
            return Vec::new();
        }
        if self.turns {
            return vec![lost.component_div(&self.metric)];
        }
        let normals: Vec<Vector6<f64>> = result.active.iter().map(|(i, _)| rows[*i].a).collect();
        let alone = |i: usize| {
            // Without the part that pushes into the others.
            let mut basis: Vec<Vector6<f64>> = Vec::new();
            for (_, n) in normals.iter().enumerate().filter(|(j, _)| *j != i) {
                let rest = basis.iter().fold(*n, |rest, b| rest - b * b.dot(n));
                basis.extend(rest.try_normalize(0.1));
            }
            let n = normals[i];
            basis.iter().fold(-n, |rest, b| rest + b * b.dot(&n)).try_normalize(0.1)
        };
        (0..normals.len()).filter_map(alone).collect()
    }

    fn moved(
        there: &MovingBody<'_>,
        near: ContactSet,
        twist: &Vector6<f64>,
        touching: Vec<usize>,
        pressing: Vec<Vector6<f64>>,
    ) -> Moved {
        let turned = twist.fixed_rows::<3>(3).norm();
        Moved { pose: there.pose, turned, touching, near, pressing, via: Vec::new() }
    }

    /// The pose after a twist about the centre of mass.
    fn displaced(&self, mover: &MovingBody<'_>, twist: &Vector6<f64>) -> Pose {
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

/// The longest step of a shape in contact.
pub(super) fn contact_step(shape: &Shape) -> f64 {
    (shape.bounds().extents().min() * 0.5).clamp(SHORTEST_CONTACT_STEP, CONTACT_STEP)
}

/// What the first projection of a step knows of the contacts. Tried in this order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FirstGuess {
    /// One plane for each contact: the one along which the motion gets furthest, as far as contacts with one plane
    /// allow.
    Certain,
    /// No contact: constraints come only from what enters at a trial, linearised there. This finds the way where
    /// every plane that was chosen beforehand is the wrong one of a corner's.
    Lazy,
}

/// The constraints from which a step starts.
#[derive(Clone)]
pub(super) struct KnownConstraints {
    /// The constraints.
    rows: Vec<VelocityConstraint>,
    /// The contacts that they come from.
    working: Vec<Contact>,
    /// The largest number of projections.
    rounds: usize,
}

enum Attempt {
    Moved(Moved),
    /// The linear constraints alone stop it.
    Stuck(Vec<usize>),
    /// No allowed pose was found at this length of step.
    Entered(Vec<usize>),
}
