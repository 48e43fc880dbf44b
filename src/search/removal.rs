//! Taking parts out: thinning, verification and refinement of a path, and what a removal changes.

use std::time::Instant;

use crate::geometry::Pose;
use crate::simulation::{End, Surroundings, exit_direction};

use super::outcome::Removal;
use super::problem::Problem;
use super::sbdp::{Gain, Job, Search, Stop, joined, simulate};
use super::state::Phase;

/// How often a motion is simulated again with the points at which verification refuted it.
const REFINEMENTS: usize = 4;

impl Search<'_, '_> {
    /// Thins and verifies a path that leads out. True if the part is out; else the motion is
    /// simulated again with the refuting points as samples, and given up after some tries.
    pub(super) fn take_out(&mut self, phase: Phase, job: Job, mut motion: Vec<Pose>) -> Result<bool, Stop> {
        let part = self.nodes[job.node].part;
        for refinement in 0..=REFINEMENTS {
            let full = joined(&self.nodes[job.node].path, &motion);
            let started = Instant::now();
            let checked = self.problem.checked_path(self.standing(part), part, &full);
            self.counters.verification += started.elapsed();
            let refuted = match checked? {
                Ok((path, depth)) => {
                    self.remove(part, path, depth);
                    return Ok(true);
                }
                Err(entries) => entries,
            };
            tracing::debug!(part, refinement, over = refuted.first().map(|e| e.over), "path refuted");
            self.problem.add_samples(part, &refuted);
            if self.refuted_before(part, job)? {
                return Ok(false);
            }
            if refinement == REFINEMENTS {
                let mut by: Vec<_> = refuted.iter().map(|e| e.other).collect();
                by.sort_unstable();
                by.dedup();
                self.block(phase, job, by);
                return Ok(false);
            }
            self.charge()?;
            let started = Instant::now();
            let action = self.actions(phase)[job.action];
            let Problem { termination, .. } = &self.problem;
            let again = simulate(&self.problem, &self.nodes[job.node], &self.around, action, termination);
            self.counters.simulation += started.elapsed();
            let again = again?;
            if !matches!(again.end, End::Disassembled(_)) {
                self.take(phase, job, again, &mut Gain::default())?;
                return Ok(false);
            }
            motion = again.path;
        }
        Ok(false)
    }

    /// Whether already the path to a state does not hold; then the state is dropped and the
    /// action that led to it is open again.
    fn refuted_before(&mut self, part: usize, job: Job) -> Result<bool, Stop> {
        let Some((parent, phase, action)) = self.nodes[job.node].origin else { return Ok(false) };
        let started = Instant::now();
        let path = self.nodes[job.node].path.clone();
        let checked = self.problem.checked_path(self.standing(part), part, &path);
        self.counters.verification += started.elapsed();
        if checked?.is_ok() {
            return Ok(false);
        }
        self.nodes[job.node].alive = false;
        if let Some(b) = self.nodes[parent].blockage_mut(phase) {
            b.reopen(action);
        }
        Ok(true)
    }

    fn standing(&self, part: usize) -> Vec<usize> {
        self.everything.standing.iter().copied().filter(|&i| i != part).collect()
    }

    pub(super) fn surroundings(&mut self, part: usize) -> &Surroundings {
        let (everything, scene) = (&self.everything, &self.problem.scene);
        self.around[part].get_or_insert_with(|| everything.without(scene, part))
    }

    pub(super) fn remove(&mut self, part: usize, path: Vec<Pose>, depth: f64) {
        self.everything = self.everything.without(&self.problem.scene, part);
        self.around.fill(None);
        let mut waited_for = Vec::new();
        for node in &mut self.nodes {
            if node.part == part {
                if node.is_root() {
                    let blockages = [node.translation.as_ref(), Some(&node.rotation)];
                    waited_for
                        .extend(blockages.into_iter().flatten().flat_map(|b| b.outlived().iter().copied()));
                }
                node.alive = false;
                // Its path and blockages are of no use any more.
                node.path.truncate(1);
                continue;
            }
            if let Some(b) = &mut node.translation {
                b.remove(part);
            }
            node.rotation.remove(part);
        }
        waited_for.sort_unstable();
        waited_for.dedup();
        let removal = Removal { part, path, depth, waited_for };
        self.observer.removal(&removal);
        self.removals.push(removal);
    }

    /// Parts whose hull is apart from all others' need no motion.
    pub(super) fn take_free_parts(&mut self) -> Result<(), Stop> {
        let mut changed = true;
        while changed && !self.is_done() {
            changed = false;
            for part in self.everything.standing.clone() {
                self.problem.termination.check()?;
                if self.is_done() {
                    break;
                }
                if self.problem.may_move(part) && self.is_free(part) {
                    let pose = self.problem.scene.bodies[part].planning_from_shape;
                    self.remove(part, vec![pose], 0.0);
                    changed = true;
                }
            }
        }
        Ok(())
    }

    fn is_free(&mut self, part: usize) -> bool {
        if self.everything.standing.len() < 2 {
            return false;
        }
        if let Some(other) = self.entangled[part]
            && self.everything.standing.binary_search(&other).is_ok()
        {
            return false;
        }
        let scene = &self.problem.scene;
        let pose = scene.bodies[part].planning_from_shape;
        let meets = |&&other: &&usize| {
            other != part
                && scene.bodies[other].bounds.meets(&scene.bodies[part].bounds)
                && exit_direction(scene, &Surroundings::new(scene, vec![other]), part, &pose, None).is_none()
        };
        self.entangled[part] = self.everything.standing.iter().find(meets).copied();
        if self.entangled[part].is_some() {
            return false;
        }
        self.surroundings(part);
        let around = self.around[part].as_ref();
        around.is_some_and(|a| exit_direction(&self.problem.scene, a, part, &pose, None).is_some())
    }
}
