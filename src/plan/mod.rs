//! Plans: what is returned, and the check that it is true.

mod course;
mod depth;
pub mod export;
mod model;
mod passing;
mod sampling;
mod screw;
mod shorten;
mod verify;

pub use model::{Blocked, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, Warning};
pub use passing::Passing;
pub use shorten::thinned;
pub use verify::{Entry, Verdict, Verifier};
