//! What searches find, prove and report. `paper_tests` has what the paper prescribes.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;

use super::*;
use crate::blocking_graph::StaticAnalysis;
use crate::cache::RequestCache;
use crate::fixtures::{cells, cuboid, flats_in_slot, moved, open_box, rod, scene, tube};
use crate::geometry::{Pose, SourceMesh};
use crate::plan::{Base, PlanStatus, Verifier};
use crate::scene::Scene;
use crate::simulation::SlidingEngine;
use crate::tolerances::{HULL_CLEARANCE, HULL_MARGIN};

#[derive(Default)]
pub(super) struct Recorder(pub(super) Vec<TraceEvent>);

impl Observer for Recorder {
    fn progress(&mut self, _: usize, _: u64) {}
    fn removal(&mut self, _: &Removal) {}
    fn traces(&self) -> bool {
        true
    }
    fn traced(&mut self, event: TraceEvent) {
        self.0.push(event);
    }
}

pub(super) fn problem(scene: Scene, verifier: &Verifier) -> Problem<'_> {
    Problem {
        end_gap: None,
        clearance: 0.0,
        preferred: PreferredGroups::default(),
        up: None,
        seed: 0,
        present: (0..scene.bodies.len()).collect(),
        scene,
        verifier,
        engine: &SlidingEngine,
        fixed: Vec::new(),
        base: Base::default(),
        keep: Vec::new(),
        keep_out: Vec::new(),
        releases_kept: false,
        released: Release::Nothing,
        targets: None,
        is_group: false,
        effort: Effort::All,
        actions: ActionSet::Paper,
        static_analysis: StaticAnalysis::default(),
        sweeps: false,
        max_simulations: None,
        earlier: Vec::new(),
        spent: 0,
        path_timeout: None,
        termination: Termination::default(),
        cache: RequestCache::default(),
        verdicts: Arc::default(),
        scaled: Arc::default(),
        extra_points: HashMap::new(),
    }
}

/// Plans two parts with the extended actions.
fn pair(parts: [SourceMesh; 2]) -> Outcome {
    let (scene, verifier) = scene(parts);
    let problem = Problem {
        present: vec![0, 1],
        actions: ActionSet::Extended,
        sweeps: true,
        // Far more than any of them needs.
        max_simulations: Some(1000),
        ..problem(scene, &verifier)
    };
    search(Planner::SbdpStar, problem, &mut Recorder::default())
}

/// A covered channel that runs to and fro in `rows` rows, each nine cells long and one apart from
/// the next, and in its first cell a cube that leaves at the end of the last one.
fn serpentine(rows: usize) -> [SourceMesh; 2] {
    const LENGTH: usize = 9;
    let cell = 9.45 / (LENGTH + 2).max(2 * rows + 1) as f64;
    let lines = |count: usize| (0..=count).map(|i| i as f64 * cell).collect::<Vec<_>>();
    let (x, y, z) = (lines(LENGTH + 2), lines(2 * rows + 1), lines(3));
    let is_right_end = |row: usize| row.is_multiple_of(2);
    let is_channel = |x: usize, y: usize| {
        let within = (1..=LENGTH).contains(&x);
        if y % 2 == 1 {
            let exit = if is_right_end(rows - 1) { LENGTH + 1 } else { 0 };
            within || (y == 2 * rows - 1 && x == exit)
        } else {
            (2..2 * rows).contains(&y) && x == if is_right_end(y / 2 - 1) { LENGTH } else { 1 }
        }
    };
    let maze = cells([&x, &y, &z], |[x, y, z]| z != 1 || !is_channel(x, y));
    let (lo, hi) = (cell + 0.02, 2.0 * cell - 0.02);
    [maze, cuboid([lo; 3], [hi; 3])]
}

#[test]
fn no_maze_has_too_many_moves() {
    for rows in [3, 10, 25] {
        let outcome = pair(serpentine(rows));
        assert_eq!(outcome.status, PlanStatus::Complete, "{rows} rows: {:?}", outcome.reason);
    }
}

