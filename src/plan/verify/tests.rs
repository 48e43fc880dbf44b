use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::*;
use crate::budgets::PATH_EFFORT_IN_DOUBT;
use crate::fixtures::{
    LIMIT, ball, block_on_plate, cells, cuboid, l_shape, moved, open_box, peg_in_hole, rod, scene, tube,
};
use crate::geometry::{SourceMesh, Surface, interpolate};
use crate::tolerances::PAIR_LIMIT;

/// The path of part 1 by steps from its assembled pose, checked against all others.
fn checked(scene: &Scene, verifier: &Verifier, steps: &[Vector3<f64>]) -> Verdict {
    let mut path = vec![scene.bodies[1].planning_from_shape];
    for s in steps {
        path.push(nalgebra::Translation3::from(*s) * path[path.len() - 1]);
    }
    checked_path(scene, verifier, &path)
}

fn checked_path(scene: &Scene, verifier: &Verifier, path: &[Pose]) -> Verdict {
    let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
    verifier.check(scene, &scene.allowed, &standing, 1, path, &Termination::default()).unwrap()
}

fn overlap(scene: &Scene, verifier: &Verifier, a: usize, b: usize) -> f64 {
    verifier.assembled_depth(scene, &CongruentPair::turned(scene, a, b), &Termination::default()).unwrap()
}

#[test]
fn a_path_through_a_wall_is_refused_and_the_wall_named() {
    let [plate, block] = block_on_plate();
    let wall = cuboid([2.5, -4.0, 0.0], [3.0, 4.0, 3.0]);
    let (scene, verifier) = scene([plate, block, wall]);
    let verdict = checked(&scene, &verifier, &[Vector3::x() * 6.0]);
    let moving = scene.bodies[1].planning_from_shape;
    assert!(
        verdict.penetrations.iter().any(|e| e.on_moving) && verdict.penetrations.iter().any(|e| !e.on_moving)
    );
    assert!(verdict.penetrations.len() > 10);
    for e in &verdict.penetrations {
        assert!(e.other == 2 && e.over > LIMIT, "{e:?}");
        let (own, into) = if e.on_moving { (1, 2) } else { (2, 1) };
        let surface = |part: usize| &scene.bodies[part].shape.surface;
        assert!(surface(own).signed_distance(&e.point).abs() < 1e-9, "{e:?}");
        // Somewhere on the way it is as deep as told: how deep it gets at most is not looked into.
        let depth = |k: u32| {
            let moved = Pose::translation(f64::from(k) * 1e-3, 0.0, 0.0) * moving;
            let to_wall = scene.bodies[2].planning_from_shape.inverse() * moved;
            let at = if e.on_moving { to_wall * e.point } else { to_wall.inverse() * e.point };
            -surface(into).signed_distance(&at)
        };
        let there = (0..=6000).map(depth).fold(0.0, f64::max);
        assert!(e.over <= there + 1e-3, "{there} at {e:?}");
    }
    // The verdict is the deepest of them, and no block is deeper in a wall than half its width.
    let by_side = |on: bool| {
        let side = verdict.penetrations.iter().filter(|e| e.on_moving == on);
        side.map(|e| e.over).fold(0.0, f64::max)
    };
    assert_eq!(by_side(true).max(by_side(false)), verdict.depth);
    assert!(by_side(true) <= 0.25 + 1e-9 && by_side(false) <= 1.0 + 1e-9);
}

#[test]
fn entries_are_points_of_the_surface_that_they_name() {
    let (scene, verifier) = scene(block_on_plate());
    let verdict = checked(&scene, &verifier, &[Vector3::new(0.3, 0.2, -0.1)]);
    assert!((verdict.depth - 0.1).abs() < 1e-9, "{}", verdict.depth);
    for e in &verdict.penetrations {
        let shape = &scene.bodies[if e.on_moving { 1 } else { e.other }].shape;
        assert!(shape.surface.signed_distance(&e.point).abs() < 1e-9, "{e:?}");
    }
}

