//! Null twists as actions: a part is turned about the axis of the twist that its contacts resist least.
//!
//! The axes that all parts are turned about are drawn from faces, and are few; an assembly may have threads
//! along many more. So before anything is turned, the [`NullTwist`] of each part that is made along none of
//! these axes is computed from its contacts. Pulling and turning at once about the twist's axis, in the sense
//! of its helix, join the actions with rotational freedom, for this part alone, and are tried first. When
//! everything else has been tried, this is done for all other parts, too: a part's largest faces need not be
//! along its thread.

use crate::simulation::{Action, Axis, NullTwist};
use crate::termination::Interrupt;

use super::action_list::DrawnActions;
use super::problem::Problem;
use super::state::least_travel;

/// The wrenches along the null twist of a part as assembled among `others`.
///
/// # Errors
/// The termination condition became true.
pub(super) fn null_twist_actions(
    problem: &Problem<'_>,
    part: usize,
    others: &[usize],
) -> Result<DrawnActions, Interrupt> {
    let Problem { scene, termination, .. } = problem;
    let (pose, reach) = (scene.bodies[part].planning_from_shape, least_travel(scene, part));
    let (twist, touched) = NullTwist::of(scene, part, &pose, others, reach, termination)?;
    Ok(DrawnActions { actions: twist.iter().flat_map(along).collect(), touched })
}

/// The wrenches that follow a twist either way: in the sense of its helix, or in both where it has none.
fn along(twist: &NullTwist) -> Vec<Action> {
    let axis = Axis::along(twist.axis);
    let senses = Action::screws_along(&[axis]);
    let follows = |a: &Action| match twist.rise {
        // Of a helix that leans the other way than the axis the sense is the same.
        Some(rise) => a.force().dot(&a.torque()) * rise > 0.0,
        None => true,
    };
    senses.into_iter().filter(follows).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::Vector3;

    use super::super::problem::Problem;
    use super::super::request::{ActionSet, Planner};
    use super::super::tests::{Recorder, problem};
    use super::super::{TraceEvent, search};
    use crate::fixtures::{moved, scene, thread, wire_in_tube};
    use crate::geometry::{Pose, SourceMesh};
    use crate::plan::PlanStatus;

    /// Bolts with their nuts, each along another axis: more than faces are asked for.
    fn many_askew() -> Vec<SourceMesh> {
        let turns = [
            [0.0, 0.0, 0.0],
            [0.5, 0.3, 0.0],
            [-0.4, 0.9, 0.2],
            [0.9, -0.5, 0.1],
            [-1.1, -0.4, 0.3],
            [0.2, 1.4, -0.3],
        ];
        let place = |i: usize| Vector3::new((i % 3) as f64 * 2.8 - 2.8, (i / 3) as f64 * 2.8 - 1.4, 0.0);
        let small = |mut mesh: SourceMesh| {
            mesh.vertices.iter_mut().for_each(|v| *v = v.map(|x| 0.3 * x));
            mesh
        };
        let pair = |(i, turn): (usize, &[f64; 3])| {
            let pose = Pose::new(place(i), Vector3::from(*turn));
            thread(1.0, 0.5).map(|mesh| moved(small(mesh), &pose))
        };
        turns.iter().enumerate().flat_map(pair).collect()
    }

    /// The events of a search that takes parts apart.
    fn events(meshes: Vec<SourceMesh>, sweeps: bool) -> Vec<TraceEvent> {
        let (scene, verifier) = scene(meshes);
        let mut recorder = Recorder::default();
        let present = (0..scene.bodies.len()).collect();
        let problem = Problem {
            present,
            actions: ActionSet::Extended,
            sweeps,
            max_simulations: Some(150),
            ..problem(scene, &verifier)
        };
        let outcome = search(Planner::SbdpStar, problem, &mut recorder);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        recorder.0
    }

    fn simulated_turns(events: &[TraceEvent]) -> usize {
        let is_turn =
            |e: &&TraceEvent| matches!(e, TraceEvent::Simulated { action, .. } if action.contains('r'));
        events.iter().filter(is_turn).count()
    }

    #[test]
    fn a_thread_that_no_axis_of_faces_knows_is_turned_along_its_own() {
        let events = events(many_askew(), false);
        let (mut turns, mut refuted) = (BTreeMap::new(), BTreeMap::new());
        for event in &events {
            match event {
                TraceEvent::Simulated { part, action, .. } if action.contains('r') => {
                    *turns.entry(*part).or_insert(0) += 1;
                }
                TraceEvent::Refuted { part, .. } => *refuted.entry(*part).or_insert(0) += 1,
                _ => {}
            }
        }
        // One turn a thread, and one more where a path was refuted.
        assert_eq!(turns.len(), 6, "{turns:?}");
        for (part, turns) in turns {
            assert!(turns <= 1 + refuted.get(&part).unwrap_or(&0), "{part}: {turns}, {refuted:?}");
        }
    }

    #[test]
    fn threads_and_tubes_are_left_along_their_helices_without_simulation() {
        for (meshes, count) in [(many_askew(), 6), (wire_in_tube().into(), 1)] {
            let events = events(meshes, true);
            assert_eq!(simulated_turns(&events), 0);
            let along_thread =
                |e: &&TraceEvent| matches!(e, TraceEvent::Swept { action, .. } if action.contains('r'));
            assert_eq!(events.iter().filter(along_thread).count(), count, "{events:?}");
        }
    }
}
