//! Parts that are to be kept stay unless others cannot leave otherwise, and then as few leave as possible, and as late.

use proptest::prelude::*;

use super::tests::{Recorder, problem};
use super::*;
use crate::fixtures::{cells, cuboid, rod, scene, tube};
use crate::geometry::SourceMesh;
use crate::plan::Base;

fn planned(meshes: &[SourceMesh], change: impl FnOnce(Problem<'_>) -> Problem<'_>) -> Outcome {
    planned_by(Planner::SbdpStar, meshes, change)
}

fn planned_by(
    planner: Planner,
    meshes: &[SourceMesh],
    change: impl FnOnce(Problem<'_>) -> Problem<'_>,
) -> Outcome {
    let (scene, verifier) = scene(meshes.to_vec());
    let problem = Problem { actions: ActionSet::Extended, sweeps: true, ..problem(scene, &verifier) };
    let outcome = search(planner, change(problem), &mut Recorder::default());
    assert_eq!(outcome.unfinished.is_empty(), outcome.status == PlanStatus::Complete);
    outcome
}

fn order(outcome: &Outcome) -> Vec<usize> {
    outcome.removals.iter().flat_map(|r| r.parts.clone()).collect()
}

/// A plate (part 0), a slab that rests on it (part 1), and a block on the slab (part 2).
fn stack() -> Vec<SourceMesh> {
    let slab = |low: f64, half: f64| cuboid([-half, -half, low], [half, half, low + 1.0]);
    vec![slab(0.0, 3.0), slab(1.0, 2.0), slab(2.0, 1.0)]
}

/// A tube, and in it rods of these heights, from the lowest to the highest.
fn rods(heights: &[f64]) -> Vec<SourceMesh> {
    let mut low = -4.0;
    let mut rod = |height: &f64| {
        low += height;
        rod(0.9, [low - height, low], 24)
    };
    let rods: Vec<SourceMesh> = heights.iter().map(&mut rod).collect();
    [tube(1.0, 2.0, [-4.0, 4.0], 24)].into_iter().chain(rods).collect()
}

#[test]
fn a_kept_part_stays_and_the_plan_is_complete() {
    let outcome = planned(&stack(), |p| Problem { keep: vec![1], ..p });
    assert_eq!((order(&outcome), &outcome.remaining[..]), (vec![2], &[0, 1][..]));
    assert_eq!((outcome.status, &outcome.base.parts[..]), (PlanStatus::Complete, &[0][..]));
    let base = Base { parts: vec![2], reason: None };
    let outcome = planned(&stack(), |p| Problem { base: base.clone(), keep: vec![1], ..p });
    assert_eq!((order(&outcome), outcome.base), (vec![0], base));
    let all = planned(&stack(), |p| Problem { keep: vec![0, 1, 2], ..p });
    assert_eq!((all.status, all.removals.len()), (PlanStatus::Complete, 0));
}

#[test]
fn a_kept_part_leaves_last_where_another_cannot_leave_without_it() {
    // The two uppermost rods leave upwards; the lowest one may leave at once, but is to be kept, and a wall is below the tube.
    let mut meshes = rods(&[2.0, 2.0, 2.0, 2.0]);
    meshes.push(cuboid([-3.0, -3.0, -5.0], [3.0, 3.0, -4.0]));
    for planner in [Planner::SbdpStar, Planner::PdpT] {
        let outcome = planned_by(planner, &meshes, |p| Problem { fixed: vec![0, 5], keep: vec![2, 3], ..p });
        assert_eq!(outcome.status, PlanStatus::Complete);
        assert_eq!((order(&outcome), &outcome.remaining[..]), (vec![4, 3, 2, 1], &[0, 5][..]));
        let outcome = planned_by(planner, &meshes, |p| Problem { fixed: vec![0, 5], keep: vec![1, 2], ..p });
        assert_eq!((order(&outcome), &outcome.remaining[..]), (vec![4, 3], &[0, 1, 2, 5][..]));
    }
}

#[test]
fn as_few_kept_parts_leave_as_possible() {
    // The third rod leaves upwards past two others, or downwards past two: one of each is to be kept, or two below.
    let meshes = rods(&[1.0, 1.0, 2.0, 1.0, 1.0]);
    let off = |keep: &[usize], targets: Option<Vec<usize>>| {
        let outcome = planned(&meshes, |p| Problem { fixed: vec![0], keep: keep.to_vec(), targets, ..p });
        assert_eq!(outcome.status, PlanStatus::Complete);
        assert!(order(&outcome).contains(&3));
        let off: Vec<usize> = keep.iter().copied().filter(|part| !outcome.remaining.contains(part)).collect();
        (off, outcome.removals.len())
    };
    for targets in [None, Some(vec![3])] {
        assert_eq!(off(&[1, 2], targets.clone()), (vec![], 3));
        assert_eq!(off(&[4, 5], targets.clone()), (vec![], 3));
        assert_eq!(off(&[1, 2, 4], targets.clone()).0, [4]);
        assert_eq!(off(&[2, 4, 5], targets.clone()).0, [2]);
        assert_eq!(off(&[1, 2, 4, 5], targets).0.len(), 2);
    }
}

#[test]
fn what_does_not_help_is_not_taken_off() {
    // A ball in a closed box never leaves; what lies on the box stays.
    let shell = cells([&[0.0, 1.0, 4.0, 5.0]; 3].map(|x| &x[..]), |c| c != [1, 1, 1]);
    let meshes = [
        shell,
        cuboid([2.0, 2.0, 2.0], [3.0, 3.0, 3.0]),
        cuboid([0.0, 0.0, 5.0], [2.0, 2.0, 6.0]),
        cuboid([3.0, 3.0, 5.0], [4.0, 4.0, 6.0]),
    ];
    let outcome = planned(&meshes, |p| Problem { fixed: vec![0], keep: vec![2], ..p });
    assert_eq!(outcome.status, PlanStatus::Infeasible);
    assert_eq!((order(&outcome), &outcome.remaining[..]), (vec![3], &[0, 1, 2][..]));
    assert_eq!(outcome.unfinished, outcome.remaining);
}

/// A box that is open above and on one side (part 0), filled with cuboids: a block that was cut again and again, each time
/// the cuboid, along the axis and at the place that are given.
fn filled_box(cuts: &[(usize, usize, f64)]) -> Vec<SourceMesh> {
    let lines: &[f64] = &[-1.0, 0.0, 4.0, 5.0];
    let walls = cells([lines, lines, &[-1.0, 0.0, 3.0]], |[x, y, z]| z == 0 || x == 0 || y != 1);
    let mut blocks = vec![([0.0; 3], [4.0, 4.0, 3.0])];
    for &(which, axis, share) in cuts {
        let which = which % blocks.len();
        let (low, mut high) = blocks[which];
        let (mut from, to) = (low, high);
        let place = low[axis] + share * (high[axis] - low[axis]);
        (high[axis], from[axis]) = (place, place);
        blocks[which] = (low, high);
        blocks.push((from, to));
    }
    [walls].into_iter().chain(blocks.into_iter().map(|(low, high)| cuboid(low, high))).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(
        std::env::var("SBDP_TEST_KEPT").ok().and_then(|n| n.parse().ok()).unwrap_or(10)
    ))]
    /// Whatever set of kept parts leaves: with fewer of them, less of the rest does.
    #[test]
    fn no_plan_takes_fewer_kept_parts_off(
        cuts in prop::collection::vec(
            (0usize..6, 0usize..3, prop::sample::select(vec![0.25, 0.5, 0.75])), 3..6
        ),
        keep in prop::collection::btree_set(1usize..7, 1..4),
        target in prop::option::of(1usize..7),
    ) {
        let meshes = filled_box(&cuts);
        let count = meshes.len();
        let keep: Vec<usize> = keep.into_iter().filter(|&part| part < count).collect();
        let targets = target.map(|target| target % count).filter(|t| *t > 0 && !keep.contains(t)).map(|t| vec![t]);
        let asked: Vec<usize> =
            targets.clone().unwrap_or_else(|| (1..count).filter(|part| !keep.contains(part)).collect());
        let outcome =
            planned(&meshes, |p| Problem { fixed: vec![0], keep: keep.clone(), targets: targets.clone(), ..p });
        let off = keep.iter().filter(|part| !outcome.remaining.contains(part)).count();
        prop_assert_eq!(outcome.status, PlanStatus::Complete);
        prop_assert!(asked.iter().all(|part| !outcome.remaining.contains(part)));
        let (scene, verifier) = scene(meshes.clone());
        let mut standing: Vec<usize> = (0..count).collect();
        for Removal { parts, of, path, aside, .. } in &outcome.removals {
            if let (None, false, [part]) = (of, aside, &parts[..]) {
                standing.retain(|other| other != part);
                let t = Termination::default();
                let verdict = verifier.check(&scene, &scene.allowed, &standing, *part, path, &t).unwrap();
                prop_assert!(!verdict.is_refused(), "{} along {:?}", part, path);
            } else {
                standing.retain(|part| !parts.contains(part));
            }
        }
        for set in 0..1usize << keep.len() {
            if set.count_ones() as usize >= off {
                continue;
            }
            let held = keep.iter().enumerate().filter(|(i, _)| set >> i & 1 == 0).map(|(_, &part)| part);
            let fixed = [0].into_iter().chain(held).collect();
            let other = planned(&meshes, |p| Problem { fixed, targets: Some(asked.clone()), ..p });
            prop_assert!(other.status != PlanStatus::Complete, "{} of {:?} left, not {:b}", off, keep, set);
        }
    }
}
