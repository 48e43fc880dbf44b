//! Plans: what is returned, and the check that it is true.

pub mod export;
mod plan;
mod shorten;
mod verify;

pub use plan::{Blocked, MotionKind, Overlap, Plan, PlanStats, PlanStatus, PlanStep, Warning};
pub use shorten::thinned;
pub use verify::{Entry, Verdict, Verifier};
