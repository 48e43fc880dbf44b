//! Motions that were simulated before the serial algorithm asks for them.
//!
//! Invariant: all motions are of one version of the scene, so a kept motion is the one that a simulation
//! would yield now.

use std::collections::HashMap;

use crate::simulation::Motion;

use super::disassembly::SceneVersion;
use super::state::StateAction;

#[derive(Debug, Default)]
pub(super) struct Speculation {
    version: SceneVersion,
    motions: HashMap<StateAction, Motion>,
}

impl Speculation {
    /// Forgets what was simulated in another version of the scene.
    pub(super) fn valid_at(&mut self, now: SceneVersion) -> &mut Self {
        if self.version != now {
            self.version = now;
            self.motions.clear();
        }
        self
    }

    pub(super) fn has(&self, at: StateAction) -> bool {
        self.motions.contains_key(&at)
    }

    pub(super) fn take(&mut self, at: StateAction) -> Option<Motion> {
        self.motions.remove(&at)
    }

    pub(super) fn keep(&mut self, at: StateAction, motion: Motion) {
        self.motions.insert(at, motion);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::trace::PlanningPhase;
    use crate::simulation::End;

    #[test]
    fn a_motion_is_given_once_and_never_in_another_scene() {
        let mut speculation = Speculation::default();
        let at = StateAction { node: 1, phase: PlanningPhase::Rotation, action: 2 };
        let motion = || Motion::simulated(Vec::new(), Vec::new(), End::Collision { with: vec![3] });
        let other = StateAction { phase: PlanningPhase::Translation, ..at };
        speculation.keep(at, motion());
        let same = speculation.valid_at(SceneVersion::default());
        assert!(same.has(at) && !same.has(other));
        assert!(same.take(at).is_some() && same.take(at).is_none());
        speculation.keep(at, motion());
        let later = SceneVersion { removals: 1, extra_points: 0 };
        assert!(!speculation.valid_at(later).has(at));
    }
}
