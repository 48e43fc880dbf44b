//! An order of removals in which few parts have to be held at once.

use std::collections::HashSet;

use nalgebra::{Unit, Vector3};

use super::statics::{StandingSession, StandingState, StaticsQuery, answer, is_screwed_off};
use crate::budgets::STEADY_STATES;
use crate::geometry::{Assembly, Pose, scaled_pose};
use crate::plan::PlanStatus;
use crate::scene::{Scene, StandingParts, exit_direction};
use crate::search::{Outcome, Reason, Removal, SteadyOrder};
use crate::statics::{Stability, StaticsOptions};
use crate::termination::{Interrupt, Termination};

/// A removal as far as the order goes.
struct OrderedRemoval {
    /// The parts that it takes out of the assembly; none if it takes a group apart that is out.
    parts: Vec<usize>,
    /// The removals that come before it.
    requires: Vec<usize>,
    /// Of a single part, which has to end apart from the hull of all that stands, where it ends (shape frame to planning
    /// frame).
    end: Option<Pose>,
}

/// Where the order ends before all is removed.
#[derive(Debug, Clone, PartialEq, Eq)]
struct ShortOfHands {
    /// Of all removals that could come next, the one that needs the fewest hands; `None` if the parts need more as they
    /// stand.
    next: Option<usize>,
    /// What has to be held then.
    held: Vec<usize>,
}

/// What stands before the first removal.
pub(super) struct Standing<'a> {
    pub(super) assembly: &'a Assembly,
    pub(super) scene: &'a Scene,
    /// The parts that are there, ascending.
    pub(super) present: &'a [usize],
    /// Those that may not move.
    pub(super) fixed: &'a [usize],
}

impl Standing<'_> {
    /// Puts the removals of a search into an order in which few parts have to be held at once. If hands are limited, it ends
    /// before the first removal that needs more, in the longest order that was found. A note for the plan if the order cannot
    /// be chosen.
    pub(super) fn in_steady_order(
        &self,
        wanted: &SteadyOrder,
        outcome: &mut Outcome,
        termination: &Termination,
    ) -> Option<String> {
        let Self { assembly, scene, present, fixed } = *self;
        let stays: Vec<usize> = match [fixed, &outcome.base.parts].concat() {
            stays if stays.is_empty() => outcome.remaining.clone(),
            stays => stays,
        };
        if stays.is_empty() {
            return Some(
                "the steps are in the order of the search: nothing stays that could hold the rest".to_owned(),
            );
        }
        let query = StaticsQuery {
            options: StaticsOptions {
                up: Unit::new_normalize(Vector3::from(wanted.up)),
                friction: wanted.friction,
                ..StaticsOptions::default()
            },
            states: vec![StandingState {
                parts: present.iter().map(|&part| (part, Pose::identity())).collect(),
                stays,
            }],
            screwed: outcome
                .removals
                .iter()
                .filter(|removal| is_screwed_off(&removal.path))
                .flat_map(|removal| removal.parts.iter().copied())
                .collect(),
            ..StaticsQuery::default()
        };
        let limit = wanted.hands.map(|hands| hands.get() as usize);
        if outcome.removals.iter().any(|removal| removal.aside) {
            let short = limit.map(|limit| self.first_short(query, &outcome.removals, limit, termination));
            match short.unwrap_or(Ok(None)) {
                Ok(None) => {}
                Ok(Some(short)) => {
                    let order: Vec<usize> = (0..short.next.unwrap_or(0)).collect();
                    end_early(assembly, outcome, &order, limit.unwrap_or_default(), &short);
                }
                Err(interrupt) => end_interrupted(outcome, interrupt),
            }
            let words = "the steps are in the order of the search, and no other was looked for: parts are moved aside";
            return Some(words.to_owned());
        }
        let ordered = ordered(&outcome.removals);
        let found = StandingSession::new(assembly, scene, &query, termination).and_then(|mut session| {
            let stability = |standing: &[usize]| session.stability(standing);
            let is_out = |standing: &[usize], part, pose: &Pose| is_out(scene, standing, part, pose);
            SteadySearch { steps: &ordered, limit, stability, is_out }.run(present)
        });
        match found {
            Ok((order, None)) if order.len() < ordered.len() => {
                return Some("the steps are in the order of the search: no other was found".to_owned());
            }
            Ok((order, short)) => {
                if let Some(short) = short {
                    end_early(assembly, outcome, &order, limit.unwrap_or_default(), &short);
                } else {
                    outcome.removals = reordered(&outcome.removals, &order);
                }
            }
            Err(interrupt) => end_interrupted(outcome, interrupt),
        }
        None
    }

    /// The first of some removals, as they are ordered, that needs more hands than there are. `query` is about what stands
    /// before them.
    fn first_short(
        &self,
        query: StaticsQuery,
        removals: &[Removal],
        limit: usize,
        termination: &Termination,
    ) -> Result<Option<ShortOfHands>, Interrupt> {
        let to_input = 1.0 / self.assembly.scale;
        let first = query.states[0].clone();
        // Each state, with the removal that leads to it and the hands that move something meanwhile.
        let mut uses: Vec<(Option<usize>, usize)> = vec![(None, 0)];
        let mut states = vec![first];
        for (i, removal) in removals.iter().enumerate().filter(|(_, removal)| removal.of.is_none()) {
            let before = &states[states.len() - 1];
            let (moving, rest): (Vec<_>, Vec<_>) =
                before.parts.iter().copied().partition(|(part, _)| removal.parts.contains(part));
            let rest = StandingState { parts: rest, stays: before.stays.clone() };
            states.push(rest.clone());
            uses.push((Some(i), 1));
            if removal.aside {
                let motion = scaled_pose(&removal.motion(), to_input);
                let mut after = rest;
                after.parts.extend(moving.iter().map(|(part, pose)| (*part, motion * pose)));
                after.parts.sort_by_key(|(part, _)| *part);
                states.push(after);
                uses.push((Some(i), 0));
            }
        }
        let found = answer(self.assembly, self.scene, &StaticsQuery { states, ..query }, termination)?;
        let short =
            uses.into_iter().zip(&found.states).find(|((_, moving), state)| state.trouble() + moving > limit);
        Ok(short.map(|((next, _), state)| ShortOfHands { next, held: held(state) }))
    }
}

