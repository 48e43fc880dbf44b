//! Which rules a state-based search follows: SBDP, SBDP*, the paper's or the extended ones.

use crate::blocking_graph::{Blockage, Reopening};

use super::known_states::Resolution;
use super::request::ActionSet;
use super::state::StateNode;
use super::trace::PlanningPhase;

/// The rules of one search.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strategy {
    /// Blocking graphs order and constrain the search (SBDP*).
    pub(super) guided: bool,
    /// Translational and rotational planning have one open list each, as in the paper.
    pub(super) separate_lists: bool,
    /// Actions that only static analysis excludes are simulated, too: the last resort.
    pub(super) distrust_static: bool,
    /// Translational planning goes on with the graphs that are there, and states without graphs wait: the paper's flow
    /// from decision (d).
    pub(super) skips_analysis: bool,
}

impl Strategy {
    /// Whether the search is guided and leaves the paper's rules where others find more.
    pub(super) fn is_extended(self) -> bool {
        self.guided && !self.separate_lists
    }

    /// The rules of a search at its start.
    pub(super) fn new(guided: bool, actions: ActionSet) -> Self {
        let separate_lists = actions == ActionSet::Paper;
        Self { guided, separate_lists, distrust_static: false, skips_analysis: false }
    }

    /// How states are distinguished: the paper's way but for the extended search, which has free play to expect.
    pub(super) fn resolution(self) -> Resolution {
        if self.is_extended() { Resolution::Adaptive } else { Resolution::Fixed }
    }

    /// When an action that was blocked is open again.
    pub(super) fn reopening(self) -> Reopening {
        if self.separate_lists { Reopening::AllGone } else { Reopening::AnyGone }
    }

    /// Whether actions are tried in an order of their own over all states at once. Which action is tried
    /// next matters more for turning than the state it starts from.
    pub(super) fn orders_actions(self, phase: PlanningPhase) -> bool {
        phase == PlanningPhase::Rotation && self.is_extended()
    }

    /// Whether a state is in the open list of a phase.
    pub(super) fn lists(self, phase: PlanningPhase, node: &StateNode) -> bool {
        !self.separate_lists || node.origin.is_none_or(|origin| origin.phase == phase)
    }

    /// Whether a state is left for a later pass over its open list.
    pub(super) fn waits(self, phase: PlanningPhase, node: &StateNode) -> bool {
        self.skips_analysis && phase == PlanningPhase::Translation && node.translation.is_none()
    }

    /// Whether an action may be tried, given what is known to block it.
    pub(super) fn allows(self, blockage: &Blockage, action: usize) -> bool {
        match (self.guided, self.distrust_static) {
            (true, false) => blockage.is_open(action),
            (true, true) => blockage.is_untried(action),
            (false, _) => !blockage.is_barred(action),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_distrust_tries_what_static_analysis_excludes_and_only_sbdp_what_a_simulation_blocked() {
        let mut blockage = Blockage::open(4);
        blockage.block_single(1, 7);
        blockage.block_jointly(2, vec![7]);
        blockage.block_jointly(3, Vec::new());
        let allowed = |guided, distrust_static| {
            let strategy = Strategy { distrust_static, ..Strategy::new(guided, ActionSet::Extended) };
            (0..4).filter(|&action| strategy.allows(&blockage, action)).collect::<Vec<_>>()
        };
        assert_eq!(allowed(true, false), [0]);
        assert_eq!(allowed(true, true), [0, 1]);
        assert_eq!(allowed(false, false), [0, 1, 2]);
    }
}