#[test]
fn a_thin_wall_between_two_waypoints_is_found() {
    let wall = cuboid([1.5, -3.0, -3.0], [1.6, 3.0, 3.0]);
    let (scene, verifier) = scene([wall, cuboid([0.0; 3], [1.0; 3])]);
    let verdict = checked(&scene, &verifier, &[Vector3::x() * 4.0]);
    assert!(verdict.depth > 0.05 && verdict.depth <= 0.5, "{}", verdict.depth);
}

#[test]
fn what_goes_through_the_mouth_of_a_wall_is_free_and_what_pokes_into_the_wall_is_found() {
    let crumb = cuboid([-0.01, -0.01, 3.001], [0.01, 0.01, 3.021]);
    let (scene, verifier) = scene([open_box([-3.0; 3], [3.0; 3]), crumb]);
    assert!(scene.bodies[0].shape.surface.is_wall());
    for shift in [1.0, -0.006, -6.0] {
        assert_eq!(checked(&scene, &verifier, &[Vector3::z() * shift]).depth, 0.0, "{shift}");
    }
    // The floor is at -3: from 6.001 on it is in the crumb, and most of all half-way through.
    for (shift, depth) in [(-6.006, 0.005), (-6.5, 0.01)] {
        let verdict = checked(&scene, &verifier, &[Vector3::z() * shift]);
        assert!((verdict.depth - depth).abs() < 2e-3, "{} after {shift}", verdict.depth);
        assert!(verdict.penetrations.iter().all(|p| !p.on_moving));
    }
}

#[test]
fn where_holes_leave_nothing_to_be_settled_samples_are_asked_soon() {
    // A basket all of holes: every other facet is missing. In it a box without a lid.
    let mut basket = ball(4);
    for vertex in &mut basket.vertices {
        *vertex = vertex.map(|x| 3.0 * x);
    }
    basket.triangles = basket.triangles.into_iter().step_by(2).collect();
    let (scene, verifier) = scene([basket, open_box([-2.0, -1.5, 1.0], [1.0, 2.0, 3.5])]);
    let path = [scene.bodies[1].planning_from_shape; 2];
    let pair_path = PairPath::new(&scene, &scene.allowed, [1, 0], &path);
    let found = verifier.bounds(&pair_path);
    assert!(found.iter().any(|f| !f.open.is_empty() && f.effort < PATH_EFFORT_IN_DOUBT / 5));
}

#[test]
fn flush_sliding_is_not_deep() {
    let turn = Pose::rotation(Vector3::new(0.2, -0.15, 0.1));
    for pose in [Pose::identity(), turn] {
        let (scene, verifier) = scene(block_on_plate().map(|m| moved(m, &pose)));
        let steps = [Vector3::new(2.0, 1.0, 0.0), Vector3::new(-4.0, 0.5, 0.0), Vector3::new(8.0, 0.0, 0.0)];
        let verdict = checked(&scene, &verifier, &steps.map(|s| pose * s));
        assert!(verdict.depth < 1e-9 && verdict.penetrations.is_empty(), "{}", verdict.depth);
    }
}

#[test]
fn a_pin_in_a_round_hole_is_told_by_few_regions() {
    // Facets that do not match, and little play: a plane that leaves most room before a few corners misses others.
    let turn = Pose::rotation(Vector3::new(0.3, -0.2, 0.1));
    let meshes = [tube(1.0, 2.0, [-1.0, 1.0], 48), rod(0.99, [-4.0, 4.0], 44)];
    let (scene, verifier) = scene(meshes.map(|mesh| moved(mesh, &turn)));
    let start = scene.bodies[1].planning_from_shape;
    let path = [start, nalgebra::Translation3::from(turn * Vector3::z() * 8.0) * start];
    let pair_path = PairPath::new(&scene, &scene.allowed, [1, 0], &path);
    let [pin, _] = verifier.bounds(&pair_path);
    let triangles = scene.bodies[1].shape.surface.triangles().len();
    assert!(pin.bound < LIMIT && pin.open.is_empty());
    // A piece is one, a region 40.
    assert!(pin.effort < 4 * triangles, "{} for {triangles} triangles", pin.effort);
}

