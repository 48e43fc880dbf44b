//! A search, read-only: what its order and its report depend on.

use super::action_table::ActionTable;
use super::disassembly::Disassembly;
use super::linked::Links;
use super::rules::Rules;
use super::states::States;

/// The parts of a search that order and report read.
#[derive(Clone, Copy)]
pub(super) struct SearchView<'s, 'a, 'o> {
    pub(super) rules: Rules,
    pub(super) disassembly: &'s Disassembly<'a, 'o>,
    pub(super) states: &'s States,
    pub(super) actions: &'s ActionTable,
    pub(super) links: Option<&'s Links>,
    /// The parts that are balls, which no action has to turn.
    pub(super) balls: &'s [bool],
}

impl SearchView<'_, '_, '_> {
    /// A standing part with which a part is linked.
    pub(super) fn linked_with(&self, part: usize) -> Option<usize> {
        self.links?.holder(part, self.disassembly.everything.standing())
    }
}
