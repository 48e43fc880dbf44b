//! Which states are new: the paper's rmd, and coarser than that where a part plays freely.
//!
//! In free play, states multiply without end, and none of them matters much; in a maze, every one
//! may be a junction. So places that a part was only pushed to are told apart the coarser the more
//! of them lie in one room, that is, where the part gets straight from one to the other; those in
//! other rooms count little, and never hide one. A part that turns mostly turns in its play: what
//! it was turned to is told apart the coarser the more of that there is, wherever it is.

use rayon::prelude::*;

use crate::contact::passes_straight;
use crate::geometry::Pose;
use crate::termination::Interrupt;

use super::sbdp::Search;
use super::state::{Phase, coarseness};

/// So many states of the other kind, or in other rooms, count as one.
const ELSEWHERE: usize = 8;
/// A part that is turned by less than this, in radians, was pushed only.
const TURNED: f64 = 0.05;

impl Search<'_, '_> {
    /// Whether no state of this part is like a pose.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn is_new_state(&mut self, phase: Phase, part: usize, pose: &Pose) -> Result<bool, Interrupt> {
        let counts = |node: usize| self.nodes[node].alive && self.lists(phase, &self.nodes[node]);
        let known = &self.known[part];
        // As coarse as so many states could ever be told apart.
        if !known.has_like(pose, counts) {
            return Ok(true);
        }
        if self.separate_lists || !self.guided {
            return Ok(false);
        }
        let states: Vec<Pose> = known.poses(counts).collect();
        if states.iter().any(|state| known.alike(state, pose, 1.0)) {
            return Ok(false);
        }
        let assembled = self.disassembly.assembled(part).rotation;
        let is_turned = |state: &Pose| state.rotation.angle_to(&assembled) > TURNED;
        let (scene, standing) = (&self.disassembly.problem.scene, self.disassembly.standing(part));
        let termination = &self.disassembly.problem.termination;
        let turned = is_turned(pose);
        let is_near = |state: &Pose| match turned {
            true => Ok(is_turned(state)),
            false => passes_straight(scene, &standing, part, [state, pose], termination),
        };
        let kinds: Vec<bool> = states.par_iter().map(is_near).collect::<Result<_, Interrupt>>()?;
        let of_kind =
            |wanted: bool| states.iter().zip(&kinds).filter(move |(_, is)| **is == wanted).map(|(s, _)| s);
        let (near, far): (Vec<&Pose>, Vec<&Pose>) = (of_kind(true).collect(), of_kind(false).collect());
        let coarse = coarseness(near.len() + far.len() / ELSEWHERE);
        let hides = |state: &&Pose| known.alike(state, pose, coarse);
        let hidden = near.iter().any(hides) || (turned && far.iter().any(hides));
        if hidden {
            self.coarsest = self.coarsest.max(coarse);
        }
        Ok(!hidden)
    }

    /// How coarsely states were told apart at most, as a multiple of the paper's resolution.
    pub(super) fn coarsest(&self, most_states: usize) -> f64 {
        if self.separate_lists || !self.guided { coarseness(most_states) } else { self.coarsest }
    }
}
