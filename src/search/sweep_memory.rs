//! Straight sweeps that need not be repeated.
//!
//! A sweep that was blocked is not repeated while the part that blocked it stands. A claim that verification
//! refutes is not made again: the action stays open, for simulation.

use std::collections::HashMap;

use super::state::StateAction;

/// Why a sweep is no way out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum BlockedSweep {
    /// While this part stands.
    By(usize),
    /// Whatever part leaves.
    ForGood,
}

#[derive(Debug, Default)]
pub(super) struct SweepMemory(HashMap<StateAction, BlockedSweep>);

impl SweepMemory {
    pub(super) fn keep(&mut self, at: StateAction, blocked: BlockedSweep) {
        self.0.insert(at, blocked);
    }

    /// Whether a sweep is known to be blocked while some parts (ascending) stand.
    pub(super) fn is_blocked(&self, at: StateAction, standing: &[usize]) -> bool {
        match self.0.get(&at) {
            Some(BlockedSweep::By(part)) => standing.binary_search(part).is_ok(),
            Some(BlockedSweep::ForGood) => true,
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::trace::PlanningPhase;

    #[test]
    fn a_blocked_sweep_is_repeated_once_its_blocker_is_gone_and_a_refuted_one_never() {
        let at = |action: usize| StateAction { node: 0, phase: PlanningPhase::Translation, action };
        let mut memory = SweepMemory::default();
        memory.keep(at(0), BlockedSweep::By(4));
        memory.keep(at(1), BlockedSweep::ForGood);
        let blocked = |standing: &[usize]| [0, 1, 2].map(|action| memory.is_blocked(at(action), standing));
        assert_eq!(blocked(&[1, 4]), [true, true, false]);
        assert_eq!(blocked(&[1]), [false, true, false]);
    }
}
