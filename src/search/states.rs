//! The states of a search: which are there, which are new, and which are dropped.
//!
//! Paths are verified once one of them leads out, so the part of a path that does not hold may lie many motions back.
//! Then the first such state is dropped with all that began there. The action that led to it is made again, with the
//! refuting points as samples, a few times; otherwise an action that is always refuted would go on for ever.

use std::collections::HashMap;
use std::ops::{Index, IndexMut};

use crate::budgets::REFINEMENTS;
use crate::geometry::Pose;
use crate::scene::Scene;
use crate::termination::Interrupt;

use super::disassembly::{Disassembly, Stop};
use super::known_states::KnownStates;
use super::novelty::hiding_coarseness;
use super::rules::Rules;
use super::state::{Expansion, Phase, StateNode, coarseness};

/// All states of a search, by the index of their node. The assembled states of all parts come first.
pub(super) struct States {
    rules: Rules,
    nodes: Vec<StateNode>,
    /// The number of assembled states.
    roots: usize,
    /// The poses of each part's states.
    known: Vec<KnownStates>,
    /// The coarsest resolution at which two states were taken for one, as a multiple of the paper's.
    coarsest: f64,
    /// The number of times that the state to which an expansion led was refuted.
    refuted: HashMap<Expansion, usize>,
}

impl States {
    pub(super) fn new(scene: &Scene, rules: Rules) -> Self {
        let known = (0..scene.bodies.len()).map(|part| KnownStates::new(scene, part)).collect();
        Self { rules, nodes: Vec::new(), roots: 0, known, coarsest: 1.0, refuted: HashMap::new() }
    }

    /// Adds a state and returns the index of its node. Assembled states are added first.
    pub(super) fn add(&mut self, node: StateNode) -> usize {
        let index = self.nodes.len();
        self.known[node.part].add(index, *node.pose());
        self.roots += usize::from(node.is_root());
        self.nodes.push(node);
        index
    }

    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &StateNode> {
        self.nodes.iter()
    }

    pub(super) fn iter_mut(&mut self) -> impl Iterator<Item = &mut StateNode> {
        self.nodes.iter_mut()
    }

    /// The number of a state in the trace: 0 for the assembled one.
    pub(super) fn number(&self, node: usize) -> usize {
        if self.nodes[node].is_root() { 0 } else { node + 1 - self.roots }
    }

    /// The number in the trace of the state that is added next.
    pub(super) fn next_number(&self) -> usize {
        self.nodes.len() + 1 - self.roots
    }

    /// The number of states of a part, dropped ones included.
    pub(super) fn of_part(&self, part: usize) -> usize {
        self.known[part].len()
    }

    /// The distance of a pose from the nearest state of a part, in units of the resolution.
    pub(super) fn novelty(&self, part: usize, pose: &Pose) -> f64 {
        self.known[part].novelty(pose)
    }

    /// Whether no state of a part is like a pose.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn is_new(
        &mut self,
        disassembly: &Disassembly<'_, '_>,
        phase: Phase,
        part: usize,
        pose: &Pose,
    ) -> Result<bool, Interrupt> {
        let counts = |node: usize| self.nodes[node].alive && self.rules.lists(phase, &self.nodes[node]);
        let known = &self.known[part];
        // At the coarsest resolution that this number of states can have.
        if !known.has_like(pose, counts) {
            return Ok(true);
        }
        if !self.rules.is_extended() {
            return Ok(false);
        }
        let states: Vec<Pose> = known.poses(counts).collect();
        let hiding = hiding_coarseness(disassembly, known, &states, part, pose)?;
        if let Some(coarse) = hiding {
            self.coarsest = self.coarsest.max(coarse);
        }
        Ok(hiding.is_none())
    }

    /// The coarsest resolution at which states were told apart, as a multiple of the paper's; `most` is the largest
    /// number of states of a part.
    pub(super) fn coarsest(&self, most: usize) -> f64 {
        if self.rules.is_extended() { self.coarsest } else { coarseness(most) }
    }

    /// Drops a state whose path was refuted, with the first state on its path that `holds` refutes, too, and all that
    /// began there. Reopens the action that led there, unless that was done too often.
    pub(super) fn drop_refuted(
        &mut self,
        node: usize,
        mut holds: impl FnMut(usize, &[Pose]) -> Result<bool, Stop>,
    ) -> Result<(), Stop> {
        let mut first = node;
        while let Some(origin) = self.nodes[first].origin {
            let parent = &self.nodes[origin.node];
            if parent.is_root() || holds(parent.part, &parent.path)? {
                break;
            }
            first = origin.node;
        }
        let mut dropped = vec![false; self.nodes.len()];
        dropped[first] = true;
        for at in first..self.nodes.len() {
            // A state is older than those that began there.
            dropped[at] |= self.nodes[at].origin.is_some_and(|origin| dropped[origin.node]);
            self.nodes[at].alive &= !dropped[at];
        }
        let Some(origin) = self.nodes[first].origin else { return Ok(()) };
        let times = self.refuted.entry(origin).or_default();
        *times += 1;
        if *times <= REFINEMENTS
            && let Some(b) = self.nodes[origin.node].blockage_mut(origin.phase)
        {
            b.reopen(origin.action);
        }
        Ok(())
    }

    /// Drops the states of a part that is out, and its arcs from all blocking graphs. Returns the parts that had
    /// blocked it as assembled and left before, ascending.
    pub(super) fn remove_part(&mut self, part: usize) -> Vec<usize> {
        let mut waited_for = Vec::new();
        for node in &mut self.nodes {
            if node.part == part {
                if node.is_root() {
                    let blockages = [node.translation.as_ref(), Some(&node.rotation)];
                    waited_for
                        .extend(blockages.into_iter().flatten().flat_map(|b| b.outlived().iter().copied()));
                }
                node.alive = false;
                // Its path and blockages are of no use any more.
                node.path.truncate(1);
                continue;
            }
            if let Some(b) = &mut node.translation {
                b.remove(part);
            }
            node.rotation.remove(part);
        }
        waited_for.sort_unstable();
        waited_for.dedup();
        waited_for
    }
}