/// A closed corridor of 2 by 2 along x, from 1 to 7, with a window of some width in its ceiling, whose middle is at
/// x = 4.5, and at the corridor's end a cube that fills it but for the play at each side.
fn corridor(play: f64, width: f64) -> [SourceMesh; 2] {
    let window = [4.5 - width / 2.0, 4.5 + width / 2.0];
    let housing = cells(
        [&[0.0, 1.0, window[0], window[1], 7.0, 8.0], &[0.0, 1.0, 3.0, 4.0], &[0.0, 1.0, 3.0, 4.0]],
        |c| {
            let is_corridor = (1..=3).contains(&c[0]) && c[1] == 1 && c[2] == 1;
            let is_window = c == [2, 1, 2];
            !is_corridor && !is_window
        },
    );
    [housing, cuboid([1.0 + play; 3], [3.0 - play; 3])]
}

#[test]
fn a_part_stops_half_way_where_a_window_is_as_wide_as_its_play_or_just_fits() {
    let turn = nalgebra::UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1);
    let turned = crate::geometry::Pose::from_parts(nalgebra::Translation3::new(1.0, 2.0, 3.0), turn);
    for (play, width) in [(0.05, 2.0), (0.0, 2.0), (0.0, 2.5), (0.01, 1.981)] {
        for pose in [crate::geometry::Pose::identity(), turned] {
            let outcome = pair(corridor(play, width).map(|mesh| moved(mesh, &pose)));
            assert_eq!(
                outcome.status,
                PlanStatus::Complete,
                "play {play}, window {width}: {:?}",
                outcome.reason
            );
        }
    }
    assert_ne!(pair(corridor(0.05, 1.8)).status, PlanStatus::Complete, "the cube is 1.9 wide");
}

#[test]
fn a_loose_part_finds_a_hole_that_is_beside_all_walls_and_above_none_of_its_places() {
    // A box with a room of 6 by 6 by 4, and in its ceiling a hole of 1.1; in the room a cube of 1.
    for hole in [[3.1, 2.3], [5.2, 4.4]] {
        let lines = |at: f64| [0.0, 1.0, at, at + 1.1, 7.0, 8.0];
        let (x, y) = (lines(hole[0]), lines(hole[1]));
        let housing = cells([&x, &y, &[0.0, 1.0, 5.0, 6.0]], |c| {
            let is_room = (1..=3).contains(&c[0]) && (1..=3).contains(&c[1]) && c[2] == 1;
            let is_hole = c == [2, 2, 2];
            !is_room && !is_hole
        });
        let outcome = pair([housing, cuboid([1.7, 1.2, 1.0], [2.7, 2.2, 2.0])]);
        assert_eq!(outcome.status, PlanStatus::Complete, "{hole:?}: {:?}", outcome.reason);
    }
}

/// A box drawn as a surface without thickness, with a square hole in the middle of its top, and in it a cube.
fn surface_box(hole: f64, cube: f64) -> [SourceMesh; 2] {
    let lines: &[f64] = &[-3.0, -hole / 2.0, hole / 2.0, 3.0];
    let mut walls = cells([lines, lines, &[-3.0, 3.0]], |_| true);
    let SourceMesh { vertices, triangles } = &mut walls;
    let is_in_hole = |v: &u32| {
        let [x, y, z] = vertices[*v as usize];
        z == 3.0 && x.abs() < 3.0 && y.abs() < 3.0
    };
    triangles.retain(|t| !t.iter().all(is_in_hole));
    let [low, high] = [-2.5, cube - 2.5];
    [walls, cuboid([low; 3], [high; 3])]
}

