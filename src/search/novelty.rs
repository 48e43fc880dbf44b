//! When a state that is not far from others is new: beyond the paper's resolution (rmd), where a part plays freely.
//!
//! In free play states multiply without end, and none of them matters much; in a maze, every one may be a junction. A
//! state that a part was only pushed to is told apart the more coarsely, the more states it reaches straight; states
//! that it does not reach straight count little, and never hide one. A part that turns mostly turns in its play: a
//! state that it was turned to is told apart the more coarsely, the more such states there are, wherever they are.

use rayon::prelude::*;

use crate::budgets::STATES_ELSEWHERE;
use crate::contact::passes_straight;
use crate::geometry::Pose;
use crate::termination::Interrupt;
use crate::tolerances::TURNED;

use super::disassembly::Disassembly;
use super::known_states::KnownStates;
use super::state::coarseness;

/// The resolution, as a multiple of the paper's, at which a pose of a part is like one of some states of the part;
/// `None` if it is new.
///
/// # Errors
/// The termination condition became true.
pub(super) fn hiding_coarseness(
    disassembly: &Disassembly<'_, '_>,
    known: &KnownStates,
    states: &[Pose],
    part: usize,
    pose: &Pose,
) -> Result<Option<f64>, Interrupt> {
    if states.iter().any(|state| known.alike(state, pose, 1.0)) {
        return Ok(Some(1.0));
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
    Ok(hidden.then_some(coarse))
}
