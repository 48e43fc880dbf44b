//! What is remembered of simulation, a file per question.

mod motion;
mod swept;
mod touching;

pub use motion::MotionQuestion;
pub(crate) use motion::{MOTION, WITNESS};
pub(crate) use swept::{SWEPT, known_sweep, remembered_obstacles, remembered_sweep};
pub(crate) use touching::{TOUCHING, remembered_touching};

use crate::cache::{Digest, Validity};

use super::Action;

const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_SIMULATION"));

/// Adds all that there is to an action to a key: force, torque, and whether the part may turn.
pub(crate) fn add_action(digest: &mut Digest, action: &Action) {
    let (force, torque) = (action.force(), action.torque());
    digest.numbers(force.iter().chain(torque.iter()).copied()).integer(u64::from(action.turns()));
}
