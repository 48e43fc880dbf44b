//! Motions that were simulated ahead of their turn and wait for it.

use std::collections::HashMap;

use crate::simulation::Motion;

use super::sbdp::Job;
use super::state::Phase;

/// Motions by what they were simulated for, as long as nothing changes that they depend on: which
/// parts stand, and where contact is looked for.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    /// Removals and added samples when they were simulated.
    made_at: (usize, usize),
    motions: HashMap<(Phase, usize, usize), Motion>,
}

impl Ahead {
    /// Forgets what was simulated before something changed.
    pub(super) fn valid_at(&mut self, now: (usize, usize)) -> &mut Self {
        if self.made_at != now {
            self.made_at = now;
            self.motions.clear();
        }
        self
    }

    pub(super) fn has(&self, phase: Phase, job: Job) -> bool {
        self.motions.contains_key(&(phase, job.node, job.action))
    }

    pub(super) fn take(&mut self, phase: Phase, job: Job) -> Option<Motion> {
        self.motions.remove(&(phase, job.node, job.action))
    }

    pub(super) fn keep(&mut self, phase: Phase, job: Job, motion: Motion) {
        self.motions.insert((phase, job.node, job.action), motion);
    }
}
