//! Whether a part gets straight from one pose to another: for telling rooms apart, not for plans.

use crate::geometry::{Pose, interpolate};

use super::Scene;
use super::contact::Mover;

/// Poses looked at on one way, at most.
const MOST_POSES: usize = 64;

/// Whether a part, moved straight from one pose to another (its centre of mass on a line, its
/// rotation slerped), is seen to enter none of the parts that stand. It is looked at half its
/// smallest side apart, so no wall is thin enough to be stepped over; entering by less than the
/// distance fields' error goes unseen.
#[must_use]
pub fn passes_straight(scene: &Scene, standing: &[usize], part: usize, from: &Pose, to: &Pose) -> bool {
    let shape = &scene.bodies[part].shape;
    let centre = shape.mass.centre;
    let travel = (to * centre - from * centre).norm() + from.rotation.angle_to(&to.rotation) * shape.reach;
    let step = shape.bounds().extents().min() / 2.0;
    let count = if step > 0.0 { (travel / step).ceil().min(MOST_POSES as f64) as usize } else { MOST_POSES };
    (1..count).all(|i| {
        let pose = interpolate(from, to, &centre, i as f64 / count as f64);
        !Mover::new(scene, part, pose).clearly_enters(standing)
    })
}
