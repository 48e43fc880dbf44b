//! Near-null twists as actions: a part is turned about the axis that its contacts leave it.
//!
//! The axes that all parts are turned about are drawn from faces, and are few; an assembly may have threads
//! along many more. So before anything is turned, the contacts of each part that is made along none
//! of these axes are asked which twist they hardly resist ([`NullTwist`]); pulling and turning at once about that
//! axis, in the sense of its helix, join the actions with rotational freedom, for this part alone, and are tried
//! first. When everything else has been tried, all other parts are asked, too: a part's largest faces need not
//! know of its thread. As with [rays](super::rays), f_a does not count what others do not have.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::Blockage;
use crate::simulation::{Action, Axis, NullTwist};
use crate::termination::Interrupt;

use super::disassembly::Stop;
use super::request::ActionSet;
use super::sbdp::{Job, Search};
use super::state::{Phase, least_travel};

/// Twists of all parts together, at most.
const MOST_ACTIONS: usize = 64;
/// cos of the angle within which an axis is as good as another: two degrees.
const ALIKE: f64 = 0.9994;

/// Which twists are known, and whose they are.
#[derive(Debug, Default)]
pub(super) struct Twists {
    /// Per part: what it touched when its twist was looked for.
    touched: HashMap<usize, Vec<usize>>,
    /// Parts with the rotations that are twists of theirs.
    offered: HashSet<(usize, usize)>,
    /// Whether parts are asked that are made along an axis of all, too.
    of_all: bool,
}

impl Search<'_, '_> {
    /// Adds the near-null twists of open parts as assembled to the rotations, unless they are known; true if
    /// anything was added. Looked for again when a part that they came from is gone.
    pub(super) fn offer_twists(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        let problem = &self.disassembly.problem;
        if phase != Phase::Rotation || !self.guided || problem.actions != ActionSet::Extended {
            return Ok(false);
        }
        let started = Instant::now();
        let standing = self.disassembly.everything.standing();
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        let is_known = |part: &usize| self.twists.touched.get(part).is_some_and(|t| t.iter().all(stands));
        let is_asked = |part: &usize| self.twists.of_all || !self.directions.has_own(*part);
        let roots = open.iter().map(|&i| &self.nodes[i]).filter(|n| n.is_root());
        let parts: Vec<usize> = roots.map(|n| n.part).filter(|p| is_asked(p) && !is_known(p)).collect();
        let (scene, termination) = (&problem.scene, &problem.termination);
        let twist = |&part: &usize| {
            let others: Vec<usize> = standing.iter().copied().filter(|&p| p != part).collect();
            let (pose, reach) = (scene.bodies[part].planning_from_shape, least_travel(scene, part));
            NullTwist::of(scene, part, &pose, &others, reach, termination)
        };
        let found = parts.par_iter().map(twist).collect::<Result<Vec<_>, Interrupt>>()?;
        let before = self.twists.offered.len();
        for (part, (twist, touched)) in parts.into_iter().zip(found) {
            self.twists.touched.insert(part, touched);
            for action in twist.iter().flat_map(along) {
                self.offer_twist(part, action);
            }
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        Ok(self.twists.offered.len() > before)
    }

    /// Makes a twist an action of a part's, unless there is one as good.
    fn offer_twist(&mut self, part: usize, twist: Action) {
        let like = |a: &Action| {
            let [force, torque] = [a.force().dot(&twist.force()), a.torque().dot(&twist.torque())];
            matches!(a, Action::Screw(..)) && force > ALIKE && torque > ALIKE
        };
        let action = match self.rotations.iter().position(like) {
            Some(common) if common < self.common_rotations => return,
            Some(known) => known,
            None if self.rotations.len() - self.common_rotations == MOST_ACTIONS => return,
            None => {
                self.rotations.push(twist);
                self.nodes.iter_mut().for_each(|n| n.rotation.add_withheld());
                self.rotations.len() - 1
            }
        };
        if self.twists.offered.insert((part, action)) {
            tracing::debug!(part, action = %self.rotations[action], "twist");
            self.nodes.iter_mut().filter(|n| n.part == part).for_each(|n| n.rotation.reopen(action));
        }
    }

    /// Whether an action is a twist of a part's.
    pub(super) fn is_twist(&self, job: Job) -> bool {
        self.twists.offered.contains(&(self.nodes[job.node].part, job.action))
    }

    /// What is known of a new state of a part under rotations: nothing.
    pub(super) fn unturned(&self, part: usize) -> Blockage {
        let mut blockage = Blockage::open(self.common_rotations);
        for action in self.common_rotations..self.rotations.len() {
            blockage.add_withheld();
            if self.twists.offered.contains(&(part, action)) {
                blockage.reopen(action);
            }
        }
        blockage
    }

    /// Lets all parts be asked for their twists; true if they were not before.
    pub(super) fn ask_for_all_twists(&mut self) -> bool {
        let asks = self.guided && self.disassembly.problem.actions == ActionSet::Extended;
        asks && !std::mem::replace(&mut self.twists.of_all, true)
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
