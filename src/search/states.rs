//! The states that a search has reached, over all parts.
//!
//! Invariants: nodes are only added, so a node's number never changes and a parent is older than its
//! children; the first `roots` nodes are the parts at their assembled poses.

use std::cmp::Reverse;

use crate::blocking_graph::{Blockage, Evaluation, Reopening};
use crate::scene::Scene;

use super::known_states::KnownStates;
use super::state::{StateAction, StateNode};
use super::strategy::Strategy;
use super::trace::PlanningPhase;

pub(super) struct States {
    pub(super) nodes: Vec<StateNode>,
    /// Number of nodes at assembled poses: the first ones.
    roots: usize,
    /// Per part, for asking whether a pose is known.
    pub(super) known: Vec<KnownStates>,
    reopening: Reopening,
}

/// The states of a search in one phase, under its strategy.
#[derive(Clone, Copy)]
pub(super) struct PhaseStates<'s> {
    pub(super) strategy: Strategy,
    pub(super) phase: PlanningPhase,
    pub(super) states: &'s States,
    pub(super) scene: &'s Scene,
}

impl PhaseStates<'_> {
    /// Whether a state is in the open list of the phase.
    pub(super) fn lists(&self, node: &StateNode) -> bool {
        self.strategy.lists(self.phase, node)
    }

    /// The rank of a displaced state among the others; smaller comes first.
    pub(super) fn rank(&self, node: usize) -> (Evaluation, Reverse<u64>, usize) {
        // Novelty is not negative, so its bits have its order.
        let novelty = if self.strategy.separate_lists { 0.0 } else { self.states.nodes[node].novelty };
        (self.evaluation(node), Reverse(novelty.to_bits()), node)
    }

    /// The distance of the farthest point of a part from its centre of mass.
    pub(super) fn reach(&self, part: usize) -> f64 {
        self.scene.bodies[part].shape.reach
    }

    /// The paper's decision (d), after rotational planning took a part out: whether translational planning goes on with
    /// the graphs that are there. It does if they leave an action open, and else begins with static analysis. States
    /// that have no graphs yet do not count: as nothing is known to block them, the decision would hardly ever be no.
    pub(super) fn decision_d(&self) -> bool {
        let Strategy { guided, separate_lists, .. } = self.strategy;
        let is_open = |b: &Blockage| b.evaluation().open_actions > 0;
        let has_action =
            |n: &StateNode| n.alive && self.lists(n) && n.blockage(self.phase).is_some_and(is_open);
        guided && separate_lists && self.states.nodes.iter().any(has_action)
    }

    pub(super) fn evaluation(&self, node: usize) -> Evaluation {
        let none = Evaluation { colliding_parts: 0, open_actions: 0 };
        self.states.nodes[node].blockage(self.phase).map_or(none, Blockage::evaluation)
    }
}

impl States {
    pub(super) fn new(scene: &Scene, strategy: Strategy) -> Self {
        let of_part = |part| KnownStates::new(scene, part, strategy.resolution());
        let known = (0..scene.bodies.len()).map(of_part).collect();
        Self { nodes: Vec::new(), roots: 0, known, reopening: strategy.reopening() }
    }

    pub(super) fn add(&mut self, node: StateNode) {
        self.known[node.part].add(self.nodes.len(), *node.pose());
        self.roots += usize::from(node.is_root());
        self.nodes.push(node);
    }

    /// The number of a node in the trace: 0 for all assembled poses, displaced ones count from 1.
    pub(super) fn number(&self, node: usize) -> usize {
        (node + 1).saturating_sub(self.roots)
    }

    /// Whether an action from a state may be tried.
    pub(super) fn is_open(&self, strategy: Strategy, at: StateAction) -> bool {
        let node = &self.nodes[at.node];
        node.alive && node.blockage(at.phase).is_some_and(|b| strategy.allows(b, at.action))
    }

    /// Notes that an action ended at some parts (none: it can never succeed from there).
    pub(super) fn block(&mut self, at: StateAction, by: Vec<usize>) {
        if let Some(b) = self.nodes[at.node].blockage_mut(at.phase) {
            b.block_jointly(at.action, by);
        }
    }

    /// Ends the states of a part that leaves and deletes it from all blockages.
    pub(super) fn remove(&mut self, part: usize) {
        for node in &mut self.nodes {
            if node.part == part {
                node.alive = false;
                // Its path is of no use any more.
                node.path.truncate(1);
                continue;
            }
            if let Some(b) = &mut node.translation {
                b.remove(part, self.reopening);
            }
            node.rotation.remove(part, self.reopening);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocking_graph::Blockage;
    use crate::fixtures::{block_on_plate, scene};
    use crate::geometry::Pose;
    use crate::search::request::ActionSet;
    use crate::search::trace::PlanningPhase;

    #[test]
    fn a_part_that_leaves_ends_its_states_and_is_in_nobodys_way() {
        let (scene, _) = scene(block_on_plate());
        let strategy = Strategy::new(true, ActionSet::Extended);
        let mut states = States::new(&scene, strategy);
        let node = |part: usize, x: f64, origin| StateNode {
            part,
            path: vec![Pose::identity(), Pose::translation(x, 0.0, 0.0)],
            translation: Some(Blockage::open(2)),
            rotation: Blockage::open(2),
            origin,
            novelty: 0.0,
            alive: true,
        };
        let at = StateAction { node: 0, phase: PlanningPhase::Translation, action: 1 };
        states.add(node(0, 0.0, None));
        states.add(node(1, 0.0, None));
        states.add(node(0, 1.0, Some(at)));
        assert_eq!([0, 1, 2].map(|n| states.number(n)), [0, 0, 1]);

        states.block(at, vec![1]);
        assert!(!states.is_open(strategy, at));
        states.remove(1);
        assert!(states.is_open(strategy, at) && !states.nodes[1].alive);
        states.remove(0);
        assert!(states.nodes.iter().all(|n| !n.alive && n.path.len() == 1));
    }
}
