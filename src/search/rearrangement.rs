//! Where all parts may stand: a search for moves after which some of them leave, where nothing leaves any more.
//!
//! A state is the shift of every part against one that stays. From a state, parts move together along an axis: a part
//! with all that it would meet at once, and what these would meet in turn. They leave if they meet nothing. Else they
//! stop where they meet another part, and at the critical places before (`critical_places`): where several of these fall
//! together, as in a grid, and amid the stretches between them. First come states that the fewest moves within the play of
//! parts, or to amid a stretch, lead to; of these, those that the fewest moves lead to.
//!
//! How far one part goes past another depends on where the two stand against each other alone, and is remembered: of
//! some thousand states, most need no new casts. What is found are claims, to be verified like every path.

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap, HashMap, HashSet, VecDeque};

use nalgebra::{Translation3, Vector3};
use rayon::prelude::*;

use crate::budgets::{EDGES_CAST_FOR_PLACES, PLACES_SEARCHED};
use crate::scene::StandingParts;
use crate::simulation::{Action, Axis, SweepQuestion, travel_to};
use crate::termination::Interrupt;
use crate::tolerances::{ROUNDED, SHORT_MOVE};

use super::critical_places::{AxisCoordinates, CriticalCoordinates, alignments};
use super::problem::Problem;
use super::state::least_travel;

/// Parts that move together along a line.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shift {
    /// Ascending.
    pub(super) parts: Vec<usize>,
    pub(super) along: Vector3<f64>,
}

/// Moves one after the other, and then parts that leave.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rearrangement {
    pub(super) shifts: Vec<Shift>,
    /// The parts that leave, ascending.
    pub(super) leaving: Vec<usize>,
    /// The push with which they do.
    pub(super) action: Action,
}

/// Where all parts stand.
struct PlaceState {
    /// By the place of a part among those that stand.
    shifts: Vec<Vector3<f64>>,
    /// The state that it was reached from, and how.
    parent: Option<(usize, Shift)>,
    /// The number of moves that led to it.
    moves: u32,
}

/// A pair of parts, by their places among those that stand, an axis, and the rounded shift of the first against the
/// second.
type TravelKey = (usize, usize, usize, [i64; 3]);

/// The search.
pub(super) struct PlaceSearch<'p, 'a> {
    problem: &'p Problem<'a>,
    /// Ascending.
    standing: Vec<usize>,
    axes: Vec<Axis>,
    /// The place among those that stand of the part that stays.
    still: usize,
    coordinates: CriticalCoordinates,
    /// How far the first of a pair goes along the axis until it meets the second.
    travels: HashMap<TravelKey, Option<f64>>,
    states: Vec<PlaceState>,
    known: HashSet<Vec<[i64; 3]>>,
    /// By the number of their moves.
    open: BinaryHeap<Reverse<(u32, usize)>>,
    /// States of which only those moves were tried that lead to where parts meet or fit.
    half_open: VecDeque<usize>,
    exits: Vec<Rearrangement>,
    edges: usize,
    searched: usize,
}

impl<'p, 'a> PlaceSearch<'p, 'a> {
    /// The search among some parts (ascending) that stand where the scene has them.
    pub(super) fn new(problem: &'p Problem<'a>, standing: &[usize], axes: Vec<Axis>) -> Self {
        let size = |&i: &usize| problem.scene.bodies[standing[i]].shape.mass.volume;
        let rank = |i: &usize| (!problem.may_move(standing[*i]), problem.release_of(standing[*i]));
        let still =
            (0..standing.len()).max_by(|a, b| rank(a).cmp(&rank(b)).then(size(a).total_cmp(&size(b))));
        let mut search = Self {
            problem,
            standing: standing.to_vec(),
            axes,
            still: still.unwrap_or_default(),
            coordinates: CriticalCoordinates::default(),
            travels: HashMap::new(),
            states: Vec::new(),
            known: HashSet::new(),
            open: BinaryHeap::new(),
            half_open: VecDeque::new(),
            exits: Vec::new(),
            edges: 0,
            searched: 0,
        };
        search.add(PlaceState { shifts: vec![Vector3::zeros(); standing.len()], parent: None, moves: 0 });
        search
    }

    /// The number of states that were searched.
    pub(super) fn searched(&self) -> usize {
        self.searched
    }

