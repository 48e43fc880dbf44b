use std::f64::consts::FRAC_PI_3;

use super::*;
use crate::fixtures::{moved, peg_in_hole, rod, scene, tube};
use crate::scene::StandingParts;
use crate::simulation::sliding::SlidingEngine;
use crate::simulation::{Axis, TransitionFunction};
use crate::termination::Termination;

#[test]
fn a_peg_that_is_pulled_askew_slides_in_steps_as_long_as_those_straight_on() {
    let pose = Pose::new(Vector3::zeros(), Vector3::x() * FRAC_PI_3);
    let action = Action::Drag(Axis::Z, true);
    let (scene, verifier) = scene(peg_in_hole(-0.01).map(|mesh| moved(mesh, &pose)));
    let around = StandingParts::new(&scene, vec![0]);
    let (start, t) = (scene.bodies[1].planning_from_shape, Termination::default());
    let motion = SlidingEngine.simulate(&scene, &around, 1, &start, action, &t).unwrap();
    let gone = |pose: &Pose| (pose.translation.vector - start.translation.vector).norm();
    let within = motion.path.iter().filter(|pose| gone(pose) < 1.5).count();
    // At the speed along the hole that the pull has by itself it would take twice as many.
    let straight = 1.5 / contact_step(&scene.bodies[1].shape);
    assert!((within as f64) < 1.3 * straight && within > 8, "{within} steps, {straight} straight on");
    let verifier = verifier.with_limit(2e-3);
    let verdict = verifier.check(&scene, &scene.allowed, &[0], 1, &motion.path, &t).unwrap();
    assert!(verdict.depth < 2e-3, "{}", verdict.depth);
}

#[test]
fn a_pin_that_is_turned_askew_takes_hardly_shorter_steps_than_one_turned_straight_on() {
    let pin = || [tube(1.1, 2.0, [-1.0, 1.0], 24), rod(1.0, [-3.0, 3.0], 24)];
    let poses_per_turn = |tilt: f64| {
        let pose = Pose::new(Vector3::zeros(), Vector3::x() * tilt);
        let (scene, _) = scene(pin().map(|mesh| moved(mesh, &pose)));
        let around = StandingParts::new(&scene, vec![0]);
        let (start, t) = (scene.bodies[1].planning_from_shape, Termination::default());
        let action = Action::Turn(Axis::Z, true);
        let motion = SlidingEngine.simulate(&scene, &around, 1, &start, action, &t).unwrap();
        let turned: f64 = motion.path.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).sum();
        assert!(turned > std::f64::consts::TAU, "{turned}");
        motion.path.len() as f64 / turned
    };
    let (straight, askew) = (poses_per_turn(0.0), poses_per_turn(FRAC_PI_3));
    // At the speed about the pin's axis that the torque has by itself it takes five times as many.
    assert!(askew < 2.5 * straight, "{askew} poses for each radian, {straight} straight on");
}

#[test]
fn a_step_without_a_turn_is_as_long_as_one_with_hardly_any() {
    let (scene, _) = scene(peg_in_hole(-0.01));
    let start = scene.bodies[1].planning_from_shape;
    let drive = Drive::new(&scene, 1, &start, Action::Drag(Axis::Z, true));
    let mover = MovingBody::new(&scene, 1, start);
    let expected = contact_step(&scene.bodies[1].shape) / 0.05;
    for turn in [0.0, 1e-12] {
        let longest = drive.longest(&mover, &Vector6::new(0.0, 0.0, 0.05, turn, 0.0, 0.0));
        assert!((longest - expected).abs() < 1e-6 * expected, "{longest} of {expected}");
    }
}
