//! What this engine promises beyond the contract of all engines.

use std::sync::Arc;

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

use super::contacts::{BodyPlacement, ContactEnergy, Contacts, PointSide, matrix};
use super::points::PointCache;
use super::step::{PenaltyDrive, RigidBody, StepTally, Stepper, placement};
use super::{PenaltyEngine, PenaltyParameters};
use crate::fixtures::{ball, block_on_plate, cells, cuboid, moved, peg_in_hole, rod, scene, tube};
use crate::geometry::{Pose, SourceMesh};
use crate::scene::{Scene, StandingParts};
use crate::simulation::{Action, Axis, End, Motion, TransitionFunction};
use crate::termination::Termination;

const UP: Action = Action::Push(Axis::Z, true);
const DOWN: Action = Action::Push(Axis::Z, false);

/// Two parts: 0 stands, 1 moves.
struct Setup {
    name: &'static str,
    scene: Scene,
    pose: Pose,
    cache: PointCache,
    parameters: PenaltyParameters,
}

impl Setup {
    fn new(name: &'static str, meshes: [SourceMesh; 2], displaced: Pose) -> Self {
        let (scene, _) = scene(meshes);
        let pose = displaced * scene.bodies[1].planning_from_shape;
        Self { name, scene, pose, cache: PointCache::default(), parameters: PenaltyParameters::default() }
    }

    fn contacts(&self) -> Contacts<'_> {
        let around = StandingParts::new(&self.scene, vec![0]);
        let mut contacts = Contacts::new(&self.scene, &around, 1, &self.parameters, &self.cache);
        contacts.gather(&self.pose, 0.1);
        contacts
    }

    /// Where the body is after a displacement of its centre of mass and a turn about it.
    fn placement(&self, displacement: &Vector6<f64>) -> BodyPlacement {
        let turn: Vector3<f64> = displacement.fixed_rows::<3>(3).into();
        BodyPlacement {
            centre: self.pose * self.scene.bodies[1].shape.mass.centre + displacement.fixed_rows::<3>(0),
            rotation: UnitQuaternion::from_scaled_axis(turn).to_rotation_matrix().into_inner()
                * matrix(&self.pose),
        }
    }
}

/// Contacts on flat and curved faces, at an edge within single cells, and at a corner that turned.
fn setups() -> Vec<Setup> {
    let at = |x: f64, y: f64, z: f64, turn: [f64; 3]| Pose::new(Vector3::new(x, y, z), Vector3::from(turn));
    let plate = || cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]);
    let on_plate = |mesh: SourceMesh| [plate(), moved(mesh, &Pose::translation(0.0, 0.0, 1.0))];
    vec![
        Setup::new("flat", block_on_plate(), at(0.11, 0.07, -0.03, [4e-3, -7e-3, 0.3])),
        Setup::new("edge", block_on_plate(), at(4.97, 0.13, -0.026, [3e-3, -9e-3, 0.004])),
        Setup::new("ball", on_plate(ball(3)), at(0.03, 0.05, -0.04, [0.1, 0.2, 0.3])),
        Setup::new(
            "bore",
            [tube(1.0, 3.0, [-2.0, 2.0], 24), rod(1.0, [-3.0, 3.0], 24)],
            at(0.041, 0.017, 0.3, [2e-3, -3e-3, 0.05]),
        ),
    ]
}

/// First differences and second differences of the energy of one side.
fn differences(setup: &Setup, contacts: &Contacts<'_>, side: PointSide) -> (Vector6<f64>, Matrix6<f64>) {
    const STEP: f64 = 1e-6;
    let energy = |displacement: &Vector6<f64>| {
        let mut out = ContactEnergy::new(1);
        contacts.evaluate_side(&setup.placement(displacement), side, &mut out);
        out.energy
    };
    let unit = |a: usize| Vector6::from_fn(|i, _| if i == a { STEP } else { 0.0 });
    let first = Vector6::from_fn(|a, _| (energy(&unit(a)) - energy(&-unit(a))) / (2.0 * STEP));
    let second = Matrix6::from_fn(|a, b| {
        let (u, v) = (unit(a), unit(b));
        let mixed = energy(&(u + v)) - energy(&(u - v)) - energy(&(v - u)) + energy(&(-u - v));
        mixed / (4.0 * STEP * STEP)
    });
    (first, second)
}

