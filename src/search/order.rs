//! The order in which a state-based search expands states and tries actions.

use std::cmp::Reverse;

use crate::blocking_graph::{Blockage, Evaluation};

use super::obstructions::Obstructions;
use super::search_view::SearchView;
use super::state::{Expansion, Phase, StateNode};

impl SearchView<'_, '_, '_> {
    /// The states to expand, the initial one included. Of the last two parts, it is the same which one moves against
    /// the other: beyond the first push, only the smaller one does. A linked part is not moved, as it cannot leave, and
    /// a ball is not turned.
    pub(super) fn expandable(&self, phase: Phase) -> Vec<usize> {
        let standing = self.disassembly.everything.standing();
        let problem = &self.disassembly.problem;
        let still = match standing[..] {
            [a, b] if !self.rules.separate_lists && problem.may_move(a) && problem.may_move(b) => {
                let reach = |p: usize| problem.scene.bodies[p].shape.reach;
                Some(if reach(a) < reach(b) { b } else { a })
            }
            _ => None,
        };
        let skipped = |n: &StateNode| Some(n.part) == still && (phase == Phase::Rotation || !n.is_root());
        let in_vain = |n: &StateNode| {
            (phase == Phase::Rotation && self.balls[n.part]) || self.linked_with(n.part).is_some()
        };
        let wanted = |n: &StateNode| n.alive && self.rules.lists(phase, n) && !skipped(n) && !in_vain(n);
        (0..self.states.len()).filter(|&i| wanted(&self.states[i])).collect()
    }

    /// Takes the best displaced state off the open list: with the smaller f_c, then the smaller f_a and, beyond the
    /// paper, the larger distance from the states known before. If there is none, takes the initial state, whose f_c
    /// and f_a count as infinite, for all its parts in their order. Without guidance the first one is taken: the
    /// initial state, then displaced states by age.
    ///
    /// Beyond the paper, turning takes all states at once: the next action matters more than the state.
    pub(super) fn extract(&self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        if self.rules.turns_by_action(phase) {
            return self.ranked(phase, std::mem::take(open));
        }
        let displaced = open.iter().copied().filter(|&i| !self.states[i].is_root());
        let next = if self.rules.guided {
            displaced.min_by_key(|&i| self.rank(phase, i))
        } else {
            open.first().copied().filter(|&i| !self.states[i].is_root())
        };
        match next {
            Some(best) => {
                open.retain(|&i| i != best);
                vec![best]
            }
            None => self.ordered_roots(phase, open),
        }
    }

    /// The rank of a displaced state among the others.
    fn rank(&self, phase: Phase, node: usize) -> (Evaluation, Reverse<u64>, usize) {
        // It is not negative, so its bits have its order.
        let novelty = if self.rules.separate_lists { 0.0 } else { self.states[node].novelty };
        (self.evaluation(phase, node), Reverse(novelty.to_bits()), node)
    }

    /// Open states in the order of expansion.
    pub(super) fn ranked(&self, phase: Phase, mut open: Vec<usize>) -> Vec<usize> {
        let roots = self.ordered_roots(phase, &mut open);
        if self.rules.guided {
            open.sort_by_cached_key(|&i| self.rank(phase, i));
        }
        open.extend(roots);
        open
    }

    fn ordered_roots(&self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        let (mut roots, rest) = open.iter().partition::<Vec<usize>, _>(|&&i| self.states[i].is_root());
        *open = rest;
        if !self.rules.guided {
            return roots;
        }
        // Before anything was turned, the parts that stop pushes show which part is held least; of equal ones the
        // smallest is the likeliest fastener and the cheapest to simulate.
        let other = |i: usize| self.states[i].blockage(Phase::Translation).map(Blockage::evaluation);
        let reach =
            |i: usize| self.disassembly.problem.scene.bodies[self.states[i].part].shape.reach.to_bits();
        roots.sort_by_key(|&i| match phase {
            Phase::Translation => (self.evaluation(phase, i), None, 0, i),
            Phase::Rotation => (self.evaluation(phase, i), other(i), reach(i), i),
        });
        roots
    }

    fn evaluation(&self, phase: Phase, node: usize) -> Evaluation {
        let none = Evaluation { colliding_parts: 0, open_actions: 0 };
        self.states[node].blockage(phase).map_or(none, Blockage::evaluation)
    }

    /// The order of turns over all states; smaller is earlier. First those that pull the part along its own axis, or
    /// that only this part has. Of these, those that fewer parts stop, as far as pushes show, and then those with less
    /// in their way: a nut is not turned towards the head of its bolt.
    pub(super) fn promise(&self, obstructions: &Obstructions, turn: &Expansion) -> (bool, usize, i32) {
        let node = &self.states[turn.node];
        let Some(push) = self.actions.pull_of(node.part, turn.action) else {
            return (!self.actions.is_own(Phase::Rotation, node.part, turn.action), 0, 0);
        };
        let against = node.translation.as_ref().map_or(0, |b| b.blockers(push).len());
        (false, against, obstructions.of(turn.node, push))
    }
}
