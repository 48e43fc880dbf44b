//! The transition function f(s, a, p): where a part gets to when it is pushed, pulled or turned.
//!
//! Data flow: [`Scene`](crate::scene::Scene) → `sliding` (steps until the part is out or stuck) → [`Motion`]. All
//! questions about contact are asked in [`contact`](crate::contact): of translations, region covers; of what may turn,
//! region covers and, where these would be too many pieces, samples. What may turn follows `projection` (the nearest
//! twist that contact allows). The paper's own simulation stands beside it: [`PenaltyEngine`], with forces and time
//! steps, on the distance fields alone. [`straight_sweep`] finds parts that leave along a line, without simulation.
//! Contact suggests directions beside the axes: the planes that a part touches (`touching`), and the twist that its
//! contacts hardly resist (`null_twists`). Everything here is in the planning frame and knows nothing of search.

mod action;
mod null_twists;
mod penalty;
mod projection;
mod records;
mod reduction;
mod sliding;
mod sweep;
#[cfg(test)]
mod tests;
mod touching;
mod transition;

pub use action::{Action, Axis};
pub use null_twists::NullTwist;
pub use penalty::{PenaltyEngine, PenaltyParameters};
pub use records::MotionQuestion;
pub(crate) use records::{
    MOTION, SWEPT, TOUCHING, WITNESS, add_action, known_sweep, remembered_obstacles, remembered_sweep,
    remembered_touching,
};
pub use sliding::{PairMethod, SlidingEngine, StepCost, pair_blocks, step_costs};
pub use sweep::{
    FreeTravel, Sweep, SweepQuestion, free_travel, straight_sweep, straight_sweep_past, travel_to,
};
pub use touching::Touching;
pub use transition::{End, Motion, TransitionFunction, asked_again};
