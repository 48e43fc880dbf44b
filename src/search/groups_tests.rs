//! Tests of groups: those that leave because nothing else does, and those that are preferred.

use super::outcome::Removal;
use super::preferred::PreferredGroups;
use super::problem::Problem;
use super::request::{ActionSet, Planner};
use super::tests::{Recorder, problem};
use super::{Outcome, Reason, TraceEvent, search};
use crate::fixtures::{cells, cuboid, moved, scene};
use crate::geometry::{Pose, SourceMesh};
use crate::plan::PlanStatus;

/// A box (part 0) that is open at the top, in it a block (part 1) with a hole through it along x, and in the hole a
/// pin (part 2) as long as the block is wide: the block cannot leave the pin, nor the pin the box.
fn pinned_block() -> Vec<SourceMesh> {
    let walls: &[f64] = &[-2.0, -1.5, 1.5, 2.0];
    let housing = cells([walls, walls, &[-1.5, -1.0, 1.0]], |c| c[2] == 0 || c[0] != 1 || c[1] != 1);
    let across: &[f64] = &[-1.4, -0.4, 0.4, 1.4];
    let block = cells([&[-1.4, 1.4], across, &[-1.0, -0.4, 0.4, 0.9]], |c| c[1] != 1 || c[2] != 1);
    vec![housing, block, cuboid([-1.4, -0.35, -0.35], [1.4, 0.35, 0.35])]
}

/// The same in a sleeve (part 3) that is closed but for its end at +y.
fn pinned_block_in_sleeve() -> Vec<SourceMesh> {
    let sleeve =
        cells([&[-3.0, -2.05, 2.05, 3.0], &[-3.0, -2.05, 3.0], &[-2.5, -1.55, 1.05, 2.5]], |[x, y, z]| {
            x != 1 || y != 1 || z != 1
        });
    pinned_block().into_iter().chain([sleeve]).collect()
}

