//! Search: State-Based Disassembly Planning.
//!
//! Data flow: [`PlanRequest`] → [`Problem`] → a planner (`sbdp`) over states (`state`) → [`Outcome`].
//! Everything below the request is in the planning frame.

mod outcome;
mod problem;
mod removal;
mod report;
mod request;
mod sbdp;
mod state;

pub use crate::termination::{Interrupt, Termination};
pub use outcome::{BlockedAction, Counters, Outcome, Removal};
pub use problem::{Checked, Observer, Problem};
pub use request::{ActionSet, Engine, PlanRequest, PlanSink, Planner, Progress, Stage};

/// Runs the planner that a request names.
#[must_use]
pub fn search(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    match planner {
        Planner::SbdpStar => sbdp::sbdp_star(problem, observer),
    }
}
