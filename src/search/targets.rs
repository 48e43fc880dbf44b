//! The fewest removals that take targets out. Of parts that are to be kept, as few as possible are among them; this counts
//! first.
//!
//! A search that ends when the targets are out is pruned to what they require. Then fewer removals are looked for, in
//! searches in which only some parts may move: first those of the smallest set from which the targets leave straight, each
//! part past those of the set that it would enter; then those of the plan but one, as long as that succeeds. The base and
//! what is fixed are in no set.

use std::collections::{BTreeSet, HashMap};

use rayon::prelude::*;

use crate::budgets::{TARGET_SEARCHES, TARGET_SETS};
use crate::plan::{Base, PlanStatus};
use crate::scene::StandingParts;
use crate::simulation::{Action, SweepQuestion, remembered_obstacles};
use crate::termination::Interrupt;

use super::contraction::Unobserved;
use super::outcome::{Outcome, Removal};
use super::problem::{Effort, Problem};
use super::request::{ActionSet, Planner};
use super::requirements::without_needless;
use super::run_once;

/// A complete outcome, or one that takes the same targets out in fewer removals.
pub(super) fn with_fewest(
    planner: Planner,
    problem: &Problem<'_>,
    outcome: Outcome,
    targets: &[usize],
) -> Outcome {
    let mut shortest =
        Shortest { planner, problem, targets, best: without_needless(outcome, targets), searches: 0 };
    let is_extended = planner == Planner::SbdpStar && problem.actions == ActionSet::Extended;
    if is_extended && shortest.best.removals.len() > targets.len() {
        // What was found until an interrupt holds.
        let _ = shortest.shorten();
    }
    shortest.best
}

struct Shortest<'p, 'a> {
    planner: Planner,
    problem: &'p Problem<'a>,
    targets: &'p [usize],
    best: Outcome,
    /// The number of searches so far.
    searches: usize,
}

impl Shortest<'_, '_> {
    fn shorten(&mut self) -> Result<(), Interrupt> {
        if let Some(parts) = StraightWays::new(self.problem, &self.best)?.smallest_set(self.targets)? {
            self.search_among(&parts);
        }
        let mut needed = BTreeSet::new();
        loop {
            let moved: BTreeSet<usize> = self.best.removals.iter().flat_map(|r| r.parts.clone()).collect();
            let is_other = |part: &&usize| !self.targets.contains(part) && !needed.contains(*part);
            let mut others = moved.iter().filter(is_other).collect::<Vec<_>>();
            others.sort_by_key(|part| !self.problem.keep.contains(part));
            let Some(&&left_out) = others.first() else { return Ok(()) };
            self.problem.termination.check()?;
            let parts = moved.iter().copied().filter(|&part| part != left_out).collect();
            if !self.search_among(&parts) {
                needed.insert(left_out);
            }
        }
    }

    /// Searches with only some parts that may move; true if that takes fewer parts off that are to be kept, or as many of
    /// them in fewer removals.
    fn search_among(&mut self, parts: &BTreeSet<usize>) -> bool {
        let Self { planner, problem, targets, best, searches } = self;
        if *searches == TARGET_SEARCHES {
            return false;
        }
        *searches += 1;
        let stays = |part: &usize| !parts.contains(part) || problem.fixed.contains(part);
        let problem = Problem {
            fixed: problem.present.iter().copied().filter(stays).collect(),
            base: Base::default(),
            keep: Vec::new(),
            effort: Effort::Pushes,
            spent: problem.spent + best.counters.simulations,
            ..problem.clone()
        };
        let found = run_once(*planner, problem, &mut Unobserved);
        best.counters.add(&found.counters);
        // A group would have to be taken apart.
        if found.status != PlanStatus::Complete || found.removals.iter().any(|r| r.is_group()) {
            return false;
        }
        let Outcome { removals, remaining, .. } = without_needless(found, targets);
        let cost = |removals: &[Removal], remaining: &[usize]| {
            (self.problem.kept_off(remaining).len(), removals.len())
        };
        let is_less = cost(&removals, &remaining) < cost(&best.removals, &best.remaining);
        if is_less {
            (best.removals, best.remaining) = (removals, remaining);
        }
        is_less
    }
}

