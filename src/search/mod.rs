//! Search: State-Based Disassembly Planning.

mod request;

pub use crate::termination::{Interrupt, Termination};
pub use request::{ActionSet, Engine, PlanRequest, PlanSink, Planner, Progress, Stage};