/// Ends an outcome whose order was not found in time.
fn end_interrupted(outcome: &mut Outcome, interrupt: Interrupt) {
    outcome.status = match interrupt {
        Interrupt::Cancelled => PlanStatus::Cancelled,
        Interrupt::DeadlinePassed => PlanStatus::Timeout,
    };
    let words = "the time was over before an order was found in which few parts have to be held";
    outcome.reason = Some(Reason::Limit(words.to_owned()));
}

/// Which removal has to come after which.
fn ordered(removals: &[Removal]) -> Vec<OrderedRemoval> {
    let ordered = |(i, removal): (usize, &Removal)| {
        let requires = removal.requires.iter().copied();
        match removal.alone() {
            Some(_) => OrderedRemoval {
                parts: removal.parts.clone(),
                requires: requires.collect(),
                end: removal.path.last().copied(),
            },
            // A group is out where it ends once all is gone that goes before it.
            None if removal.of.is_none() => {
                OrderedRemoval { parts: removal.parts.clone(), requires: (0..i).collect(), end: None }
            }
            // How a group lies matters to its own parts alone, which keep their order.
            None => {
                let siblings = (0..i).filter(|&other| removals[other].of == removal.of);
                OrderedRemoval { parts: Vec::new(), requires: requires.chain(siblings).collect(), end: None }
            }
        }
    };
    removals.iter().enumerate().map(ordered).collect()
}

/// The removals in another order (their places as they were), in which each comes after those that it requires. With more
/// parts out than a path requires, it is free all the same.
fn reordered(removals: &[Removal], order: &[usize]) -> Vec<Removal> {
    let mut places = vec![None; removals.len()];
    order.iter().enumerate().for_each(|(place, &removal)| places[removal] = Some(place));
    let place = |removal: usize| places[removal];
    let removal = |&number: &usize| {
        let removal = &removals[number];
        let mut requires: Vec<usize> = removal.requires.iter().filter_map(|&before| place(before)).collect();
        requires.sort_unstable();
        Removal { of: removal.of.and_then(place), requires, ..removal.clone() }
    };
    order.iter().map(removal).collect()
}

/// Ends the outcome with the removals of an order, for want of hands.
fn end_early(
    assembly: &Assembly,
    outcome: &mut Outcome,
    order: &[usize],
    limit: usize,
    short: &ShortOfHands,
) {
    let left = (0..outcome.removals.len()).filter(|number| !order.contains(number));
    let left: Vec<&Removal> = left.map(|number| &outcome.removals[number]).collect();
    let stay = left.iter().filter(|removal| removal.of.is_none()).flat_map(|removal| &removal.parts);
    outcome.remaining.extend(stay.copied().collect::<Vec<usize>>());
    // What is moved aside stays, too.
    outcome.remaining.sort_unstable();
    outcome.remaining.dedup();
    outcome.unfinished = outcome.remaining.clone();
    let names = |parts: &[usize]| {
        let names: Vec<&str> = parts.iter().map(|&part| assembly.parts[part].name.as_str()).collect();
        names.join(", ")
    };
    let held = format!("{} to hold {}", short.held.len(), names(&short.held));
    let hands = if limit == 1 { "1 hand".to_owned() } else { format!("{limit} hands") };
    let reason = match short.next {
        None => format!("As the parts stand, {hands} cannot hold them: {held}."),
        Some(next) => format!(
            "No order was found that {hands} can carry out. Where the longest one ends, the step that needs the fewest moves \
             {}: 1 for that, and {held}.",
            names(&outcome.removals[next].parts)
        ),
    };
    (outcome.status, outcome.reason) = (PlanStatus::Exhausted, Some(Reason::Limit(reason)));
    outcome.removals = reordered(&outcome.removals, order);
}