/// Straight ways out of the assembled state.
struct StraightWays<'p, 'a> {
    problem: &'p Problem<'a>,
    /// How many parts the plan takes off that are to be kept, and its removals: a set of fewer is looked for.
    most: (usize, usize),
    /// Parts of the base.
    base: &'p [usize],
    translations: Vec<Action>,
    /// By part, what it enters on each way, if that is nothing that stays.
    obstacles: HashMap<usize, Vec<BTreeSet<usize>>>,
}

/// Parts that have to leave: smaller sets first.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
struct NeededParts {
    /// How many of them are to be kept.
    kept: usize,
    count: usize,
    parts: BTreeSet<usize>,
    /// Those for which no way was chosen yet.
    open: BTreeSet<usize>,
    /// Which part leaves after which other.
    after: BTreeSet<(usize, usize)>,
}

impl<'p, 'a> StraightWays<'p, 'a> {
    fn new(problem: &'p Problem<'a>, plan: &'p Outcome) -> Result<Self, Interrupt> {
        let (translations, _) = problem.action_lists(&problem.directions()?);
        let most = (problem.kept_off(&plan.remaining).len(), plan.removals.len());
        let base = &plan.base.parts[..];
        Ok(Self { problem, most, base, translations, obstacles: HashMap::new() })
    }

    /// The smallest set of parts, the targets among them, that leave straight one after the other, if it is smaller than the
    /// plan.
    fn smallest_set(mut self, targets: &[usize]) -> Result<Option<BTreeSet<usize>>, Interrupt> {
        let parts: BTreeSet<usize> = targets.iter().copied().collect();
        let (kept, count, open) = (0, parts.len(), parts.clone());
        let first = NeededParts { kept, count, parts, open, after: BTreeSet::new() };
        let (mut queue, mut seen, most) = (BTreeSet::from([first]), 0, self.most);
        let keep = &self.problem.keep;
        while let Some(needed) = queue.pop_first() {
            let Some(&part) = needed.open.first() else { return Ok(Some(needed.parts)) };
            seen += 1;
            if seen > TARGET_SETS {
                break;
            }
            for obstacles in self.ways_of(part)? {
                let mut next = needed.clone();
                next.open.remove(&part);
                next.open.extend(obstacles.difference(&needed.parts));
                next.parts.extend(obstacles);
                next.after.extend(obstacles.iter().map(|&other| (part, other)));
                next.count = next.parts.len();
                next.kept = next.parts.iter().filter(|part| keep.contains(part)).count();
                if (next.kept, next.count) < most && has_order(&next) {
                    queue.insert(next);
                }
            }
        }
        Ok(None)
    }

    fn ways_of(&mut self, part: usize) -> Result<&[BTreeSet<usize>], Interrupt> {
        if !self.obstacles.contains_key(&part) {
            let Problem { scene, present, fixed, cache, termination, .. } = self.problem;
            let standing = present.iter().copied().filter(|&other| other != part).collect();
            let around = StandingParts::new(scene, standing);
            let along = |action: &Action| {
                let question = SweepQuestion {
                    scene,
                    standing_parts: &around,
                    part,
                    start: &scene.bodies[part].planning_from_shape,
                    direction: &action.force(),
                };
                remembered_obstacles(cache, &question, termination)
            };
            let found = self.translations.par_iter().map(along).collect::<Result<Vec<_>, Interrupt>>()?;
            let stays = |other: &usize| fixed.contains(other) || self.base.contains(other);
            let free = found.into_iter().flatten().filter(|by| !by.iter().any(stays));
            self.obstacles.insert(part, free.map(BTreeSet::from_iter).collect());
        }
        Ok(&self.obstacles[&part])
    }
}

/// Whether the parts can leave in some order.
fn has_order(needed: &NeededParts) -> bool {
    let mut left = needed.parts.clone();
    loop {
        let waits = |part: &usize| needed.after.iter().any(|(a, b)| a == part && left.contains(b));
        let waiting: BTreeSet<usize> = left.iter().copied().filter(waits).collect();
        if waiting.is_empty() || waiting.len() == left.len() {
            return waiting.is_empty();
        }
        left = waiting;
    }
}
