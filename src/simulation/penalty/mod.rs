//! The engine `penalty`: the paper's simulation.
//!
//! Rigid-body dynamics under a constant acceleration, with penalty forces where contact points are
//! inside the other part's distance field (`contacts`), integrated by implicit steps (`step`).
//! After each planning time step the velocity is zeroed; the part is stuck when it is then near a
//! state that it was in before.
//!
//! Guarantees: deterministic to the bit; along the path no sample of either surface is deeper than
//! its pair's allowed penetration and the declared tolerance, measured on the triangles (`depth`). The paper
//! has no such check. A block of steps in which it fails ends at the last waypoint that held, and
//! the next begins there at rest. Known misses: features that enter only between two samples; parts
//! that turn so fast that a thin one is crossed within a single step.

use crate::tolerances::{PENALTY_REACH, PENALTY_TRAVEL, TOUCHED};

mod contacts;
mod depth;
mod parameters;
mod points;
mod slopes;
mod step;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::Vector3;

use crate::geometry::{Pose, SampleTree, Shape};
use crate::scene::{Scene, StandingParts, exit_direction};
use crate::termination::{Interrupt, Termination};

use super::{Action, End, Motion, TransitionFunction};
use contacts::Contacts;
pub use parameters::PenaltyParameters;
use points::PointCache;
use step::{BodyState, PenaltyDrive, RigidBody, Stepper};

/// The engine. It remembers the contact points of shapes that it met; clones share them.
#[derive(Debug, Clone, Default)]
pub struct PenaltyEngine {
    parameters: PenaltyParameters,
    cache: Arc<PointCache>,
}

impl PartialEq for PenaltyEngine {
    fn eq(&self, other: &Self) -> bool {
        self.parameters == other.parameters
    }
}

impl PenaltyEngine {
    /// An engine with other parameters than the paper's.
    #[must_use]
    pub fn new(parameters: PenaltyParameters) -> Self {
        Self { parameters, cache: Arc::default() }
    }

    /// Its parameters.
    #[must_use]
    pub fn parameters(&self) -> &PenaltyParameters {
        &self.parameters
    }

    /// The points of a shape at which contact acts, in the shape's frame.
    #[must_use]
    pub fn contact_points(&self, shape: &Arc<Shape>) -> Arc<SampleTree> {
        self.cache.of(shape, self.parameters.longest_edge)
    }

    fn drive(&self, shape: &Shape, action: Action) -> PenaltyDrive {
        let p = &self.parameters;
        let turning = p.force * p.torque_factor;
        let pulling = match action {
            Action::Push(..) | Action::Drag(..) | Action::Turn(..) => p.force,
            // A force of half the torque over the part's radius: a/α = ρ²/(2r).
            Action::Screw(..) => turning * shape.mass.gyration_squared / (2.0 * shape.reach),
        };
        PenaltyDrive {
            linear: action.force() * pulling,
            angular: action.torque() * turning,
            turns: action.turns(),
        }
    }
}

impl TransitionFunction for PenaltyEngine {
    fn name(&self) -> &'static str {
        "penalty"
    }

    fn depth_tolerance(&self) -> f64 {
        self.parameters.depth_tolerance()
    }

    fn simulate(
        &self,
        scene: &Scene,
        surroundings: &StandingParts,
        part: usize,
        start: &Pose,
        action: Action,
        termination: &Termination,
    ) -> Result<Motion, Interrupt> {
        let parameters = &self.parameters;
        let shape = &scene.bodies[part].shape;
        let contacts = Contacts::new(scene, surroundings, part, parameters, &self.cache);
        let drive = self.drive(shape, action);
        let pairs = contacts.pairs.len();
        let run = PenaltyRun {
            surroundings,
            parameters,
            stepper: Stepper::new(RigidBody::new(shape), drive, parameters, pairs),
            contacts,
            path: vec![*start],
            slack: f64::NEG_INFINITY,
            touched: vec![false; pairs],
            hint: Some(-action.force()).filter(|f| f.norm() > 0.5),
        };
        run.simulate(termination)
    }
}

/// How a block of steps ended.
enum BlockedPairs {
    /// The hulls are apart.
    Out(Vector3<f64>),
    /// All its time is over.
    Over(BodyState),
    /// Going on would have been too deep; the state is that of the last waypoint.
    Cut(BodyState),
}

/// One motion.
struct PenaltyRun<'a> {
    surroundings: &'a StandingParts,
    parameters: &'a PenaltyParameters,
    stepper: Stepper<'a>,
    contacts: Contacts<'a>,
    path: Vec<Pose>,
    /// How far a point may still travel before contact points must be gathered again.
    slack: f64,
    /// Per pair, whether it was in contact in this block.
    touched: Vec<bool>,
    hint: Option<Vector3<f64>>,
}