#[track_caller]
fn assert_derivatives(setup: &Setup, contacts: &Contacts<'_>, side: PointSide) -> ContactEnergy {
    let mut out = ContactEnergy::new(1);
    contacts.evaluate_side(&setup.placement(&Vector6::zeros()), side, &mut out);
    assert!(out.energy > 1e-3 && out.touched[0], "{}: no contact on side {side:?}", setup.name);
    let (first, second) = differences(setup, contacts, side);
    let off = (out.gradient - first).norm() / first.norm();
    assert!(off < 1e-5, "{} {side:?}: {} for {first}", setup.name, out.gradient);
    let hessian = out.gauss + out.curvature;
    let off = (hessian - second).norm() / second.norm();
    assert!(off < 1e-4, "{} {side:?}: off by {off}, {hessian} for {second}", setup.name);
    out
}

#[test]
fn contact_derivatives_are_those_of_finite_differences_on_both_sides() {
    for setup in setups() {
        let contacts = setup.contacts();
        for side in [PointSide::Moving, PointSide::Standing] {
            // The plate's own points are 0.5 apart: none is under a small ball, nor at its edge's end.
            let mut out = ContactEnergy::new(1);
            contacts.evaluate_side(&setup.placement(&Vector6::zeros()), side, &mut out);
            if out.energy == 0.0 && side == PointSide::Standing && setup.name == "ball" {
                continue;
            }
            assert_derivatives(&setup, &contacts, side);
        }
    }
}

/// Without the terms of curvature the second derivative is a different one: the test above sees them.
#[test]
fn curvature_is_a_part_of_the_derivative_that_counts() {
    for (name, side) in
        [("edge", PointSide::Moving), ("edge", PointSide::Standing), ("bore", PointSide::Moving)]
    {
        let setup = setups().into_iter().find(|s| s.name == name).unwrap();
        let out = assert_derivatives(&setup, &setup.contacts(), side);
        let share = out.curvature.norm() / out.gauss.norm();
        assert!(share > 1e-3, "{name} {side:?}: {share}");
    }
}

#[test]
fn damping_has_the_derivatives_of_its_energy() {
    for mut setup in setups() {
        setup.parameters.damping = 2e4;
        let mut contacts = setup.contacts();
        let before = Vector6::new(0.002, 0.001, 0.004, 1e-3, -2e-3, 1e-3);
        contacts.start_step(&setup.placement(&before));
        assert_derivatives(&setup, &contacts, PointSide::Moving);
    }
}

#[test]
fn damping_takes_speed_out_of_an_impact() {
    let (scene, _) = scene(block_on_plate());
    // Slow steps hide it: they damp by themselves.
    let speed = |damping: f64| {
        let parameters = PenaltyParameters { damping, time_step: 1e-5, ..PenaltyParameters::default() };
        let (cache, around) = (PointCache::default(), StandingParts::new(&scene, vec![0]));
        let mut contacts = Contacts::new(&scene, &around, 1, &parameters, &cache);
        let drive = PenaltyDrive { linear: Vector3::zeros(), angular: Vector3::zeros(), turns: false };
        let mut stepper = Stepper::new(RigidBody::new(&scene.bodies[1].shape), drive, &parameters, 1);
        let mut state = stepper.rigid.at_rest(&scene.bodies[1].planning_from_shape);
        state.velocity.z = -1.0;
        contacts.gather(&stepper.rigid.pose(&state), 0.2);
        let mut fastest_up = f64::NEG_INFINITY;
        for _ in 0..2000 {
            contacts.start_step(&placement(&state, &Vector6::zeros()));
            state = stepper.step(&state, &contacts).state;
            fastest_up = fastest_up.max(state.velocity.z);
        }
        fastest_up
    };
    let [undamped, damped] = [0.0, 1e6].map(speed);
    assert!(undamped > 0.9 && undamped <= 1.0, "thrown back at {undamped}");
    assert!(damped > 0.0 && damped < 0.8 * undamped, "{damped} after {undamped}");
}