/// A search for the order, depth first.
struct SteadySearch<'a, S, O> {
    steps: &'a [OrderedRemoval],
    /// Of hands.
    limit: Option<usize>,
    /// How parts stand.
    stability: S,
    /// Whether a part at a pose of its shape is out of those that stand.
    is_out: O,
}

/// A state on the way.
struct SteadyState {
    standing: Vec<usize>,
    stability: Stability,
    /// The removals that could come next and were not looked at; the last one comes first.
    pending: Vec<usize>,
    /// Those that were, with what stands then.
    seen: Vec<(usize, Vec<usize>, Stability)>,
}

impl<S, O> SteadySearch<'_, S, O>
where
    S: FnMut(&[usize]) -> Result<Stability, Interrupt>,
    O: Fn(&[usize], usize, &Pose) -> bool,
{
    /// The longest order that was found, and why it is not longer if it is not whole.
    fn run(mut self, present: &[usize]) -> Result<(Vec<usize>, Option<ShortOfHands>), Interrupt> {
        let first = (self.stability)(present)?;
        if let Some(limit) = self.limit
            && first.trouble() > limit
        {
            return Ok((Vec::new(), Some(ShortOfHands { next: None, held: held(&first) })));
        }
        let mut order: Vec<usize> = Vec::new();
        let mut best: (Vec<usize>, Option<ShortOfHands>) = (Vec::new(), None);
        let mut failed: HashSet<Vec<usize>> = HashSet::new();
        let mut states = vec![self.state(present.to_vec(), first, &order)];
        while let Some(state) = states.last_mut() {
            if order.len() == self.steps.len() {
                return Ok((order, None));
            }
            let next = self.next(state)?;
            let is_short = |found: &Stability| self.limit.is_some_and(|limit| found.trouble() + 1 > limit);
            match next {
                Some((number, rest, found)) if !is_short(&found) => {
                    order.push(number);
                    if failed.contains(&sorted(&order)) {
                        order.pop();
                    } else {
                        let state = self.state(rest, found, &order);
                        states.push(state);
                    }
                }
                next => {
                    // All others need as many hands.
                    let short = next
                        .map(|(number, _, found)| ShortOfHands { next: Some(number), held: held(&found) });
                    if best.1.is_none() || order.len() > best.0.len() {
                        best = (order.clone(), short);
                    }
                    failed.insert(sorted(&order));
                    if failed.len() >= STEADY_STATES {
                        break;
                    }
                    states.pop();
                    order.pop();
                }
            }
        }
        Ok(best)
    }

    fn state(&self, standing: Vec<usize>, stability: Stability, order: &[usize]) -> SteadyState {
        let mut is_done = vec![false; self.steps.len()];
        order.iter().for_each(|&number| is_done[number] = true);
        let is_ready = |number: &usize| {
            !is_done[*number] && self.steps[*number].requires.iter().all(|&before| is_done[before])
        };
        let mut pending: Vec<usize> = (0..self.steps.len()).filter(is_ready).collect();
        // What has to be held goes first.
        let falling = stability.falling();
        pending.sort_by_key(|&number| !self.steps[number].parts.iter().any(|part| falling.contains(part)));
        pending.reverse();
        SteadyState { standing, stability, pending, seen: Vec::new() }
    }

    /// The removal that comes next: the first that needs no more hands than the state has, else one that needs the fewest.
    fn next(&mut self, state: &mut SteadyState) -> Result<Option<(usize, Vec<usize>, Stability)>, Interrupt> {
        let is_steady = |found: &Stability| found.trouble() <= state.stability.trouble();
        while !state.seen.iter().any(|(_, _, found)| is_steady(found)) {
            let Some(number) = state.pending.pop() else { break };
            let OrderedRemoval { parts, end, .. } = &self.steps[number];
            let rest: Vec<usize> =
                state.standing.iter().copied().filter(|part| !parts.contains(part)).collect();
            if let (Some(end), &[part]) = (end, &parts[..])
                && !(self.is_out)(&rest, part, end)
            {
                continue;
            }
            let found = (self.stability)(&rest)?;
            state.seen.push((number, rest, found));
        }
        let trouble = |place: &usize| state.seen[*place].2.trouble();
        let least = (0..state.seen.len()).min_by_key(trouble);
        Ok(least.map(|place| state.seen.remove(place)))
    }
}

