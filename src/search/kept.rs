//! Parts that are to be kept are taken off where others cannot leave otherwise: as late and as few as possible.
//!
//! A first search takes none of them off. Where it is not complete, a second one goes on with what remains and may take
//! them off; its removals of such parts that no other removal requires are left out again. If several still leave, searches
//! in which only some may leave look for fewer.

use std::collections::BTreeSet;

use crate::budgets::KEPT_SEARCHES;
use crate::plan::PlanStatus;

use super::contraction::Unobserved;
use super::deferred_removals::DeferredRemovals;
use super::outcome::{Counters, Outcome, Removal};
use super::problem::{Observer, Problem};
use super::release::Release;
use super::request::Planner;
use super::requirements::without_unrequired;
use super::run_with_moves;

/// The outcome of a search that took none of the parts off that are to be kept; where it is not complete, with what leaves
/// once some of them are off.
pub(super) fn with_kept_released(
    planner: Planner,
    problem: &Problem<'_>,
    outcome: Outcome,
    observer: &mut dyn Observer,
) -> Outcome {
    let is_over = matches!(outcome.status, PlanStatus::Exhausted | PlanStatus::Infeasible);
    let is_kept = |part: &usize| problem.keep.contains(part);
    if !is_over || !outcome.remaining.iter().any(is_kept) {
        return outcome;
    }
    let here = Problem { releases_kept: true, ..problem.after(&outcome) };
    let first = outcome.removals.len();
    let mut search = KeptSearch {
        planner,
        here: &here,
        spent: problem.spent,
        first,
        counters: outcome.counters,
        searches: 0,
    };
    let found = search
        .searched(&problem.keep, &mut DeferredRemovals::after(observer, 0, outcome.counters.simulations));
    let mut best = search.with_fewest(found);
    if search.cost(&best).0 == here.wanted(&outcome.remaining).len() {
        // None of them was in the way of anything.
        best = Outcome { status: best.status, reason: best.reason, ..outcome };
    }
    best.removals[first..].iter().for_each(|removal| observer.removal(removal));
    Outcome { counters: search.counters, ..best }
}

/// Searches for what remains, in which parts may leave that are to be kept.
struct KeptSearch<'p, 'a> {
    planner: Planner,
    here: &'p Problem<'a>,
    /// Simulations before the first of them.
    spent: u64,
    /// The number of removals before.
    first: usize,
    /// Those of all searches so far.
    counters: Counters,
    searches: usize,
}

impl KeptSearch<'_, '_> {
    /// The outcome of a search in which, of the parts that are to be kept, only some may leave. Nothing else does at first.
    fn searched(&mut self, may_leave: &[usize], observer: &mut dyn Observer) -> Outcome {
        self.searches += 1;
        let held = self.here.keep.iter().filter(|part| !may_leave.contains(part));
        let problem = Problem {
            fixed: self.here.fixed.iter().chain(held).copied().collect(),
            keep: may_leave.to_vec(),
            released: Release::Kept,
            spent: self.spent + self.counters.simulations,
            ..self.here.clone()
        };
        let found = run_with_moves(self.planner, &problem, observer);
        self.counters.add(&found.counters);
        self.pruned(found)
    }

    /// Without the removals that are not needed. Those before are done.
    fn pruned(&self, outcome: Outcome) -> Outcome {
        let Problem { keep, targets, .. } = self.here;
        let is_asked = |part: &usize| match targets {
            Some(targets) => targets.contains(part),
            None => !keep.contains(part),
        };
        let is_needed = |(i, r): (usize, &Removal)| i < self.first || r.parts.iter().any(is_asked);
        let needed = outcome.removals.iter().enumerate().map(is_needed).collect();
        let pruned = without_unrequired(outcome, needed);
        let unfinished = if pruned.unfinished.is_empty() { Vec::new() } else { pruned.remaining.clone() };
        Outcome { unfinished, ..pruned }
    }

    /// An outcome, or one in which as much leaves, and fewer parts do that are to be kept.
    fn with_fewest(&mut self, mut best: Outcome) -> Outcome {
        let mut tried: BTreeSet<Vec<usize>> = BTreeSet::new();
        while self.searches < KEPT_SEARCHES && self.here.termination.check().is_ok() {
            let fewer = self.fewer(&self.here.kept_off(&best.remaining));
            let Some(next) = fewer.into_iter().find(|set| !tried.contains(set)) else { break };
            let found = self.searched(&next, &mut Unobserved);
            tried.insert(next);
            if found.status == best.status && self.cost(&found) < self.cost(&best) {
                best = found;
            }
        }
        best
    }

    /// Sets of parts that are to be kept of which fewer than those that left may have to leave: all but one of these, one,
    /// or two. None where one left: without any, less leaves.
    fn fewer(&self, off: &[usize]) -> Vec<Vec<usize>> {
        if off.len() < 2 {
            return Vec::new();
        }
        let all: Vec<usize> =
            self.here.present.iter().copied().filter(|part| self.here.keep.contains(part)).collect();
        let without = |part: &usize| all.iter().copied().filter(|other| other != part).collect();
        let mut sets: Vec<Vec<usize>> = off.iter().map(without).collect();
        sets.extend(all.iter().map(|&part| vec![part]));
        if off.len() > 2 {
            let pairs =
                all.iter().enumerate().flat_map(|(i, &a)| all[i + 1..].iter().map(move |&b| vec![a, b]));
            sets.extend(pairs);
        }
        sets
    }

    /// How many of the parts that are asked for do not leave, and how many do that are to be kept.
    fn cost(&self, outcome: &Outcome) -> (usize, usize) {
        (self.here.wanted(&outcome.remaining).len(), self.here.kept_off(&outcome.remaining).len())
    }
}