#[test]
fn defaults_are_those_of_the_paper() {
    let p = PenaltyParameters::default();
    let table =
        (p.planning_time_step, p.penetration_threshold, p.force, p.similar_translation, p.similar_rotation);
    assert_eq!(table, (1e-1, 0.01, 100.0, 0.05, 0.5));
    assert_eq!((p.stiffness, p.damping, p.time_step), (1e6, 0.0, 1e-3));
    assert_eq!((p.torque_factor, p.longest_edge, p.block_steps()), (3.0, 0.5, 100));
    assert_eq!(PenaltyEngine::default(), PenaltyEngine::new(p));
    assert_ne!(PenaltyEngine::default(), PenaltyEngine::new(PenaltyParameters { force: 99.0, ..p }));
}

fn motion(parameters: PenaltyParameters, scene: &Scene, action: Action) -> Motion {
    let (engine, around) = (PenaltyEngine::new(parameters), StandingParts::new(scene, vec![0]));
    let start = scene.bodies[1].planning_from_shape;
    engine.simulate(scene, &around, 1, &start, action, &Termination::default()).unwrap()
}

/// A block in the middle of a frame, touching nothing.
fn free_block() -> Scene {
    let across: &[f64] = &[-4.0, -3.0, 3.0, 4.0];
    let frame = cells([across, across, &[-2.0, 2.0]], |c| c != [1, 1, 0]);
    scene([frame, cuboid([-0.5, -0.4, -0.3], [0.5, 0.4, 0.3])]).0
}

#[test]
fn a_free_block_travels_0_505_and_turns_1_515_in_a_planning_time_step() {
    let scene = free_block();
    let one = PenaltyParameters { most_blocks: 1, ..PenaltyParameters::default() };
    let start = scene.bodies[1].planning_from_shape;
    for axis in [Axis::X, Axis::Y] {
        for action in [Action::Push(axis, true), Action::Drag(axis, true), Action::Turn(axis, false)] {
            let motion = motion(one, &scene, action);
            assert!(matches!(motion.end, End::Undecided { .. }), "{action}: {:?}", motion.end);
            let last = motion.path[motion.path.len() - 1];
            let travel = last.translation.vector - start.translation.vector;
            let turn = (last.rotation * start.rotation.inverse()).scaled_axis();
            assert!((travel - action.force() * 0.505).norm() < 1e-9, "{action}: {travel}");
            assert!((turn - action.torque() * 1.515).norm() < 1e-9, "{action}: {turn}");
        }
    }
}

#[test]
fn a_screw_pulls_with_half_of_its_torque_over_the_radius() {
    let scene = free_block();
    let one = PenaltyParameters { most_blocks: 1, ..PenaltyParameters::default() };
    let shape = &scene.bodies[1].shape;
    let start = scene.bodies[1].planning_from_shape;
    let motion = motion(one, &scene, Action::Screw(Axis::X, false, true));
    let last = motion.path[motion.path.len() - 1];
    let expected = -1.515 * shape.mass.gyration_squared / (2.0 * shape.reach);
    assert!((last.translation.x - expected).abs() < 1e-9, "{} for {expected}", last.translation.x);
    assert!((start.rotation.angle_to(&last.rotation) - 1.515).abs() < 1e-9);
}