fn planned(
    parts: Vec<SourceMesh>,
    change: impl FnOnce(Problem<'_>) -> Problem<'_>,
) -> (Outcome, Vec<TraceEvent>) {
    let (scene, verifier) = scene(parts);
    let mut recorder = Recorder::default();
    let problem = Problem { actions: ActionSet::Extended, sweeps: true, ..problem(scene, &verifier) };
    (search(Planner::SbdpStar, change(problem), &mut recorder), recorder.0)
}

fn left(outcome: &Outcome) -> Vec<(&[usize], Option<usize>)> {
    outcome.removals.iter().map(|r: &Removal| (&r.parts[..], r.of)).collect()
}

#[test]
fn what_holds_together_leaves_the_base_together_and_is_then_taken_apart() {
    let turn = Pose::rotation(nalgebra::Vector3::new(0.3, -0.5, 0.2));
    let scale = |mesh: SourceMesh| {
        let mut mesh = mesh;
        mesh.vertices.iter_mut().flatten().for_each(|x| *x *= 1.4);
        mesh
    };
    for pose in [Pose::identity(), turn] {
        let parts = pinned_block().into_iter().map(|mesh| moved(scale(mesh), &pose)).collect();
        let (outcome, events) = planned(parts, |problem| problem);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        assert_eq!(outcome.base.parts, [0]);
        let [group, inner] = &outcome.removals[..] else { panic!("{:?}", left(&outcome)) };
        assert_eq!((&group.parts[..], group.of, group.wave), (&[1, 2][..], None, 0));
        assert_eq!((inner.parts.len(), inner.of, &inner.requires[..], inner.wave), (1, Some(0), &[0][..], 1));
        assert_eq!((&outcome.remaining[..], outcome.kept_together().len()), (&[0][..], 0));
        let way = group.motion().translation.vector.normalize();
        assert!(way.dot(&(pose * nalgebra::Vector3::z())) > 0.99, "it leaves along {way}");
        let tried = TraceEvent::GroupTried { parts: vec![1, 2], leaves: true };
        assert!(events.contains(&tried));
    }
}

#[test]
fn a_group_leaves_before_what_carries_it() {
    // A channel along y (part 0), in it a slab (1) that could be drawn out, and on that a pinned block (2, 3).
    let channel =
        cells([&[-3.0, -1.5, 1.5, 3.0], &[-3.0, 3.0], &[-2.0, -1.0, 1.5]], |c| c[0] != 1 || c[2] == 0);
    let slab = cuboid([-1.4, -1.4, -1.0], [1.4, 1.4, -0.5]);
    let across: &[f64] = &[-1.4, -0.4, 0.4, 1.4];
    let block = cells([&[-1.4, 1.4], across, &[-0.5, 0.1, 0.9, 1.4]], |c| c[1] != 1 || c[2] != 1);
    let pin = cuboid([-1.4, -0.35, 0.1], [1.4, 0.35, 0.8]);
    let up = Some(nalgebra::Vector3::z());
    let (outcome, _) = planned(vec![channel, slab, block, pin], |problem| Problem { up, ..problem });
    assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
    let left = left(&outcome);
    assert_eq!((left[0], left[1]), ((&[2, 3][..], None), (&[1][..], None)));
    assert_eq!((left.len(), left[2].0.len(), left[2].1), (3, 1, Some(0)));
    assert_eq!(outcome.base.parts, [0]);
}

#[test]
fn groups_are_taken_apart_in_groups() {
    let (outcome, _) = planned(pinned_block_in_sleeve(), |problem| problem);
    assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
    let left = left(&outcome);
    assert_eq!(left[..2], [(&[0, 1, 2][..], None), (&[1, 2][..], Some(0))]);
    assert_eq!((left.len(), left[2].0.len(), left[2].1), (3, 1, Some(1)));
    assert_eq!(outcome.removals.iter().map(|r| r.wave).collect::<Vec<_>>(), [0, 1, 2]);
    assert_eq!(outcome.removals[2].requires, [1]);
}

#[test]
fn a_group_in_which_nothing_is_wanted_is_kept_together() {
    let target = |part: usize| {
        let (outcome, _) =
            planned(pinned_block_in_sleeve(), |problem| Problem { targets: Some(vec![part]), ..problem });
        assert_eq!(outcome.status, PlanStatus::Complete, "{part}: {:?}", outcome.reason);
        outcome
    };
    // The sleeve is pulled off the others.
    assert_eq!(left(&target(3)), [(&[3][..], None)]);
    // To get the box out, what is in it is not taken apart.
    let housing = target(0);
    assert!(housing.kept_together().contains(&vec![1, 2]), "{:?}", left(&housing));
    assert_eq!(target(2).removals.len(), 3);
}

#[test]
fn where_nothing_leaves_it_is_said_which_parts_are_free_together() {
    // Over the mouth of the box, with play above the block, lies a lid. Neither holds the block alone.
    let mut parts = pinned_block();
    parts.push(cuboid([-3.0, -2.0, 1.3], [3.0, 2.0, 2.0]));
    let (outcome, _) =
        planned(parts, |problem| Problem { fixed: vec![0, 3], max_simulations: Some(100), ..problem });
    assert_eq!((outcome.status, outcome.removals.len()), (PlanStatus::Partial, 0));
    let free: Vec<_> =
        outcome.free_together.iter().map(|group| (&group.parts[..], group.direction)).collect();
    assert!(free.contains(&(&[1, 2][..], [0.0, 0.0, 1.0])), "{free:?}");
}

#[test]
fn what_never_comes_apart_leaves_together() {
    // A ring about a bar of another ring, both in a box.
    let ring = || {
        let across: &[f64] = &[-1.2, -0.8, 0.8, 1.2];
        cells([across, across, &[-0.2, 0.2]], |c| c[0] != 1 || c[1] != 1)
    };
    let turned = Pose::new(
        nalgebra::Vector3::new(1.0, 0.0, 0.0),
        nalgebra::Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0),
    );
    let walls: &[f64] = &[-3.0, -2.5, 2.5, 3.0];
    let housing = cells([walls, walls, &[-2.0, -1.5, 1.5]], |c| c[2] == 0 || c[0] != 1 || c[1] != 1);
    let (outcome, _) = planned(vec![housing, ring(), moved(ring(), &turned)], |problem| problem);
    assert_eq!(outcome.status, PlanStatus::Infeasible, "{:?}", outcome.reason);
    assert!(matches!(outcome.reason, Some(Reason::Inseparable(pair)) if pair.parts == [1, 2]));
    assert_eq!(left(&outcome), [(&[1, 2][..], None)]);
    assert_eq!((outcome.kept_together(), outcome.unfinished), (vec![vec![1, 2]], vec![1, 2]));
}

#[test]
fn a_group_leaves_by_several_moves() {
    // A slot that goes up, and then along y: what is in it cannot leave straight.
    let slot = cells(
        [&[-2.0, -1.5, 1.5, 2.0], &[-2.0, -1.5, 1.5, 6.0], &[-1.5, -1.0, 1.0, 3.1, 3.6]],
        |[x, y, z]| {
            let is_shaft = x == 1 && y == 1 && (z == 1 || z == 2);
            let is_exit = x == 1 && y == 2 && z == 2;
            !is_shaft && !is_exit
        },
    );
    let mut parts = pinned_block();
    parts[0] = slot;
    let (outcome, events) = planned(parts, |problem| problem);
    assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
    assert_eq!(left(&outcome)[0], (&[1, 2][..], None));
    assert!(outcome.removals[0].path.len() > 2, "it turns a corner");
    assert!(events.iter().any(|e| matches!(e, TraceEvent::GroupTried { leaves: true, .. })));
}

