//! Pairs of parts that are proved never to come apart.
//!
//! A proof is about two parts alone. If no motion of one takes it away from the other, no motion of the other does
//! either, since only their relative motion counts, and further parts are only in the way. So they stay together,
//! whatever else is removed, and a request that wants them apart has no plan. They may leave the rest together.

use crate::termination::Interrupt;

use super::enclosed::enclosed_pairs;
use super::linked::linked_pairs;
use super::necked::necked_pairs;
use super::outcome::{Inseparable, SeparationProof};
use super::problem::Problem;

/// The pairs that were found so far. Each kind of proof is looked for once, among the parts that remain then.
#[derive(Debug, Default)]
pub(super) struct InseparablePairs {
    pairs: Vec<Inseparable>,
    knows_linked: bool,
    knows_enclosed: bool,
    knows_necked: bool,
}

/// Looks for the pairs that one kind of proof shows, unless that was done; true if there are new ones.
pub(super) type FindPairs = fn(&mut InseparablePairs, &Problem<'_>, &[usize]) -> Result<bool, Interrupt>;

impl InseparablePairs {
    /// All kinds of proof, the cheaper first.
    pub(super) const PROOFS: [FindPairs; 3] = [Self::find_linked, Self::find_necked, Self::find_enclosed];

    /// Finds the linked pairs among some parts (ascending), unless that was done; true if there are new ones.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn find_linked(&mut self, problem: &Problem<'_>, parts: &[usize]) -> Result<bool, Interrupt> {
        if self.knows_linked {
            return Ok(false);
        }
        let linked = linked_pairs(&problem.scene, parts, &problem.termination)?;
        self.knows_linked = true;
        let pair = |parts| Inseparable { parts, proof: SeparationProof::Linked };
        Ok(self.add(linked.into_iter().map(pair).collect()))
    }

    /// The same for pairs of which one part encloses the other.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn find_enclosed(
        &mut self,
        problem: &Problem<'_>,
        parts: &[usize],
    ) -> Result<bool, Interrupt> {
        if self.knows_enclosed {
            return Ok(false);
        }
        let enclosed = enclosed_pairs(problem, parts, |a, b| self.has(a, b))?;
        self.knows_enclosed = true;
        Ok(self.add(enclosed))
    }

    /// The same for pairs of which one part has its neck in an opening of the other.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn find_necked(&mut self, problem: &Problem<'_>, parts: &[usize]) -> Result<bool, Interrupt> {
        if self.knows_necked {
            return Ok(false);
        }
        let necked = necked_pairs(problem, parts, |a, b| self.has(a, b))?;
        self.knows_necked = true;
        Ok(self.add(necked))
    }

    fn has(&self, a: usize, b: usize) -> bool {
        self.pairs.iter().any(|p| p.parts == [a, b] || p.parts == [b, a])
    }

    fn add(&mut self, pairs: Vec<Inseparable>) -> bool {
        let any = !pairs.is_empty();
        self.pairs.extend(pairs);
        any
    }

    /// One of the parts that stand (ascending) from which a part never comes away.
    pub(super) fn holder(&self, part: usize, standing: &[usize]) -> Option<usize> {
        self.held_with(part).find(|p| standing.binary_search(p).is_ok())
    }

    /// The parts from which a part never comes away.
    pub(super) fn held_with(&self, part: usize) -> impl Iterator<Item = usize> + '_ {
        self.pairs.iter().filter_map(move |pair| match pair.parts {
            [a, b] if a == part => Some(b),
            [a, b] if b == part => Some(a),
            _ => None,
        })
    }

    /// The first pair among the parts that stand (ascending) of which one is wanted (ascending).
    pub(super) fn first(&self, standing: &[usize], wanted: &[usize]) -> Option<Inseparable> {
        let is_among = |part: usize, parts: &[usize]| parts.binary_search(&part).is_ok();
        let counts = |pair: &&Inseparable| {
            pair.parts.iter().all(|&p| is_among(p, standing))
                && pair.parts.iter().any(|&p| is_among(p, wanted))
        };
        self.pairs.iter().find(counts).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pair_counts_while_both_stand_and_one_is_wanted() {
        let pair = |parts| Inseparable { parts, proof: SeparationProof::Ball };
        let mut pairs = InseparablePairs::default();
        assert!(pairs.add(vec![pair([4, 1]), pair([2, 3])]));
        assert_eq!(pairs.holder(1, &[0, 1, 4]), Some(4));
        assert_eq!(pairs.holder(4, &[0, 1, 4]), Some(1));
        assert_eq!(pairs.holder(1, &[0, 1, 2, 3]), None);
        assert_eq!(pairs.first(&[0, 1, 2, 3], &[0, 3]), Some(pair([2, 3])));
        assert_eq!(pairs.first(&[1, 2, 3, 4], &[1]), Some(pair([4, 1])));
        assert_eq!(pairs.first(&[0, 1, 2, 3], &[0, 1]), None);
    }
}
