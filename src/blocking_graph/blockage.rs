//! The outgoing edges of one part at one pose, for all actions of a set.

use std::collections::BTreeSet;

/// The paper's (f_c, f_a): smaller is expanded first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Evaluation {
    /// f_c: distinct parts that block some action.
    pub colliding_parts: usize,
    /// f_a: actions that nothing is known to block.
    pub open_actions: usize,
}

/// When an action that several parts stopped is open again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reopening {
    /// When any of them is gone: the motion may differ.
    AnyGone,
    /// When all of them are, as in the paper, where each has an edge.
    AllGone,
}

/// Who blocks which action. A collision is about a set of parts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Blockage {
    /// Per action: parts that each alone block it (static analysis).
    single: Vec<BTreeSet<usize>>,
    /// Per action: sets that blocked it in a simulation.
    jointly: Vec<Vec<Vec<usize>>>,
    /// All parts that block some action.
    parts: BTreeSet<usize>,
    /// How many actions, from the first, are open to all parts: these count in f_a.
    common: usize,
    /// Of these, those that nothing is known to block.
    open: usize,
}

impl Blockage {
    /// Nothing is known to block any of `actions` actions.
    #[must_use]
    pub fn open(actions: usize) -> Self {
        Self {
            single: vec![BTreeSet::new(); actions],
            jointly: vec![Vec::new(); actions],
            parts: BTreeSet::new(),
            common: actions,
            open: actions,
        }
    }

    /// One more action, which this part does not have unless it is reopened. Such actions do not count
    /// in f_a: parts are compared by those that all have.
    pub fn add_withheld(&mut self) {
        self.single.push(BTreeSet::new());
        self.jointly.push(vec![Vec::new()]);
    }

    /// `by` alone blocks an action.
    pub fn block_single(&mut self, action: usize, by: usize) {
        self.single[action].insert(by);
        self.parts.insert(by);
        self.count_open();
    }

    /// A simulation of an action ended at these parts (none: it can never succeed from here).
    pub fn block_jointly(&mut self, action: usize, by: Vec<usize>) {
        self.parts.extend(&by);
        self.jointly[action].push(by);
        self.count_open();
    }

    /// Evaluated after every change, because states are looked at much more often than changed.
    fn count_open(&mut self) {
        self.open = (0..self.common).filter(|&a| self.is_open(a)).count();
    }

    fn refresh(&mut self) {
        let joint = self.jointly.iter().flatten().flatten();
        self.parts = self.single.iter().flatten().chain(joint).copied().collect();
        self.count_open();
    }

    /// Forgets what simulations said about an action.
    pub fn reopen(&mut self, action: usize) {
        self.jointly[action].clear();
        self.refresh();
    }

    /// Whether nothing is known to block an action.
    #[must_use]
    pub fn is_open(&self, action: usize) -> bool {
        self.single[action].is_empty() && self.jointly[action].is_empty()
    }

    /// Whether only static analysis speaks against an action.
    #[must_use]
    pub fn is_untried(&self, action: usize) -> bool {
        self.jointly[action].is_empty()
    }

    /// Whether an action can never succeed, whichever parts leave.
    #[must_use]
    pub fn is_barred(&self, action: usize) -> bool {
        self.jointly[action].iter().any(Vec::is_empty)
    }

    /// Actions that are open, in order.
    pub fn open_actions(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.single.len()).filter(|&a| self.is_open(a))
    }

    /// A part is gone: deletes its vertex.
    pub fn remove(&mut self, part: usize, reopening: Reopening) {
        if !self.parts.contains(&part) {
            return;
        }
        for set in &mut self.single {
            set.remove(&part);
        }
        for sets in &mut self.jointly {
            sets.retain_mut(|set| {
                let Some(at) = set.iter().position(|&p| p == part) else { return true };
                set.remove(at);
                reopening == Reopening::AllGone && !set.is_empty()
            });
        }
        self.refresh();
    }

    /// The evaluation functions f_c and f_a.
    #[must_use]
    pub fn evaluation(&self) -> Evaluation {
        Evaluation { colliding_parts: self.parts.len(), open_actions: self.open }
    }

    /// The parts that each alone block an action, by static analysis.
    pub fn single_blockers(&self, action: usize) -> &BTreeSet<usize> {
        &self.single[action]
    }

    /// The parts known to block an action.
    #[must_use]
    pub fn blockers(&self, action: usize) -> BTreeSet<usize> {
        self.single[action].iter().chain(self.jointly[action].iter().flatten()).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removing_any_witness_of_a_collision_reopens_its_action() {
        let mut b = Blockage::open(2);
        b.block_jointly(0, vec![3, 5]);
        b.block_single(1, 5);
        assert_eq!(b.evaluation(), Evaluation { colliding_parts: 2, open_actions: 0 });
        let mut paper = b.clone();
        b.remove(3, Reopening::AnyGone);
        assert!(b.is_open(0) && !b.is_open(1));
        paper.remove(3, Reopening::AllGone);
        assert!(!paper.is_open(0), "part 5 still stands");
        paper.remove(5, Reopening::AllGone);
        assert!(paper.is_open(0) && paper.is_open(1));
        b.remove(5, Reopening::AnyGone);
        assert_eq!(b.evaluation(), Evaluation { colliding_parts: 0, open_actions: 2 });
    }

    #[test]
    fn a_collision_with_nothing_stays() {
        let mut b = Blockage::open(1);
        b.block_jointly(0, Vec::new());
        b.remove(0, Reopening::AnyGone);
        assert!(!b.is_open(0) && !b.is_untried(0));
    }
}
