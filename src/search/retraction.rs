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