fn preferring(parts: Vec<SourceMesh>, groups: &[&[usize]]) -> Outcome {
    let groups: Vec<Vec<usize>> = groups.iter().map(|group| group.to_vec()).collect();
    let (outcome, _) =
        planned(parts, |problem| Problem { preferred: PreferredGroups::new(&groups), ..problem });
    assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
    outcome
}

/// A plate (part 0), on it two stacks of three blocks each (1 to 3, 4 to 6, from below), of which the lowest is wide.
fn stacks() -> Vec<SourceMesh> {
    let block = |x: f64, z: f64| cuboid([x, 0.0, z], [x + 1.0, 1.0, z + 1.0]);
    let stack = |x: f64| [cuboid([x - 0.5, -1.0, 0.0], [x + 1.5, 2.0, 1.0]), block(x, 1.0), block(x, 2.0)];
    [cuboid([-2.0, -2.0, -1.0], [6.0, 3.0, 0.0])].into_iter().chain(stack(0.0)).chain(stack(3.0)).collect()
}

#[test]
fn preferred_groups_leave_as_wholes_and_are_then_taken_apart() {
    let outcome = preferring(stacks(), &[]);
    assert!(outcome.removals.iter().all(|r| r.parts.len() == 1 && r.of.is_none()));
    // The inner group counts once the outer one is out.
    let outcome = preferring(stacks(), &[&[2, 3], &[3, 1, 2], &[4, 5, 6]]);
    assert_eq!(outcome.base.parts, [0]);
    let mut first = left(&outcome)[..2].to_vec();
    first.sort_unstable();
    assert_eq!(first, [(&[1, 2, 3][..], None), (&[4, 5, 6][..], None)]);
    let of = |parts: &[usize]| outcome.removals.iter().find(|r| r.parts == parts).and_then(|r| r.of);
    let outer = outcome.removals.iter().position(|r| r.parts == [1, 2, 3]);
    let inner = outcome.removals.iter().position(|r| r.parts == [2, 3]);
    assert_eq!(of(&[2, 3]), outer);
    assert!(of(&[2]).or(of(&[3])) == inner && inner.is_some());
    assert!(outcome.kept_together().is_empty());
    // With the base in it, a group stays as long as others leave. Everything is no group.
    let outcome = preferring(stacks(), &[&[0, 1, 2, 3], &[0, 1, 2, 3, 4, 5, 6]]);
    assert_eq!(outcome.base.parts, [0]);
    assert!(outcome.removals.iter().all(|r| r.parts.len() == 1));
    assert!(outcome.removals[..3].iter().all(|r| r.parts[0] > 3), "{:?}", left(&outcome));
}

#[test]
fn what_holds_a_preferred_group_leaves_before_it() {
    // A channel (part 0), closed at its ends, with a hole through one wall. In it a block (1), held by a pin (2) through that
    // hole, and on the block another one (3).
    let channel = cells(
        [&[-2.0, -1.0, 1.0, 3.0], &[-2.0, -1.0, -0.2, 0.2, 1.0, 2.0], &[-1.0, 0.0, 0.8, 1.2, 2.0]],
        |[x, y, z]| z == 0 || y == 0 || y == 4 || (x != 1 && !(x == 0 && y == 2 && z == 2)),
    );
    let block = cells([&[-1.0, 0.0, 1.0], &[-1.0, -0.2, 0.2, 1.0], &[0.0, 0.8, 1.2, 2.0]], |[x, y, z]| {
        !(x == 0 && y == 1 && z == 1)
    });
    let pin = cuboid([-3.0, -0.2, 0.8], [0.0, 0.2, 1.2]);
    let top = cuboid([-1.0, -1.0, 2.0], [1.0, 1.0, 3.0]);
    let outcome = preferring(vec![channel, block, pin, top], &[&[1, 2, 3]]);
    assert_eq!(left(&outcome)[..2], [(&[2][..], None), (&[1, 3][..], None)]);
    assert_eq!(outcome.removals[1].requires, [0]);
}

#[test]
fn a_preferred_group_that_cannot_leave_is_given_up() {
    // A shaft, closed above, with an exit to one side at its upper end, and in it a cube on another. Each leaves up and then
    // sideways, and the two together do not.
    let shaft = cells(
        [&[0.0, 1.0, 2.0, 3.0], &[-1.5, -0.5, 0.5, 1.5], &[0.0, 1.0, 2.0, 3.0, 4.0, 5.5]],
        |[x, y, z]| !(y == 1 && ((x == 1 && (1..4).contains(&z)) || (x == 2 && z == 3))),
    );
    let cube = |z: f64| cuboid([1.0, -0.5, z], [2.0, 0.5, z + 1.0]);
    let outcome = preferring(vec![shaft, cube(1.0), cube(2.0)], &[&[1, 2]]);
    assert_eq!(left(&outcome), [(&[2][..], None), (&[1][..], None)]);
    assert!(outcome.removals.iter().all(|r| r.path.len() > 2), "they turn a corner");
}
