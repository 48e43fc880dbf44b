//! Screws checked against a dense look: never a bound below what is there.

use std::f64::consts::TAU;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use crate::fixtures::{LIMIT, cuboid, joined, open_box, scene, thread, wire_in_tube};
use crate::geometry::{Bounds, Pose, SourceMesh, interpolate};
use crate::plan::Verifier;
use crate::scene::Scene;
use crate::termination::Termination;

use super::super::PairPath;
use super::super::course::{Course, Interval};
use super::unsettled;

const TURNS: f64 = 3.0;
const PITCH: f64 = 0.5;

/// The nut of a scene screwed by `turns`, rising by `pitch` per turn, set off by a displacement.
fn screwed(scene: &Scene, turns: f64, pitch: f64, off: &Pose) -> Vec<Pose> {
    let steps = (turns.abs() * 8.0).ceil();
    let at = |k: f64| {
        let turn = turns * k / steps;
        let screw = Pose::new(Vector3::z() * (pitch * turn), Vector3::z() * (TAU * turn));
        screw * off * scene.bodies[1].planning_from_shape
    };
    (0..=steps as usize).map(|k| at(k as f64)).collect()
}

/// The deepest that a dense look at the vertices of both parts finds.
fn dense(scene: &Scene, path: &[Pose]) -> f64 {
    let centre = scene.centre_in_shape(1);
    let shapes = [0, 1].map(|i| &scene.bodies[i].shape.surface);
    let poses = path
        .windows(2)
        .flat_map(|w| (0..6).map(|k| interpolate(&w[0], &w[1], &centre, f64::from(k) / 6.0)))
        .chain(path.last().copied());
    let into = |of: usize, to_other: &Pose| {
        let depth = |p: &Point3<f64>| -shapes[1 - of].signed_distance(p);
        let near = Bounds::of(shapes[1 - of].vertices());
        let points = shapes[of].vertices().iter().map(|v| to_other * v).filter(|p| near.contains(p));
        points.map(|p| depth(&p)).fold(0.0, f64::max)
    };
    poses
        .map(|pose| {
            let to_standing = scene.bodies[0].planning_from_shape.inverse() * pose;
            into(1, &to_standing).max(into(0, &to_standing.inverse()))
        })
        .fold(0.0, f64::max)
}

fn checked(scene: &Scene, verifier: &Verifier, path: &[Pose]) -> f64 {
    let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != 1).collect();
    let t = Termination::default();
    verifier.check(scene, &scene.allowed, &standing, 1, path, &t).unwrap().depth
}

/// The share of the way that profiles leave open.
fn open(scene: &Scene, path: &[Pose]) -> Vec<Interval> {
    let pair_path = PairPath::new(scene, &scene.allowed, [1, 0], path);
    let course = Course::new(&pair_path.path, pair_path.centre, pair_path.reach());
    unsettled(&course, pair_path.surfaces(), vec![Interval::WHOLE], LIMIT, &Termination::default()).unwrap()
}

fn nut_on_bolt() -> [SourceMesh; 2] {
    thread(TURNS, PITCH)
}

#[test]
fn a_thread_that_fits_is_settled_whole() {
    let (scene, verifier) = scene(nut_on_bolt());
    let path = screwed(&scene, TURNS, PITCH, &Pose::identity());
    assert_eq!(open(&scene, &path), []);
    assert!(checked(&scene, &verifier, &path) < LIMIT / 8.0);
}

#[test]
fn a_wire_in_its_tube_is_settled_nearly_whole() {
    let (scene, verifier) = scene(wire_in_tube());
    let path = screwed(&scene, TURNS, 2.5, &Pose::identity());
    // Its centre is off the axis and moves straight from one pose to the next, an eighth of a turn further.
    let open_share: f64 = open(&scene, &path).iter().map(|i| i.of(1.0)).map(|[from, to]| to - from).sum();
    assert!(open_share < 0.01, "{open_share}");
    assert!(checked(&scene, &verifier, &path) < LIMIT);
    // Up or down by more than its play, it is in a wall.
    let path = screwed(&scene, 1.0, 2.5, &Pose::translation(0.0, 0.0, 0.05));
    assert!(dense(&scene, &path) > LIMIT && checked(&scene, &verifier, &path) > LIMIT);
}

