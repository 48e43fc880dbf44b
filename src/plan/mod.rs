//! Plans: what is returned, and the check that it is true.

mod centred;
mod course;
mod depth;
pub mod export;
mod model;
mod sampling;
mod screw_envelope;
mod screw_path;
#[cfg(test)]
mod screw_tests;
mod screws;
mod shorten;
mod slip;
mod verify;

pub use model::{Blocked, MotionKind, Overlap, Plan, PlanStats, PlanStatus, PlanStep, Warning};
pub use shorten::thinned;
pub use verify::{Entry, Verdict, Verifier};
