//! What goes when the check on the triangles refutes the way to a state.
//!
//! Ways are checked once one of them leads out, so what does not hold may lie many motions back, and all that
//! began there goes with it. The action that led there is made again, with the refuting points as samples; if
//! that does not mend it, it is given up: else one that is refuted again and again would never end.

use super::disassembly::{REFINEMENTS, Stop};
use super::sbdp::Search;
use super::state::Phase;

/// An action from a state: the state's node, the phase, and the action's number.
pub(super) type Origin = (usize, Phase, usize);

impl Search<'_, '_> {
    /// Drops a state whose way was refuted, with the first on that way of which that is true and all that began
    /// there.
    pub(super) fn drop_state(&mut self, node: usize) -> Result<(), Stop> {
        let mut first = node;
        while let Some((parent, ..)) = self.nodes[first].origin {
            let parent_node = &self.nodes[parent];
            if parent_node.is_root() || self.disassembly.holds(parent_node.part, &parent_node.path)? {
                break;
            }
            first = parent;
        }
        let mut dropped = vec![false; self.nodes.len()];
        dropped[first] = true;
        for at in first..self.nodes.len() {
            // What led to a state is older than it.
            dropped[at] |= self.nodes[at].origin.is_some_and(|(parent, ..)| dropped[parent]);
            self.nodes[at].alive &= !dropped[at];
        }
        let Some(origin) = self.nodes[first].origin else { return Ok(()) };
        let times = self.retracted.entry(origin).or_default();
        *times += 1;
        let (parent, phase, action) = origin;
        if *times <= REFINEMENTS
            && let Some(b) = self.nodes[parent].blockage_mut(phase)
        {
            b.reopen(action);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Problem;
    use super::super::begun::Begun;
    use super::super::disassembly::Disassembly;
    use super::super::state::Node;
    use super::super::tests::{Recorder, problem};
    use super::*;
    use crate::blocking_graph::Blockage;
    use crate::fixtures::{block_on_plate, scene};
    use crate::geometry::Pose;

    #[test]
    fn what_began_on_a_refuted_way_goes_with_it_and_its_action_is_made_again_for_some_times() {
        let (scene, verifier) = scene(block_on_plate());
        let mut recorder = Recorder::default();
        let problem = Problem { present: vec![0, 1], fixed: vec![0], ..problem(scene, &verifier) };
        let (disassembly, begun) = Disassembly::beside(problem, &mut recorder, |p| Begun::of(p, true));
        let mut search = Search::new(disassembly, begun.unwrap(), true);
        let root = search.nodes.len() - 1;
        let start = *search.nodes[root].pose();
        let at = |x: f64, z: f64| Pose::translation(x, 0.0, z) * start;
        let add = |search: &mut Search<'_, '_>, parent: usize, end: Pose| {
            let (translation, rotation) = (None, Blockage::open(search.rotations.len()));
            let path = [&search.nodes[parent].path[..], &[end]].concat();
            let origin = Some((parent, Phase::Rotation, 0));
            search.add_node(Node { part: 1, path, translation, rotation, origin, novelty: 1.0, alive: true });
            search.nodes.len() - 1
        };
        for time in 1..=REFINEMENTS + 1 {
            search.nodes[root].rotation.block_jointly(0, vec![0]);
            let beside = add(&mut search, root, at(1.0, 0.5));
            // Through the plate and up again: what is refuted lies two motions before the state that is dropped.
            let under = add(&mut search, beside, at(1.0, -0.5));
            let up = add(&mut search, under, at(1.0, 1.0));
            let last = add(&mut search, up, at(2.0, 1.0));
            let sibling = add(&mut search, under, at(0.0, 1.0));
            search.nodes[beside].rotation.block_jointly(0, vec![0]);
            assert!(search.drop_state(up).is_ok());
            let alive = [beside, under, up, last, sibling].map(|node| search.nodes[node].alive);
            assert_eq!(alive, [true, false, false, false, false]);
            assert!(search.nodes[beside].rotation.is_open(0) && !search.nodes[root].rotation.is_open(0));
            // The same action from the same state, as it is made again.
            let origin = search.nodes[under].origin.unwrap();
            assert_eq!(search.retracted.remove(&origin), Some(1));
            search.retracted.insert((root, Phase::Rotation, 0), time - 1);
            assert!(search.drop_state(beside).is_ok());
            assert_eq!(search.nodes[root].rotation.is_open(0), time <= REFINEMENTS, "{time}");
        }
    }
}
