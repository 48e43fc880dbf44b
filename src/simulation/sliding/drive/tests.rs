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

#[test]
fn a_step_without_a_turn_is_as_long_as_one_with_hardly_any() {
    let (scene, _) = scene(peg_in_hole(-0.01));
    let start = scene.bodies[1].planning_from_shape;
    let drive = Drive::new(&scene, 1, &start, Action::Drag(Axis::Z, true));
    let mover = Mover::new(&scene, 1, start);
    let expected = contact_step(&scene.bodies[1].shape) / 0.05;
    for turn in [0.0, 1e-12] {
        let longest = drive.longest(&mover, &Vector6::new(0.0, 0.0, 0.05, turn, 0.0, 0.0));
        assert!((longest - expected).abs() < 1e-6 * expected, "{longest} of {expected}");
    }
}
