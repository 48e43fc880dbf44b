//! Near-null twists as actions: a part is turned about the axis that its contacts leave it.
//!
//! The axes that all parts are turned about are drawn from faces, and are few; an assembly may have threads
//! along many more. So before anything is turned, the contacts of each part that is made along none
//! of these axes are asked which twist they hardly resist ([`NullTwist`]); pulling and turning at once about that
//! axis, in the sense of its helix, join the actions with rotational freedom, for this part alone, and are tried
//! first. When everything else has been tried, all other parts are asked, too: a part's largest faces need not
//! know of its thread.

use crate::simulation::{Action, Axis, NullTwist};

use super::disassembly::Stop;
use super::own_actions::OwnActions;
use super::request::ActionSet;
use super::sbdp::Search;
use super::state::{Phase, least_travel};

/// Twists of all parts together, at most.
const MOST_ACTIONS: usize = 64;
/// cos of the angle within which an axis is as good as another: two degrees.
const ALIKE: f64 = 0.9994;

/// Which twists are known, and whose they are.
#[derive(Debug)]
pub(super) struct Twists {
    pub(super) own: OwnActions,
    /// Whether parts are asked that are made along an axis of all, too.
    of_all: bool,
}

impl Twists {
    /// None yet, beside the actions with rotational freedom about axes.
    pub(super) fn beside(rotations: &[Action]) -> Self {
        Self { own: OwnActions::new(rotations.len(), MOST_ACTIONS, ALIKE), of_all: false }
    }
}

impl Search<'_, '_> {
    /// Adds the near-null twists of open parts as assembled to the rotations, unless they are known; true if
    /// anything was added.
    pub(super) fn offer_twists(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        if phase != Phase::Rotation || !self.follows_twists() {
            return Ok(false);
        }
        let of_all = self.twists.of_all;
        let without: Vec<bool> = (0..self.known.len()).map(|part| !self.directions.has_own(part)).collect();
        self.offer_own(
            phase,
            open,
            |part| of_all || without[part],
            |problem, part, others| {
                let scene = &problem.scene;
                let (pose, reach) = (scene.bodies[part].planning_from_shape, least_travel(scene, part));
                let (twist, touched) =
                    NullTwist::of(scene, part, &pose, others, reach, &problem.termination)?;
                Ok((twist.iter().flat_map(along).collect(), touched))
            },
        )
    }

    /// Lets all parts be asked for their twists; true if they were not before.
    pub(super) fn ask_for_all_twists(&mut self) -> bool {
        self.follows_twists() && !std::mem::replace(&mut self.twists.of_all, true)
    }

    fn follows_twists(&self) -> bool {
        self.guided && self.disassembly.problem.actions == ActionSet::Extended
    }
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
    use nalgebra::Vector3;

    use super::super::problem::Problem;
    use super::super::request::Planner;
    use super::super::tests::{Recorder, problem};
    use super::super::{TraceEvent, search};
    use super::*;
    use crate::fixtures::{moved, scene, thread};
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

    #[test]
    fn a_thread_that_no_axis_of_faces_knows_is_turned_along_its_own() {
        let (scene, verifier) = scene(many_askew());
        let mut recorder = Recorder::default();
        let present = (0..scene.bodies.len()).collect();
        let problem = Problem {
            present,
            actions: ActionSet::Extended,
            sweeps: true,
            max_simulations: Some(60),
            ..problem(scene, &verifier)
        };
        let outcome = search(Planner::SbdpStar, problem, &mut recorder);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        let turned: Vec<_> = recorder
            .0
            .iter()
            .filter_map(|e| match e {
                TraceEvent::Simulated { action, end, .. } if action.contains('r') => Some((action, end)),
                _ => None,
            })
            .collect();
        assert_eq!(turned.len(), 6, "one turn a thread: {turned:?}");
    }
}