impl PenaltyRun<'_> {
    fn simulate(mut self, termination: &Termination) -> Result<Motion, Interrupt> {
        let mut state = self.stepper.rigid.at_rest(&self.path[0]);
        let mut earlier = vec![state];
        let mut ever_touched = vec![false; self.touched.len()];
        let mut was_cut = false;
        for _ in 0..self.parameters.most_blocks {
            let block = self.block(state, termination)?;
            ever_touched.iter_mut().zip(&self.touched).for_each(|(ever, now)| *ever |= now);
            let (after, is_cut) = match block {
                BlockedPairs::Out(direction) => return Ok(self.ended(End::Disassembled(direction))),
                BlockedPairs::Over(after) => (after, false),
                BlockedPairs::Cut(after) => (after, true),
            };
            state = after;
            // What came in too fast is tried once more from rest before it counts as stuck.
            if is_cut && !was_cut {
                was_cut = true;
                continue;
            }
            was_cut = is_cut;
            if earlier.iter().any(|e| self.are_similar(e, &state)) {
                let end = self.stuck(&ever_touched);
                return Ok(self.ended(end));
            }
            earlier.push(state);
        }
        let end = End::Undecided {
            reason: "the motion has too many steps".into(),
            touched: self.parts(&ever_touched),
        };
        Ok(self.ended(end))
    }

    /// The part came back to where it was.
    fn stuck(&self, ever_touched: &[bool]) -> End {
        if self.touched.contains(&true) {
            return End::Collision { with: self.parts(&self.touched) };
        }
        let reason = "the part came back to an earlier pose without contact";
        End::Undecided { reason: reason.into(), touched: self.parts(ever_touched) }
    }

    fn ended(self, end: End) -> Motion {
        tracing::debug!(
            part = self.contacts.part,
            tally = ?self.stepper.tally,
            waypoints = self.path.len(),
            ?end,
            "simulated"
        );
        // Not remembered, so nobody asks again.
        Motion::simulated(self.path, Vec::new(), end)
    }

    /// The parts of marked pairs, ascending.
    fn parts(&self, marked: &[bool]) -> Vec<usize> {
        let pairs = self.contacts.pairs.iter().zip(marked);
        let mut out: Vec<_> = pairs.filter(|(_, m)| **m).map(|(p, _)| p.other).collect();
        out.sort_unstable();
        out.dedup();
        out
    }

    fn are_similar(&self, a: &BodyState, b: &BodyState) -> bool {
        (a.centre - b.centre).norm() < self.parameters.similar_translation
            && a.rotation.angle_to(&b.rotation) < self.parameters.similar_rotation
    }

    /// Steps from rest until the velocity is zeroed again.
    fn block(&mut self, from: BodyState, termination: &Termination) -> Result<BlockedPairs, Interrupt> {
        self.touched.fill(false);
        let steps = self.parameters.block_steps();
        let (mut state, mut held) = (from.at_rest(), from.at_rest());
        let (mut since, mut travelled) = (0, 0.0);
        for step in 1..=steps {
            termination.check()?;
            let (next, travel) = self.step(&state);
            state = next;
            since += 1;
            travelled += travel;
            if since < self.parameters.steps_per_waypoint && travelled < PENALTY_TRAVEL && step < steps {
                continue;
            }
            // The path ends where the part does.
            let least = if step < steps { TOUCHED } else { f64::MIN_POSITIVE };
            match self.waypoint(&state, travelled, least) {
                PenaltyWaypoint::Deep => return Ok(BlockedPairs::Cut(held)),
                PenaltyWaypoint::Out(direction) => return Ok(BlockedPairs::Out(direction)),
                PenaltyWaypoint::Held => travelled = 0.0,
                PenaltyWaypoint::Same => {}
            }
            held = state.at_rest();
            since = 0;
        }
        Ok(BlockedPairs::Over(held))
    }

    /// The state after one time step, and how far a point travelled at most.
    fn step(&mut self, state: &BodyState) -> (BodyState, f64) {
        let mut reach = 2.0 * self.stepper.expected_travel(state);
        if self.slack < reach {
            self.gather(state, reach);
        }
        self.contacts.start_step(&step::placement(state, &nalgebra::Vector6::zeros()));
        let mut step = self.stepper.step(state, &self.contacts);
        // Contact threw it further than expected: something may have been missed.
        while step.travel > self.slack {
            reach = 2.0 * step.travel;
            self.gather(state, reach);
            self.contacts.start_step(&step::placement(state, &nalgebra::Vector6::zeros()));
            step = self.stepper.step(state, &self.contacts);
        }
        self.slack -= step.travel;
        for (touched, now) in self.touched.iter_mut().zip(self.stepper.touched()) {
            *touched |= now;
        }
        (step.state, step.travel)
    }

    fn gather(&mut self, state: &BodyState, reach: f64) {
        self.slack = reach.max(PENALTY_REACH);
        self.contacts.gather(&self.stepper.rigid.pose(state), self.slack);
    }

    /// Checks the pose of a state and adds it to the path, if it is `least` from the last one.
    fn waypoint(&mut self, state: &BodyState, travelled: f64, least: f64) -> PenaltyWaypoint {
        let pose = self.stepper.rigid.pose(state);
        let last = self.path[self.path.len() - 1];
        if travelled < least {
            return PenaltyWaypoint::Same;
        }
        let mut deep = Vec::new();
        if !depth::holds_between(&self.contacts, self.parameters, &last, &pose, &mut deep) {
            deep.into_iter().for_each(|i| self.touched[i] = true);
            return PenaltyWaypoint::Deep;
        }
        self.path.push(pose);
        let part = self.contacts.part;
        match exit_direction(self.contacts.scene, self.surroundings, part, &pose, self.hint) {
            Some(direction) => PenaltyWaypoint::Out(direction),
            None => PenaltyWaypoint::Held,
        }
    }
}

/// What became of a pose.
enum PenaltyWaypoint {
    /// It is the last one of the path.
    Held,
    /// It is too close to the last one to be another.
    Same,
    /// It would be too deep, or so would be the way there.
    Deep,
    /// The part is out.
    Out(Vector3<f64>),
}
