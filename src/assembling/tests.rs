//! Assembly plans over small solids.

use super::*;
use crate::fixtures::{cells, cuboid, moved, peg_in_hole, scene};
use crate::geometry::SourceMesh;

/// A removal straight up (or along some other shift).
fn out(scene: &Scene, part: usize, shift: [f64; 3]) -> Removal {
    let start = scene.bodies[part].planning_from_shape;
    let end = Pose::translation(shift[0], shift[1], shift[2]) * start;
    Removal {
        parts: vec![part],
        of: None,
        aside: false,
        path: vec![start, end],
        depth: 0.0,
        requires: Vec::new(),
        wave: 0,
    }
}

fn run(
    meshes: Vec<SourceMesh>,
    removals: impl Fn(&Scene) -> Vec<Removal>,
    waiting: impl Fn(&Scene) -> Waiting,
) -> (Scene, Verifier, Vec<Insertion>, Result<(), Unfinished>) {
    let (scene, verifier) = scene(meshes);
    let removals = removals(&scene);
    let moves = |part: &usize| removals.iter().any(|r| r.parts == [*part]);
    let remain: Vec<usize> = (0..scene.bodies.len()).filter(|part| !moves(part)).collect();
    let termination = Termination::default();
    let assembling = Assembling::new(&scene, &verifier, &removals, &remain, &waiting(&scene), &termination);
    let mut insertions = Vec::new();
    let ended = assembling.run(|insertion| insertions.push(insertion));
    for (insertion, (part, start)) in insertions.iter().zip(assembling.starts()) {
        assert_eq!((insertion.parts[0], insertion.path[0]), (part, start));
    }
    (scene, verifier, insertions, ended)
}

/// Three slabs on a plate, which leave upwards, the last one first.
fn stack() -> Vec<SourceMesh> {
    let slab = |k: f64| cuboid([-1.0, -1.0, k], [1.0, 1.0, k + 0.9]);
    vec![cuboid([-3.0, -3.0, -1.0], [3.0, 3.0, -0.1]), slab(0.0), slab(1.0), slab(2.0)]
}

fn unstacked(scene: &Scene) -> Vec<Removal> {
    let mut removals: Vec<_> = (1..4).rev().map(|part| out(scene, part, [0.0, 0.0, 4.0])).collect();
    removals[1].requires = vec![0];
    removals[2].requires = vec![0, 1];
    removals
}

/// Every way past all that stands and waits, checked at poses close to each other, on the triangles.
fn assert_apart(scene: &Scene, verifier: &Verifier, insertions: &[Insertion]) {
    for (done, insertion) in insertions.iter().enumerate() {
        let mut bodies = scene.bodies.to_vec();
        for later in &insertions[done + 1..] {
            let body = &mut bodies[later.parts[0]];
            body.planning_from_shape = later.path[0];
            body.bounds = body.shape.bounds().transformed(&later.path[0]);
        }
        let there = Scene { bodies: std::sync::Arc::new(bodies), ..scene.clone() };
        let others: Vec<usize> = (0..scene.bodies.len()).filter(|&p| p != insertion.parts[0]).collect();
        let verdict = verifier
            .check(
                &there,
                &scene.allowed,
                &others,
                insertion.parts[0],
                &insertion.path,
                &Termination::default(),
            )
            .unwrap();
        assert!(verdict.penetrations.is_empty(), "part {}: {}", insertion.parts[0], verdict.depth);
        assert_eq!(insertion.path.last(), Some(&scene.bodies[insertion.parts[0]].planning_from_shape));
    }
}

#[test]
fn the_order_is_reversed_and_parts_come_from_where_they_wait() {
    let (scene, verifier, insertions, ended) = run(stack(), unstacked, |_| Waiting::Beside(Vec::new()));
    assert_eq!(ended, Ok(()));
    assert_eq!(insertions.iter().map(|i| i.parts[0]).collect::<Vec<_>>(), [1, 2, 3]);
    let order: Vec<_> = insertions.iter().map(|i| (i.requires.clone(), i.wave)).collect();
    assert_eq!(order, [(vec![], 0), (vec![0], 1), (vec![0, 1], 2)]);
    for insertion in &insertions {
        let moved = insertion.path[0].translation.vector - insertion.path.last().unwrap().translation.vector;
        assert!(moved.y < -3.0 && insertion.path.len() > 2, "{moved}");
    }
    assert_apart(&scene, &verifier, &insertions);
}

#[test]
fn without_staging_paths_are_the_removals_reversed() {
    let (scene, _, insertions, ended) = run(stack(), unstacked, |_| Waiting::Nowhere);
    assert_eq!(ended, Ok(()));
    for (insertion, removal) in insertions.iter().zip(unstacked(&scene).iter().rev()) {
        let reversed: Vec<Pose> = removal.path.iter().rev().copied().collect();
        assert_eq!((&insertion.parts, &insertion.path), (&removal.parts, &reversed));
    }
}

