//! The paper's test: a part is disassembled when its convex hull does not meet the convex hull of
//! all remaining other parts.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Pose, Support, gap_along, hull_vertices, separating, transformed};
use crate::tolerances::HULL_MARGIN;

use super::Scene;

/// What stands still while one part moves.
#[derive(Debug, Clone)]
pub struct StandingParts {
    /// The parts that stand, ascending.
    pub standing: Vec<usize>,
    /// Points with the same convex hull as them all: its vertices, and perhaps some inside.
    pub hull: Vec<Point3<f64>>,
}

impl StandingParts {
    /// The surroundings made of some parts at their assembled poses.
    #[must_use]
    pub fn new(scene: &Scene, standing: Vec<usize>) -> Self {
        let points: Vec<_> = standing
            .iter()
            .flat_map(|&i| transformed(&scene.bodies[i].shape.hull, &scene.bodies[i].planning_from_shape))
            .collect();
        let hull = if points.is_empty() { points } else { hull_vertices(&points) };
        Self { standing, hull }
    }
}

/// A direction along which the surroundings lie apart from the part at `pose`, if there is one.
/// It is certified on all vertices of the part and of all that stand, not only on hulls.
#[must_use]
pub fn exit_direction(
    scene: &Scene,
    standing_parts: &StandingParts,
    part: usize,
    pose: &Pose,
    hint: Option<Vector3<f64>>,
) -> Option<Vector3<f64>> {
    let body = &scene.bodies[part];
    let mine = transformed(&body.shape.hull, pose);
    let hint = hint.filter(|d| gap_along(d, &mine, &standing_parts.hull) >= HULL_MARGIN);
    let sought = || separating(&Support::of(&mine), &Support::of(&standing_parts.hull), HULL_MARGIN);
    let direction = hint.or_else(sought)?;
    let reach = |pose: &Pose, points: &[Point3<f64>]| {
        points.iter().map(|p| (pose * p).coords.dot(&direction)).fold(f64::NEG_INFINITY, f64::max)
    };
    let far = reach(pose, body.shape.surface.vertices());
    let apart = standing_parts.standing.iter().all(|&i| {
        let other = &scene.bodies[i];
        // The corner of its box that lies least far: mostly that is enough.
        if -other.bounds.support(&-direction) - far >= HULL_MARGIN {
            return true;
        }
        let local = other.planning_from_shape.rotation.inverse() * direction;
        let shift = other.planning_from_shape.translation.vector.dot(&direction);
        let near = gap_along(&local, &[Point3::origin()], other.shape.surface.vertices()) + shift;
        near - far >= HULL_MARGIN / 2.0
    });
    apart.then_some(direction)
}