fn sorted(order: &[usize]) -> Vec<usize> {
    let mut set = order.to_vec();
    set.sort_unstable();
    set
}

/// What has to be held, and what is not known to stand.
fn held(stability: &Stability) -> Vec<usize> {
    let sets = stability.unstable.iter().filter_map(|unstable| unstable.hold.first());
    let mut held: Vec<usize> = sets.flatten().chain(&stability.unknown).copied().collect();
    held.sort_unstable();
    held
}

/// Whether the hull of a part at a pose of its shape is apart from that of what stands.
fn is_out(scene: &Scene, standing: &[usize], part: usize, pose: &Pose) -> bool {
    standing.is_empty()
        || exit_direction(scene, &StandingParts::new(scene, standing.to_vec()), part, pose, None).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statics::Unstable;

    /// The order that is found of steps that take off one part each, where each state has the parts to hold that `held` says.
    fn found(
        requires: &[&[usize]],
        limit: Option<usize>,
        held: impl Fn(&[usize]) -> Vec<usize>,
    ) -> (Vec<usize>, Option<ShortOfHands>) {
        let step = |(part, requires): (usize, &&[usize])| OrderedRemoval {
            parts: vec![part],
            requires: requires.to_vec(),
            end: None,
        };
        let steps: Vec<OrderedRemoval> = requires.iter().enumerate().map(step).collect();
        let stability = |standing: &[usize]| {
            let hold = held(standing);
            let unstable = Unstable { falls: Vec::new(), hold: vec![hold.clone()], needs_clamping: false };
            let unstable = if hold.is_empty() { Vec::new() } else { vec![unstable] };
            Ok(Stability { unstable, ..Stability::default() })
        };
        let search =
            SteadySearch { steps: &steps, limit, stability, is_out: |_: &[usize], _, _: &Pose| true };
        let present: Vec<usize> = (0..=requires.len()).collect();
        search.run(&present).unwrap()
    }

    #[test]
    fn what_would_fall_goes_before_it_does() {
        // Part 2 falls as soon as part 0 is gone.
        let held = |standing: &[usize]| {
            if standing.contains(&2) && !standing.contains(&0) { vec![2] } else { Vec::new() }
        };
        assert_eq!(found(&[&[], &[], &[]], None, held), (vec![1, 2, 0], None));
        // It cannot, and is held for as short as possible.
        assert_eq!(found(&[&[], &[], &[0]], None, held), (vec![1, 0, 2], None));
    }

    #[test]
    fn an_order_that_leads_nowhere_is_taken_back() {
        // Once part 0 is gone and part 1 is there, taking off anything lets two fall.
        let held = |standing: &[usize]| match [0, 1, 2].map(|part| standing.contains(&part)) {
            [false, true, false] | [false, false, true] => vec![1, 2],
            _ => Vec::new(),
        };
        let requires: [&[usize]; 3] = [&[], &[], &[]];
        let (order, short) = found(&requires, Some(2), held);
        assert_eq!((order.len(), short), (3, None));
        assert_ne!(order[0], 0, "{order:?}");
        assert_eq!(found(&requires, Some(3), held).0.len(), 3);
    }

    /// Without a limit there is always a next step, unless a part that takes its turn is not out.
    #[test]
    fn an_order_that_cannot_go_on_gives_no_reason() {
        let steps = [OrderedRemoval { parts: vec![1], requires: vec![], end: Some(Pose::identity()) }];
        let stability = |_: &[usize]| Ok(Stability::default());
        let is_out = |_: &[usize], _, _: &Pose| false;
        let found = SteadySearch { steps: &steps, limit: None, stability, is_out }.run(&[0, 1]).unwrap();
        assert_eq!(found, (vec![], None));
    }

    #[test]
    fn for_want_of_hands_the_longest_order_ends_with_what_it_needs() {
        let short = |next, held: &[usize]| Some(ShortOfHands { next, held: held.to_vec() });
        let held = |standing: &[usize]| if standing.contains(&1) { Vec::new() } else { vec![2, 3] };
        let requires: [&[usize]; 3] = [&[], &[0], &[1]];
        assert_eq!(found(&requires, Some(2), held), (vec![0], short(Some(1), &[2, 3])));
        assert_eq!(found(&requires, Some(3), held), (vec![0, 1, 2], None));
        assert_eq!(found(&requires, Some(1), |_| vec![1, 2]), (vec![], short(None, &[1, 2])));
    }
}
