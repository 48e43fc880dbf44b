//! What must be done before a part's very path is free.
//!
//! A path was verified past the parts that stood. Here it is verified past each part that had left, too, where that
//! stood assembled: the path requires those that it enters to be out, and no other. For this to say something, the
//! path leads out of all parts that were there at the start, and not only of those that still stand.
//!
//! A part that was moved aside had several places. Done is only what is required, in turn; so each part stands after as
//! many of its moves as are required, and is required to make the next one where the path enters it there.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use nalgebra::{Translation3, Vector3};

use crate::geometry::{Pose, gap_along, transformed};
use crate::scene::{Scene, StandingParts, exit_direction};
use crate::termination::Interrupt;
use crate::tolerances::{ALONG_HULL, HULL_CLEARANCE, HULL_MARGIN};

use super::outcome::{Outcome, Removal};
use super::problem::Problem;
use super::release::Release;

/// A body that leaves what stands.
#[derive(Clone, Copy)]
pub(super) struct Leaving<'p, 'a> {
    /// The question about the scene in which the body is.
    pub(super) problem: &'p Problem<'a>,
    /// A part, or the body of a group.
    pub(super) body: usize,
    /// All that stands beside it.
    pub(super) around: &'p StandingParts,
    /// Whether it is only moved aside.
    pub(super) aside: bool,
}

impl Leaving<'_, '_> {
    /// Its removal, after some others, along a path past all that stands, with what it requires. A path that leads out is
    /// led on until it is out of everything.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn removal(
        self,
        earlier: &[Removal],
        path: Vec<Pose>,
        depth: f64,
    ) -> Result<Removal, Interrupt> {
        let Self { problem, body, aside, .. } = self;
        let path = if aside { path } else { self.led_out(earlier, path) };
        let parts = problem.scene.members(&body).to_vec();
        let places = EarlierPlaces::new(problem, body, &path, earlier);
        let moved_before = |i: &usize| earlier[*i].parts.iter().any(|part| parts.contains(part));
        // Its path begins where the earlier ones of its parts end.
        let mut requires: BTreeSet<usize> = (0..earlier.len()).filter(moved_before).collect();
        let mut depths = Depths::new();
        loop {
            let done = closed(&requires, earlier);
            let others = places.moves.iter().filter(|(part, _)| !parts.contains(part));
            // Where each part stands if only that is done; where all its moves are, the path was verified.
            let standing = others.filter_map(|(&part, moves)| {
                let count = moves.iter().filter(|&i| done.contains(i)).count();
                (count < moves.len()).then_some((part, count))
            });
            let standing: Vec<EarlierPlace> = standing.collect();
            let unknown: Vec<_> = standing.iter().filter(|at| !depths.contains_key(at)).copied().collect();
            depths.extend(places.depths_past(self, &unknown, &path)?);
            let entered: Vec<usize> = standing
                .iter()
                .filter(|at| depths.get(at) == Some(&None))
                .map(|(part, count)| places.moves[part][*count])
                .collect();
            if entered.is_empty() {
                let depth = standing.iter().filter_map(|at| *depths.get(at)?).fold(depth, f64::max);
                let wave = done.iter().map(|&i| earlier[i].wave + 1).max().unwrap_or(0);
                let requires = requires.into_iter().collect();
                return Ok(Removal { parts, of: None, aside, path, depth, requires, wave });
            }
            requires.extend(entered);
        }
    }

    /// A path that ends apart from the hull of all that stands, continued until that is as far away as asked for, and until
    /// it is apart from all that was there at the start. It goes on as it came, or straight away from the hull where it
    /// came along it. On both ways, nothing of the hull is met.
    pub(super) fn led_out(self, earlier: &[Removal], mut path: Vec<Pose>) -> Vec<Pose> {
        let Self { problem: Problem { scene, end_gap, clearance, .. }, body, around, .. } = self;
        let Some(&end) = path.last() else { return path };
        let last = last_leg(&path);
        // It points to where the others lie.
        let Some(towards) = exit_direction(scene, around, body, &end, last.map(|d| -d)) else {
            return path;
        };
        let away = -towards;
        // Straight away from the hull, the part comes nearer to nothing.
        let straight = last.filter(|d| *clearance == 0.0 && d.dot(&away) >= ALONG_HULL);
        let along = straight.unwrap_or(away);
        let hull = transformed(&scene.bodies[body].shape.hull, &end);
        let gap = gap_along(&towards, &hull, &around.hull);
        let usual = || HULL_CLEARANCE * scene.bodies[body].bounds.extents().amax();
        let end_gap = end_gap.unwrap_or_else(usual).max(*clearance);
        let near = hull.iter().map(|p| p.coords.dot(&along)).fold(f64::INFINITY, f64::min);
        let gone = earlier.iter().flat_map(|r| &r.parts).map(|&p| scene.bodies[p].bounds.support(&along));
        let past_gone = gone.fold(f64::NEG_INFINITY, f64::max) + HULL_MARGIN - near;
        let further = past_gone.max((end_gap - gap) / along.dot(&away));
        if further > 0.0 {
            if last == Some(along) {
                path.pop();
            }
            path.push(Translation3::from(along * further) * end);
        }
        path
    }
}