#[test]
fn a_bolt_whose_head_crosses_its_shank_is_settled_as_others_are_and_one_with_holes_is_not() {
    // The head's lower half sticks in the shank, below the nut.
    let [bolt, nut] = nut_on_bolt();
    let path = |scene: &Scene| screwed(scene, TURNS, PITCH, &Pose::identity());
    for (head, open) in [(cuboid as fn(_, _) -> _, false), (open_box, true)] {
        let head: SourceMesh = head([-1.5, -1.5, -1.0], [1.5, 1.5, 0.7]);
        let (scene, verifier) = scene([joined([bolt.clone(), head]), nut.clone()]);
        let bolt = &scene.bodies[0].shape.surface;
        assert!(bolt.is_open() && bolt.rim().is_some() == open);
        let pair_path = PairPath::new(&scene, &scene.allowed, [1, 0], &path(&scene));
        let found = verifier.bounds(&pair_path);
        assert_eq!(found.iter().all(|f| f.open.is_empty()), !open, "{found:?}");
        assert!(checked(&scene, &verifier, &path(&scene)) < LIMIT / 8.0);
    }
}

#[test]
fn a_wrong_pitch_is_refused() {
    let (scene, verifier) = scene(nut_on_bolt());
    for pitch in [0.8 * PITCH, 1.25 * PITCH, -PITCH] {
        let path = screwed(&scene, 2.0, pitch, &Pose::identity());
        assert!(dense(&scene, &path) > LIMIT && checked(&scene, &verifier, &path) > LIMIT, "{pitch}");
    }
}

#[test]
fn a_stop_at_the_end_is_met() {
    // The nut's upper face ends at 6 − 3 · 0.5 + 1 = 5.5, and rises by 1 in two turns.
    let [bolt, nut] = nut_on_bolt();
    let stop = cuboid([1.3, -1.0, 6.2], [1.6, 1.0, 7.0]);
    let (scene, verifier) = scene([bolt, nut, stop]);
    let path = screwed(&scene, 2.0, PITCH, &Pose::identity());
    assert!(checked(&scene, &verifier, &path[..=8]) < LIMIT / 8.0);
    assert!(checked(&scene, &verifier, &path) > LIMIT);
}

#[test]
fn a_path_pressed_to_its_thread_is_brought_into_the_middle_of_the_play() {
    let (scene, verifier) = scene(nut_on_bolt());
    // To and fro, by two thirds of the play.
    let straight = screwed(&scene, TURNS + 1.0, PITCH, &Pose::identity());
    let wobble = |k: usize| Pose::translation(0.02 * (k as f64 * 1.7).sin(), 0.02 * (k as f64).sin(), 0.0);
    let path: Vec<Pose> = straight.iter().enumerate().map(|(k, p)| wobble(k) * p).collect();
    let t = Termination::default();
    let centred = verifier.path_on_thread(&scene, &[0], 1, &path, &t).unwrap().unwrap();
    t.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
    assert!(verifier.path_on_thread(&scene, &[0], 1, &path, &t).is_err(), "half a profile tells nothing");
    assert_eq!(centred[0], path[0]);
    assert_eq!(centred[centred.len() - 1], path[path.len() - 1]);
    assert!(checked(&scene, &verifier, &centred) <= LIMIT);
    // Away from its ends both axes are one, to half of the play (0.0075 on these coarse facets).
    let start = scene.bodies[1].planning_from_shape;
    let middle = start * scene.centre_in_shape(1);
    let on_axis = |pose: &Pose| (pose * start.inverse() * middle).xy().coords;
    let off = centred[5..centred.len() - 8].iter().map(|p| on_axis(p).norm()).fold(0.0, f64::max);
    assert!(off < 0.015, "{off}");
    assert!(path[5..].iter().any(|p| on_axis(p).norm() > 0.015));
}

#[test]
fn what_turns_beside_no_thread_is_left_as_it_is() {
    let peg = cuboid([-0.5, -0.5, 0.0], [0.5, 0.5, 4.0]);
    let (scene, verifier) = scene([cuboid([-3.0, -3.0, -1.0], [3.0, 3.0, 0.0]), peg]);
    let path = screwed(&scene, 2.0, PITCH, &Pose::identity());
    assert_eq!(verifier.path_on_thread(&scene, &[0], 1, &path, &Termination::default()), Ok(None));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn no_screw_is_deeper_than_its_bound(
        x in -0.04..0.04f64, z in -0.1..0.1f64, tilt in -0.03..0.03f64, pitch in 0.48..0.52f64, turns in 1.0..2.5f64,
    ) {
        let (scene, verifier) = scene(nut_on_bolt());
        let off = Pose::new(Vector3::new(x, 0.0, z), Vector3::y() * tilt);
        let path = screwed(&scene, turns, pitch, &off);
        let deepest = dense(&scene, &path);
        let depth = checked(&scene, &verifier, &path);
        prop_assert!(depth >= deepest.min(LIMIT) - 1e-4, "{depth} for {deepest}");
        // Where profiles settle the way, not even the finest look finds anything.
        if open(&scene, &path).is_empty() {
            prop_assert!(deepest <= 1e-9, "{deepest}");
        }
    }
}
