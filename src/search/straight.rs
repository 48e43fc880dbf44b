//! Straight removals in a state-based search: what leaves along a line needs no simulation.
//!
//! Before states are expanded with translations, every open action of every open state is swept,
//! in the order in which the states would be expanded. Sweeps are so much cheaper than simulations
//! that parts which leave straight are all out before the first simulation. A sweep that was
//! blocked is not repeated while the part that blocked it stands. A claim that verification
//! refutes is not made again: the action stays open, for simulation.

use std::collections::HashMap;

use nalgebra::Vector3;

use crate::simulation::Sweep;

use super::disassembly::{Run, Stop};
use super::sbdp::{Job, Search};
use super::state::{Node, Phase};
use super::trace::TraceEvent;

/// Shorter ways out are all alike, in the planning frame.
const LEAST_WAY: f64 = 1e-6;

/// Sweeps that need not be repeated, by state and action.
#[derive(Debug, Default)]
pub(super) struct Swept(HashMap<(usize, usize), Blocked>);

/// Why a sweep is no way out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Blocked {
    /// While this part stands.
    By(usize),
    /// Whoever leaves.
    ForGood,
}

impl Search<'_, '_> {
    /// Takes out whatever straight sweeps from the open states show free, in one run over them;
    /// true if anything left.
    pub(super) fn sweep_out(&mut self, phase: Phase, open: &[usize]) -> Result<bool, Stop> {
        if phase != Phase::Translation || !self.disassembly.problem.sweeps || self.distrust_static {
            return Ok(false);
        }
        let jobs = self.jobs_to_sweep(open);
        let (mut next, mut removed) = (0, false);
        while next < jobs.len() && !self.disassembly.is_done() {
            let (window, end) = self.sweeps_from(&jobs, next);
            next = end;
            let runs: Vec<Run> = window.iter().map(|&at| self.run_of(phase, jobs[at])).collect();
            let results = self.disassembly.sweep(&runs)?;
            for ((&at, run), result) in window.iter().zip(&runs).zip(results) {
                let job = jobs[at];
                let blocked = match result {
                    Some(Sweep::Clear { path, .. }) => {
                        if self.nodes[job.node].alive && self.prove_sweep(job, run, &path)? {
                            // Later results answer a question that has changed.
                            (next, removed) = (at + 1, true);
                            break;
                        }
                        Blocked::ForGood
                    }
                    Some(Sweep::Blocked { by }) => Blocked::By(by),
                    None => Blocked::ForGood,
                };
                self.swept.0.insert((job.node, job.action), blocked);
            }
        }
        Ok(removed)
    }

    /// The next sweeps worth doing, as many as there are threads, and where the ones after them begin.
    fn sweeps_from(&self, jobs: &[Job], from: usize) -> (Vec<usize>, usize) {
        let wanted =
            |at: &usize| self.is_open(Phase::Translation, jobs[*at]) && !self.is_known_blocked(&jobs[*at]);
        let window: Vec<usize> =
            (from..jobs.len()).filter(wanted).take(rayon::current_num_threads()).collect();
        let end = if window.len() < rayon::current_num_threads() { None } else { window.last() };
        let end = end.map_or(jobs.len(), |at| at + 1);
        (window, end)
    }

    /// In the order of expansion: displaced states first, then all parts as assembled; each along the
    /// shorter ways out first. Such a plan takes less room, and less is to be verified.
    fn jobs_to_sweep(&self, open: &[usize]) -> Vec<Job> {
        let hull = self.disassembly.everything.hull();
        let forces: Vec<_> = self.translations.iter().map(|action| action.force()).collect();
        let reach =
            |force: &Vector3<f64>| hull.iter().map(|p| p.coords.dot(force)).fold(f64::NEG_INFINITY, f64::max);
        let reaches: Vec<f64> = forces.iter().map(reach).collect();
        let jobs = |node: usize| {
            let Node { part, .. } = self.nodes[node];
            let bounds = self.disassembly.problem.scene.bodies[part].shape.bounds();
            let bounds = bounds.transformed(self.nodes[node].pose());
            let way = |action: &usize| reaches[*action] + bounds.support(&-forces[*action]);
            let mut actions: Vec<usize> = (0..forces.len()).collect();
            // Only what is much longer counts: the order is then the same in all assemblies but for a little.
            actions.sort_by_cached_key(|action| (way(action).max(LEAST_WAY).log2() * 2.0).floor() as i32);
            actions.into_iter().map(move |action| Job { node, action })
        };
        self.ranked(Phase::Translation, open.to_vec()).into_iter().flat_map(jobs).collect()
    }

    fn is_known_blocked(&self, job: &Job) -> bool {
        match self.swept.0.get(&(job.node, job.action)) {
            Some(Blocked::By(part)) => self.disassembly.everything.standing().binary_search(part).is_ok(),
            Some(Blocked::ForGood) => true,
            None => false,
        }
    }

    /// Verifies a path that a sweep claims to be clear, and takes the part out if it holds.
    fn prove_sweep(&mut self, job: Job, run: &Run, motion: &[crate::geometry::Pose]) -> Result<bool, Stop> {
        let prefix = self.nodes[job.node].path.clone();
        match self.disassembly.prove_sweep(run, &prefix, motion)? {
            Ok((path, depth)) => {
                let (state, part, action) = (self.state(job.node), run.part, run.action.to_string());
                self.disassembly.counters.sweeps += 1;
                self.disassembly.trace(|| TraceEvent::Swept { state, part, action });
                self.remove(part, path, depth);
                Ok(true)
            }
            Err(refuted) => {
                if refuted.prefix {
                    self.drop_state(job.node)?;
                }
                Ok(false)
            }
        }
    }
}
