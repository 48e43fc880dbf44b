//! A blocking graph made small: equal parts that are blocked alike as one vertex, without arrows that follow from others.
//!
//! Groups are the coarsest stable partition (colour refinement) that begins with the classes of equal parts: of two parts of
//! a group, each is blocked by parts of the same groups, and blocks parts of the same groups. What is left is the transitive
//! reduction between strongly connected components (Aho, Garey and Ullman 1972); within a component all arrows stay.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::algo::tarjan_scc;
use petgraph::graph::DiGraph;

/// A graph whose vertices are groups of parts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Quotient {
    /// Parts, ascending; groups by their first part.
    pub(super) groups: Vec<Vec<usize>>,
    /// Pairs of groups: each part of the first is blocked by one of the second. Without those that follow from others.
    pub(super) edges: Vec<[usize; 2]>,
    /// Whether parts of a group block one another.
    pub(super) holds_itself: Vec<bool>,
    /// Whether the parts of a group are blocked.
    pub(super) is_blocked: Vec<bool>,
    /// How many edges between groups follow from others.
    pub(super) left_out: usize,
}

/// The quotient of a graph of parts with their classes. An edge has first the part that is blocked.
pub(super) fn quotient(classes: &[usize], edges: &[[usize; 2]]) -> Quotient {
    let colours = stable(classes, edges);
    let count = colours.iter().max().map_or(0, |most| most + 1);
    let mut groups = vec![Vec::new(); count];
    colours.iter().enumerate().for_each(|(part, &colour)| groups[colour].push(part));
    let all: BTreeSet<[usize; 2]> = edges.iter().map(|edge| edge.map(|part| colours[part])).collect();
    let between: Vec<[usize; 2]> = all.iter().copied().filter(|[a, b]| a != b).collect();
    let reduced = reduced(count, &between);
    Quotient {
        holds_itself: (0..count).map(|group| all.contains(&[group, group])).collect(),
        is_blocked: (0..count).map(|group| all.iter().any(|[part, _]| *part == group)).collect(),
        left_out: between.len() - reduced.len(),
        groups,
        edges: reduced,
    }
}

/// Numbers of groups, in the order of their first parts.
fn stable(classes: &[usize], edges: &[[usize; 2]]) -> Vec<usize> {
    let mut colours = numbered(classes);
    loop {
        let mut around = vec![(BTreeSet::new(), BTreeSet::new()); classes.len()];
        for &[part, by] in edges {
            around[part].0.insert(colours[by]);
            around[by].1.insert(colours[part]);
        }
        let refined: Vec<_> = colours.iter().zip(around).collect();
        let next = numbered(&refined);
        // Groups are only ever divided.
        if next.iter().max() == colours.iter().max() {
            return next;
        }
        colours = next;
    }
}

fn numbered<T: Ord>(keys: &[T]) -> Vec<usize> {
    let mut known: BTreeMap<&T, usize> = BTreeMap::new();
    let number = |key| {
        let next = known.len();
        *known.entry(key).or_insert(next)
    };
    keys.iter().map(number).collect()
}

/// The edges without those between two components from one to the other of which there is a way through a third.
fn reduced(count: usize, edges: &[[usize; 2]]) -> Vec<[usize; 2]> {
    let pairs = edges.iter().map(|[a, b]| (*a as u32, *b as u32));
    let mut graph = DiGraph::<(), ()>::from_edges(pairs);
    while graph.node_count() < count {
        graph.add_node(());
    }
    let mut component = vec![0; count];
    // What is reachable from a component comes before it.
    let components = tarjan_scc(&graph);
    for (number, members) in components.iter().enumerate() {
        members.iter().for_each(|node| component[node.index()] = number);
    }
    let mut next: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); components.len()];
    for [a, b] in edges.iter().map(|edge| edge.map(|group| component[group])).filter(|[a, b]| a != b) {
        next[a].insert(b);
    }
    let mut reachable: Vec<BTreeSet<usize>> = Vec::new();
    for own in &next {
        let beyond = own.iter().flat_map(|&other| reachable[other].iter().copied());
        reachable.push(own.iter().copied().chain(beyond).collect());
    }
    let follows =
        |a: usize, b: usize| next[a].iter().any(|&other| other != b && reachable[other].contains(&b));
    let is_kept =
        |[a, b]: &&[usize; 2]| component[*a] == component[*b] || !follows(component[*a], component[*b]);
    edges.iter().filter(is_kept).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_parts_are_one_vertex_if_they_are_blocked_alike() {
        // A plate under two bolts with washers; a third equal bolt blocks nothing.
        let edges = [[0, 1], [0, 2], [0, 3], [0, 4], [3, 1], [4, 2]];
        let q = quotient(&[0, 1, 1, 2, 2, 1], &edges);
        assert_eq!(q.groups, [vec![0], vec![1, 2], vec![3, 4], vec![5]]);
        assert_eq!((q.edges, q.left_out), (vec![[0, 2], [2, 1]], 1));
        assert_eq!(q.is_blocked, [true, false, true, false]);
    }

    #[test]
    fn parts_that_block_one_another_keep_their_arrows() {
        let q = quotient(&[0, 1, 2, 3], &[[0, 1], [1, 0], [1, 2], [0, 2], [2, 3], [0, 3]]);
        assert_eq!((q.edges, q.left_out), (vec![[0, 1], [0, 2], [1, 0], [1, 2], [2, 3]], 1));
        let pair = quotient(&[7, 7], &[[0, 1], [1, 0]]);
        assert_eq!((pair.groups, pair.edges, pair.holds_itself), (vec![vec![0, 1]], vec![], vec![true]));
    }

    #[test]
    fn a_chain_of_equal_parts_is_told_apart_by_its_ends() {
        let q = quotient(&[0; 3], &[[0, 1], [1, 2]]);
        assert_eq!(q.groups.len(), 3);
    }
}
