//! Which states are new: the paper's rmd, and coarser than that where a part plays freely.
//!
//! Free play yields states without end, and none of them matters much; in a maze, each may be a junction. A pose that a
//! part was only pushed to is compared with known states of the same free region, that is, those from which the part
//! gets there straight. The more of them there are, the coarser is the comparison. States of other regions count little,
//! and never make a pose known. A part that turns mostly turns in its play, so turned poses are compared with all turned
//! states, the more coarsely the more there are.

use rayon::prelude::*;

use crate::budgets::STATES_ELSEWHERE;
use crate::contact::passes_straight;
use crate::geometry::Pose;
use crate::termination::Interrupt;
use crate::tolerances::TURNED;

use super::disassembly::Disassembly;
use super::state::coarseness;
use super::states::PhaseStates;

/// The decision which poses make new states.
#[derive(Debug)]
pub(super) struct Novelty {
    /// The coarsest resolution at which a pose was taken for a known state, as a multiple of the paper's.
    coarsest: f64,
}

impl Default for Novelty {
    fn default() -> Self {
        Self { coarsest: 1.0 }
    }
}

impl Novelty {
    /// Whether a part has no state like a pose.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn is_new(
        &mut self,
        of: &PhaseStates<'_>,
        disassembly: &Disassembly<'_, '_>,
        part: usize,
        pose: &Pose,
    ) -> Result<bool, Interrupt> {
        let PhaseStates { strategy, states, .. } = *of;
        let counts = |node: usize| states.nodes[node].alive && of.lists(&states.nodes[node]);
        let known = &states.known[part];
        // At the coarsest resolution that this number of states allows.
        if !known.has_like(pose, counts) {
            return Ok(true);
        }
        if !strategy.is_extended() {
            return Ok(false);
        }
        let states: Vec<Pose> = known.poses(counts).collect();
        if states.iter().any(|state| known.alike(state, pose, 1.0)) {
            return Ok(false);
        }
        let assembled = disassembly.assembled(part).rotation;
        let is_turned = |state: &Pose| state.rotation.angle_to(&assembled) > TURNED;
        let (scene, standing) = (&disassembly.problem.scene, disassembly.standing(part));
        let termination = &disassembly.problem.termination;
        let turned = is_turned(pose);
        let is_near = |state: &Pose| match turned {
            true => Ok(is_turned(state)),
            false => passes_straight(scene, &standing, part, [state, pose], termination),
        };
        let kinds: Vec<bool> = states.par_iter().map(is_near).collect::<Result<_, Interrupt>>()?;
        let of_kind =
            |wanted: bool| states.iter().zip(&kinds).filter(move |(_, is)| **is == wanted).map(|(s, _)| s);
        let (near, far): (Vec<&Pose>, Vec<&Pose>) = (of_kind(true).collect(), of_kind(false).collect());
        let coarse = coarseness(near.len() + far.len() / STATES_ELSEWHERE);
        let hides = |state: &&Pose| known.alike(state, pose, coarse);
        let hidden = near.iter().any(hides) || (turned && far.iter().any(hides));
        if hidden {
            self.coarsest = self.coarsest.max(coarse);
        }
        Ok(!hidden)
    }

    /// The coarsest resolution used, as a multiple of the paper's.
    pub(super) fn coarsest(&self) -> f64 {
        self.coarsest
    }
}
