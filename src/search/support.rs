//! What carries what, in the assembled state.
//!
//! A part is carried by those that stop it at once on its way down (the edges of its directional blocking graph in that
//! direction), and in the end by what stays. A part carries another alone if all chains of edges from the other to what
//! stays lead through it: it dominates the other. It leaves after the other where both can, so that nothing is left in the
//! air.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use petgraph::Direction;
use petgraph::algo::dominators::simple_fast;
use petgraph::graphmap::DiGraphMap;
use petgraph::visit::Dfs;

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

    /// Of the parts that stand (ascending), those that alone carry another one, which is not among those that stay; and for
    /// each the number of parts, and of the ground, that carry it alone: the depth in the tree of dominators. Where no chain leads to what stays, as where a bearing has play, a part is carried
    /// alone by the only one under it.
    pub(super) fn carriers(
        &self,
        standing: &[usize],
        stays: impl Fn(usize) -> bool,
    ) -> BTreeMap<usize, usize> {
        if self.carried_by.is_empty() {
            return BTreeMap::new();
        }
        let (carries, ground) = self.carries(standing, &stays);
        let dominators = simple_fast(&carries, ground);
        let carrier = |&part: &usize| match dominators.immediate_dominator(part) {
            Some(dominator) => (dominator != ground).then_some(dominator),
            None => {
                let mut under = carries.neighbors_directed(part, Direction::Incoming);
                under.next().filter(|_| under.next().is_none())
            }
        };
        let carried = standing.iter().filter(|&&part| !stays(part) && carries.contains_node(part));
        let depth = |part| dominators.strict_dominators(part).map_or(usize::MAX, Iterator::count);
        carried.filter_map(carrier).map(|part| (part, depth(part))).collect()
    }

    /// Of the parts that stand (ascending), those that are carried, and are not any more when some have left.
    pub(super) fn left_in_air(
        &self,
        standing: &[usize],
        leaving: &[usize],
        stays: impl Fn(usize) -> bool,
    ) -> Vec<usize> {
        if self.carried_by.is_empty() {
            return Vec::new();
        }
        let (mut carries, ground) = self.carries(standing, &stays);
        let carried_before = carried(&carries, ground);
        let under = |carries: &DiGraphMap<usize, ()>, part| {
            carries.neighbors_directed(part, Direction::Incoming).next().is_some()
        };
        let others = standing.iter().copied().filter(|part| !leaving.contains(part) && !stays(*part));
        let others: Vec<(usize, bool)> = others.map(|part| (part, under(&carries, part))).collect();
        leaving.iter().for_each(|&part| _ = carries.remove_node(part));
        let carried_after = carried(&carries, ground);
        let is_left = |&(part, was_on_something): &(usize, bool)| match carried_before.contains(&part) {
            true => !carried_after.contains(&part),
            false => was_on_something && !under(&carries, part),
        };
        others.into_iter().filter(is_left).map(|(part, _)| part).collect()
    }

    /// What carries what among the parts that stand, and the node of the ground, which carries what stays. Edges lead up.
    fn carries(&self, standing: &[usize], stays: &impl Fn(usize) -> bool) -> (DiGraphMap<usize, ()>, usize) {
        let ground = self.carried_by.len();
        let mut carries = DiGraphMap::new();
        carries.add_node(ground);
        for &part in standing {
            if stays(part) {
                carries.add_edge(ground, part, ());
            } else {
                let by = self.carried_by[part].iter().filter(|by| standing.binary_search(by).is_ok());
                by.for_each(|&by| _ = carries.add_edge(by, part, ()));
            }
        }
        (carries, ground)
    }
}

/// What the ground carries.
fn carried(carries: &DiGraphMap<usize, ()>, ground: usize) -> HashSet<usize> {
    let mut search = Dfs::new(carries, ground);
    std::iter::from_fn(|| search.next(carries)).collect()
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
            supports.carriers(standing, |part| part == base).into_keys().collect::<Vec<_>>()
        };
        assert_eq!(carriers(&[0, 1, 2, 3], 0), [0, 1]);
        assert_eq!(carriers(&[0, 1, 3], 0), [0, 1]);
        assert_eq!(carriers(&[0, 1, 2, 3], 1), [1], "a base is carried by nothing");
        assert_eq!(carriers(&[0, 2, 3], 0), [2]);
        // 4 on 2 and 3: whichever leaves, the other carries it; but both stand on 1.
        let carried_by = vec![vec![], vec![0], vec![1], vec![1], vec![2, 3]];
        let supports = Supports { carried_by: carried_by.into_iter().map(BTreeSet::from_iter).collect() };
        let carriers = |standing: &[usize]| supports.carriers(standing, |part| part == 0);
        // By each only the ground is below 0.
        assert_eq!(carriers(&[0, 1, 2, 3, 4]).into_iter().collect::<Vec<_>>(), [(0, 1), (1, 2)]);
        assert_eq!(carriers(&[0, 1, 3, 4]).into_iter().collect::<Vec<_>>(), [(0, 1), (1, 2), (3, 3)]);
        let left = |leaving: &[usize]| supports.left_in_air(&[0, 1, 2, 3, 4], leaving, |part| part == 0);
        assert_eq!(left(&[1]), [2, 3, 4]);
        assert_eq!(left(&[1, 2, 3]), [4]);
        assert!(left(&[2]).is_empty() && left(&[1, 2, 3, 4]).is_empty());
        // Nothing connects 3 with what stays.
        let left = |leaving: &[usize]| supports.left_in_air(&[0, 2, 3, 4], leaving, |part| part == 0);
        assert_eq!((left(&[2]), left(&[2, 3])), (vec![], vec![4]));
        assert!(Supports::default().carriers(&[0, 1], |_| false).is_empty());
    }
}