#[test]
fn a_surface_is_a_wall_from_both_sides() {
    let turns = [
        (0.0, 0.0, 0.0),
        (std::f64::consts::PI, 0.0, 0.0),
        (0.0, std::f64::consts::FRAC_PI_2, 0.0),
        (0.3, -0.7, 1.1),
    ];
    for (roll, pitch, yaw) in turns {
        let turn = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let turned = crate::geometry::Pose::from_parts(nalgebra::Translation3::identity(), turn);
        let status = |meshes: [SourceMesh; 2]| pair(meshes.map(|mesh| moved(mesh, &turned))).status;
        assert_eq!(status(surface_box(2.2, 2.0)), PlanStatus::Complete, "the cube fits, {turn}");
        assert_eq!(status(surface_box(1.9, 2.0)), PlanStatus::Infeasible, "it does not fit, {turn}");
        let tray = pair(
            [open_box([-3.0; 3], [3.0; 3]), cuboid([-2.9, -2.9, -2.9], [2.9, 2.9, -1.0])]
                .map(|mesh| moved(mesh, &turned)),
        );
        let [Removal { parts, path, .. }] = &tray.removals[..] else { panic!("{:?}", tray.reason) };
        let way = path[path.len() - 1].translation.vector - path[0].translation.vector;
        // The cuboid leaves upwards, or the tray downwards.
        let up = turn.inverse() * way * if parts[0] == 1 { 1.0 } else { -1.0 };
        assert!(up.z > 1.9 && up.xy().norm() < 0.5 * up.z, "parts {parts:?} leaves by {up:?}");
    }
}

/// Two rings in one another, or beside each other.
fn rings(apart: f64) -> [SourceMesh; 2] {
    let ring = || tube(1.5, 2.0, [-0.25, 0.25], 24);
    let turn = nalgebra::UnitQuaternion::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
    let pose = crate::geometry::Pose::from_parts(nalgebra::Translation3::new(apart, 0.1, 0.0), turn);
    [ring(), moved(ring(), &pose)]
}

#[test]
fn linked_rings_are_proved_never_to_come_apart() {
    let outcome = pair(rings(1.75));
    assert_eq!((outcome.status, outcome.counters.simulations), (PlanStatus::Infeasible, 0));
    assert!(
        matches!(outcome.reason, Some(Reason::Inseparable(pair)) if pair.proof == SeparationProof::Linked)
    );
    let blocked: Vec<_> = outcome.blocked.iter().map(|b| (b.part, b.by.as_slice())).collect();
    assert!(blocked.contains(&(0, &[1])) && blocked.contains(&(1, &[0])), "{blocked:?}");
}

#[test]
fn what_only_looks_linked_comes_apart() {
    assert_eq!(pair(rings(4.2)).status, PlanStatus::Complete, "beside each other");
    let through = [tube(1.5, 2.0, [-3.0, 3.0], 24), rod(1.0, [-3.5, 3.5], 24)];
    assert_eq!(pair(through).status, PlanStatus::Complete, "a rod has no hole");
}

#[test]
fn a_motion_without_time_is_undecided_and_no_proof_of_anything() {
    let (scene, verifier) = scene(paper_tests::pin_bolt_cover());
    for planner in Planner::ALL {
        let problem =
            Problem { path_timeout: Some(std::time::Duration::ZERO), ..problem(scene.clone(), &verifier) };
        let outcome = search(planner, problem, &mut Recorder::default());
        assert_eq!((outcome.status, outcome.remaining.len()), (PlanStatus::Timeout, 3), "{planner:?}");
    }
}

/// A plate with two pegs and a block on it, and a second plate beside: all leave straight.
fn straight() -> Vec<SourceMesh> {
    let across: &[f64] = &[-4.0, -3.0, -2.0, 2.0, 3.0, 4.0];
    let plate =
        cells([across, across, &[-1.0, -0.5, 0.0]], |[x, y, z]| z == 0 || y != 2 || (x != 1 && x != 3));
    let block = |x: [f64; 2], z: [f64; 2]| cells([&x, &[-2.0, 2.0], &z], |_| true);
    vec![
        plate,
        block([-3.0, -2.0], [-0.5, 1.0]),
        block([2.0, 3.0], [-0.5, 1.0]),
        block([-1.0, 1.0], [0.0, 2.0]),
    ]
}

fn with_sweeps(sweeps: bool) -> (Outcome, Vec<TraceEvent>) {
    let (scene, verifier) = scene(straight());
    let present = (0..scene.bodies.len()).collect();
    let mut recorder = Recorder::default();
    let problem = Problem { present, sweeps, actions: ActionSet::Extended, ..problem(scene, &verifier) };
    (search(Planner::SbdpStar, problem, &mut recorder), recorder.0)
}