impl Index<usize> for States {
    type Output = StateNode;

    fn index(&self, node: usize) -> &StateNode {
        &self.nodes[node]
    }
}

impl IndexMut<usize> for States {
    fn index_mut(&mut self, node: usize) -> &mut StateNode {
        &mut self.nodes[node]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::blocking_graph::Blockage;
    use crate::fixtures::{block_on_plate, scene};
    use crate::search::request::ActionSet;

    const ACTIONS: usize = 3;
    const TURN: Phase = Phase::Rotation;

    /// States of a block (part 1) on a plate, with its assembled state.
    fn states() -> (States, Pose) {
        let (scene, _) = scene(block_on_plate());
        let mut states = States::new(&scene, Rules::new(ActionSet::Extended, true));
        let start = scene.bodies[1].planning_from_shape;
        states.add(node(vec![start], None));
        (states, start)
    }

    fn node(path: Vec<Pose>, origin: Option<Expansion>) -> StateNode {
        let open = || Blockage::open(ACTIONS);
        StateNode {
            part: 1,
            path,
            translation: Some(open()),
            rotation: open(),
            origin,
            novelty: 1.0,
            alive: true,
        }
    }

    fn child(states: &mut States, parent: usize, end: Pose) -> usize {
        let path = [&states[parent].path[..], &[end]].concat();
        states.add(node(path, Some(Expansion { node: parent, phase: TURN, action: 0 })))
    }

    #[test]
    fn states_on_a_refuted_path_are_dropped_and_their_action_is_reopened_a_few_times() {
        let (mut states, start) = states();
        let at = |x: f64, z: f64| Pose::translation(x, 0.0, z) * start;
        // A path holds unless it goes through the plate.
        let holds =
            |_: usize, path: &[Pose]| Ok(path.iter().all(|pose| pose.translation.z >= start.translation.z));
        for time in 1..=REFINEMENTS + 1 {
            states[0].rotation.block_jointly(0, vec![0]);
            let beside = child(&mut states, 0, at(1.0, 0.5));
            // Through the plate and up again: the refuted state is two motions before the one that is dropped.
            let under = child(&mut states, beside, at(1.0, -0.5));
            let up = child(&mut states, under, at(1.0, 1.0));
            let last = child(&mut states, up, at(2.0, 1.0));
            let sibling = child(&mut states, under, at(0.0, 1.0));
            states[beside].rotation.block_jointly(0, vec![0]);
            assert!(states.drop_refuted(up, holds).is_ok());
            let alive = [beside, under, up, last, sibling].map(|node| states[node].alive);
            assert_eq!(alive, [true, false, false, false, false]);
            assert!(states[beside].rotation.is_open(0) && !states[0].rotation.is_open(0));
            // The same action from the same state, as it is made again.
            let origin = states[under].origin.unwrap();
            assert_eq!(states.refuted.remove(&origin), Some(1));
            states.refuted.insert(Expansion { node: 0, phase: TURN, action: 0 }, time - 1);
            assert!(states.drop_refuted(beside, holds).is_ok());
            assert_eq!(states[0].rotation.is_open(0), time <= REFINEMENTS, "{time}");
        }
    }

    #[test]
    fn a_part_that_leaves_frees_the_others_and_names_those_that_it_waited_for() {
        let (mut states, start) = states();
        let (scene, _) = scene(block_on_plate());
        let plate = StateNode { part: 0, ..node(vec![scene.bodies[0].planning_from_shape], None) };
        let plate = states.add(plate);
        let moved = child(&mut states, 0, Pose::translation(0.0, 0.0, 1.0) * start);
        assert_eq!([0, plate, moved].map(|node| states.number(node)), [0, 0, 1]);
        states[0].rotation.block_jointly(1, vec![0]);
        states[moved].rotation.block_jointly(2, vec![0]);
        assert_eq!(states.remove_part(0), Vec::<usize>::new());
        assert!(!states[plate].alive && states[0].alive && states[moved].alive);
        assert!(states[0].rotation.is_open(1) && states[moved].rotation.is_open(2));
        assert_eq!(states.remove_part(1), [0], "the block had waited for the plate");
        assert!(states.iter().all(|node| !node.alive));
        assert_eq!(states[moved].path.len(), 1);
    }
}