#[test]
fn a_part_is_turned_and_led_round_what_stands() {
    // The peg waits below the plate, head down.
    let waits = |scene: &Scene| {
        let turned = Pose::translation(0.5, 0.0, -8.0) * Pose::rotation(nalgebra::Vector3::x() * 3.0);
        Waiting::Beside(vec![(1, turned * scene.bodies[1].planning_from_shape)])
    };
    let up = |scene: &Scene| vec![out(scene, 1, [0.0, 0.0, 6.0])];
    let (scene, verifier, insertions, ended) = run(peg_in_hole(-0.05).to_vec(), up, waits);
    assert_eq!(ended, Ok(()));
    assert_apart(&scene, &verifier, &insertions);
    for piece in insertions[0].path.windows(2) {
        assert!(piece[0].rotation.angle_to(&piece[1].rotation) < 2.0, "the slerp is ambiguous");
    }
}

#[test]
fn who_waits_in_another_part_is_told() {
    let waits = |scene: &Scene| Waiting::Beside(vec![(2, scene.bodies[1].planning_from_shape)]);
    let (.., insertions, ended) = run(stack(), unstacked, waits);
    // The first slab comes to where the second one waits.
    assert_eq!(ended, Err(Unfinished::Hindered(1, Hindrance::InsertionMeets, vec![2])));
    assert!(insertions.is_empty());
    let waits = |scene: &Scene| Waiting::Beside(vec![(1, scene.bodies[0].planning_from_shape)]);
    let (.., ended) = run(stack(), unstacked, waits);
    assert_eq!(ended, Err(Unfinished::Hindered(1, Hindrance::WaitsIn, vec![0])));
}

#[test]
fn no_way_out_of_a_closed_box_is_found() {
    // A hollow box, and a cube that should come from within it.
    let walls: [&[f64]; 3] = [&[-2.0, -1.0, 1.0, 2.0]; 3];
    let meshes = vec![
        cells(walls, |cell| cell != [1, 1, 1]),
        moved(cuboid([-0.5; 3], [0.5; 3]), &Pose::translation(0.0, 0.0, 4.0)),
    ];
    let waits = |scene: &Scene| {
        Waiting::Beside(vec![(1, Pose::translation(0.0, 0.0, -4.0) * scene.bodies[1].planning_from_shape)])
    };
    let up = |scene: &Scene| vec![out(scene, 1, [0.0, 0.0, 1.0])];
    let (.., ended) = run(meshes, up, waits);
    assert_eq!(ended, Err(Unfinished::Hindered(1, Hindrance::NoWay(MOST_SAMPLES), vec![])));
}

#[test]
fn a_cancelled_request_is_told_so() {
    let (scene, verifier) = scene(stack());
    let removals = unstacked(&scene);
    let termination = Termination::default();
    termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
    let waiting = Waiting::Beside(Vec::new());
    let assembling = Assembling::new(&scene, &verifier, &removals, &[0], &waiting, &termination);
    assert_eq!(assembling.run(|_| {}), Err(Unfinished::Interrupted(Interrupt::Cancelled)));
}

#[test]
fn a_group_is_put_together_right_before_it_is_put_in() {
    // Of the slabs, the middle one and the top one leave together, and then each other.
    let removals = |scene: &Scene| {
        let group = scene.with_joined(&[2, 3], &Termination::default()).unwrap();
        let mut together = out(&group, 4, [0.0, 0.0, 4.0]);
        together.parts = vec![2, 3];
        let mut last = out(scene, 1, [0.0, 0.0, 4.0]);
        (last.requires, last.wave) = (vec![0], 1);
        let mut within = out(scene, 3, [5.0, 0.0, 0.0]);
        (within.of, within.requires, within.wave) = (Some(0), vec![0], 1);
        vec![together, last, within]
    };
    let (scene, verifier) = scene(stack());
    let (removals, termination) = (removals(&scene), Termination::default());
    for waiting in [Waiting::Nowhere, Waiting::Beside(Vec::new())] {
        let assembling = Assembling::new(&scene, &verifier, &removals, &[0], &waiting, &termination);
        let mut insertions = Vec::new();
        assert_eq!(assembling.run(|insertion| insertions.push(insertion)), Ok(()));
        let order: Vec<_> =
            insertions.iter().map(|i| (i.parts.clone(), i.of, i.requires.clone(), i.wave)).collect();
        assert_eq!(
            order,
            [(vec![1], None, vec![], 0), (vec![3], Some(2), vec![], 0), (vec![2, 3], None, vec![0, 1], 1),]
        );
        // The one within begins where its insertion into the group does, and the group where its own does.
        let start = |part: usize| assembling.starts().into_iter().find(|(p, _)| *p == part).unwrap().1;
        for (part, [x, z]) in [(2, [0.0, 4.0]), (3, [5.0, 4.0])] {
            let assembled = scene.bodies[part].planning_from_shape.translation.vector;
            let shift = start(part).translation.vector - assembled;
            assert!((shift - Vector3::new(x, 0.0, z)).norm() < 1e-9, "part {part}: {shift}");
        }
        assert_eq!(insertions[0].path.len() > 2, waiting != Waiting::Nowhere, "only the slab below waits");
    }
}
