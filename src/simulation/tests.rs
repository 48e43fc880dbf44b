//! The contract of all engines: every test runs over each of [`ENGINES`].

use std::sync::LazyLock;
use std::sync::atomic::Ordering;

use nalgebra::{Point3, Vector3};

use super::{Action, Axis, End, Motion, PenaltyEngine, SlidingEngine, TransitionFunction};
use crate::fixtures::{block_on_plate, cells, cuboid, moved, peg_in_hole, rod, scene, tube};
use crate::geometry::{Pose, SourceMesh};
use crate::plan::Verifier;
use crate::scene::{Scene, StandingParts};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::HULL_MARGIN;

static PENALTY: LazyLock<PenaltyEngine> = LazyLock::new(PenaltyEngine::default);
static ENGINES: LazyLock<[&dyn TransitionFunction; 2]> = LazyLock::new(|| [&SlidingEngine, &*PENALTY]);

const UP: Action = Action::Push(Axis::Z, true);
const DOWN: Action = Action::Push(Axis::Z, false);
const SIDEWAYS: [Action; 4] = [
    Action::Push(Axis::X, true),
    Action::Push(Axis::X, false),
    Action::Push(Axis::Y, true),
    Action::Push(Axis::Y, false),
];

/// Between two samples or two poses of the engine a feature may be a little deeper than there.
const BETWEEN_SAMPLES: f64 = 2e-4;

/// How far from its course contact may let a part stray: its walls give way by the tolerance.
fn play(engine: &dyn TransitionFunction) -> f64 {
    engine.depth_tolerance().max(5e-3)
}

/// A scene in which part 1 moves and part 0 stands.
struct Case {
    name: &'static str,
    scene: Scene,
    verifier: Verifier,
    surroundings: StandingParts,
}

impl Case {
    fn new(name: &'static str, meshes: impl IntoIterator<Item = SourceMesh>) -> Self {
        let (scene, verifier) = scene(meshes);
        let surroundings = StandingParts::new(&scene, vec![0]);
        Self { name, scene, verifier, surroundings }
    }

    fn assembled(&self) -> Pose {
        self.scene.bodies[1].planning_from_shape
    }

    fn motion(&self, engine: &dyn TransitionFunction, action: Action) -> Motion {
        let t = Termination::default();
        engine.simulate(&self.scene, &self.surroundings, 1, &self.assembled(), action, &t).unwrap()
    }

    /// A bound of the depth beyond the allowed penetrations along a path, on the triangles, precisely
    /// enough to compare it with `most`.
    fn depth(&self, path: &[Pose], most: f64) -> f64 {
        let (scene, t) = (&self.scene, Termination::default());
        self.verifier.with_limit(most).check(scene, &scene.allowed, &[0], 1, path, &t).unwrap().depth
    }
}

fn tilted() -> Pose {
    Pose::rotation(Vector3::new(0.1, 0.5, 0.0))
}

/// A frame with a small block in the middle of it, touching nothing.
fn block_in_frame() -> [SourceMesh; 2] {
    let across: &[f64] = &[-4.0, -3.0, 3.0, 4.0];
    let frame = cells([across, across, &[-2.0, 2.0]], |c| c != [1, 1, 0]);
    [frame, cuboid([-0.5, -0.4, -0.3], [0.5, 0.4, 0.3])]
}

/// A tube with a rod in it that is wider than the bore by `excess` all around.
fn round_peg(excess: f64) -> [SourceMesh; 2] {
    [tube(1.0, 3.0, [-2.0, 2.0], 24), rod(1.0 + excess, [-3.0, 3.0], 24)]
}

fn cases() -> Vec<Case> {
    vec![
        Case::new("block on plate", block_on_plate()),
        Case::new("flush peg", peg_in_hole(0.0)),
        Case::new("loose peg", peg_in_hole(-0.05)),
        Case::new("press fit", peg_in_hole(0.02)),
        Case::new("tilted peg", peg_in_hole(0.0).map(|m| moved(m, &tilted()))),
        Case::new("block in frame", block_in_frame()),
        Case::new("round peg", round_peg(0.0)),
        Case::new("loose round peg", round_peg(-0.03)),
    ]
}

fn reach(points: impl Iterator<Item = Point3<f64>>, d: &Vector3<f64>) -> (f64, f64) {
    points.map(|p| p.coords.dot(d)).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)))
}

