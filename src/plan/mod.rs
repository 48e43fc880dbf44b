//! Plans: what is returned, and the check that it is true.

pub mod export;
mod plan;

pub use plan::{Blocked, MotionKind, Overlap, Plan, PlanStats, PlanStatus, PlanStep, Warning};
