//! Groups that left are taken apart: each by a search of its own, in which only its parts stand, where they stood in the
//! assembly. A small group that does not come apart is searched again at its own scale, as if it were alone.

use crate::plan::{Base, PlanStatus};

use super::deferred_removals::DeferredRemovals;
use super::outcome::{Outcome, Reason, Removal};
use super::own_scale::{scale_of_all, searched_at};
use super::problem::{Observer, Problem};
use super::release::Release;
use super::request::Planner;
use super::requirements::places_after;
use super::run;
use super::trace::TraceEvent;

/// Takes the group of a removal apart, as far as its parts are asked for, and adds the removals to an outcome. If it does
/// not come apart, the outcome is that of this search, unless it was not complete before.
pub(super) fn take_apart(
    planner: Planner,
    problem: &Problem<'_>,
    outcome: &mut Outcome,
    group: usize,
    observer: &mut dyn Observer,
) {
    let present = outcome.removals[group].parts.clone();
    let targets: Option<Vec<usize>> = problem
        .targets
        .as_ref()
        .map(|targets| targets.iter().copied().filter(|target| present.contains(target)).collect());
    if targets.as_ref().is_some_and(Vec::is_empty) {
        return;
    }
    if observer.traces() {
        observer.traced(TraceEvent::GroupOpened { parts: present.clone() });
    }
    let spent = problem.spent + outcome.counters.simulations;
    let scene = problem.scene.with_placed(&places_after(&problem.scene, &outcome.removals[..group]));
    let base = Base::default();
    let inner =
        Problem { scene, present, targets, base, released: Release::Nothing, spent, ..problem.clone() };
    let done = outcome.removals.len();
    let mut deferred = DeferredRemovals::after(observer, done, outcome.counters.simulations);
    let found = taken_apart(planner, inner, &mut deferred);
    let Outcome { status, reason, removals, unfinished, blocked, free_together, counters, .. } = found;
    for removal in removals {
        let of = Some(removal.of.map_or(group, |of| done + of));
        let mut requires: Vec<usize> = removal.requires.iter().map(|i| done + i).collect();
        if of == Some(group) {
            requires.insert(0, group);
        }
        let wave = requires.iter().map(|&i| outcome.removals[i].wave + 1).max().unwrap_or(0);
        let removal = Removal { of, requires, wave, ..removal };
        observer.removal(&removal);
        outcome.removals.push(removal);
    }
    outcome.counters.add(&counters);
    if outcome.status == PlanStatus::Complete && status != PlanStatus::Complete {
        (outcome.status, outcome.reason, outcome.unfinished) = (status, reason, unfinished);
        (outcome.blocked, outcome.free_together) = (blocked, free_together);
    }
}

/// The search for a group, and where it ends with parts left, the one at the group's own scale. Of the two, the one
/// with more removals counts, and how the second one ended.
fn taken_apart(planner: Planner, problem: Problem<'_>, observer: &mut dyn Observer) -> Outcome {
    let found = run(planner, problem.clone(), observer);
    let (Some(Reason::Exhausted), Some(scale)) = (&found.reason, scale_of_all(&problem)) else {
        return found;
    };
    let spent = problem.spent + found.counters.simulations;
    let problem = Problem { spent, ..problem };
    let mut again = searched_at(&problem, scale, |scaled| run(planner, scaled, observer));
    again.counters.add(&found.counters);
    if again.removals.len() >= found.removals.len() {
        return again;
    }
    Outcome { status: again.status, reason: again.reason, counters: again.counters, ..found }
}
