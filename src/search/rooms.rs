//! Which states are new: the paper's rmd, and coarser than that where a part plays freely.
//!
//! In free play, states multiply without end, and none of them matters much; in a maze, every one
//! may be a junction. So places that a part was only pushed to are told apart the coarser the more
//! of them lie in one room, that is, where the part gets straight from one to the other; those in
//! other rooms count little, and never hide one. A part that turns mostly turns in its play: what
//! it was turned to is told apart the coarser the more of that there is, wherever it is.

use rayon::prelude::*;

use crate::geometry::Pose;
use crate::simulation::passes_straight;

use super::sbdp::Search;
use super::state::{Phase, coarseness};

/// So many states of the other kind, or in other rooms, count as one.
const ELSEWHERE: usize = 8;
/// A part that is turned by less than this, in radians, was pushed only.
const TURNED: f64 = 0.05;

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
        let assembled = self.disassembly.assembled(part).rotation;
        let is_turned = |state: &Pose| state.rotation.angle_to(&assembled) > TURNED;
        let (scene, standing) = (&self.disassembly.problem.scene, self.disassembly.standing(part));
        let is_near = |state: &Pose| passes_straight(scene, &standing, part, state, pose);
        let turned = is_turned(pose);
        let (near, far): (Vec<&Pose>, Vec<&Pose>) =
            states.par_iter().partition(|s| if turned { is_turned(s) } else { is_near(s) });
        let coarse = coarseness(near.len() + far.len() / ELSEWHERE);
        let hides = |state: &&Pose| known.alike(state, pose, coarse);
        let hidden = near.iter().any(hides) || (turned && far.iter().any(hides));
        if hidden {
            self.coarsest = self.coarsest.max(coarse);
        }
        !hidden
    }

    /// How coarsely states were told apart at most, as a multiple of the paper's resolution.
    pub(super) fn coarsest(&self, most_states: usize) -> f64 {
        if self.separate_lists || !self.guided { coarseness(most_states) } else { self.coarsest }
    }
}