/// All that some removals require, in turn, and these themselves.
fn closed(removals: &BTreeSet<usize>, all: &[Removal]) -> BTreeSet<usize> {
    let mut closure = BTreeSet::new();
    let mut open: Vec<usize> = removals.iter().copied().collect();
    while let Some(i) = open.pop() {
        if closure.insert(i) {
            open.extend(&all[i].requires);
        }
    }
    closure
}

/// A part, and how many of its moves are done.
type EarlierPlace = (usize, usize);

/// How deep a path gets past parts at earlier places; `None` where it is refused.
type Depths = HashMap<EarlierPlace, Option<f64>>;

/// Where parts stood before they left, or were moved aside.
struct EarlierPlaces<'s> {
    scene: &'s Scene,
    earlier: &'s [Removal],
    /// By part that the path may meet where it stood last, or that was moved aside: its removals, in order.
    moves: BTreeMap<usize, Vec<usize>>,
}

impl<'s> EarlierPlaces<'s> {
    /// Of a scene in which each part stands where it stood last, and the path of a body.
    fn new(problem: &'s Problem<'_>, body: usize, path: &[Pose], earlier: &'s [Removal]) -> Self {
        let parts_of = |of: fn(&&Removal) -> bool| earlier.iter().filter(of).flat_map(|r| &r.parts).copied();
        let mut gone: Vec<usize> = parts_of(|r| !r.aside).collect();
        gone.sort_unstable();
        let mut met = problem.near(&gone, body, path);
        met.extend(parts_of(|r| r.aside));
        let mut moves: BTreeMap<usize, Vec<usize>> = met.into_iter().map(|part| (part, Vec::new())).collect();
        for (i, removal) in earlier.iter().enumerate() {
            for part in &removal.parts {
                if let Some(moves) = moves.get_mut(part) {
                    moves.push(i);
                }
            }
        }
        Self { scene: &problem.scene, earlier, moves }
    }

    /// Where a part stood after some of its moves: in the scene, but for moves aside that came after these.
    fn place(&self, part: usize, count: usize) -> Pose {
        let undone = self.moves[&part][count..].iter().rev().map(|&i| &self.earlier[i]).filter(|r| r.aside);
        undone
            .fold(self.scene.bodies[part].planning_from_shape, |at, removal| removal.motion().inverse() * at)
    }

    /// How deep a path gets past parts after some of their moves; `None` where it is refused.
    fn depths_past(
        &self,
        leaving: Leaving<'_, '_>,
        parts: &[EarlierPlace],
        path: &[Pose],
    ) -> Result<Depths, Interrupt> {
        let mut depths = Depths::new();
        let is_elsewhere =
            |(part, count): &&EarlierPlace| self.moves[part][*count..].iter().any(|&i| self.earlier[i].aside);
        let (elsewhere, here): (Vec<_>, Vec<_>) = parts.iter().partition(is_elsewhere);
        let here_parts: Vec<usize> = here.iter().map(|(part, _)| *part).collect();
        let past = leaving.problem.depths_past(&here_parts, leaving.body, path)?;
        depths.extend(here.into_iter().map(|at| {
            // What is far from the path is not asked about.
            let known = past.iter().find(|(part, _)| *part == at.0);
            (at, known.map_or(Some(0.0), |(_, depth)| *depth))
        }));
        for at in elsewhere {
            let scene = self.scene.with_placed(&[(at.0, self.place(at.0, at.1))]);
            let problem = Problem { scene, ..leaving.problem.clone() };
            let past = problem.depths_past(&[at.0], leaving.body, path)?;
            depths.insert(at, past.first().map_or(Some(0.0), |(_, depth)| *depth));
        }
        Ok(depths)
    }
}

