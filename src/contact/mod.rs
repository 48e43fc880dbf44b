//! Contact: every question that the planner asks about two bodies that may touch.
//!
//! | question | entry | result |
//! |---|---|---|
//! | how far a body goes along a line until it meets another (shape cast) | [`Crossing::way`] | length |
//! | bounds that hold for all points of a surface (region cover): for shifts, turns, and paths | [`region_cover`] | cells, holds, [`Found`](region_cover::depth::Found) |
//! | contacts at samples of both surfaces (open surfaces and fallbacks) | [`sampled`] | `Near` |
//! | whether two threads pass each other along their helix | [`helix_profile`] | open stretches |
//! | whether the hulls of a body and of all others are apart | [`exit_direction`](crate::scene::exit_direction) | direction |

pub(crate) mod constraint;
pub(crate) mod course;
pub(crate) mod helix_profile;
mod passing;
pub(crate) mod region_cover;
pub(crate) mod sampled;
mod shape_cast;

pub use passing::Passing;
pub use region_cover::KeptCells;
pub use shape_cast::{Crossing, Margins};