    /// The next moves after which some parts leave; `None` if there are no further states, or the budget is used up.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn next_exit(&mut self) -> Result<Option<Rearrangement>, Interrupt> {
        while self.exits.is_empty() && self.edges < EDGES_CAST_FOR_PLACES && self.searched < PLACES_SEARCHED {
            self.problem.termination.check()?;
            let (state, fits) = match self.open.pop() {
                Some(Reverse((_, state))) => (state, true),
                None => match self.half_open.pop_front() {
                    Some(state) => (state, false),
                    None => break,
                },
            };
            if fits {
                self.searched += 1;
                self.cast(state)?;
                self.half_open.push_back(state);
            }
            for axis in 0..self.axes.len() {
                for forward in [true, false] {
                    self.expand(state, (axis, forward), fits);
                }
            }
            // The smallest group first, and the last one is taken first.
            self.exits.sort_by_key(|exit| Reverse(exit.leaving.len()));
        }
        Ok(self.exits.pop())
    }

    /// Casts all pairs of a state that are not known.
    fn cast(&mut self, state: usize) -> Result<(), Interrupt> {
        let shifts = &self.states[state].shifts;
        let count = shifts.len();
        let pairs = (0..count).flat_map(|p| (0..count).map(move |q| (p, q))).filter(|(p, q)| p != q);
        let all = pairs.flat_map(|(p, q)| (0..self.axes.len()).map(move |axis| (p, q, axis)));
        let mut missing: Vec<(TravelKey, Vector3<f64>)> = all
            .map(|(p, q, axis)| (key(p, q, axis, shifts), shifts[p] - shifts[q]))
            .filter(|(key, _)| !self.travels.contains_key(key))
            .collect();
        missing.sort_by_key(|(key, _)| *key);
        let nothing = StandingParts { standing: Vec::new(), hull: Vec::new() };
        let Problem { scene, termination, .. } = self.problem;
        let cast = |&((p, q, axis, _), shift): &(TravelKey, Vector3<f64>)| {
            let start = Translation3::from(shift) * scene.bodies[self.standing[p]].planning_from_shape;
            let question = SweepQuestion {
                scene,
                standing_parts: &nothing,
                part: self.standing[p],
                start: &start,
                direction: &self.axes[axis].unit(),
            };
            travel_to(&question, self.standing[q], termination)
        };
        let found: Vec<(Option<f64>, usize)> =
            missing.par_iter().map(cast).collect::<Result<_, Interrupt>>()?;
        for ((key, _), (travel, edges)) in missing.into_iter().zip(found) {
            self.edges += edges;
            self.travels.insert(key, travel);
        }
        Ok(())
    }

    /// How far a part goes from a state until it meets another.
    fn travel(&self, state: usize, [p, q]: [usize; 2], axis: usize, forward: bool) -> Option<f64> {
        let shifts = &self.states[state].shifts;
        // Only the relative motion counts.
        let (p, q) = if forward { (p, q) } else { (q, p) };
        self.travels.get(&key(p, q, axis, shifts)).copied().flatten()
    }

    /// Adds the states that moves along an axis lead to, and exits: if it `fits`, those where parts meet or fit, and else
    /// all others.
    fn expand(&mut self, state: usize, (axis, forward): (usize, bool), fits: bool) {
        let count = self.standing.len();
        let mut groups: BTreeSet<Vec<usize>> = BTreeSet::new();
        for seed in 0..count {
            for play in [true, false] {
                groups.extend(self.group(state, seed, (axis, forward), play));
            }
        }
        for group in groups {
            let is_in = |p: &usize| group.binary_search(p).is_ok();
            let rest: Vec<usize> = (0..count).filter(|p| !is_in(p)).collect();
            let pairs = group.iter().flat_map(|&p| rest.iter().map(move |&q| [p, q]));
            let met = pairs.filter_map(|pair| self.travel(state, pair, axis, forward)).min_by(f64::total_cmp);
            // Only the relative motion counts: the part that stays does so if the others may move.
            let (moving, forward) = if is_in(&self.still) { (&rest, !forward) } else { (&group, forward) };
            if moving.is_empty() || !moving.iter().all(|&p| self.problem.may_move(self.standing[p])) {
                continue;
            }
            let action = Action::Push(self.axes[axis], forward);
            let parts: Vec<usize> = moving.iter().map(|&p| self.standing[p]).collect();
            let Some(met) = met else {
                if !fits {
                    continue;
                }
                let shifts = self.shifts_to(state);
                self.exits.push(Rearrangement { shifts, leaving: parts, action });
                continue;
            };
            for length in self.stops(state, moving, (axis, forward), met, fits) {
                let along = action.force() * length;
                let mut shifts = self.states[state].shifts.clone();
                moving.iter().for_each(|&p| shifts[p] += along);
                let moves = self.states[state].moves + 1;
                let parent = Some((state, Shift { parts: parts.clone(), along }));
                self.add(PlaceState { shifts, parent, moves });
            }
        }
    }

    /// A part with all that it meets at once, in turn; with `play`, also what it meets within a short move. `None` if that
    /// is everything.
    fn group(
        &self,
        state: usize,
        seed: usize,
        (axis, forward): (usize, bool),
        play: bool,
    ) -> Option<Vec<usize>> {
        let count = self.standing.len();
        let mut group = BTreeSet::from([seed]);
        let mut open = vec![seed];
        while let Some(p) = open.pop() {
            for q in (0..count).filter(|q| !group.contains(q)).collect::<Vec<_>>() {
                let near =
                    if play { self.short(p).min(self.short(q)) } else { self.least(p).min(self.least(q)) };
                if self.travel(state, [p, q], axis, forward).is_some_and(|met| met < near) {
                    group.insert(q);
                    open.push(q);
                }
            }
        }
        (group.len() < count).then(|| group.into_iter().collect())
    }

    /// How far some parts move along an axis until they meet another or come to a place before that where several
    /// critical places fall together, beyond their play; or, unless it `fits`, within their play, and to amid the stretches
    /// between these places.
    fn stops(
        &mut self,
        state: usize,
        moving: &[usize],
        (axis, forward): (usize, bool),
        met: f64,
        fits: bool,
    ) -> Vec<f64> {
        let short = moving.iter().map(|&p| self.short(p)).fold(f64::INFINITY, f64::min);
        let least = moving.iter().map(|&p| self.least(p)).fold(f64::INFINITY, f64::min);
        if met < least {
            return Vec::new();
        }
        let mine = self.coordinates_of(state, axis, moving);
        let rest: Vec<usize> = (0..self.standing.len()).filter(|p| !moving.contains(p)).collect();
        let still = self.coordinates_of(state, axis, &rest);
        let range = if forward { [0.0, met] } else { [-met, 0.0] };
        let mut places: Vec<f64> = [(&still.critical, &mine.critical), (&still.centres, &mine.centres)]
            .into_iter()
            .flat_map(|(still, mine)| alignments(still, mine, range))
            .map(f64::abs)
            .collect();
        places.sort_by(f64::total_cmp);
        let together = places.chunk_by(|a, b| b - a < short / 2.0);
        // Of places that count as one, the first that is added stays: where parts fit rather than where they meet.
        let mut stops: Vec<f64> = together.map(|some| (some[0] + some[some.len() - 1]) / 2.0).collect();
        stops.push(met);
        if fits {
            stops.retain(|length| *length >= short);
        } else {
            let from = [0.0].into_iter().chain(stops.iter().copied());
            let amid = from.zip(&stops).map(|(from, to)| (from + to) / 2.0).collect::<Vec<_>>();
            stops.retain(|length| *length < short);
            stops.extend(amid);
        }
        stops.retain(|length| *length >= least && *length <= met);
        stops
    }

    /// The coordinates of some parts along an axis, as they stand in a state.
    fn coordinates_of(&mut self, state: usize, axis: usize, parts: &[usize]) -> AxisCoordinates {
        let along = self.axes[axis].unit().into_inner();
        let mut all = AxisCoordinates::default();
        for &p in parts {
            let own =
                self.coordinates.of_all(&self.problem.scene, &[self.standing[p]], (axis, self.axes[axis]));
            let shift = along.dot(&self.states[state].shifts[p]);
            all.critical.extend(own.critical.iter().map(|x| x + shift));
            all.centres.extend(own.centres.iter().map(|x| x + shift));
        }
        all.critical.sort_by(f64::total_cmp);
        all.centres.sort_by(f64::total_cmp);
        all
    }

    /// Adds a state unless one like it is known.
    fn add(&mut self, state: PlaceState) {
        let still = state.shifts[self.still];
        let like = |(p, shift): (usize, &Vector3<f64>)| {
            let cell = (self.short(p) / 4.0).max(ROUNDED);
            (shift - still).map(|x| (x / cell).round() as i64).into()
        };
        let places: Vec<[i64; 3]> = state.shifts.iter().enumerate().map(like).collect();
        if self.known.insert(places) {
            self.open.push(Reverse((state.moves, self.states.len())));
            self.states.push(state);
        }
    }

    /// The moves that lead to a state.
    fn shifts_to(&self, state: usize) -> Vec<Shift> {
        let mut shifts = Vec::new();
        let mut at = state;
        while let Some((parent, shift)) = &self.states[at].parent {
            shifts.push(shift.clone());
            at = *parent;
        }
        shifts.reverse();
        shifts
    }

    /// The length below which a move of a part is within its play.
    fn short(&self, p: usize) -> f64 {
        let shape = &self.problem.scene.bodies[self.standing[p]].shape;
        SHORT_MOVE * shape.thickness().min(shape.bounds().extents().min())
    }

    /// The length below which it is none.
    fn least(&self, p: usize) -> f64 {
        least_travel(&self.problem.scene, self.standing[p])
    }
}

fn key(p: usize, q: usize, axis: usize, shifts: &[Vector3<f64>]) -> TravelKey {
    (p, q, axis, (shifts[p] - shifts[q]).map(|x| (x / ROUNDED).round() as i64).into())
}
