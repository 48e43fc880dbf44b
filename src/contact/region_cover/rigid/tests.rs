//! What regions tell of a part that turns.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::*;
use crate::fixtures::{cells, cuboid, l_shape, moved, peg_in_hole, scene, spread};
use crate::geometry::interpolate;
use crate::tolerances::DEPTH_TOLERANCE;

#[test]
fn a_loose_peg_turns_and_is_told_by_regions_all_the_way() {
    let (scene, _) = scene(peg_in_hole(-0.05));
    let around = StandingParts::new(&scene, vec![0]);
    let start = scene.bodies[1].planning_from_shape;
    let termination = Termination::default();
    let mut holds = RigidCover::new(&scene, &around, PosedPart::new(1, &start), 0.1, false, &termination);
    let mover = MovingBody::new(&scene, 1, start);
    let near = holds.settle(&mover, None).unwrap();
    assert!(near.contacts.iter().all(|c| c.gap >= 0.0) && !holds.samples());
    let turned = MovingBody { pose: start * Pose::rotation(Vector3::z() * 0.3), ..mover };
    assert!(
        holds.near(&turned).unwrap().contacts.iter().any(|c| c.gap < -0.01),
        "its corners are in the walls"
    );
    let lifted = MovingBody { pose: Pose::translation(0.0, 0.0, 0.1) * start, ..mover };
    assert!(holds.near(&lifted).unwrap().contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE));
    assert!(!holds.settle(&lifted, None).unwrap().contacts.is_empty(), "what was found of the walls is kept");
    assert!(!holds.samples());
}

#[test]
fn a_long_pin_is_stopped_by_what_its_faces_get_over_without_another_region() {
    // The pin's corners are far from the plate: it is the plate's that get inside.
    let plate =
        cells([&[-2.0, -0.5, 0.5, 2.0], &[-2.0, -0.5, 0.5, 2.0], &[-0.5, 0.5]], |c| c[0] != 1 || c[1] != 1);
    let (scene, _) = scene([plate, cuboid([-0.45, -0.45, -4.0], [0.45, 0.45, 4.0])]);
    let start = scene.bodies[1].planning_from_shape;
    let termination = Termination::default();
    let mover = MovingBody::new(&scene, 1, start);
    let mut pair = RigidPair::new(&scene, PosedPart::new(1, &start), 0, true, &termination).unwrap().unwrap();
    let mut looked = |pose: Pose| {
        let mut near = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
        let left = pair.near(&start, &MovingBody { pose, ..mover }, 0.1, &mut near);
        (left.is_some(), near.contacts)
    };
    for shift in [Vector3::x() * 0.1, Vector3::new(0.08, 0.06, 1.0)] {
        let (is_open, contacts) = looked(Pose::from(shift) * start);
        assert!(!is_open && !contacts.is_empty(), "{shift}");
        for contact in contacts {
            assert!((-0.051..-DEPTH_TOLERANCE).contains(&contact.gap), "{}", contact.gap);
        }
    }
    assert!(looked(Pose::from(Vector3::new(0.04, -0.04, 0.5)) * start).1.is_empty());
}

#[test]
fn what_regions_let_pass_enters_nothing() {
    // Two solids with a reentrant corner each, and a third that stands about; the same places at each run.
    // Where surfaces cross by less than the tolerance regions leave small bits to the face before them: a
    // little more is let pass there.
    const LET_PASS: f64 = 3e-3;
    let termination = Termination::default();
    let (mut passed, mut stopped) = (0, 0);
    let turns = spread([0.0; 3], [TAU; 3], 90);
    for (place, turn) in spread([-2.5; 3], [2.5; 3], 90).zip(turns) {
        let pose = Pose::new(place.coords, turn.coords);
        let post = cuboid([2.0, -3.0, -3.0], [2.5, -2.0, 3.0]);
        let (scene, verifier) = scene([l_shape(), moved(l_shape(), &pose), post]);
        let deep = |path: &[Pose]| {
            verifier.check(&scene, &scene.allowed, &[0, 2], 1, path, &termination).unwrap().depth
        };
        let start = scene.bodies[1].planning_from_shape;
        if deep(&[start]) > 1e-9 {
            continue;
        }
        let around = StandingParts::new(&scene, vec![0, 2]);
        let mover = MovingBody::new(&scene, 1, start);
        for direction in spread([-1.0; 3], [1.0; 3], 12) {
            let mut holds =
                RigidCover::new(&scene, &around, PosedPart::new(1, &start), 0.12, false, &termination);
            holds.settle(&mover, None).unwrap();
            // The way to the other solid, with a turn about another axis.
            let step = Pose::new(
                (scene.bodies[0].bounds.centre() - mover.centre()).normalize() * 0.05
                    + direction.coords * 0.03,
                direction.coords.yzx() * 0.04,
            );
            let mut there = mover;
            for _ in 0..12 {
                let from = there.pose;
                let next = MovingBody { pose: step * from, ..mover };
                let near = holds.near(&next).unwrap();
                let middle = MovingBody {
                    pose: interpolate(&from, &next.pose, &scene.centre_in_shape(1), 0.5),
                    ..mover
                };
                if near.contacts.iter().any(|c| c.gap < -DEPTH_TOLERANCE)
                    || !holds.is_clear_at(&middle).unwrap()
                {
                    stopped += 1;
                    break;
                }
                holds.settle(&next, Some(near)).unwrap();
                if holds.samples() {
                    break;
                }
                let got = deep(&[from, next.pose]);
                assert!(got < LET_PASS, "{got} deep from {place}, {turn} along {direction}");
                passed += 1;
                there = next;
            }
        }
    }
    assert!(passed > 1000 && stopped > 100, "{passed} steps passed, {stopped} stopped");
}