#[test]
fn a_flush_peg_leaves_its_hole_unhindered() {
    let (scene, verifier) = scene(peg_in_hole(0.0));
    assert!(checked(&scene, &verifier, &[Vector3::z() * 4.0]).depth < 1e-9);
    let askew = checked(&scene, &verifier, &[Vector3::z(), Vector3::x() * 0.05]);
    assert!((askew.depth - 0.05).abs() < 1e-3, "{}", askew.depth);
}

#[test]
fn what_a_turn_sweeps_over_is_found() {
    // A bar that points up turns half-way about y, through a ridge it is clear of at both ends.
    let base = cells([&[-4.0, 1.5, 1.8, 4.0], &[-1.0, 1.0], &[-1.0, 0.0, 2.0]], |c| c[2] == 0 || c[0] == 1);
    let (scene, verifier) = scene([base, cuboid([-0.2, -0.2, 0.5], [0.2, 0.2, 4.5])]);
    let from = scene.bodies[1].planning_from_shape;
    let about = |angle: f64| {
        let foot = Pose::translation(0.0, 0.0, 2.5);
        foot * Pose::rotation(Vector3::y() * angle) * foot.inverse() * from
    };
    assert!(checked_path(&scene, &verifier, &[from, about(-0.5)]).depth < 1e-9);
    let path = [0.0, 1.0, 2.0, 3.0, 4.0].map(|k| about(k * std::f64::consts::FRAC_PI_4));
    assert!(checked_path(&scene, &verifier, &[path[0]]).depth < 1e-9);
    assert!(checked_path(&scene, &verifier, &[path[4]]).depth < 1e-9);
    assert!(checked_path(&scene, &verifier, &path).depth > 0.05);
}

#[test]
fn an_overlap_is_measured_and_granted() {
    let low = cuboid([-3.0, -3.0, -2.0], [3.0, 3.0, 0.0]);
    let (scene, verifier) = scene([low, cuboid([-1.0, -1.0, -0.3], [1.0, 1.0, 3.0])]);
    let depth = overlap(&scene, &verifier, 0, 1);
    assert!((depth - 0.3).abs() < 1e-9, "{depth}");
    assert!((overlap(&scene, &verifier, 1, 0) - depth).abs() < 1e-9);
    assert!(checked(&scene, &verifier, &[Vector3::z() * 0.1, Vector3::x()]).depth < 1e-9);
    let deeper = checked(&scene, &verifier, &[Vector3::z() * -0.1]);
    assert!((deeper.depth - 0.1).abs() < 1e-9, "{}", deeper.depth);
}

#[test]
fn what_keeps_a_deep_overlap_on_its_way_is_let_pass() {
    let low = cuboid([-3.0, -3.0, -2.0], [3.0, 3.0, 0.0]);
    let turned = Pose::new(Vector3::z() * 0.1, Vector3::new(0.7, 0.3, -0.4));
    let (scene, verifier) = scene([low, moved(ball(3), &turned)]);
    let depth = overlap(&scene, &verifier, 0, 1);
    let [low, ball] = &scene.bodies[..] else { unreachable!() };
    let low_from_ball = low.planning_from_shape.inverse() * ball.planning_from_shape;
    let points = on_surface(&ball.shape.surface).into_iter();
    let depths = points.map(|p| -low.shape.surface.signed_distance(&(low_from_ball * p)));
    let deepest = depths.fold(0.0, f64::max);
    assert!(
        deepest > 20.0 * LIMIT && (deepest - LIMIT / 8.0..=deepest + 1e-9).contains(&depth),
        "{depth} of {deepest}"
    );
    let verdict = checked(&scene, &verifier, &[Vector3::x() * 0.7]);
    assert!(verdict.depth < LIMIT / 2.0 && verdict.penetrations.is_empty(), "{}", verdict.depth);
}

