//! Search: State-Based Disassembly Planning.
//!
//! Data flow: [`PlanRequest`] → [`Problem`] → a planner (`sbdp`: states and blocking graphs; `pdp`:
//! one part after the other; `rrt`: random trees), which changes the `disassembly` → [`Outcome`].
//! Everything below the request is in the planning frame.
//!
//! A search by states has parts, each of its own type and file: `states`, `action_table`, `order`, `novelty`,
//! `invalidation`, `sweep_memory`, `speculation`. The loop in `sbdp` is Algorithm 1 of the paper and passes
//! them to each other.

mod action_list;
mod action_table;
mod aside;
mod ball;
mod base;
mod blocked_actions;
mod carried_groups;
mod cell_decomposition;
mod cell_memory;
mod clearance;
mod contraction;
mod critical_places;
mod critical_turns;
mod deepest_point;
mod deferred_removals;
mod directions;
mod disassembly;
mod enclosed;
mod groups;
#[cfg(test)]
mod groups_tests;
mod initial_analysis;
mod inseparable;
mod invalidation;
mod kept;
#[cfg(test)]
mod kept_tests;
mod known_states;
mod linked;
mod necked;
mod novelty;
mod order;
mod outcome;
mod own_scale;
#[cfg(test)]
mod paper_tests;
mod pdp;
mod preferred;
mod problem;
mod rays;
mod rearrangement;
mod release;
mod report;
mod request;
mod requirements;
mod rrt;
mod sbdp;
mod speculation;
mod state;
mod states;
mod stopped_actions;
mod strategy;
mod subassembly;
mod support;
mod sweep_memory;
mod targets;
#[cfg(test)]
mod tests;
mod trace;
mod twists;
mod unscrewing;

use crate::plan::PlanStatus;
use deferred_removals::DeferredRemovals;

pub use crate::termination::{Interrupt, Termination};
pub use directions::axes_of;
pub use initial_analysis::initial_graphs;
pub use outcome::{
    BlockedAction, Counters, Inseparable, NearPass, Outcome, Reason, Removal, SeparationProof,
};
pub use preferred::PreferredGroups;
pub use problem::{Checked, Effort, Observer, Problem, VerifiedPath};
pub use release::Release;
pub use request::{
    ActionSet, Engine, PlanRequest, PlanSink, Planner, Progress, Stage, Staging, SteadyOrder, Tried,
};
pub use state::least_travel;
pub use trace::{BlockedBy, PlanningPhase, TraceEvent};

/// Runs the planner that a request names.
#[must_use]
pub fn search(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let Some(targets) = problem.targets.clone() else { return run(planner, problem, observer) };
    // Only what the targets require is reported, and that is known at the end.
    let mut deferred = DeferredRemovals::new(observer);
    let mut outcome = run(planner, problem.clone(), &mut deferred);
    if outcome.status == PlanStatus::Complete {
        outcome = targets::with_fewest(planner, &problem, outcome, &targets);
    }
    outcome.removals.iter().for_each(|r| observer.removal(r));
    outcome
}

/// A search, with parts taken off that are to be kept where others cannot leave otherwise, and the groups that left taken
/// apart.
fn run(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let outcome = run_with_moves(planner, &problem, observer);
    let mut outcome = kept::with_kept_released(planner, &problem, outcome, observer);
    for group in 0..outcome.removals.len() {
        if outcome.removals[group].is_group() {
            subassembly::take_apart(planner, &problem, &mut outcome, group, observer);
        }
    }
    outcome
}

/// A search, with parts moved aside where nothing leaves.
fn run_with_moves(planner: Planner, problem: &Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let mut outcome = run_once(planner, problem.clone(), observer);
    // What is moved aside is so because nothing leaves: no group was left whole then.
    let alone = Problem { preferred: PreferredGroups::default(), ..problem.clone() };
    loop {
        let next = match aside::moved_aside(planner, &alone, &mut outcome, observer) {
            Ok(Some(next)) => next,
            Ok(None) => break,
            Err(interrupt) => {
                (outcome.status, outcome.reason) = disassembly::interrupted(interrupt);
                break;
            }
        };
        let counters = outcome.counters;
        outcome = run_once(planner, next, observer);
        outcome.counters.add(&counters);
    }
    outcome
}

fn run_once(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    match planner {
        Planner::SbdpStar => sbdp::sbdp(problem, observer, true),
        Planner::Sbdp => sbdp::sbdp(problem, observer, false),
        Planner::PdpT => pdp::pdp(problem, observer, pdp::PdpMode::Translation),
        Planner::PdpR => pdp::pdp(problem, observer, pdp::PdpMode::Rotation),
        Planner::PdpStar => pdp::pdp_star(problem, observer),
        Planner::Rrt => rrt::rrt(problem, observer, rrt::Extension::Straight),
        Planner::BkRrt => rrt::rrt(problem, observer, rrt::Extension::Simulated),
    }
}
