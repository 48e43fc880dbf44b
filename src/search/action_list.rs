//! The actions of one phase: those of all parts, and behind them those of single parts.

use std::collections::{HashMap, HashSet};

use crate::blocking_graph::Blockage;
use crate::simulation::Action;

/// Actions that one part's contacts yield.
pub(super) struct DrawnActions {
    pub(super) actions: Vec<Action>,
    /// The parts whose contacts were used: when one of them is gone, the answer is another.
    pub(super) touched: Vec<usize>,
}

/// The actions of one phase. Invariant: an action keeps its number.
#[derive(Debug)]
pub(super) struct ActionList {
    /// First the common ones, then those of single parts.
    pub(super) all: Vec<Action>,
    /// Number of actions that all parts have.
    pub(super) common: usize,
    /// Largest number of actions of single parts, of all parts together.
    most_own: usize,
    /// cos of the angle within which two directions are the same.
    same_direction: f64,
    /// Per part: what it touched when its actions were drawn.
    pub(super) touched: HashMap<usize, Vec<usize>>,
    /// Pairs of a part and an action that is its own.
    own: HashSet<(usize, usize)>,
}

impl ActionList {
    pub(super) fn new(common: Vec<Action>, most_own: usize, same_direction: f64) -> Self {
        let (touched, own) = (HashMap::new(), HashSet::new());
        Self { common: common.len(), all: common, most_own, same_direction, touched, own }
    }

    /// Whether an action is one that a part has beside the common ones.
    pub(super) fn is_own(&self, part: usize, action: usize) -> bool {
        self.own.contains(&(part, action))
    }

    /// Whether a part's actions have been drawn and all that they came from stands.
    pub(super) fn is_current(&self, part: usize, standing: &[usize]) -> bool {
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        self.touched.get(&part).is_some_and(|touched| touched.iter().all(stands))
    }

    /// The number of an action that is now a part's own, unless it was or a common one is as good. A new
    /// action is appended.
    pub(super) fn add_own(&mut self, part: usize, wanted: Action) -> Option<usize> {
        let action = match self.all.iter().position(|a| a.is_like(&wanted, self.same_direction)) {
            Some(common) if common < self.common => return None,
            Some(known) => known,
            None if self.all.len() - self.common == self.most_own => return None,
            None => {
                self.all.push(wanted);
                self.all.len() - 1
            }
        };
        self.own.insert((part, action)).then_some(action)
    }

    /// Completes the blockage of a new state of a part, which is about common actions only.
    pub(super) fn with_own(&self, part: usize, mut blockage: Blockage) -> Blockage {
        for action in self.common..self.all.len() {
            blockage.add_withheld();
            if self.is_own(part, action) {
                blockage.reopen(action);
            }
        }
        blockage
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::simulation::Axis;

    fn push(direction: [f64; 3]) -> Action {
        let axis = Axis::along(nalgebra::Unit::new_normalize(Vector3::from(direction)));
        Action::Push(axis, true)
    }

    #[test]
    fn own_actions_come_behind_the_common_ones_and_belong_to_their_parts_alone() {
        let mut list = ActionList::new(Action::translations().to_vec(), 1, 0.999);
        assert_eq!(list.add_own(3, push([1.0, 0.0, 0.0])), None, "a common one is as good");
        assert_eq!(list.add_own(3, push([1.0, 1.0, 0.0])), Some(6));
        assert_eq!(list.add_own(3, push([1.0, 1.0, 0.0])), None, "it is its own already");
        assert_eq!(list.add_own(4, push([1.0, 1.0, 0.0])), Some(6), "parts may share one");
        assert_eq!(list.add_own(4, push([0.0, 1.0, 1.0])), None, "no room");
        assert_eq!(list.all.len(), 7);
        let open = |part: usize| list.with_own(part, Blockage::open(list.common)).is_open(6);
        assert_eq!([open(3), open(4), open(5)], [true, true, false]);
    }

    #[test]
    fn actions_are_drawn_again_once_a_part_that_they_came_from_is_gone() {
        let mut list = ActionList::new(Vec::new(), 1, 0.999);
        assert!(!list.is_current(0, &[0, 1, 2]));
        list.touched.insert(0, vec![1]);
        assert!(list.is_current(0, &[0, 1]) && !list.is_current(0, &[0, 2]));
    }
}
