//! The straight sweeps that need not be repeated.
//!
//! A sweep that a part blocked is not repeated while that part stands. A claim that verification refuted is not made
//! again: the action stays open, for simulation.

use std::collections::HashMap;

use super::state::Expansion;

/// Sweeps that were no way out.
#[derive(Debug, Default)]
pub(super) struct SweepMemory(HashMap<Expansion, SweepBlock>);

/// Why a sweep is no way out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SweepBlock {
    /// This part blocks it.
    By(usize),
    /// Removals do not change that.
    ForGood,
}

impl SweepMemory {
    pub(super) fn block(&mut self, sweep: Expansion, by: SweepBlock) {
        self.0.insert(sweep, by);
    }

    /// Whether a sweep is known to be no way out while some parts (ascending) stand.
    pub(super) fn is_blocked(&self, sweep: &Expansion, standing: &[usize]) -> bool {
        match self.0.get(sweep) {
            Some(SweepBlock::By(part)) => standing.binary_search(part).is_ok(),
            Some(SweepBlock::ForGood) => true,
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::Phase;
    use super::*;

    #[test]
    fn a_blocked_sweep_is_repeated_once_the_part_that_blocked_it_is_gone() {
        let sweep = |action| Expansion { node: 0, phase: Phase::Translation, action };
        let mut memory = SweepMemory::default();
        memory.block(sweep(0), SweepBlock::By(2));
        memory.block(sweep(1), SweepBlock::ForGood);
        let blocked =
            |standing: &[usize]| [0, 1, 2].map(|action| memory.is_blocked(&sweep(action), standing));
        assert_eq!(blocked(&[1, 2, 3]), [true, true, false]);
        assert_eq!(blocked(&[1, 3]), [false, true, false]);
    }
}