#[test]
fn a_nut_a_hair_too_tight_for_its_bolt_is_bounded_as_easily_as_one_that_fits() {
    let effort = |inner: f64| {
        let (bolt, nut) = (rod(0.3, [-4.0, 4.0], 40), tube(inner, 0.6, [3.0, 3.4], 40));
        let (scene, verifier) = scene([bolt, nut]);
        assert_eq!(scene.allowed.of(1, 0) > 0.0, inner < 0.3);
        let start = scene.bodies[1].planning_from_shape;
        let path = [start, Pose::translation(0.0, 0.0, 1.2) * start];
        let pair_path = &PairPath::new(&scene, &scene.allowed, [1, 0], &path);
        let found = verifier.bounds(pair_path);
        assert!(found.iter().all(|side| side.bound < LIMIT / 2.0 && side.open.is_empty()));
        found.iter().map(|side| side.effort).sum::<usize>()
    };
    let (fitting, tight) = (effort(0.3), effort(0.2997));
    assert!(tight < 4 * fitting, "{tight} where {fitting} is enough");
}

#[test]
fn parts_that_touch_or_are_apart_do_not_overlap() {
    let (scene, verifier) = scene(block_on_plate());
    let pair = CongruentPair::turned(&scene, 0, 1);
    let found = verifier.overlap(&scene, &pair, &Termination::default()).unwrap();
    assert!(found.surface < 1e-12 && found.common == 0.0);
}

#[test]
fn coincident_parts_share_their_inside() {
    let block = || cuboid([-3.0, -2.0, -1.0], [3.0, 2.0, 1.0]);
    let (scene, verifier) = scene([block(), block()]);
    assert!(overlap(&scene, &verifier, 0, 1) < 1e-9, "no surface is inside the other");
    let pair = CongruentPair::turned(&scene, 0, 1);
    let found = verifier.overlap(&scene, &pair, &Termination::default()).unwrap();
    assert!((0.9..=1.0).contains(&found.common) && found.depth() == found.common, "{found:?}");
}

#[test]
fn a_depth_up_to_the_limit_is_told_but_not_refused() {
    let (scene, verifier) = scene(block_on_plate());
    // The block is 2 wide and the plate 1 thick.
    let limit = 2.0 * PAIR_LIMIT;
    let slight = checked(&scene, &verifier, &[Vector3::z() * (-0.9 * limit)]);
    assert!((slight.depth - 0.9 * limit).abs() < 1e-9 && slight.penetrations.is_empty());
    assert!(!checked(&scene, &verifier, &[Vector3::z() * (-1.1 * limit)]).penetrations.is_empty());
    assert_eq!((verifier.limit(), slight.limit), (LIMIT, limit));
}

#[test]
fn a_pair_is_judged_alike_whatever_stands_beside_it() {
    // A captive rivet: its head is 0.004 wider than the hole on all sides.
    let limits = [5.5, 9.5].map(|length| {
        let beside = cuboid([2.0, -length / 2.0, 0.0], [3.0, length / 2.0, 1.0]);
        let (scene, verifier) = scene([tube(0.3, 1.0, [0.0, 0.5], 24), rod(0.304, [0.5, 0.8], 24), beside]);
        let verdict = checked(&scene, &verifier, &[Vector3::z() * -2.0]);
        assert!(!verdict.penetrations.is_empty() && verdict.limit < 1e-3, "{}", verdict.limit);
        verdict.limit
    });
    assert_eq!(limits[0], limits[1]);
}

#[test]
fn a_thin_shelf_does_not_pass_a_thin_wall() {
    let wall = cuboid([-4.5, -4.5, 0.0], [4.5, 4.5, 0.004]);
    let shelf = cuboid([-2.0, -0.002, 1.0], [2.0, 0.002, 2.0]);
    let (scene, verifier) = scene([wall, shelf]);
    let verdict = checked(&scene, &verifier, &[Vector3::z() * -3.0]);
    assert!(!verdict.penetrations.is_empty() && verdict.limit < 0.001, "{}", verdict.limit);
}

