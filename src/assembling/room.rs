//! What is around a part that moves: parts that stand assembled and parts that wait.

use std::sync::Arc;

use nalgebra::Point3;

use crate::contact::seems_clear;
use crate::geometry::{Bounds, Pose, interpolate, separating_direction, transformed};
use crate::plan::{Verdict, Verifier};
use crate::scene::{PosedPart, Scene};
use crate::termination::{Interrupt, Termination, try_all};

/// Turns between two waypoints stay below this, so that the slerp is unambiguous.
const MOST_TURN: f64 = 1.5;
/// The most pieces in which a way is checked.
const MOST_GLANCES: f64 = 64.0;
/// Looks are no closer and no further apart than these shares of the longest side.
const FINE: f64 = 0.005;
const COARSE: f64 = 0.02;

/// All parts twice: numbered as in the assembly where they stand assembled, and after them all once more
/// where they wait.
pub(super) struct Room {
    pub(super) scene: Scene,
    verifier: Verifier,
    parts: usize,
    /// By number: its hull where it stands or waits, in the planning frame.
    hulls: Vec<Vec<Point3<f64>>>,
    /// By part: how far it reaches from the point that moves on lines.
    reach: Vec<f64>,
    /// Holds every part at both places.
    pub(super) bounds: Bounds,
}

impl Room {
    /// Parts that wait nowhere are never asked about there.
    pub(super) fn new(scene: &Scene, verifier: &Verifier, waiting: &[(usize, Pose)]) -> Self {
        let parts = scene.bodies.len();
        let mut bodies = [&scene.bodies[..], &scene.bodies[..]].concat();
        for (part, pose) in waiting {
            let body = &mut bodies[parts + part];
            body.planning_from_shape = *pose;
            body.bounds = Bounds::of(&transformed(&body.shape.hull, pose));
        }
        let hulls = bodies.iter().map(|b| transformed(&b.shape.hull, &b.planning_from_shape)).collect();
        let all = bodies.iter().fold(Bounds::EMPTY, |all, b| all.union(&b.bounds));
        Self {
            scene: Scene { hulls: Arc::clone(&scene.hulls), ..Scene::of(bodies, scene.longest_side) },
            verifier: verifier.twice(),
            parts,
            hulls,
            reach: (0..parts).map(|part| scene.reach(part)).collect(),
            bounds: all,
        }
    }

    /// The number of a part where it waits.
    pub(super) fn waiting(&self, part: usize) -> usize {
        self.parts + part
    }

    /// The part that a number stands for.
    pub(super) fn part(&self, number: usize) -> usize {
        number % self.parts
    }

    /// How far a part reaches from the point that moves on lines.
    pub(super) fn reach(&self, part: usize) -> f64 {
        self.reach[part]
    }

    /// Checks a way of a part (poses of its shape) among some numbers (ascending), with no penetration allowed.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn check(
        &self,
        among: &[usize],
        part: usize,
        path: &[Pose],
        termination: &Termination,
    ) -> Result<Verdict, Interrupt> {
        let pieces = path.iter().zip(path.iter().skip(1).chain(path.last()));
        let mut found = Vec::new();
        for glance in pieces.flat_map(|(from, to)| self.glances(part, [from, to])) {
            let near = self.near(among, part, &glance);
            if !near.is_empty() {
                let allowed = &self.scene.allowed;
                found.push(self.verifier.check(&self.scene, allowed, &near, part, &glance, termination)?);
            }
        }
        Ok(Verdict::of_all(found))
    }

    /// Whether a part on a straight way is seen to keep clear of some numbers (ascending), at poses so close
    /// that it cannot get at anything in between: for trying ways, not for plans.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn seems_clear(
        &self,
        among: &[usize],
        part: usize,
        piece: [&Pose; 2],
        termination: &Termination,
    ) -> Result<bool, Interrupt> {
        let thin = self.scene.bodies[part].shape.bounds().extents().min() / 2.0;
        let step = thin.clamp(FINE * self.scene.longest_side, COARSE * self.scene.longest_side);
        let clear = |glance: &[Pose; 2]| {
            let near = self.near(among, part, glance);
            if near.is_empty() {
                return Ok(true);
            }
            let count = (self.travel(part, glance) / step).ceil().max(1.0);
            let at = |i: usize| self.between(part, glance, i as f64 / count);
            try_all(0..=count as usize, |i| {
                seems_clear(&self.scene, &near, PosedPart::new(part, &at(i)), step / 2.0, termination)
            })
        };
        for glance in self.glances(part, piece) {
            termination.check()?;
            if !clear(&glance)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The poses of a straight way, so close that the rotation between two is unambiguous.
    pub(super) fn way(&self, part: usize, from: &Pose, to: &Pose) -> Vec<Pose> {
        let count = (from.rotation.angle_to(&to.rotation) / MOST_TURN).ceil().max(1.0);
        let inner = (1..count as usize).map(|i| self.between(part, &[*from, *to], i as f64 / count));
        std::iter::once(*from).chain(inner).chain([*to]).collect()
    }

    /// No point of a part moves further on a straight piece of its way.
    fn travel(&self, part: usize, [from, to]: &[Pose; 2]) -> f64 {
        let centre = self.scene.centre_in_shape(part);
        let shift = (to * centre - from * centre).norm();
        shift + self.reach(part) * from.rotation.angle_to(&to.rotation)
    }

    fn between(&self, part: usize, [from, to]: &[Pose; 2], share: f64) -> Pose {
        interpolate(from, to, &self.scene.centre_in_shape(part), share)
    }

    /// A straight piece of the way cut into pieces no longer than the part, if they are not too many.
    fn glances(&self, part: usize, [from, to]: [&Pose; 2]) -> Vec<[Pose; 2]> {
        let ends = [*from, *to];
        let reach = self.reach(part).max(f64::MIN_POSITIVE);
        let count = (self.travel(part, &ends) / reach).ceil().clamp(1.0, MOST_GLANCES);
        // The ends stay as they are to the bit.
        let at = |i: usize| match i {
            0 => ends[0],
            i if i as f64 >= count => ends[1],
            i => self.between(part, &ends, i as f64 / count),
        };
        (0..count as usize).map(|i| [at(i), at(i + 1)]).collect()
    }

    /// Of some numbers, those that a part may meet on a short piece of its way.
    fn near(&self, among: &[usize], part: usize, glance: &[Pose; 2]) -> Vec<usize> {
        let mut near = self.scene.broad_phase.meeting_of(among, &self.scene.swept_bounds(part, glance));
        if glance[0].rotation == glance[1].rotation && !near.is_empty() {
            let hull = &self.scene.bodies[part].shape.hull;
            let swept: Vec<_> = glance.iter().flat_map(|pose| transformed(hull, pose)).collect();
            near.retain(|&other| separating_direction(&swept, &self.hulls[other], 0.0, None).is_none());
        }
        near
    }
}
