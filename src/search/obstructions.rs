//! How much stands in the way of pulls, for the order of turns.

use std::collections::{BTreeSet, HashMap};

use rayon::prelude::*;

use crate::budgets::SHORT_STEPS_PER_POLL;
use crate::contact::obstruction;
use crate::termination::{Interrupt, Poll};

use super::action_table::ActionTable;
use super::disassembly::{Disassembly, Stop};
use super::state::{Expansion, Phase};
use super::states::States;

/// For a state and a push, the longest stretch of other parts in its way, by its binary logarithm, and the version of
/// the disassembly for which that holds.
#[derive(Debug, Default)]
pub(super) struct Obstructions(HashMap<(usize, usize), ((usize, usize), i32)>);

impl Obstructions {
    /// Measures the obstructions of the pulls of some turns, unless they are known.
    pub(super) fn measure(
        &mut self,
        disassembly: &Disassembly<'_, '_>,
        states: &States,
        actions: &ActionTable,
        turns: &[Expansion],
    ) -> Result<(), Stop> {
        let version = disassembly.version();
        let asked: BTreeSet<(usize, usize)> = turns
            .iter()
            .filter_map(|turn| Some((turn.node, actions.pull_of(states[turn.node].part, turn.action)?)))
            .filter(|key| self.0.get(key).is_none_or(|(at, _)| *at != version))
            .collect();
        let standing = |&(node, _): &(usize, usize)| disassembly.standing(states[node].part);
        let asked: Vec<_> = asked.into_iter().map(|key| (key, standing(&key))).collect();
        let (pushes, problem) = (actions.of(Phase::Translation), &disassembly.problem);
        let found = asked.par_iter().map(|((node, push), standing)| {
            let (node, force) = (&states[*node], pushes[*push].force());
            let poll = Poll::every(SHORT_STEPS_PER_POLL, Some(&problem.termination));
            obstruction(&problem.scene, standing, node.part, node.pose(), &force, &poll)
        });
        let found: Vec<f64> = found.collect::<Result<_, Interrupt>>()?;
        for ((key, _), way) in asked.into_iter().zip(found) {
            let doublings = if way > 0.0 { way.log2().floor() as i32 } else { i32::MIN };
            self.0.insert(key, (version, doublings));
        }
        Ok(())
    }

    /// The obstruction of a push from a state, as last measured.
    pub(super) fn of(&self, node: usize, push: usize) -> i32 {
        self.0.get(&(node, push)).map_or(0, |(_, doublings)| *doublings)
    }
}
