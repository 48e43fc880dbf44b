//! Extreme rays as actions: the edges of the cone within which a part's contacts let it move.
//!
//! A part that lies against several planes can leave at first only within the cone that they bound. If this
//! cone is narrow, its extreme rays lead out of the fit, even if no surface of the assembly is made along
//! them: a slanted key in a flat plate. Contact bends forces along the axes into such a way, too, but they
//! leave it wherever its wall has a gap.
//!
//! The rays of the parts as assembled join the translations, each for the parts whose contacts leave it, when
//! no sweep along the axes takes anything out any more. They are swept at once. They are simulated only when
//! everything else has been tried, for they seldom lead to what bent forces do not. Cones with many rays are
//! wide, and no ray of them is better than others; these are left out.

use nalgebra::{Unit, Vector3};

use crate::budgets::NARROW_CONE_RAYS;
use crate::geometry::extreme_rays;
use crate::simulation::{Action, Axis, Touching, remembered_touching};
use crate::termination::Interrupt;

use super::action_list::DrawnActions;
use super::problem::Problem;
use super::state::least_travel;

/// The pushes along the extreme rays of a part as assembled among `others`.
///
/// # Errors
/// The termination condition became true.
pub(super) fn extreme_ray_actions(
    problem: &Problem<'_>,
    part: usize,
    others: &[usize],
) -> Result<DrawnActions, Interrupt> {
    let Problem { scene, cache, termination, .. } = problem;
    let (pose, reach) = (scene.bodies[part].planning_from_shape, least_travel(scene, part));
    let Touching { normals, parts: touched } =
        remembered_touching(cache, scene, part, &pose, others, reach, termination)?;
    let rays = extreme_rays(&normals.unwrap_or_default());
    let few = if rays.len() <= NARROW_CONE_RAYS { &rays[..] } else { &[] };
    Ok(DrawnActions { actions: few.iter().map(push_along).collect(), touched })
}

/// The push along a ray.
fn push_along(ray: &Unit<Vector3<f64>>) -> Action {
    let axis = Axis::along(if ray[ray.iamax()] < 0.0 { -*ray } else { *ray });
    Action::Push(axis, axis.unit().dot(ray) > 0.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::outcome::Outcome;
    use super::super::problem::Problem;
    use super::super::request::{ActionSet, Planner};
    use super::super::tests::{Recorder, problem};
    use super::super::{TraceEvent, search};
    use crate::fixtures::{cells, moved, peg_in_hole, scene};
    use crate::geometry::{Pose, SourceMesh};
    use crate::plan::PlanStatus;

    const WAY: Vector3<f64> = Vector3::new(0.45, 0.3, 1.0);

    /// A plate (part 0) with a blind square hole along [`WAY`], and at its bottom a key (part 1) that
    /// fits tightly. Most of both looks along z, so no axis is slanted.
    fn key_in_slanted_hole() -> [SourceMesh; 2] {
        let slanted = |mut mesh: SourceMesh| {
            for v in &mut mesh.vertices {
                // Halved, so that it stays in the planning frame however it is turned.
                *v = [v[0] + WAY.x * v[2], v[1] + WAY.y * v[2], v[2]].map(|x| 0.5 * x);
            }
            mesh
        };
        let across: &[f64] = &[-4.5, -1.5, -0.5, 0.5, 1.5, 4.5];
        let plate = cells([across, across, &[-3.0, -2.5, -1.7, -0.9, -0.3, 0.0]], |[x, y, z]| {
            let is_hole = x == 2 && y == 2 && z > 0;
            !is_hole
        });
        let key = cells([&[-0.5, 0.5], &[-0.5, 0.5], &[-2.5, -1.9]], |_| true);
        [slanted(plate), slanted(key)]
    }

    fn planned(parts: [SourceMesh; 2], actions: ActionSet, most: u64) -> (Outcome, Vec<TraceEvent>) {
        let (scene, verifier) = scene(parts);
        let mut recorder = Recorder::default();
        let present = vec![0, 1];
        let problem = Problem {
            present,
            actions,
            sweeps: true,
            max_simulations: Some(most),
            ..problem(scene, &verifier)
        };
        (search(Planner::SbdpStar, problem, &mut recorder), recorder.0)
    }

    #[test]
    fn a_key_leaves_along_the_ray_that_its_contacts_leave() {
        for turn in [Vector3::zeros(), Vector3::new(0.3, -0.5, 0.2), Vector3::new(-0.7, 0.4, 1.1)] {
            let turn = Pose::rotation(turn);
            let (outcome, _) =
                planned(key_in_slanted_hole().map(|m| moved(m, &turn)), ActionSet::Extended, 20);
            let counters = &outcome.counters;
            assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
            assert_eq!((counters.simulations, counters.sweeps), (0, 1));
            let [removal] = &outcome.removals[..] else { panic!("{:?}", outcome.removals) };
            let travel =
                removal.path[removal.path.len() - 1].translation.vector - removal.path[0].translation.vector;
            // Either part may be the one that leaves.
            let along = travel.normalize().dot(&(turn * WAY.normalize()));
            assert!(along * (if removal.parts == [1] { 1.0 } else { -1.0 }) > 1.0 - 1e-6, "{travel}");
        }
    }

    #[test]
    fn the_papers_actions_are_along_the_axes_of_the_world_alone() {
        let (outcome, events) = planned(key_in_slanted_hole(), ActionSet::Paper, 20);
        assert!(outcome.counters.sweeps == 0 && outcome.counters.simulations > 0);
        let slanted =
            |e: &TraceEvent| matches!(e, TraceEvent::Simulated { action, .. } if action.contains('['));
        assert!(!events.iter().any(slanted));
    }

    #[test]
    fn what_leaves_along_an_axis_does_so_as_without_rays() {
        let (outcome, events) = planned(peg_in_hole(0.0), ActionSet::Extended, 20);
        assert_eq!((outcome.status, outcome.counters.sweeps), (PlanStatus::Complete, 1));
        let out = |e: &TraceEvent| matches!(e, TraceEvent::Swept { action, .. } if action.ends_with('z'));
        assert!(events.iter().any(out));
    }
}
