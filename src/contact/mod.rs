//! Contact: every question that the planner asks about two bodies that may touch.
//!
//! | question | entry | answer |
//! |---|---|---|
//! | how far a body goes along a line until it meets another (shape cast) | `shape_cast`: [`ShapeCast`] | a length |
//! | bounds that hold for all points of a surface (region cover), for shifts, for turns and for paths | `region_cover`: `shift`, `rigid`, `path` | regions and what leaves them; a depth |
//! | contacts at samples of both surfaces, for open surfaces and as a fallback | `sampled` | contacts |
//! | whether a sample is deeper than a limit, at a pose or on a way that is only tried | `sampled::penetration` | yes or no |
//! | how long a stretch of others is in the way of a direction (to order turns) | [`obstruction`] | a length |
//! | whether a few points show that a path enters a part | [`is_seen_to_enter`] | yes, or nothing |
//! | whether two threads pass each other along their helix | `helix_profile` | the stretches left open |
//! | which path off a thread keeps its surfaces furthest apart | `helix_profile::path_on_thread` | a path |
//! | which ways lead a part off the threads that it shares with others | `helix_profile::ways_off` | paths |
//! | how near bodies pass others on their way | [`closest_approach`] | a distance, and a bound |
//! | whether a body keeps a distance from another on its way | [`PassingPair`] | where it does not |
//! | whether the hulls of a body and of all others are apart | [`exit_direction`](crate::scene::exit_direction) | a direction |
//!
//! `course` says how points move along a path, [`PairPath`] which way a body takes past another. Contact knows the scene
//! and nothing of simulation, plans and search.

mod closest_approach;
pub(crate) mod constraint;
pub(crate) mod course;
pub(crate) mod helix_profile;
mod obstruction;
mod pair_path;
mod passing;
pub(crate) mod region_cover;
pub(crate) mod sampled;
mod shape_cast;

pub use closest_approach::{ClosestApproach, PassedPair, closest_approach};
pub use obstruction::{is_seen_to_enter, obstruction};
pub use pair_path::PairPath;
pub use passing::PassingPair;
pub use region_cover::ShiftCoverCache;
pub use sampled::{passes_straight, seems_clear};
pub use shape_cast::{CastMargins, ShapeCast};