#[test]
fn a_cancelled_check_ends_with_the_reason() {
    let (scene, verifier) = scene(block_on_plate());
    let termination = Termination::default();
    termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
    let path = [scene.bodies[1].planning_from_shape];
    let ended = verifier.check(&scene, &scene.allowed, &[0], 1, &path, &termination);
    assert_eq!(ended, Err(Interrupt::Cancelled));
}

fn poses(size: f64) -> impl Strategy<Value = Vec<Pose>> {
    let step = prop::array::uniform6(-1.0..1.0f64);
    let step = step.prop_map(move |[x, y, z, a, b, c]| {
        Pose::new(Vector3::new(x, y, z) * size, Vector3::new(a, b, c) * size)
    });
    prop::collection::vec(step, 1..4)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn nothing_is_deeper_than_the_bound(steps in poses(0.08), x in -0.3..0.6f64, turn in 0.0..6.0f64) {
        // Two solids with a reentrant corner each, about to mesh, and something far away.
        let large = |mesh: SourceMesh| SourceMesh {
            vertices: mesh.vertices.iter().map(|v| v.map(|x| x * 1.5)).collect(),
            ..mesh
        };
        let place = Pose::new(Vector3::new(3.0 + x, 0.4, 1.5), Vector3::y() * 0.3 + Vector3::z() * turn);
        let far = cuboid([7.0, -1.0, -1.0], [7.5, 0.0, 0.0]);
        let (scene, verifier) = scene([large(l_shape()), moved(large(l_shape()), &place), far]);
        let allowed = scene.allowed.of(0, 1);
        let from = scene.bodies[1].planning_from_shape;
        let mut path = vec![from];
        path.extend(steps.iter().map(|s| s * from));
        let verdict = checked_path(&scene, &verifier, &path);
        let centre = scene.centre_in_shape(1);
        let poses = |count: u32| -> Vec<Pose> {
            let at = |w: &[Pose], k| interpolate(&w[0], &w[1], &centre, f64::from(k) / f64::from(count));
            path.windows(2).flat_map(|w| (0..=count).map(move |k| at(w, k))).collect()
        };
        let depth = |pose: &Pose, on_moving: bool, p: &Point3<f64>| {
            let relative = scene.bodies[0].planning_from_shape.inverse() * pose;
            let at = if on_moving { relative * p } else { relative.inverse() * p };
            let into = &scene.bodies[usize::from(!on_moving)].shape.surface;
            -into.signed_distance(&at) - allowed
        };
        // What a dense look finds, at points all over both.
        let deepest = poses(10).into_iter().flat_map(|pose| {
            let sides = [(true, 1), (false, 0)];
            sides.map(|(on_moving, body)| {
                let points = on_surface(&scene.bodies[body].shape.surface);
                points.iter().map(|p| depth(&pose, on_moving, p)).fold(0.0, f64::max)
            })
        });
        let deepest = deepest.fold(0.0, f64::max);
        let limit = verdict.limit;
        prop_assert!(verdict.depth >= deepest.min(limit) - 1e-5, "{} for {deepest}", verdict.depth);
        prop_assert_eq!(verdict.depth > limit, !verdict.penetrations.is_empty());
        // No alarm without a cause; a corner may be deep for a moment only.
        let dense = poses(600);
        for e in verdict.penetrations.iter().take(20) {
            let there = dense.iter().map(|pose| depth(pose, e.on_moving, &e.point)).fold(0.0, f64::max);
            prop_assert!(there > 0.25 * limit && e.over <= there + 0.01, "{there} at {e:?}");
        }
    }
}

fn on_surface(surface: &Surface) -> Vec<Point3<f64>> {
    let weights = (0..=6u32).flat_map(|i| (0..=6 - i).map(move |j| [i, j, 6 - i - j]));
    let at = |t: u32, w: [u32; 3]| {
        let corners = surface.corners(t);
        Point3::from((0..3).map(|k| corners[k].coords * f64::from(w[k]) / 6.0).sum::<Vector3<f64>>())
    };
    (0..surface.triangles().len() as u32).flat_map(|t| weights.clone().map(move |w| at(t, w))).collect()
}
