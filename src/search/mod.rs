//! Search: State-Based Disassembly Planning.

mod request;

pub use request::{
    ActionSet, Engine, Interrupt, PlanRequest, PlanSink, Planner, Progress, Stage, Termination,
};
