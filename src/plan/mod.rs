//! Plans, and the verification of their paths.

mod common_depth;
pub mod export;
mod model;
mod placements;
mod records;
mod shorten;
mod verify;

pub use model::{
    Base, Blocked, FreeGroup, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd,
    Warning,
};
pub(crate) use placements::MOTION_ROUNDING;
pub use placements::{Placements, StepFrame};
pub use records::{KnownVerdicts, VerdictQuestion};
pub(crate) use records::{OVERLAP, VERDICT, overlap_key};
pub use shorten::thinned;
pub use verify::{PairOverlap, Verdict, Verifier};
