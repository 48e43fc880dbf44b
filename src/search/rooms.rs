//! Which states are new: the paper's rmd, and coarser than that where a part plays freely.
//!
//! In free play, states multiply without end, and none of them matters much; in a maze, every one
//! may be a junction. So states are told apart the coarser the more of them lie in one room, that
//! is, where the part gets straight from one to the other. States in other rooms count little, and
//! never hide one.

use rayon::prelude::*;

use crate::geometry::Pose;
use crate::simulation::passes_straight;

use super::sbdp::Search;
use super::state::{Phase, coarseness};

/// So many states in other rooms count as one in the same room.
const ELSEWHERE: usize = 8;

impl Search<'_, '_> {
    /// Whether no state of this part is like a pose.
    pub(super) fn is_new_state(&mut self, phase: Phase, part: usize, pose: &Pose) -> bool {
        let counts = |node: usize| self.nodes[node].alive && self.lists(phase, &self.nodes[node]);
        let known = &self.known[part];
        // As coarse as so many states could ever be told apart.
        if !known.has_like(pose, counts) {
            return true;
        }
        if self.separate_lists || !self.guided {
            return false;
        }
        let states: Vec<Pose> = known.poses(counts).collect();
        if states.iter().any(|state| known.alike(state, pose, 1.0)) {
            return false;
        }
        let (scene, standing) = (&self.disassembly.problem.scene, self.disassembly.standing(part));
        let is_near = |state: &&Pose| passes_straight(scene, &standing, part, state, pose);
        let room: Vec<&Pose> = states.par_iter().filter(is_near).collect();
        let coarse = coarseness(room.len() + (states.len() - room.len()) / ELSEWHERE);
        let is_new = !room.iter().any(|state| known.alike(state, pose, coarse));
        if !is_new {
            self.coarsest = self.coarsest.max(coarse);
        }
        is_new
    }

    /// How coarsely states were told apart at most, as a multiple of the paper's resolution.
    pub(super) fn coarsest(&self, most_states: usize) -> f64 {
        if self.separate_lists || !self.guided { coarseness(most_states) } else { self.coarsest }
    }
}
