//! In which order a state-based search expands states and tries actions.

use std::cmp::Reverse;
use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::blocking_graph::{Blockage, Evaluation};
use crate::contact::obstruction;
use crate::simulation::Action;
use crate::termination::{Interrupt, Poll};

use super::disassembly::Stop;
use super::sbdp::{Job, Search};
use super::state::{Node, Phase};

/// Rays between two looks at the termination condition.
const RAY_POLL: u32 = 64;

impl Search<'_, '_> {
    /// The states to expand, the initial one included. Of two last parts it is the same which one
    /// moves against the other: beyond the first push, only the smaller one does. A linked part is
    /// not moved, for it cannot leave, and a ball not turned.
    pub(super) fn expandable(&self, phase: Phase) -> Vec<usize> {
        let standing = self.disassembly.everything.standing();
        let problem = &self.disassembly.problem;
        let still = match standing[..] {
            [a, b] if !self.separate_lists && problem.may_move(a) && problem.may_move(b) => {
                let reach = |p: usize| problem.scene.bodies[p].shape.reach;
                Some(if reach(a) < reach(b) { b } else { a })
            }
            _ => None,
        };
        let skipped = |n: &Node| Some(n.part) == still && (phase == Phase::Rotation || !n.is_root());
        let in_vain =
            |n: &Node| (phase == Phase::Rotation && self.balls[n.part]) || self.linked_with(n.part).is_some();
        let wanted = |n: &Node| n.alive && self.lists(phase, n) && !skipped(n) && !in_vain(n);
        (0..self.nodes.len()).filter(|&i| wanted(&self.nodes[i])).collect()
    }

    /// Whether a state is in the list of a kind of planning.
    pub(super) fn lists(&self, phase: Phase, node: &Node) -> bool {
        !self.separate_lists || node.origin.is_none_or(|(_, by, _)| by == phase)
    }

    /// Takes the best displaced state off the open list (smaller f_c, then smaller f_a; beyond the
    /// paper, then what is farther from the states known before), or else the initial state, which comes
    /// last (its f_c and f_a count as infinite) and stands for all its parts in their order.
    /// Without guidance the first comes first: the initial state, then displaced ones by age.
    ///
    /// Beyond the paper, turning takes all states at once: which action is tried next matters more
    /// than in which state.
    pub(super) fn extract(&mut self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        if self.turns_by_action(phase) {
            return self.ranked(phase, std::mem::take(open));
        }
        let displaced = open.iter().copied().filter(|&i| !self.nodes[i].is_root());
        let next = if self.guided {
            displaced.min_by_key(|&i| self.rank(phase, i))
        } else {
            open.first().copied().filter(|&i| !self.nodes[i].is_root())
        };
        let batch = match next {
            Some(best) => {
                open.retain(|&i| i != best);
                vec![best]
            }
            None => self.ordered_roots(phase, open),
        };
        for &i in &batch {
            self.trace_expansion(phase, i);
        }
        batch
    }

    /// Whether actions are tried in an order of their own, over all states.
    pub(super) fn turns_by_action(&self, phase: Phase) -> bool {
        phase == Phase::Rotation && self.guided && !self.separate_lists
    }

    /// Where a displaced state stands among the others.
    fn rank(&self, phase: Phase, node: usize) -> (Evaluation, Reverse<u64>, usize) {
        // Not negative, so its bits are in its order.
        let novelty = if self.separate_lists { 0.0 } else { self.nodes[node].novelty };
        (self.evaluation(phase, node), Reverse(novelty.to_bits()), node)
    }

    /// Open states in the order of expansion.
    pub(super) fn ranked(&self, phase: Phase, mut open: Vec<usize>) -> Vec<usize> {
        let roots = self.ordered_roots(phase, &mut open);
        if self.guided {
            open.sort_by_cached_key(|&i| self.rank(phase, i));
        }
        open.extend(roots);
        open
    }

    fn ordered_roots(&self, phase: Phase, open: &mut Vec<usize>) -> Vec<usize> {
        let (mut roots, rest) = open.iter().partition::<Vec<usize>, _>(|&&i| self.nodes[i].is_root());
        *open = rest;
        if !self.guided {
            return roots;
        }
        // Before anything was turned, what stops pushes tells which part is least held; among
        // equals the smallest is the likeliest fastener and the cheapest to simulate.
        let other = |i: usize| self.nodes[i].blockage(Phase::Translation).map(Blockage::evaluation);
        let reach =
            |i: usize| self.disassembly.problem.scene.bodies[self.nodes[i].part].shape.reach.to_bits();
        roots.sort_by_key(|&i| match phase {
            Phase::Translation => (self.evaluation(phase, i), None, 0, i),
            Phase::Rotation => (self.evaluation(phase, i), other(i), reach(i), i),
        });
        roots
    }

    pub(super) fn evaluation(&self, phase: Phase, node: usize) -> Evaluation {
        let none = Evaluation { colliding_parts: 0, open_actions: 0 };
        self.nodes[node].blockage(phase).map_or(none, Blockage::evaluation)
    }

    /// What stands in the way of the parts of some jobs along their own axes, as far as it is not known.
    pub(super) fn look_ahead(&mut self, jobs: &[Job]) -> Result<(), Stop> {
        let version = self.disassembly.version();
        let asked: BTreeSet<(usize, usize)> = jobs
            .iter()
            .filter_map(|&job| Some((job.node, self.pull(job)?)))
            .filter(|key| self.in_the_way.get(key).is_none_or(|(at, _)| *at != version))
            .collect();
        let standing = |&(node, _): &(usize, usize)| self.disassembly.standing(self.nodes[node].part);
        let asked: Vec<_> = asked.into_iter().map(|key| (key, standing(&key))).collect();
        let (nodes, translations, problem) = (&self.nodes, &self.translations, &self.disassembly.problem);
        let found = asked.par_iter().map(|((node, push), standing)| {
            let (node, force) = (&nodes[*node], translations[*push].force());
            let poll = Poll::every(RAY_POLL, Some(&problem.termination));
            obstruction(&problem.scene, standing, node.part, node.pose(), &force, &poll)
        });
        let found: Vec<f64> = found.collect::<Result<_, Interrupt>>()?;
        for ((key, _), way) in asked.into_iter().zip(found) {
            let doublings = if way > 0.0 { way.log2().floor() as i32 } else { i32::MIN };
            self.in_the_way.insert(key, (version, doublings));
        }
        Ok(())
    }

    /// The push that pulls as an action does that also turns a part about its own axis.
    fn pull(&self, job: Job) -> Option<usize> {
        let action = self.rotations[job.action];
        let Action::Screw(axis, ..) = action else { return None };
        let pulls = |t: &Action| t.force() == action.force();
        self.directions.is_own(self.nodes[job.node].part, axis).then_some(())?;
        self.translations.iter().position(pulls)
    }

    /// Of actions that may turn a part, those first that pull it along its own axis, or that it alone has, over
    /// all parts;
    /// of these, those that fewer parts stand against, as far as pushes tell, and then those in whose way
    /// less stands: a nut is not turned towards the head of its bolt. Smaller is better.
    pub(super) fn promise(&self, job: Job) -> (bool, usize, i32) {
        let Some(push) = self.pull(job) else {
            let is_own = self.twists.own.has(self.nodes[job.node].part, job.action);
            return (!is_own, 0, 0);
        };
        let against = self.nodes[job.node].translation.as_ref().map_or(0, |b| b.blockers(push).len());
        (false, against, self.in_the_way.get(&(job.node, push)).map_or(0, |(_, way)| *way))
    }
}
