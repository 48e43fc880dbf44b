//! What is around a part that moves: parts that stand assembled and parts that wait.

use std::sync::Arc;

use nalgebra::Point3;

use crate::contact::seems_clear;
use crate::geometry::{Bounds, Pose, separating_direction, transformed};
use crate::plan::{Verdict, Verifier};
use crate::scene::{PartMetric, PosedPart, Scene};
use crate::termination::{Interrupt, Termination, try_all};

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
    /// By part.
    metrics: Vec<PartMetric>,
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
            metrics: (0..parts).map(|part| PartMetric::of(scene, part)).collect(),
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

    pub(super) fn metric(&self, part: usize) -> &PartMetric {
        &self.metrics[part]
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
        let metric = self.metric(part);
        let clear = |glance @ [from, to]: &[Pose; 2]| {
            let near = self.near(among, part, glance);
            if near.is_empty() {
                return Ok(true);
            }
            let count = (metric.distance(from, to) / step).ceil().max(1.0);
            let at = |i: usize| metric.between(from, to, i as f64 / count);
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

    /// A straight piece of the way cut into pieces no longer than the part, if they are not too many.
    fn glances(&self, part: usize, [from, to]: [&Pose; 2]) -> Vec<[Pose; 2]> {
        let ends = [*from, *to];
        let metric = self.metric(part);
        let reach = metric.reach.max(f64::MIN_POSITIVE);
        let count = (metric.distance(from, to) / reach).ceil().clamp(1.0, MOST_GLANCES);
        // The ends stay as they are to the bit.
        let at = |i: usize| match i {
            0 => ends[0],
            i if i as f64 >= count => ends[1],
            i => metric.between(from, to, i as f64 / count),
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
