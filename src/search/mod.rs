//! Search: State-Based Disassembly Planning.
//!
//! Data flow: [`PlanRequest`] → [`Problem`] → a planner (`sbdp`: states and blocking graphs; `pdp`:
//! one part after the other), which works on the `disassembly` under way → [`Outcome`].
//! Everything below the request is in the planning frame.

mod ahead;
mod begun;
mod directions;
mod disassembly;
mod known_states;
mod linked;
mod order;
mod outcome;
mod own_actions;
mod pdp;
mod problem;
mod rays;
mod report;
mod request;
mod retraction;
mod rooms;
mod round;
mod sbdp;
mod state;
mod straight;
#[cfg(test)]
mod tests;
mod trace;
mod twists;

pub use crate::termination::{Interrupt, Termination};
pub use begun::initial_blockages;
pub use directions::axes_of;
pub use outcome::{BlockedAction, Counters, Outcome, Removal};
pub use problem::{Checked, Observer, Problem};
pub use request::{ActionSet, Engine, PlanRequest, PlanSink, Planner, Progress, Stage, Staging};
pub use state::least_travel;
pub use trace::{BlockedBy, TraceEvent, TracePhase};

/// Runs the planner that a request names.
#[must_use]
pub fn search(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    match planner {
        Planner::SbdpStar => sbdp::sbdp(problem, observer, true),
        Planner::Sbdp => sbdp::sbdp(problem, observer, false),
        Planner::PdpT => pdp::pdp(problem, observer, pdp::Mode::Translation),
        Planner::PdpR => pdp::pdp(problem, observer, pdp::Mode::Rotation),
        Planner::PdpStar => pdp::pdp_star(problem, observer),
    }
}
