//! Motions that were simulated before their turn, in parallel, and wait for it.

use std::collections::HashMap;

use crate::simulation::Motion;

use super::state::Expansion;

/// Motions by their expansion, as long as nothing changes that they depend on: the standing parts, and the samples at
/// which contact is measured.
#[derive(Debug, Default)]
pub(super) struct Speculation {
    /// The version of the disassembly in which they were simulated.
    version: (usize, usize),
    motions: HashMap<Expansion, Motion>,
}

impl Speculation {
    /// Forgets the motions of other versions.
    pub(super) fn at(&mut self, version: (usize, usize)) -> &mut Self {
        if self.version != version {
            self.version = version;
            self.motions.clear();
        }
        self
    }

    pub(super) fn has(&self, expansion: &Expansion) -> bool {
        self.motions.contains_key(expansion)
    }

    pub(super) fn take(&mut self, expansion: &Expansion) -> Option<Motion> {
        self.motions.remove(expansion)
    }

    pub(super) fn keep(&mut self, expansion: Expansion, motion: Motion) {
        self.motions.insert(expansion, motion);
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::Phase;
    use super::*;
    use crate::simulation::End;

    #[test]
    fn a_motion_is_taken_once_and_forgotten_when_the_disassembly_changes() {
        let motion = || Motion::simulated(Vec::new(), Vec::new(), End::Collision { with: vec![1] });
        let expansion = |action| Expansion { node: 0, phase: Phase::Rotation, action };
        let mut speculation = Speculation::default();
        speculation.keep(expansion(0), motion());
        speculation.keep(expansion(1), motion());
        assert!(speculation.at((0, 0)).has(&expansion(0)) && !speculation.has(&expansion(2)));
        assert!(speculation.take(&expansion(0)).is_some() && speculation.take(&expansion(0)).is_none());
        assert!(!speculation.at((1, 0)).has(&expansion(1)));
    }
}
