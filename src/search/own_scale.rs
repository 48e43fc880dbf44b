//! Searches at the scale of what moves.
//!
//! Steps and depths of motions are lengths of the planning frame, and so is what verification allows them; of a small part
//! it allows less. What is so small that motions get deeper than verification allows is searched as if the assembly were
//! no larger than its surroundings.

use std::collections::HashMap;
use std::sync::Arc;

use crate::plan::Verifier;
use crate::scene::{OwnScale, rounded_down};
use crate::tolerances::{DEPTH_TOLERANCE, PAIR_LIMIT};

use super::outcome::Outcome;
use super::problem::Problem;

/// The scale at which a part is searched, a power of two; `None` for that of the assembly. It is the least at which
/// verification allows the part what it allows a large one.
pub(super) fn scale_of(problem: &Problem<'_>, part: usize) -> Option<f64> {
    let side = problem.scene.bodies[part].shape.bounds().extents().max();
    let is_small = problem.verifier.is_by_pair() && PAIR_LIMIT * side < DEPTH_TOLERANCE;
    let factor = (problem.verifier.limit() / (PAIR_LIMIT * side)).log2().ceil().exp2();
    (is_small && factor.is_finite() && factor > 1.0).then_some(factor)
}

/// The scale at which a group is searched that is taken apart, as if it were the whole assembly, and the longest side that
/// it has then; `None` for that of the assembly.
pub(super) fn scale_of_all(problem: &Problem<'_>) -> Option<(f64, f64)> {
    let all = problem.present.iter().map(|&part| problem.scene.bodies[part].bounds);
    let longest = all.reduce(|all, one| all.union(&one))?.extents().max();
    // Where the longest side is a power of two times 10, it becomes 10.
    let factor = (10.0 / longest).log2().floor().exp2();
    (factor.is_finite() && factor > 1.0).then(|| (factor, rounded_down(longest * factor)))
}

/// The outcome of a search with all parts that stand at another scale.
pub(super) fn searched_at(
    problem: &Problem<'_>,
    (factor, longest_side): (f64, f64),
    search: impl FnOnce(Problem<'_>) -> Outcome,
) -> Outcome {
    let own = OwnScale::of(&problem.scene, &problem.present, factor, longest_side, &problem.scaled);
    let verifier: Verifier = problem.verifier.at_scale(&own.scene, longest_side / problem.scene.longest_side);
    let scaled = Problem {
        scene: own.scene.clone(),
        verifier: &verifier,
        end_gap: problem.end_gap.map(|gap| gap * factor),
        clearance: problem.clearance * factor,
        verdicts: Arc::default(),
        extra_points: HashMap::new(),
        ..problem.clone()
    };
    let mut outcome = search(scaled);
    for removal in &mut outcome.removals {
        removal.path.iter_mut().for_each(|pose| *pose = own.restored(pose));
        removal.depth /= factor;
    }
    outcome
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::super::contraction::Unobserved;
    use super::super::request::{ActionSet, Planner};
    use super::super::search;
    use super::super::tests::problem;
    use super::*;
    use crate::fixtures::{cuboid, flats_in_slot, scene, thread, wire_in_tube};
    use crate::geometry::{Bounds, SourceMesh};
    use crate::plan::PlanStatus;

    /// A mechanism of two parts beside a fixed beam of length 9, of which the mechanism has a share.
    fn beside_a_beam(mechanism: &[SourceMesh; 2], share: f64) -> [SourceMesh; 3] {
        let points: Vec<Point3<f64>> =
            mechanism.iter().flat_map(|mesh| &mesh.vertices).map(|v| Point3::from(*v)).collect();
        let bounds = Bounds::of(&points);
        let by = 9.0 * share / bounds.extents().max();
        let scaled = |mesh: &SourceMesh| {
            let mut mesh = mesh.clone();
            mesh.vertices.iter_mut().flatten().for_each(|x| *x *= by);
            mesh
        };
        let near = by * bounds.max.y + 9.0 * share;
        let beam = cuboid([-4.5, near, -0.05], [4.5, near + 0.1, 0.05]);
        [scaled(&mechanism[0]), scaled(&mechanism[1]), beam]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

        /// The answer about a pair does not depend on what stands far away.
        #[test]
        fn small_parts_come_apart_beside_large_ones(kind in 0..3usize, share in 0.003..0.02f64) {
            let mechanisms = [thread(1.5, 0.5), wire_in_tube(), flats_in_slot(0.9, 0.05, -0.05)];
            let (scene, verifier) = scene(beside_a_beam(&mechanisms[kind], share));
            let problem = Problem {
                fixed: vec![0, 2],
                actions: ActionSet::Extended,
                sweeps: true,
                max_simulations: Some(1000),
                ..problem(scene, &verifier)
            };
            prop_assert!(scale_of(&problem, 1).is_some() && scale_of(&problem, 2).is_none());
            let outcome = search(Planner::SbdpStar, problem, &mut Unobserved);
            prop_assert_eq!(outcome.status, PlanStatus::Complete, "kind {}, {:?}", kind, outcome.reason);
        }
    }
}
