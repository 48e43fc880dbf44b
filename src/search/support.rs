//! What carries what, in the assembled state.
//!
//! A part is carried by those that stop it at once on its way down: the edges of its directional blocking graph in that
//! direction. One that alone carries another leaves after it where both can, so that nothing is left in the air. Of
//! several that carry a part together, any may leave.

use std::collections::BTreeSet;

use crate::blocking_graph::StateGraphs;

/// What carries each part.
#[derive(Debug, Default)]
pub(super) struct Supports {
    /// By part. Empty where nothing is known.
    carried_by: Vec<BTreeSet<usize>>,
}

impl Supports {
    /// Given the graphs of all parts, and which action leads down.
    pub(super) fn of(graphs: &[StateGraphs], down: usize) -> Self {
        let carried_by = graphs.iter().map(|graphs| graphs.blockage.single_blockers(down).clone());
        Self { carried_by: carried_by.collect() }
    }

    /// Of the parts that stand (ascending), those that alone carry another one, which is not among those that stay.
    pub(super) fn carriers(&self, standing: &[usize], stays: impl Fn(usize) -> bool) -> BTreeSet<usize> {
        let carried =
            standing.iter().filter(|&&part| !stays(part)).filter_map(|&part| self.carried_by.get(part));
        let only = carried.filter_map(|by| {
            let mut by = by.iter().copied().filter(|part| standing.binary_search(part).is_ok());
            by.next().filter(|_| by.next().is_none())
        });
        only.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_alone_under_another_part_carries_it() {
        // 1 on 0, 2 on 1, 3 on 1 and 2.
        let carried_by = vec![vec![], vec![0], vec![1], vec![1, 2]];
        let supports = Supports { carried_by: carried_by.into_iter().map(BTreeSet::from_iter).collect() };
        let carriers = |standing: &[usize], base: usize| {
            supports.carriers(standing, |part| part == base).into_iter().collect::<Vec<_>>()
        };
        assert_eq!(carriers(&[0, 1, 2, 3], 0), [0, 1]);
        assert_eq!(carriers(&[0, 1, 3], 0), [0, 1]);
        assert_eq!(carriers(&[0, 1, 2, 3], 1), [1], "a base is carried by nothing");
        assert_eq!(carriers(&[0, 2, 3], 0), [2]);
        assert!(Supports::default().carriers(&[0, 1], |_| false).is_empty());
    }
}
