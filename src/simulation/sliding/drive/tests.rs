use std::f64::consts::FRAC_PI_3;

use super::*;
use crate::fixtures::{moved, peg_in_hole, scene};
use crate::simulation::sliding::SlidingEngine;
use crate::simulation::{Axis, Surroundings, TransitionFunction};
use crate::termination::Termination;

#[test]
fn a_peg_that_is_pulled_askew_slides_in_steps_as_long_as_those_straight_on() {
    let pose = Pose::new(Vector3::zeros(), Vector3::x() * FRAC_PI_3);
    let action = Action::Drag(Axis::Z, true);
    let (scene, verifier) = scene(peg_in_hole(-0.01).map(|mesh| moved(mesh, &pose)));
    let around = Surroundings::new(&scene, vec![0]);
    let (start, t) = (scene.bodies[1].planning_from_shape, Termination::default());
    let motion = SlidingEngine.simulate(&scene, &around, 1, &start, action, &t).unwrap();
    let gone = |pose: &Pose| (pose.translation.vector - start.translation.vector).norm();
    let within = motion.path.iter().filter(|pose| gone(pose) < 1.5).count();
    // At the speed along the hole that the pull has by itself it would take twice as many.
    let straight = 1.5 / contact_step(&scene.bodies[1].shape);
    assert!((within as f64) < 1.3 * straight && within > 8, "{within} steps, {straight} straight on");
    let verdict = verifier.check(&scene, &scene.allowances, &[0], 1, &motion.path, &t).unwrap();
    assert!(verdict.depth < 2e-3, "{}", verdict.depth);
}
