//! Extreme rays as actions: the directions that a part's contacts leave when they hold it tightly.
//!
//! A part that lies against several planes can leave at first only within the cone that they bound. If
//! this cone is narrow, its extreme rays are the ways out of the fit, even if no surface of
//! the assembly is made along them: a slanted key in a flat plate. Forces along the axes follow
//! such a way, too, as contact bends them, but leave it wherever its wall has a gap.
//!
//! So when no sweep along the axes takes anything out any more, the rays of the parts as assembled join
//! the translations, each for the parts whose contacts leave it. They are swept at
//! once; simulated they are only when everything else has been tried, for they seldom lead to what
//! bent forces do not. Cones with many rays are wide, and no ray of them is better than others;
//! these are left out. The evaluation f_a does not count rays: parts are compared by what is open to all.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use nalgebra::{Unit, Vector3};
use rayon::prelude::*;

use crate::geometry::extreme_rays;
use crate::simulation::{Action, Axis, Touching};
use crate::termination::Interrupt;

use super::disassembly::Stop;
use super::request::ActionSet;
use super::sbdp::Search;
use super::state::{Phase, least_travel};

/// A cone with more rays is not narrow.
const MOST_RAYS: usize = 4;
/// Rays of all parts together, at most.
const MOST_ACTIONS: usize = 32;
/// cos of the angle within which two directions are one (a quarter of a degree).
const ALIKE: f64 = 0.999_99;

/// Which rays are known, and whose they are.
#[derive(Debug, Default)]
pub(super) struct Rays {
    /// Per part: what it touched when its rays were looked for.
    touched: HashMap<usize, Vec<usize>>,
    /// Parts with the translations that are rays of theirs.
    offered: HashSet<(usize, usize)>,
    /// Whether they are simulated, too.
    pub(super) simulated: bool,
}

impl Search<'_, '_> {
    /// Adds the extreme rays of open parts as assembled to the translations, unless they are known; true
    /// if anything was added. Looked for again when a part that they came from is gone.
    pub(super) fn offer_rays(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        let problem = &self.disassembly.problem;
        if phase != Phase::Translation || problem.actions != ActionSet::Extended {
            return Ok(false);
        }
        let started = Instant::now();
        let standing = self.disassembly.everything.standing();
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        let is_known = |part: &usize| self.rays.touched.get(part).is_some_and(|t| t.iter().all(stands));
        let roots = open.iter().map(|&i| &self.nodes[i]).filter(|n| n.is_root());
        let parts: Vec<usize> = roots.map(|n| n.part).filter(|p| !is_known(p)).collect();
        let (scene, termination) = (&problem.scene, &problem.termination);
        let touching = |&part: &usize| {
            termination.check()?;
            let others: Vec<usize> = standing.iter().copied().filter(|&p| p != part).collect();
            let (pose, reach) = (scene.bodies[part].planning_from_shape, least_travel(scene, part));
            problem.recall.touching(scene, part, &pose, &others, reach, termination)
        };
        let found = parts.par_iter().map(touching).collect::<Result<Vec<_>, Interrupt>>()?;
        let before = self.rays.offered.len();
        for (part, Touching { normals, parts: touched }) in parts.into_iter().zip(found) {
            self.rays.touched.insert(part, touched);
            let rays = extreme_rays(&normals.unwrap_or_default());
            if rays.len() <= MOST_RAYS {
                rays.iter().for_each(|ray| self.offer(part, ray));
            }
        }
        self.disassembly.counters.static_analysis += started.elapsed();
        Ok(self.rays.offered.len() > before)
    }

    /// Makes a ray an action of a part's, unless it is along one of the axes.
    fn offer(&mut self, part: usize, ray: &Unit<Vector3<f64>>) {
        let like = |a: &Action| a.force().dot(ray) > ALIKE;
        let action = match self.translations.iter().position(like) {
            Some(along_axis) if along_axis < self.along_axes() => return,
            Some(ray) => ray,
            None if self.translations.len() - self.along_axes() == MOST_ACTIONS => return,
            None => {
                let axis = Axis::along(if ray[ray.iamax()] < 0.0 { -*ray } else { *ray });
                self.translations.push(Action::Push(axis, axis.unit().dot(ray) > 0.0));
                for b in self.nodes.iter_mut().filter_map(|n| n.translation.as_mut()) {
                    b.add_withheld();
                }
                self.translations.len() - 1
            }
        };
        if self.rays.offered.insert((part, action)) {
            tracing::debug!(part, action = %self.translations[action], "ray");
            let nodes = self.nodes.iter_mut().filter(|n| n.part == part);
            nodes.filter_map(|n| n.translation.as_mut()).for_each(|b| b.reopen(action));
        }
    }

    /// How many of the translations are along axes: the first ones.
    pub(super) fn along_axes(&self) -> usize {
        2 * self.directions.axes.len()
    }

    /// Completes the blockage of a new state, which knows of translations along axes only.
    pub(super) fn add_rays(&mut self, node: usize) {
        let (rays, part) = (self.along_axes()..self.translations.len(), self.nodes[node].part);
        let Some(b) = &mut self.nodes[node].translation else { return };
        for action in rays {
            b.add_withheld();
            if self.rays.offered.contains(&(part, action)) {
                b.reopen(action);
            }
        }
    }

    /// Lets the rays be simulated; true if there are any and they were not before.
    pub(super) fn simulate_rays(&mut self) -> bool {
        let late = !self.rays.simulated && self.translations.len() > self.along_axes();
        self.rays.simulated = late || self.rays.simulated;
        late
    }
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
            assert!(along * (if removal.part == 1 { 1.0 } else { -1.0 }) > 1.0 - 1e-6, "{travel}");
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
