//! Distances between poses of a part, and straight ways from one to another.

use nalgebra::Point3;

use crate::geometry::{Pose, interpolate};

use super::Scene;

/// Turns between two waypoints stay below this, so that the slerp is unambiguous: π at most. At half, ways that turn
/// have twice as many waypoints.
const MOST_TURN: f64 = 1.5;

/// How a part moves on straight ways: its centre on a line, while it turns at a constant rate.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PartMetric {
    /// The point that moves on lines, in the frame of the part's shape.
    pub(crate) centre: Point3<f64>,
    /// How far the part reaches from there.
    pub(crate) reach: f64,
}

impl PartMetric {
    pub(crate) fn of(scene: &Scene, part: usize) -> Self {
        Self { centre: scene.centre_in_shape(part), reach: scene.reach(part) }
    }

    /// No point of the part moves further on the straight way between two poses.
    pub(crate) fn distance(&self, a: &Pose, b: &Pose) -> f64 {
        (a * self.centre - b * self.centre).norm() + self.reach * a.rotation.angle_to(&b.rotation)
    }

    /// The pose at a share of the straight way from `a` to `b`.
    pub(crate) fn between(&self, a: &Pose, b: &Pose, share: f64) -> Pose {
        interpolate(a, b, &self.centre, share)
    }

    /// Of some poses, the number of the one nearest to a pose; 0 of none.
    pub(crate) fn nearest(&self, poses: &[Pose], to: &Pose) -> usize {
        let distances = poses.iter().map(|pose| self.distance(pose, to));
        distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(number, _)| number)
    }

    /// The poses of a straight way, so close that the rotation between two is unambiguous.
    pub(crate) fn way(&self, from: &Pose, to: &Pose) -> Vec<Pose> {
        let count = (from.rotation.angle_to(&to.rotation) / MOST_TURN).ceil().max(1.0);
        let inner = (1..count as usize).map(|i| self.between(from, to, i as f64 / count));
        std::iter::once(*from).chain(inner).chain([*to]).collect()
    }
}