/// A body that turns about no principal axis keeps its angular momentum but for what a step of
/// first order loses: the gyroscopic moment is there and has the right sign.
#[test]
fn a_body_that_spins_freely_keeps_its_angular_momentum() {
    let scene = free_block();
    let shape = &scene.bodies[1].shape;
    let drift = |time_step: f64| {
        let parameters = PenaltyParameters { time_step, ..PenaltyParameters::default() };
        let cache = PointCache::default();
        let around = StandingParts::new(&scene, Vec::new());
        let contacts = Contacts::new(&scene, &around, 1, &parameters, &cache);
        let drive = PenaltyDrive { linear: Vector3::zeros(), angular: Vector3::zeros(), turns: true };
        let mut stepper = Stepper::new(RigidBody::new(shape), drive, &parameters, 0);
        let mut state = RigidBody::new(shape).at_rest(&scene.bodies[1].planning_from_shape);
        state.spin = Vector3::new(8.0, 6.0, 3.0);
        let momentum = |rotation: &UnitQuaternion<f64>, spin: &Vector3<f64>| {
            rotation * (shape.mass.unit_inertia() * (rotation.inverse() * spin))
        };
        let before = momentum(&state.rotation, &state.spin);
        for _ in 0..(0.1 / time_step).round() as usize {
            state = stepper.step(&state, &contacts).state;
        }
        (momentum(&state.rotation, &state.spin) - before).norm() / before.norm()
    };
    let (coarse, fine) = (drift(1e-3), drift(1e-4));
    assert!(coarse < 0.02, "{coarse}");
    // First order: a tenth of the step, a tenth of the drift. Without the moment it would stay.
    assert!(fine < coarse / 5.0, "{fine} after {coarse}");
}

#[test]
fn a_block_pushed_into_its_plate_sinks_as_the_stiffness_predicts() {
    let (scene, _) = scene(block_on_plate());
    for stiffness in [1e6, 1e5] {
        let parameters = PenaltyParameters { stiffness, ..PenaltyParameters::default() };
        let engine = PenaltyEngine::new(parameters);
        // Points of the block's lower face, and those of the plate's upper face under it.
        let points = |part: usize| {
            let body = &scene.bodies[part];
            let points = engine.contact_points(&body.shape);
            points.points().iter().map(|p| body.planning_from_shape * p).collect::<Vec<_>>()
        };
        let mine = points(1).into_iter().filter(|p| p.z == 0.0).count();
        let under = |p: &nalgebra::Point3<f64>| p.z == 0.0 && p.x.abs() < 0.9 && p.y.abs() < 0.9;
        let theirs = points(0).into_iter().filter(under).count();
        assert!(mine >= 25 && theirs >= 9, "{mine} and {theirs} points");
        let motion = motion(parameters, &scene, DOWN);
        assert_eq!(motion.end, End::Collision { with: vec![0] });
        let sunk = scene.bodies[1].planning_from_shape.translation.z
            - motion.path[motion.path.len() - 1].translation.z;
        let expected = 8.0 * 100.0 / (stiffness * (mine + theirs) as f64);
        let beyond = sunk - parameters.penetration_threshold;
        assert!(
            (beyond - expected).abs() < 0.02 * expected,
            "{beyond} for {expected}, stiffness {stiffness}"
        );
    }
}

/// What the steps in contact cost of a part that starts at rest, and the most that one took.
fn tally(scene: &Scene, action: Action) -> (StepTally, u64) {
    let engine = PenaltyEngine::default();
    let around = StandingParts::new(scene, vec![0]);
    let mut contacts = Contacts::new(scene, &around, 1, engine.parameters(), &engine.cache);
    let shape = &scene.bodies[1].shape;
    let mut stepper =
        Stepper::new(RigidBody::new(shape), engine.drive(shape, action), engine.parameters(), 1);
    let mut state = stepper.rigid.at_rest(&scene.bodies[1].planning_from_shape);
    let (mut all, mut most) = (StepTally::default(), 0);
    for _ in 0..100 {
        contacts.gather(&stepper.rigid.pose(&state), 0.3);
        stepper.tally = StepTally::default();
        state = stepper.step(&state, &contacts).state;
        if stepper.touched()[0] {
            all.steps += 1;
            all.iterations += stepper.tally.iterations;
            all.evaluations += stepper.tally.evaluations;
            all.settled += stepper.tally.settled;
            most = most.max(stepper.tally.iterations);
        }
    }
    (all, most)
}