/// The gap between part 1 at the end of its path and part 0, along a direction.
fn gap(case: &Case, motion: &Motion, d: &Vector3<f64>) -> f64 {
    let vertices = |part: usize, pose: Pose| {
        case.scene.bodies[part].shape.surface.vertices().iter().map(move |v| pose * v)
    };
    let (_, mine) = reach(vertices(1, motion.path[motion.path.len() - 1]), d);
    let (theirs, _) = reach(vertices(0, case.scene.bodies[0].planning_from_shape), d);
    theirs - mine
}

#[track_caller]
fn assert_out(case: &Case, motion: &Motion) {
    let End::Disassembled(d) = &motion.end else { panic!("{}: {:?}", case.name, motion.end) };
    assert!((d.norm() - 1.0).abs() < 1e-9, "{}: {d} is no direction", case.name);
    let gap = gap(case, motion, d);
    assert!(gap >= HULL_MARGIN / 2.0, "{}: a gap of {gap} along {d}", case.name);
}

#[test]
fn a_block_leaves_its_plate_upwards() {
    let case = Case::new("block on plate", block_on_plate());
    for engine in *ENGINES {
        let motion = case.motion(engine, UP);
        assert_out(&case, &motion);
        assert!(motion.path.len() > 1);
        let moved =
            motion.path[motion.path.len() - 1].translation.vector - case.assembled().translation.vector;
        assert!(moved.z > 0.0 && moved.xy().norm() < 1e-6, "{moved}");
    }
}

#[test]
fn a_block_pushed_into_its_plate_goes_nowhere() {
    let case = Case::new("block on plate", block_on_plate());
    for engine in *ENGINES {
        let motion = case.motion(engine, DOWN);
        assert_eq!(motion.end, End::Collision { with: vec![0] }, "{}", engine.name());
        for pose in &motion.path {
            let off = (pose.translation.vector - case.assembled().translation.vector).norm();
            assert!(off <= engine.depth_tolerance(), "{} lets it sink by {off}", engine.name());
        }
    }
}

/// Only an engine without forces can promise this: where stiffness holds a part, it sinks.
#[test]
fn sliding_does_not_move_a_block_pushed_into_its_plate() {
    let case = Case::new("block on plate", block_on_plate());
    let motion = case.motion(&SlidingEngine, DOWN);
    let stuck = End::Collision { with: vec![0] };
    assert_eq!(motion, Motion::simulated(vec![case.assembled()], Vec::new(), stuck));
}

#[test]
fn a_block_slides_over_its_plate_until_it_is_out() {
    let case = Case::new("block on plate", block_on_plate());
    for (engine, action) in ENGINES.into_iter().flat_map(|e| SIDEWAYS.map(|a| (e, a))) {
        let motion = case.motion(engine, action);
        assert!(matches!(motion.end, End::Disassembled(_)), "{action}: {:?}", motion.end);
        for pose in &motion.path {
            let lift = pose.translation.z - case.assembled().translation.z;
            assert!(lift.abs() < 1e-3, "{action} lifts it by {lift}");
        }
    }
}

#[test]
fn a_peg_in_a_blind_hole_leaves_only_upwards() {
    for excess in [0.0, 0.02] {
        let case = Case::new("peg", peg_in_hole(excess));
        for engine in *ENGINES {
            assert_out(&case, &case.motion(engine, UP));
            for action in SIDEWAYS.into_iter().chain([DOWN]) {
                let motion = case.motion(engine, action);
                assert_eq!(motion.end, End::Collision { with: vec![0] }, "{action}, excess {excess}");
            }
        }
    }
}

#[test]
fn a_round_peg_leaves_its_bore_both_ways_and_turns_in_it() {
    for excess in [0.0, -0.03, 0.02] {
        let case = Case::new("round peg", round_peg(excess));
        for engine in *ENGINES {
            assert_out(&case, &case.motion(engine, UP));
            assert_out(&case, &case.motion(engine, DOWN));
            for action in SIDEWAYS {
                let motion = case.motion(engine, action);
                assert_eq!(motion.end, End::Collision { with: vec![0] }, "{action}, excess {excess}");
            }
        }
    }
    let case = Case::new("loose round peg", round_peg(-0.03));
    for engine in *ENGINES {
        let motion = case.motion(engine, Action::Turn(Axis::Z, true));
        assert!(matches!(motion.end, End::Undecided { .. }), "{:?}", motion.end);
    }
}

