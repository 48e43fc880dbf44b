//! Straight removals in a state-based search: what leaves along a line needs no simulation.
//!
//! Before states are expanded with translations, every open action of every open state is swept,
//! in the order in which the states would be expanded. Sweeps are so much cheaper than simulations
//! that parts which leave straight are all out before the first simulation. A sweep that was
//! blocked is not repeated while the part that blocked it stands. A claim that verification
//! refutes is not made again: the action stays open, for simulation.

use std::collections::HashMap;

use crate::simulation::Sweep;

use super::disassembly::{Run, Stop};
use super::sbdp::{Job, Search};
use super::state::Phase;
use super::trace::TraceEvent;

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

    /// In the order of expansion: displaced states first, then all parts as assembled.
    fn jobs_to_sweep(&self, open: &[usize]) -> Vec<Job> {
        let phase = Phase::Translation;
        let actions = 0..self.translations.len();
        let nodes = self.ranked(phase, open.to_vec());
        nodes.into_iter().flat_map(|node| actions.clone().map(move |action| Job { node, action })).collect()
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
                    self.drop_state(job.node);
                }
                Ok(false)
            }
        }
    }
}