#[test]
fn what_leaves_straight_is_not_simulated() {
    let (swept, events) = with_sweeps(true);
    let (simulated, _) = with_sweeps(false);
    let order = |o: &Outcome| o.removals.iter().map(|r| r.parts[0]).collect::<Vec<_>>();
    assert_eq!((swept.status, order(&swept)), (PlanStatus::Complete, order(&simulated)));
    assert_eq!((swept.counters.simulations, swept.counters.sweeps), (0, 3));
    assert_eq!((simulated.counters.simulations, simulated.counters.sweeps), (3, 0));
    let told = events.iter().filter(|e| matches!(e, TraceEvent::Swept { .. })).count();
    assert_eq!(told, 3);
    assert!(events.iter().all(|e| !matches!(e, TraceEvent::Simulated { .. })));
}

#[test]
fn what_leaves_either_way_takes_the_shorter() {
    for (heights, up) in [([0.5, 3.0], true), ([-3.0, -0.5], false)] {
        let (scene, verifier) = scene([tube(1.0, 2.0, [-4.0, 4.0], 24), rod(0.9, heights, 24)]);
        let (present, fixed, actions) = (vec![0, 1], vec![0], ActionSet::Extended);
        let problem = Problem { present, fixed, actions, sweeps: true, ..problem(scene, &verifier) };
        let outcome = search(Planner::SbdpStar, problem, &mut Recorder::default());
        let [Removal { path, .. }] = &outcome.removals[..] else { panic!("{:?}", outcome.removals) };
        let way = path[path.len() - 1].translation.vector - path[0].translation.vector;
        assert!((way.z > 0.0) == up && way.norm() < 4.0, "{way}");
    }
}

#[test]
fn a_sweep_that_the_triangles_refute_takes_nothing_out_and_leaves_its_points_for_simulation() {
    use super::disassembly::{Disassembly, Transition};
    use crate::geometry::Pose;
    use crate::simulation::Action;

    let (scene, verifier) = scene(straight());
    let start = scene.bodies[1].planning_from_shape;
    let mut recorder = Recorder::default();
    let present = (0..scene.bodies.len()).collect();
    let problem = Problem { present, ..problem(scene, &verifier) };
    let (mut disassembly, _) = Disassembly::beside(problem, &mut recorder, |_| Ok(()));
    let run = Transition { part: 1, start, action: Action::translations()[0] };
    let through = [start, Pose::translation(9.0, 0.0, 0.0) * start];
    let Ok(Err(refuted)) = disassembly.prove_sweep(&run, &[start], &through) else { panic!("not refuted") };
    assert!(!refuted.prefix);
    assert!(!disassembly.problem.scene.bodies[1].extra_samples.points().is_empty());
    assert!(disassembly.removals.is_empty());
    let told = |e: &TraceEvent| matches!(e, TraceEvent::Refuted { part: 1, by, .. } if by.contains(&0));
    assert!(recorder.0.iter().any(told));
}

#[test]
fn a_shaft_with_flats_is_turned_until_they_are_along_its_slot() {
    for (turned, play) in [(0.9, 0.05), (-0.7, 0.01), (2.0, 0.05)] {
        let outcome = pair(flats_in_slot(turned, play, -play));
        assert_eq!(outcome.status, PlanStatus::Complete, "{turned} {play}");
        let [removal] = &outcome.removals[..] else { panic!("{:?}", outcome.removals) };
        let (first, last) = (&removal.path[0], &removal.path[removal.path.len() - 1]);
        assert!(last.rotation.angle_to(&first.rotation) > 0.3);
    }
    let captive = pair(flats_in_slot(0.9, 0.05, 0.05));
    assert_eq!(captive.status, PlanStatus::Exhausted);
}