/// Where parts stand after some removals that leave the assembly or are moved aside in it: those that were moved aside.
pub(super) fn places_after(scene: &Scene, removals: &[Removal]) -> Vec<(usize, Pose)> {
    let mut places: BTreeMap<usize, Pose> = BTreeMap::new();
    for removal in removals.iter().filter(|r| r.aside && r.of.is_none()) {
        for &part in &removal.parts {
            let place = places.entry(part).or_insert(scene.bodies[part].planning_from_shape);
            *place = removal.motion() * *place;
        }
    }
    places.into_iter().collect()
}

impl<'a> Problem<'a> {
    /// The question about what remains after a search that was not complete.
    pub(super) fn after(&self, outcome: &Outcome) -> Self {
        Problem {
            scene: self.scene.with_placed(&places_after(&self.scene, &outcome.removals)),
            present: outcome.remaining.clone(),
            base: outcome.base.clone(),
            released: Release::Nothing,
            spent: self.spent + outcome.counters.simulations,
            earlier: outcome.removals.clone(),
            ..self.clone()
        }
    }
}

/// The unit vector of the last leg of a path, if that does not turn.
fn last_leg(path: &[Pose]) -> Option<Vector3<f64>> {
    let [.., from, to] = path else { return None };
    let shift = to.translation.vector - from.translation.vector;
    (from.rotation == to.rotation).then(|| shift.try_normalize(0.0)).flatten()
}

/// A complete outcome without the removals that no target requires: what is left stands as verified as before.
pub(super) fn without_needless(outcome: Outcome, targets: &[usize]) -> Outcome {
    let needed = outcome.removals.iter().map(|removal| frees(removal, &outcome.removals, targets)).collect();
    without_unrequired(outcome, needed)
}

/// An outcome without the removals that are not needed, and that none of the needed ones requires in turn.
pub(super) fn without_unrequired(outcome: Outcome, mut needed: Vec<bool>) -> Outcome {
    let Outcome { mut removals, mut remaining, .. } = outcome;
    for i in (0..removals.len()).rev() {
        if needed[i] {
            removals[i].requires.iter().for_each(|&j| needed[j] = true);
        }
    }
    // The numbers that the needed ones get.
    let numbers: Vec<usize> =
        needed.iter().scan(0, |next, &is| Some(std::mem::replace(next, *next + usize::from(is)))).collect();
    let needless = removals.iter().zip(&needed).filter(|(r, is)| !**is && r.of.is_none() && !r.aside);
    remaining.extend(needless.flat_map(|(r, _)| &r.parts));
    remaining.sort_unstable();
    let mut is_needed = needed.into_iter();
    removals.retain(|_| is_needed.next() == Some(true));
    let referred = removals.iter_mut().flat_map(|r| r.requires.iter_mut().chain(&mut r.of));
    referred.for_each(|number| *number = numbers[*number]);
    Outcome { removals, remaining, ..outcome }
}

/// Whether a removal takes a target out, or is one of those that leave a target behind alone.
fn frees(removal: &Removal, removals: &[Removal], targets: &[usize]) -> bool {
    let takes_alone = |r: &Removal, target: usize| r.parts[..] == [target] && !r.aside;
    let of_same_body = |r: &&Removal| r.of == removal.of;
    targets.iter().any(|&target| {
        let stands_there = match removal.of {
            Some(group) => removals[group].parts.contains(&target),
            None => true,
        };
        let leaves = |r: &Removal| r.parts.contains(&target) && !r.aside;
        takes_alone(removal, target) || stands_there && !removals.iter().filter(of_same_body).any(leaves)
    })
}
