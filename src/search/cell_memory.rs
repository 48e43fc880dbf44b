//! Searches by cells that need not be repeated.
//!
//! A search that found no way out finds none again while the parts that stopped its casts stand and it begins at the
//! same states.

use std::collections::{BTreeSet, HashMap};

use crate::budgets::{EDGES_CAST_AT_LAST, EDGES_CAST_BEFORE_TURNING};

use super::critical_places::CriticalCoordinates;

/// When the cells of a part are searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum CellStage {
    /// Before anything is turned, from the states with the rotation of the assembled pose.
    BeforeTurning,
    /// After that, from where turns of these states in place lead.
    AfterCriticalTurn,
    /// When nothing else is left, from all states.
    Last,
}

impl CellStage {
    /// The number of edges that may be cast.
    pub(super) fn most_edges(self) -> usize {
        match self {
            Self::BeforeTurning | Self::AfterCriticalTurn => EDGES_CAST_BEFORE_TURNING,
            Self::Last => EDGES_CAST_AT_LAST,
        }
    }
}

/// A search that found no way out.
#[derive(Debug)]
struct VainSearch {
    /// The nodes of the states that it began at.
    starts: Vec<usize>,
    /// The parts that stopped its casts.
    met: BTreeSet<usize>,
}

#[derive(Debug, Default)]
pub(super) struct CellMemory {
    pub(super) coordinates: CriticalCoordinates,
    /// By part and stage: the last search.
    vain: HashMap<(usize, CellStage), VainSearch>,
}

impl CellMemory {
    pub(super) fn keep(&mut self, part: usize, stage: CellStage, starts: Vec<usize>, met: BTreeSet<usize>) {
        self.vain.insert((part, stage), VainSearch { starts, met });
    }

    /// Whether a search of a part from some states is known to find no way out while some parts (ascending) stand.
    pub(super) fn holds(&self, part: usize, stage: CellStage, starts: &[usize], standing: &[usize]) -> bool {
        self.vain.get(&(part, stage)).is_some_and(|known| {
            let stands = |met: &usize| standing.binary_search(met).is_ok();
            known.met.iter().all(stands) && starts.iter().all(|start| known.starts.contains(start))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vain_search_is_repeated_where_it_would_begin_elsewhere_or_something_it_met_is_gone() {
        let mut memory = CellMemory::default();
        let stage = CellStage::BeforeTurning;
        assert!(!memory.holds(3, stage, &[0], &[1, 2, 3]));
        memory.keep(3, stage, vec![0, 4], BTreeSet::from([1]));
        assert!(memory.holds(3, stage, &[4], &[1, 3]) && memory.holds(3, stage, &[0, 4], &[1, 2, 3]));
        assert!(!memory.holds(3, stage, &[0, 5], &[1, 2, 3]), "another start");
        assert!(!memory.holds(3, stage, &[0], &[2, 3]), "part 1 is gone");
        assert!(!memory.holds(2, stage, &[0], &[1, 2, 3]), "another part");
        assert!(!memory.holds(3, CellStage::Last, &[0], &[1, 2, 3]), "a larger budget");
    }
}
