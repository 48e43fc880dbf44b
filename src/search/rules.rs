//! The variant of the search: the paper's or the extended one, with or without blocking graphs.

use crate::budgets::TRANSLATION_PASSES;

use super::request::ActionSet;
use super::state::{Phase, StateNode};

/// What a variant of the search does.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    /// Whether blocking graphs order and constrain the search (SBDP*).
    pub(super) guided: bool,
    /// Whether there is one open list for translational planning and one for rotational, as in the paper.
    pub(super) separate_lists: bool,
}

impl Rules {
    pub(super) fn new(actions: ActionSet, guided: bool) -> Self {
        Self { guided, separate_lists: actions == ActionSet::Paper }
    }

    pub(super) fn translation_passes(self) -> usize {
        if self.separate_lists { 1 } else { TRANSLATION_PASSES }
    }

    /// Whether a state is in the open list of a phase.
    pub(super) fn lists(self, phase: Phase, node: &StateNode) -> bool {
        !self.separate_lists || node.origin.is_none_or(|origin| origin.phase == phase)
    }

    /// Whether actions are tried in an order of their own, over all states.
    pub(super) fn turns_by_action(self, phase: Phase) -> bool {
        phase == Phase::Rotation && self.is_extended()
    }

    /// Whether the search goes beyond the paper's.
    pub(super) fn is_extended(self) -> bool {
        self.guided && !self.separate_lists
    }
}
