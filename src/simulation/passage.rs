//! Whether a part gets straight from one pose to another, at a glance: for telling rooms apart and for
//! trying ways, not for plans.

use crate::budgets::PASSAGE_POSES;
use crate::contact::sampled::Mover;
use crate::geometry::{Pose, interpolate};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination, try_all};

/// Whether a part, moved straight from one pose to another (its centre of mass on a line, its
/// rotation slerped), is seen to enter none of the parts that stand. It is looked at half its
/// smallest side apart, so no wall is thin enough to be stepped over; entering by less than the
/// distance fields' error goes unseen.
///
/// # Errors
/// The termination condition became true.
pub fn passes_straight(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    [from, to]: [&Pose; 2],
    termination: &Termination,
) -> Result<bool, Interrupt> {
    let shape = &scene.bodies[part].shape;
    let centre = shape.mass.centre;
    let travel = (to * centre - from * centre).norm() + from.rotation.angle_to(&to.rotation) * shape.reach;
    let step = shape.bounds().extents().min() / 2.0;
    let count =
        if step > 0.0 { (travel / step).ceil().min(PASSAGE_POSES as f64) as usize } else { PASSAGE_POSES };
    try_all(1..count, |i| {
        let pose = interpolate(from, to, &centre, i as f64 / count as f64);
        Ok(!Mover::new(scene, part, pose).until(termination).clearly_enters(standing)?)
    })
}

/// Whether a part at a pose is seen to keep clear of all parts that stand, by some distance and what the
/// distance fields can be wrong by. Seen at samples of the surfaces: what is finer goes unseen.
///
/// # Errors
/// The termination condition became true.
pub fn seems_clear(
    scene: &Scene,
    standing: &[usize],
    (part, pose): (usize, &Pose),
    by: f64,
    termination: &Termination,
) -> Result<bool, Interrupt> {
    Mover::new(scene, part, *pose).until(termination).seems_clear(standing, by)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, Vector3};

    use super::*;
    use crate::fixtures::{peg_in_hole, scene};

    #[test]
    fn a_peg_passes_through_its_hole_but_not_through_the_wall() {
        let (scene, _) = scene(peg_in_hole(-0.05));
        let at = |x: f64, z: f64| {
            Translation3::from(Vector3::new(x, 0.0, z)) * scene.bodies[1].planning_from_shape
        };
        let passes = |from: Pose, to: Pose| {
            passes_straight(&scene, &[0], 1, [&from, &to], &Termination::default()).unwrap()
        };
        assert!(passes(at(0.0, 0.0), at(0.0, 4.0)) && passes(at(0.0, 4.0), at(0.0, 0.0)));
        assert!(passes(at(0.0, 4.0), at(6.0, 4.0)) && passes(at(6.0, 4.0), at(6.0, 0.0)));
        assert!(!passes(at(0.0, 0.0), at(6.0, 0.0)), "both ends are free, the way is not");
        assert!(passes(at(0.0, 0.0), at(0.0, 0.0)));
    }
}