#[test]
fn newton_converges_in_a_few_iterations() {
    let askew = Pose::rotation(Vector3::new(0.1, 0.5, 0.0));
    let cases = [
        ("block", scene(block_on_plate()).0, DOWN),
        ("free block", scene(block_on_plate()).0, Action::Drag(Axis::Z, false)),
        ("peg", scene(peg_in_hole(0.0).map(|m| moved(m, &askew))).0, UP),
        ("free peg", scene(peg_in_hole(0.0).map(|m| moved(m, &askew))).0, Action::Drag(Axis::Z, true)),
        ("peg that turns", scene(peg_in_hole(-0.05)).0, Action::Turn(Axis::X, true)),
    ];
    for (name, scene, action) in cases {
        let (tally, most) = tally(&scene, action);
        assert!(tally.steps > 40, "{name}: {tally:?}");
        assert!(most <= 6 && tally.iterations <= 4 * tally.steps, "{name}: {tally:?}, at most {most}");
        assert_eq!(tally.settled, 0, "{name}: {tally:?}");
    }
}

/// A square peg that is turned about its axis rests on the rim of its hole, where the slope of the
/// field jumps from cell to cell: with one slope at a time, most of these steps found no minimum.
#[test]
fn newton_finds_minima_where_the_slope_of_the_field_jumps() {
    for (excess, way) in [(0.02, true), (0.02, false), (-0.05, true), (-0.05, false)] {
        let (tally, _) = tally(&scene(peg_in_hole(excess)).0, Action::Turn(Axis::Z, way));
        assert!(tally.steps > 40, "{excess}: {tally:?}");
        assert!(tally.settled <= 2 && tally.iterations <= 7 * tally.steps, "{excess}: {tally:?}");
    }
}

#[test]
fn a_soft_contact_ends_the_motion_before_it_is_deeper_than_declared() {
    let (scene, verifier) = scene(block_on_plate());
    let soft = PenaltyParameters { stiffness: 100.0, ..PenaltyParameters::default() };
    let motion = motion(soft, &scene, DOWN);
    assert_eq!(motion.end, End::Collision { with: vec![0] });
    let t = Termination::default();
    let depth = verifier.check(&scene, &scene.allowed, &[0], 1, &motion.path, &t).unwrap().depth;
    assert!(depth <= soft.depth_tolerance(), "{depth}");
    // It got close to it, though: nothing but the check stopped it.
    assert!(depth > 0.3 * soft.depth_tolerance(), "{depth}");
}

#[test]
fn sheets_thinner_than_the_threshold_still_touch() {
    let sheet = cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 0.015]);
    let (scene, _) = scene([cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]), sheet]);
    let start = scene.bodies[1].planning_from_shape.translation.z;
    let sunk = |parameters| {
        let motion = motion(parameters, &scene, DOWN);
        assert_eq!(motion.end, End::Collision { with: vec![0] });
        start - motion.path[motion.path.len() - 1].translation.z
    };
    let own = sunk(PenaltyParameters::default());
    assert!(own < 0.004, "{own}");
    let paper = sunk(PenaltyParameters { share_of_extent: f64::INFINITY, ..PenaltyParameters::default() });
    assert!(paper > 0.009, "{paper}");
}

#[test]
fn an_overlap_at_the_assembled_pose_is_granted_to_contact() {
    // The block stands 0.02 in its plate.
    let meshes = [cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]), cuboid([-1.0, -1.0, -0.02], [1.0, 1.0, 2.0])];
    let setup = Setup::new("sunk", meshes, Pose::identity());
    let contacts = setup.contacts();
    let threshold = contacts.threshold(&contacts.pairs[0]);
    assert!((threshold - 0.03).abs() < 1e-3, "{threshold}");
    let mut out = ContactEnergy::new(1);
    contacts.evaluate(&setup.placement(&Vector6::zeros()), true, &mut out);
    assert_eq!((out.energy, out.touched[0]), (0.0, false));
}

#[test]
fn clones_share_what_they_remember() {
    let (scene, _) = scene(block_on_plate());
    let engine = PenaltyEngine::default();
    let shape = &scene.bodies[1].shape;
    assert!(Arc::ptr_eq(&engine.contact_points(shape), &engine.clone().contact_points(shape)));
    assert!(!Arc::ptr_eq(&engine.contact_points(shape), &PenaltyEngine::default().contact_points(shape)));
}