#[test]
fn a_loose_peg_stops_at_the_wall() {
    let case = Case::new("loose peg", peg_in_hole(-0.05));
    for (engine, action) in ENGINES.into_iter().flat_map(|e| SIDEWAYS.map(|a| (e, a))) {
        let motion = case.motion(engine, action);
        assert_eq!(motion.end, End::Collision { with: vec![0] }, "{action}");
        let last = motion.path[motion.path.len() - 1];
        let travel = (last.translation.vector - case.assembled().translation.vector).dot(&action.force());
        assert!((travel - 0.05).abs() <= 2.0 * engine.depth_tolerance(), "{action} by {travel}");
    }
}

#[test]
fn a_push_at_a_slant_slides_along_the_hole() {
    let case = Case::new("tilted peg", peg_in_hole(0.0).map(|m| moved(m, &tilted())));
    let axis = tilted() * Vector3::z();
    for engine in *ENGINES {
        let motion = case.motion(engine, UP);
        assert_out(&case, &motion);
        // In the hole it can only follow the axis.
        let within = |v: &Vector3<f64>| v.dot(&axis) < 1.9;
        let travel = motion.path.iter().map(|p| p.translation.vector - case.assembled().translation.vector);
        for v in travel.filter(within) {
            assert!(v.cross(&axis).norm() < play(engine), "{v} is off the axis");
        }
        assert!(matches!(case.motion(engine, DOWN).end, End::Collision { .. }));
    }
}

#[test]
fn a_tilted_block_slides_down_to_the_stop() {
    // A ramp at 45 degrees with a ridge at its lower end.
    let turn = Pose::rotation(Vector3::new(0.0, std::f64::consts::FRAC_PI_4, 0.0));
    let ramp = cells([&[-3.0, 3.0, 3.5], &[-2.0, 2.0], &[-0.5, 0.0, 1.0]], |c| c != [0, 0, 1]);
    let block = cuboid([-1.0, -0.5, 0.0], [0.0, 0.5, 0.8]);
    let case = Case::new("ramp", [ramp, block].map(|m| moved(m, &turn)));
    for engine in *ENGINES {
        let motion = case.motion(engine, DOWN);
        assert_eq!(motion.end, End::Collision { with: vec![0] });
        let last = motion.path[motion.path.len() - 1];
        let travel = last.translation.vector - case.assembled().translation.vector;
        let along = turn * Vector3::x();
        assert!((travel.dot(&along) - 3.0).abs() < play(engine), "{travel}");
        assert!(travel.cross(&along).norm() < play(engine), "{travel}");
    }
}

#[test]
fn a_part_falls_into_the_pit_that_it_slides_over() {
    // A long slide on a ramp at 45 degrees, then a pit a fifth longer than the block.
    let turn = Pose::rotation(Vector3::new(0.0, std::f64::consts::FRAC_PI_4, 0.0));
    let ramp = cells([&[-3.0, 2.0, 3.2, 4.5], &[-2.0, 2.0], &[-1.5, -0.6, 0.0]], |c| c != [1, 0, 1]);
    let block = cuboid([-2.0, -0.5, 0.0], [-1.0, 0.5, 0.8]);
    let case = Case::new("pit", [ramp, block].map(|m| moved(m, &turn)));
    for engine in *ENGINES {
        let motion = case.motion(engine, DOWN);
        assert_eq!(motion.end, End::Collision { with: vec![0] });
        let last = motion.path[motion.path.len() - 1];
        let travel = turn.inverse() * (last.translation.vector - case.assembled().translation.vector);
        let expected = Vector3::new(4.2, 0.0, -0.6);
        assert!((travel - expected).norm() < 2.0 * play(engine), "{}: {travel}", engine.name());
    }
}

#[test]
fn the_same_input_gives_the_same_motion_to_the_bit() {
    let actions: Vec<_> = [
        UP,
        DOWN,
        Action::Drag(Axis::Z, true),
        Action::Turn(Axis::Z, true),
        Action::Screw(Axis::Z, true, false),
    ]
    .into_iter()
    .chain(SIDEWAYS)
    .collect();
    for case in cases() {
        for (engine, &action) in ENGINES.into_iter().flat_map(|e| actions.iter().map(move |a| (e, a))) {
            // Debug output tells also -0 from 0.
            let twice = [(); 2].map(|()| format!("{:?}", case.motion(engine, action)));
            assert!(twice[0] == twice[1], "{}: {action} under {}", case.name, engine.name());
        }
    }
}