/// A box without a lid, a slab on its floor, a block on the slab, and a bar across the box's mouth beside the block.
fn packed_box() -> Vec<SourceMesh> {
    let walls = cells([&[0.0, 0.5, 4.5, 5.0], &[0.0, 0.5, 4.5, 5.0], &[0.0, 0.5, 3.0]], |[x, y, z]| {
        z == 0 || x != 1 || y != 1
    });
    let slab = cuboid([0.6, 0.6, 0.5], [4.4, 4.4, 1.0]);
    let block = cuboid([1.0, 1.0, 1.0], [2.0, 2.0, 2.0]);
    let bar = cuboid([-0.5, 3.0, 3.0], [5.5, 3.5, 3.4]);
    vec![walls, slab, block, bar]
}

#[test]
fn a_step_requires_what_its_path_would_enter_and_nothing_else() {
    let (scene, verifier) = scene(packed_box());
    for planner in [Planner::SbdpStar, Planner::PdpT, Planner::Rrt] {
        let actions = if planner == Planner::SbdpStar { ActionSet::Extended } else { ActionSet::Paper };
        let sweeps = actions == ActionSet::Extended;
        let problem = Problem { actions, sweeps, ..problem(scene.clone(), &verifier) };
        let Outcome { status, removals, .. } = search(planner, problem, &mut Recorder::default());
        assert_eq!(status, PlanStatus::Complete);
        for (i, Removal { parts, path, requires, wave, .. }) in removals.iter().enumerate() {
            let part = &parts[0];
            let required: Vec<usize> = requires.iter().map(|&j| removals[j].parts[0]).collect();
            let before = requires.iter().map(|&j| removals[j].wave + 1).max();
            assert!(requires.iter().all(|&j| j < i) && *wave == before.unwrap_or(0));
            let is_refused = |gone: &[usize]| {
                let stands = |p: &usize| p != part && !gone.contains(p);
                let standing: Vec<usize> = (0..scene.bodies.len()).filter(stands).collect();
                let t = Termination::default();
                verifier.check(&scene, &scene.allowed, &standing, *part, path, &t).unwrap().is_refused()
            };
            assert!(!is_refused(&required), "{part} after {required:?} with {}", planner.name());
            for needed in &required {
                let others: Vec<usize> = required.iter().copied().filter(|p| p != needed).collect();
                assert!(is_refused(&others), "{part} does not need {needed} to be out");
            }
        }
    }
}

#[test]
fn a_plan_for_a_target_has_what_that_requires_and_no_more() {
    let (scene, verifier) = scene(packed_box());
    let parts_out = |target: usize| {
        let problem = Problem {
            actions: ActionSet::Extended,
            sweeps: true,
            targets: Some(vec![target]),
            ..problem(scene.clone(), &verifier)
        };
        let outcome = search(Planner::SbdpStar, problem, &mut Recorder::default());
        assert_eq!(outcome.removals.len() + outcome.remaining.len(), scene.bodies.len());
        outcome.removals.iter().flat_map(|r| r.parts.clone()).collect::<Vec<_>>()
    };
    assert_eq!(parts_out(3), [3]);
    assert_eq!(parts_out(2), [2]);
    // The slab is under the block and the bar.
    let mut needed = parts_out(1);
    assert_eq!(needed.pop(), Some(1));
    needed.sort_unstable();
    assert_eq!(needed, [2, 3]);
}

#[test]
fn the_base_stays_as_long_as_others_leave() {
    let (scene, verifier) = scene(packed_box());
    let plan = |fixed: Vec<usize>| {
        let problem = Problem {
            actions: ActionSet::Extended,
            sweeps: true,
            fixed,
            ..problem(scene.clone(), &verifier)
        };
        search(Planner::SbdpStar, problem, &mut Recorder::default())
    };
    let outcome = plan(Vec::new());
    assert_eq!((outcome.base.parts, outcome.remaining), (vec![0], vec![0]));
    let outcome = plan(vec![3]);
    assert_eq!((outcome.base, outcome.remaining.contains(&3)), (Base::default(), true));
}

/// A plate (part 0), a slab that rests on it (part 1), and a block on the slab (part 2): all may go sideways at once.
fn stack() -> Vec<SourceMesh> {
    let slab = |low: f64, half: f64| cuboid([-half, -half, low], [half, half, low + 1.0]);
    vec![slab(0.0, 3.0), slab(1.0, 2.0), slab(2.0, 1.0)]
}

