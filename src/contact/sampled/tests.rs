use nalgebra::Vector3;

use super::pair_samples::{GatherExtent, PairSamples};
use super::*;
use crate::fixtures::{ball, block_on_plate, cuboid, l_shape, moved, peg_in_hole, scene};

const REACH: f64 = 0.03;

#[test]
fn without_fields_the_same_contacts_are_found() {
    let askew = Pose::new(Vector3::new(0.9, 0.2, 0.4), Vector3::new(0.3, -0.5, 0.2));
    // A post that stands about gives the scene its size.
    let post = cuboid([2.0, -3.0, -3.0], [2.5, -2.0, 3.0]);
    let mut contacts = 0;
    for meshes in [
        peg_in_hole(0.0).to_vec(),
        // Deeper than that is allowed, so that nothing is near in the second one.
        peg_in_hole(5e-4).to_vec(),
        block_on_plate().to_vec(),
        vec![l_shape(), moved(ball(3), &askew), post],
    ] {
        let (scene, _) = scene(meshes);
        let start = scene.bodies[1].planning_from_shape;
        for shift in [Vector3::zeros(), Vector3::new(0.01, -0.02, 0.015), Vector3::z() * 0.5] {
            let mut pose = start;
            pose.translation.vector += shift;
            let mover = MovingBody::new(&scene, 1, pose);
            let by_fields = mover.near_first(0, REACH).unwrap();
            let extent = GatherExtent { radius: REACH, reach: REACH, most: usize::MAX };
            let exact =
                PairSamples::new(&mover.exactly(), 0, REACH).near(&mover.exactly(), extent).unwrap().unwrap();
            // Which trees they are in decides on their order.
            let told = |near: &ContactSet| {
                let told = |c: &Contact| {
                    let sample = c.sample.coords.map(f64::to_bits).data.0;
                    (c.side == ContactSide::Moving, sample, (c.gap * 1e9).round() as i64)
                };
                let mut told: Vec<_> = near.contacts.iter().map(told).collect();
                told.sort_unstable();
                told
            };
            assert_eq!(told(&by_fields), told(&exact), "{shift}");
            // What is no contact is no nearer than the clearance that either tells; fields tell less.
            assert!(exact.clearance >= by_fields.clearance - 1e-9);
            contacts += exact.contacts.len();
            // Measured again elsewhere, they are the same, too.
            let there = MovingBody { pose: Pose::translation(1e-3, 2e-3, -1e-3) * pose, ..mover };
            for contact in &exact.contacts {
                let gap = |mover: MovingBody<'_>| mover.remeasured(contact, f64::INFINITY).map(|c| c.gap);
                let (one, other) = (gap(there).unwrap(), gap(there.exactly()).unwrap());
                assert!((one - other).abs() < 1e-9, "{one} or {other}");
            }
        }
    }
    assert!(contacts > 1000, "{contacts}");
}

#[test]
fn many_looks_are_refused() {
    let (scene, _) = scene(peg_in_hole(0.0));
    let mover = MovingBody::new(&scene, 1, scene.bodies[1].planning_from_shape).exactly();
    let vicinity = PairSamples::new(&mover, 0, REACH);
    let looked =
        |most| vicinity.near(&mover, GatherExtent { radius: REACH, reach: REACH, most }).unwrap().is_some();
    assert!(!looked(10) && looked(100_000));
}
