//! What stopped the actions of each part at its assembled pose, for planners without blocking graphs.

use std::collections::{BTreeMap, BTreeSet};

use super::disassembly::Disassembly;
use super::outcome::BlockedAction;

/// Per part and number of an action: the parts that stopped it, when last tried.
#[derive(Debug, Default)]
pub(super) struct StoppedActions(BTreeMap<(usize, usize), Vec<usize>>);

impl StoppedActions {
    pub(super) fn keep(&mut self, part: usize, action: usize, with: Vec<usize>) {
        self.0.insert((part, action), with);
    }

    /// The parts that stopped actions of a part.
    pub(super) fn of(&self, part: usize) -> BTreeSet<usize> {
        self.0.range((part, 0)..=(part, usize::MAX)).flat_map(|(_, with)| with).copied().collect()
    }

    /// The blocked actions of the parts that should have come out, given how actions are named.
    pub(super) fn blocked(
        &self,
        disassembly: &Disassembly<'_, '_>,
        name: impl Fn(usize) -> String,
    ) -> Vec<BlockedAction> {
        let standing = disassembly.everything.standing();
        let wanted = disassembly.problem.wanted(standing);
        let of_wanted = self.0.iter().filter(|((part, _), _)| wanted.binary_search(part).is_ok());
        let blocked = of_wanted.map(|(&(part, action), by)| BlockedAction {
            part,
            action: name(action),
            by: by.iter().copied().filter(|p| standing.binary_search(p).is_ok()).collect(),
        });
        blocked.filter(|b| !b.by.is_empty()).collect()
    }
}