fn planned(meshes: Vec<SourceMesh>, change: impl FnOnce(Problem<'_>) -> Problem<'_>) -> Outcome {
    let (scene, verifier) = scene(meshes);
    let problem = Problem { actions: ActionSet::Extended, sweeps: true, ..problem(scene, &verifier) };
    search(Planner::SbdpStar, change(problem), &mut Recorder::default())
}

fn order(outcome: &Outcome) -> Vec<usize> {
    outcome.removals.iter().flat_map(|r| r.parts.clone()).collect()
}

#[test]
fn what_carries_another_part_leaves_after_it() {
    for turn in [Vector3::zeros(), Vector3::new(0.4, -0.3, 0.7)] {
        let meshes = stack().into_iter().map(|mesh| moved(mesh, &Pose::rotation(turn))).collect();
        assert_eq!(order(&planned(meshes, |p| p)), [2, 1]);
    }
}

#[test]
fn a_given_base_stays_and_leaves_only_where_nothing_else_does() {
    let given = |part: usize| Base { parts: vec![part], reason: None };
    let outcome = planned(stack(), |p| Problem { base: given(2), ..p });
    assert_eq!((outcome.remaining, outcome.base), (vec![2], given(2)));
    // The block leaves beside the bar, the slab only after it.
    let wanted = |part: usize| {
        let targets = Some(vec![part]);
        planned(packed_box(), |p| Problem { base: given(3), fixed: vec![0], targets, ..p })
    };
    let (block, slab) = (wanted(2), wanted(1));
    assert_eq!((order(&block), block.base), (vec![2], given(3)));
    assert_eq!((slab.status, slab.remaining, slab.base), (PlanStatus::Complete, vec![0], Base::default()));
}

#[test]
fn a_way_up_comes_first_wherever_up_is_said_to_be() {
    // A cube on a plate of the same footprint: five ways of about one length.
    let meshes =
        || vec![cuboid([-3.0, -3.0, -3.0], [3.0, 3.0, 0.0]), cuboid([-3.0, -3.0, 0.0], [3.0, 3.0, 5.9])];
    for up in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]].map(Vector3::from) {
        let outcome = planned(meshes(), |problem| Problem { up: Some(up), fixed: vec![0], ..problem });
        let way = outcome.removals[0].motion().translation.vector.normalize();
        assert_eq!(outcome.removals[0].parts.len(), 1);
        assert!(way.dot(&up) > 0.99, "{up:?}: {way:?}");
    }
}

#[test]
fn ways_end_as_far_off_as_asked_for() {
    let gap = |end_gap: Option<f64>| {
        let outcome = planned(stack(), |p| Problem { end_gap, ..p });
        outcome.removals[0].motion().translation.vector.norm()
    };
    assert!((gap(Some(0.5)) - 0.5).abs() < 1e-9 && (gap(Some(0.0)) - HULL_MARGIN).abs() < HULL_MARGIN);
    assert!((gap(None) - 2.0 * HULL_CLEARANCE).abs() < 1e-9, "a hundredth of its longest side");
}

#[test]
fn a_target_leaves_on_the_way_that_fewest_block() {
    // A tube, and rods in it one above the other: one below the target, three above it.
    let rods = [[-3.9, -2.0], [-2.0, 0.0], [0.0, 1.0], [1.0, 2.0], [2.0, 3.9]].map(|at| rod(0.9, at, 24));
    let meshes: Vec<SourceMesh> = [tube(1.0, 2.0, [-4.0, 4.0], 24)].into_iter().chain(rods).collect();
    let wanted = |targets: &[usize]| {
        let outcome = planned(meshes.clone(), |p| Problem { targets: Some(targets.to_vec()), ..p });
        assert_eq!(outcome.status, PlanStatus::Complete);
        assert_eq!(outcome.removals.len() + outcome.remaining.len(), meshes.len());
        order(&outcome)
    };
    assert_eq!(wanted(&[2]), [1, 2]);
    assert_eq!(wanted(&[4]), [5, 4]);
    assert_eq!(wanted(&[2, 4]).len(), 4);
}