#[test]
fn no_path_is_deeper_than_the_engine_declares() {
    for case in cases() {
        let actions = Action::translations()
            .into_iter()
            .chain(Action::rotations_about(&Axis::WORLD))
            .chain(Action::screws_along(&Axis::WORLD));
        for (engine, action) in actions.flat_map(|a| ENGINES.map(|e| (e, a))) {
            let motion = case.motion(engine, action);
            assert_eq!(motion.path[0], case.assembled(), "{}: {action}", case.name);
            let most = engine.depth_tolerance() + BETWEEN_SAMPLES;
            let depth = case.depth(&motion.path, most);
            assert!(depth <= most, "{}: {action} gets {depth} deep, ends in {:?}", case.name, motion.end);
            if matches!(motion.end, End::Disassembled(_)) {
                assert_out(&case, &motion);
            }
        }
    }
}

#[test]
fn collisions_name_standing_parts_in_order() {
    for case in cases() {
        for (engine, action) in
            Action::rotations_about(&Axis::WORLD).into_iter().flat_map(|a| ENGINES.map(|e| (e, a)))
        {
            let motion = case.motion(engine, action);
            let (End::Collision { with: named } | End::Undecided { touched: named, .. }) = motion.end else {
                continue;
            };
            assert!(named.is_empty() || named == [0], "{}: {action} names {named:?}", case.name);
        }
    }
}

#[test]
fn a_push_does_not_turn_the_part() {
    for case in cases() {
        for (engine, action) in Action::translations().into_iter().flat_map(|a| ENGINES.map(|e| (e, a))) {
            for pose in case.motion(engine, action).path {
                assert_eq!(pose.rotation, case.assembled().rotation, "{}: {action}", case.name);
            }
        }
    }
}

#[test]
fn a_cancelled_simulation_ends_with_the_reason() {
    let case = Case::new("block on plate", block_on_plate());
    let termination = Termination::default();
    termination.cancel_flag().store(true, Ordering::Relaxed);
    for engine in *ENGINES {
        let (scene, start) = (&case.scene, case.assembled());
        let ended = engine.simulate(scene, &case.surroundings, 1, &start, UP, &termination);
        assert_eq!(ended, Err(Interrupt::Cancelled));
    }
}

#[test]
fn a_free_part_that_turns_comes_to_an_end() {
    let case = Case::new("block in frame", block_in_frame());
    for (engine, axis) in ENGINES.into_iter().flat_map(|e| [Axis::X, Axis::Y, Axis::Z].map(|a| (e, a))) {
        for way in [true, false] {
            let motion = case.motion(engine, Action::Turn(axis, way));
            let End::Undecided { touched, .. } = &motion.end else { panic!("{axis:?}: {:?}", motion.end) };
            assert!(touched.is_empty(), "{touched:?}");
            let centre = motion.path[motion.path.len() - 1].translation.vector;
            assert!((centre - case.assembled().translation.vector).norm() < 1e-9, "{centre}");
        }
    }
}

#[test]
fn with_nothing_around_a_part_is_out_at_once() {
    let case = Case::new("block on plate", block_on_plate());
    let nothing = StandingParts::new(&case.scene, Vec::new());
    for engine in *ENGINES {
        let start = case.assembled();
        let motion =
            engine.simulate(&case.scene, &nothing, 1, &start, DOWN, &Termination::default()).unwrap();
        assert!(matches!(motion.end, End::Disassembled(_)), "{:?}", motion.end);
    }
}

#[test]
fn a_displaced_part_starts_where_it_is_told() {
    let case = Case::new("peg", peg_in_hole(0.0));
    let start = Pose::translation(0.0, 0.0, 1.0) * case.assembled();
    for engine in *ENGINES {
        let t = Termination::default();
        let motion = engine.simulate(&case.scene, &case.surroundings, 1, &start, DOWN, &t).unwrap();
        assert_eq!((motion.path[0], &motion.end), (start, &End::Collision { with: vec![0] }));
        let last = motion.path[motion.path.len() - 1];
        let off = (last.translation.vector - case.assembled().translation.vector).norm();
        assert!(off <= 2.0 * engine.depth_tolerance(), "back in its place but for {off}");
    }
}
