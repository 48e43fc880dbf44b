//! Crossings: a part that goes straight past one that stands, told by segments cast from points of
//! their surfaces.
//!
//! A solid that is moved along `d` comes to overlap another exactly if on some line along `d` a
//! point of its surface that faces `d` passes a point of the other's that faces against it. So only
//! such points are asked: from every leading sample of the moving part a segment as long as the way
//! is cast against the triangles that face it, and from every sample of the standing part that
//! faces the motion a segment backwards against the leading triangles. Walls along the direction
//! face neither way: sliding along them, however flush, costs nothing.
//!
//! What a pair may overlap (its allowance, and the tolerance) is taken off the samples across the
//! direction: a press fit's rim passes by its hole's. Known miss: edges that cross between two
//! samples, as of all tests by samples; an overlap that is there at the start is taken for granted.
//! Known refusals: contact that slides down a slope, overlaps that grow on the way.

use nalgebra::{Point3, Vector3};

use super::Scene;
use crate::geometry::{Bounds, OrientedSamples, Pose, Surface};
use crate::termination::{Interrupt, Poll, Termination};

/// Faces that look along the direction, or against it, by less than this count as walls.
const STEEPNESS: f64 = 1e-3;
/// Samples between two looks at the termination condition.
const CAST_POLL: u32 = 64;

/// A part that goes straight past one that stands.
#[derive(Debug)]
pub struct Crossing<'a> {
    pub(super) scene: &'a Scene,
    pub(super) part: usize,
    pub(super) start: &'a Pose,
    pub(super) direction: &'a Vector3<f64>,
    /// What stands.
    pub other: usize,
    /// How far the part goes, until it is past the other or out of them all.
    pub travel: f64,
    /// How deep it may get into the other.
    pub granted: f64,
    pub(super) termination: &'a Termination,
}

impl Crossing<'_> {
    /// Whether the part enters the other on the way. That depends on nothing but what is in here, and on the
    /// shapes of both and where the other stands.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn enters(&self) -> Result<bool, Interrupt> {
        let poll = &Poll::every(CAST_POLL, Some(self.termination));
        let [forward, backward] = self.casts(poll);
        let entered = forward.enters() || backward.enters();
        // What was found of casts that were cut short is not to be believed.
        self.termination.check()?;
        Ok(entered)
    }

    /// How far the part gets on the way until it meets the other: all of the way if it does not. Where that is less
    /// than `least` it may be less than found.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn way(&self, least: f64) -> Result<f64, Interrupt> {
        let poll = &Poll::every(CAST_POLL, Some(self.termination));
        let [forward, backward] = self.casts(poll);
        let least = least.min(self.travel);
        let travel = backward.way(forward.way(self.travel, least), least);
        self.termination.check()?;
        Ok(travel)
    }

    fn casts<'b>(&'b self, poll: &'b Poll<'b>) -> [Cast<'b>; 2] {
        let Self { scene, part, start, direction, other, travel, granted, .. } = *self;
        let (moving, standing) = (&scene.bodies[part], &scene.bodies[other]);
        let standing_from_moving = standing.planning_from_shape.inverse() * start;
        let forward = standing.planning_from_shape.rotation.inverse() * direction;
        let backward = start.rotation.inverse() * -direction;
        let [mine, theirs] = [moving, standing].map(|body| &body.shape);
        [
            (mine, theirs, standing_from_moving, forward),
            (theirs, mine, standing_from_moving.inverse(), backward),
        ]
        .map(|(samples, target, to_target, along)| {
            let (samples, target) = (samples.oriented(), &target.surface);
            Cast { samples, target, to_target, along, travel, granted, poll }
        })
    }
}

/// Segments from the samples of one surface against another.
struct Cast<'a> {
    samples: &'a OrientedSamples,
    target: &'a Surface,
    to_target: Pose,
    /// How the samples move against the target, in its frame.
    along: Vector3<f64>,
    travel: f64,
    granted: f64,
    poll: &'a Poll<'a>,
}

impl Cast<'_> {
    fn enters(&self) -> bool {
        let reach = self.travel + self.granted;
        self.leading(|from| {
            self.poll.is_over() || self.target.is_entered_along(from, &self.along, reach, STEEPNESS)
        })
    }

    /// How far of `travel` it goes until something is entered; what is less than `least` may be too much.
    fn way(&self, travel: f64, least: f64) -> f64 {
        let mut reach = travel + self.granted;
        let is_short = |reach: f64| reach < least + self.granted;
        let _ = !is_short(reach)
            && self.leading(|from| {
                if let Some(at) = self.target.entered_along(from, &self.along, reach, STEEPNESS) {
                    reach = at;
                }
                self.poll.is_over() || is_short(reach)
            });
        reach - self.granted
    }

    /// Whether a segment passes `test`, by where it begins: one from each leading sample, as far back and as far
    /// below the faces there as is granted.
    fn leading(&self, mut test: impl FnMut(&Point3<f64>) -> bool) -> bool {
        // In the samples' frame.
        let along = self.to_target.rotation.inverse() * self.along;
        let corridor = self.corridor();
        self.samples.leading(&self.to_target, &corridor, &along, STEEPNESS).any(|(point, normals)| {
            let leads = normals.iter().any(|n| n.dot(&along) > STEEPNESS);
            if !leads || !corridor.contains(&(self.to_target * point)) {
                return false;
            }
            let below = self.to_target * (point + inward(normals, &along, self.granted));
            test(&(below - self.along * self.granted))
        })
    }

    /// From where the target's box is reached.
    fn corridor(&self) -> Bounds {
        let bounds = *self.target.bounds();
        let back = self.along * -(self.travel + self.granted);
        let before = Bounds { min: bounds.min + back, max: bounds.max + back };
        bounds.union(&before).grown(2.0 * self.granted)
    }
}

/// The offset across `along` that takes a point below all faces that meet there, by `depth`; none
/// where they leave no room for it.
fn inward(normals: &[Vector3<f64>], along: &Vector3<f64>, depth: f64) -> Vector3<f64> {
    let across = |n: &Vector3<f64>| (n - along * n.dot(along)).try_normalize(0.1);
    let mut offset = Vector3::zeros();
    for side in normals.iter().filter_map(across) {
        offset -= side * (side.dot(&offset) + depth).max(0.0);
    }
    let below = |side: Vector3<f64>| side.dot(&offset) <= -0.5 * depth;
    if normals.iter().filter_map(across).all(below) { offset } else { Vector3::zeros() }
}
