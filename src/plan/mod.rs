//! Plans, and the verification of their paths.

mod common_depth;
mod elastic_band;
mod model;
mod records;
mod shorten;
mod verify;

pub(crate) use elastic_band::{BandPush, pushed, with_waypoint};
pub use model::{
    Base, Blocked, FreeGroup, MotionKind, Overlap, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd,
    Warning,
};
pub use records::{KnownVerdicts, VerdictQuestion};
pub(crate) use records::{OVERLAP, VERDICT, overlap_key};
pub use shorten::thinned;
pub use verify::{PairOverlap, Verdict, Verifier};
