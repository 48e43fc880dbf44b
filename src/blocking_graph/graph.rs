//! The blocking graphs of the assembled state, one per direction, for display.

use super::Blockage;
use crate::simulation::Action;

/// Who keeps whom from following one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectionalGraph {
    /// The direction: a translation.
    pub direction: Action,
    /// Pairs of parts, ascending: the first cannot follow the direction because of the second. The removal
    /// of a part deletes its pairs and changes nothing else.
    pub edges: Vec<[usize; 2]>,
}

impl DirectionalGraph {
    /// The graphs of some directions, from the blockages of all parts for the same directions.
    #[must_use]
    pub fn of(blockages: &[Blockage], directions: &[Action]) -> Vec<Self> {
        let edges = |action: usize| {
            let of_part =
                |(part, b): (usize, &Blockage)| b.blockers(action).into_iter().map(move |by| [part, by]);
            blockages.iter().enumerate().flat_map(of_part).collect()
        };
        directions.iter().enumerate().map(|(i, &direction)| Self { direction, edges: edges(i) }).collect()
    }

    /// The graph once some parts (ascending) are gone.
    #[must_use]
    pub fn without(&self, removed: &[usize]) -> Self {
        let is_gone = |part: &usize| removed.binary_search(part).is_ok();
        let edges = self.edges.iter().filter(|e| !e.iter().any(is_gone)).copied().collect();
        Self { direction: self.direction, edges }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_removal_deletes_a_vertex_with_its_edges() {
        let mut blockages = vec![Blockage::open(6); 3];
        blockages[0].block_single(4, 1);
        blockages[0].block_single(4, 2);
        blockages[2].block_single(5, 0);
        let graphs = DirectionalGraph::of(&blockages, &Action::translations());
        assert_eq!(graphs[4].edges, [[0, 1], [0, 2]]);
        assert_eq!((graphs[5].edges.as_slice(), graphs[0].edges.len()), (&[[2, 0]][..], 0));
        assert_eq!(graphs[4].without(&[1]).edges, [[0, 2]]);
        assert_eq!(graphs[4].direction.to_string(), "+z");
    }
}
