//! The base: the parts that stay, and that the rest is taken off. The request gives them, or else one is chosen.
//!
//! A fitter leaves standing what is large, low and in touch with much: a base plate, a housing. So the choice is by the
//! sum of three shares: of the largest volume, of the most neighbours, and, with half the weight, of the way down to the
//! lowest part. Up is where most parts can go at first: screws leave away from what they are screwed into, and files do
//! not say which way an assembly stands. Whether a part lies under others matters less than whether it is the large
//! one: a table is put together on its top.
//!
//! The base leaves only where nothing else does. Then another one is chosen of what is left. If what is lifted off it is
//! larger than what stays, and has a part that is about as good a base, that part becomes the base instead: the key of a
//! burr leaves the other pieces, not they the key.

use nalgebra::Vector3;

use crate::plan::Base;
use crate::scene::{Body, Scene};
use crate::tolerances::HULL_MARGIN;

use super::problem::Problem;

/// Share. The weight of how low a part lies, against 1 for its size and 1 for its neighbours. Chosen, not derived: of
/// `gearbox_1stage`, whose halves are nearly equal, it chooses the lower one. At double, a small foot may be chosen before
/// the plate that stands on it; at half, of two equal plates the upper one, for a few neighbours more.
const LOW_WEIGHT: f64 = 0.5;
/// Share of the score of a base from which on another part is about as good. Chosen, not derived: the pieces of a burr,
/// which differ mainly in how low they lie, are above it; the parts of a machine on a large plate are below it. At half, the
/// plate is pulled from under that machine; above 1, a burr is lifted off its key.
const AS_GOOD: f64 = 0.75;

/// A part as a base.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    part: usize,
    /// Its volume.
    size: f64,
    /// The number of parts whose boxes touch its box.
    neighbours: usize,
    /// The height of its lowest corner.
    low: f64,
}

/// The parts that may be chosen, among those that stand.
struct Candidates {
    all: Vec<Candidate>,
    /// The largest volume, and the most neighbours.
    most: (f64, f64),
    /// The lowest and the highest of their lowest corners.
    heights: (f64, f64),
}

impl Problem<'_> {
    /// The part that the rest is best taken off, given what stands and which way is up. None where parts are fixed: the
    /// rest is taken off those.
    pub(super) fn chosen_base(&self, standing: &[usize], up: &Vector3<f64>) -> Base {
        let Some(candidates) = Candidates::of(self, standing, up) else { return Base::default() };
        candidates.best(|_| true).map_or_else(Base::default, |best| candidates.base(best))
    }

    /// The base where some parts are found to leave the chosen one: a part of theirs, if they are larger than what stays,
    /// and one is about as good.
    pub(super) fn base_among(
        &self,
        leaving: &[usize],
        standing: &[usize],
        up: &Vector3<f64>,
    ) -> Option<Base> {
        let volume = |parts: &[usize]| -> f64 {
            parts.iter().map(|&part| self.scene.bodies[part].shape.mass.volume).sum()
        };
        let is_larger = 2.0 * volume(leaving) > volume(standing);
        if self.base.reason.is_none() || !is_larger {
            return None;
        }
        let candidates = Candidates::of(self, standing, up)?;
        let best = candidates.best(|part| leaving.contains(&part))?;
        let now = candidates.all.iter().find(|c| self.base.parts.contains(&c.part))?;
        let is_as_good = candidates.score(best) >= AS_GOOD * candidates.score(now);
        is_as_good.then(|| candidates.base(best))
    }
}

impl Candidates {
    fn of(problem: &Problem<'_>, standing: &[usize], up: &Vector3<f64>) -> Option<Self> {
        let Problem { scene, fixed, targets, keep_out, .. } = problem;
        let is_target = |part: &usize| targets.as_ref().is_some_and(|t| t.contains(part));
        let standing: Vec<usize> = standing.iter().copied().filter(|part| !keep_out.contains(part)).collect();
        if standing.len() < 2 || standing.iter().any(|part| fixed.contains(part)) {
            return None;
        }
        let free = standing.iter().filter(|part| !is_target(part));
        let all: Vec<Candidate> = free.map(|&part| Candidate::of(scene, &standing, part, up)).collect();
        let most = |of: fn(&Candidate) -> f64| all.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let heights = (-most(|c| -c.low), most(|c| c.low));
        let most = (most(|c| c.size), most(|c| c.neighbours as f64));
        Some(Self { all, most, heights })
    }

    /// The first of those with the highest score.
    fn best(&self, is_asked: impl Fn(usize) -> bool) -> Option<&Candidate> {
        let asked = self.all.iter().rev().filter(|c| is_asked(c.part));
        asked.max_by(|a, b| self.score(a).total_cmp(&self.score(b)))
    }

    fn score(&self, c: &Candidate) -> f64 {
        let share = |of: f64, all: f64| if all > 0.0 { of / all } else { 1.0 };
        let ((size, neighbours), (lowest, highest)) = (self.most, self.heights);
        let down = share(highest - c.low, highest - lowest);
        share(c.size, size) + share(c.neighbours as f64, neighbours) + LOW_WEIGHT * down
    }

    /// A part as the base, and why.
    fn base(&self, chosen: &Candidate) -> Base {
        let words = [
            (chosen.size >= self.most.0).then(|| "it is the largest".to_owned()),
            (chosen.low <= self.heights.0 + HULL_MARGIN).then(|| "no other lies lower".to_owned()),
            Some(match chosen.neighbours {
                1 => "it touches 1 other".to_owned(),
                n => format!("it touches {n} others"),
            }),
        ];
        let reason = words.into_iter().flatten().collect::<Vec<_>>().join(", ");
        Base { parts: vec![chosen.part], reason: Some(reason) }
    }
}

impl Candidate {
    fn of(scene: &Scene, present: &[usize], part: usize, up: &Vector3<f64>) -> Self {
        let Body { bounds, shape, .. } = &scene.bodies[part];
        let touching = scene.broad_phase.meeting_of(present, &bounds.grown(HULL_MARGIN));
        Self {
            part,
            size: shape.mass.volume,
            neighbours: touching.into_iter().filter(|&other| other != part).count(),
            low: -bounds.support(&-up),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::problem;
    use super::*;
    use crate::fixtures::{cuboid, scene};

    /// Three cubes in a row; the one in the middle touches both others.
    fn chosen(leaving: &[usize], base: Base) -> Option<Vec<usize>> {
        let cube = |x: f64| cuboid([x, 0.0, 0.0], [x + 2.0, 2.0, 2.0]);
        let (scene, verifier) = scene(vec![cube(0.0), cube(2.0), cube(4.0)]);
        let problem = Problem { base, ..problem(scene, &verifier) };
        problem.base_among(leaving, &[0, 1, 2], &Vector3::z()).map(|base| base.parts)
    }

    #[test]
    fn the_larger_side_stays_if_it_has_as_good_a_base() {
        let base = |part: usize| Base { parts: vec![part], reason: Some("it is the largest".into()) };
        assert_eq!(chosen(&[1, 2], base(0)), Some(vec![1]));
        assert_eq!(chosen(&[2], base(0)), None, "two cubes stay");
        assert_eq!(chosen(&[1, 2], Base { reason: None, ..base(0) }), None, "the request gave it");
    }

    #[test]
    fn a_part_in_touch_with_more_is_chosen() {
        let cube = |x: f64| cuboid([x, 0.0, 0.0], [x + 2.0, 2.0, 2.0]);
        let (scene, verifier) = scene(vec![cube(0.0), cube(2.0), cube(4.0)]);
        let problem = problem(scene, &verifier);
        let base = problem.chosen_base(&[0, 1, 2], &Vector3::z());
        assert_eq!(base.parts, [1]);
        assert_eq!(
            base.reason.as_deref(),
            Some("it is the largest, no other lies lower, it touches 2 others")
        );
        let wanted = Problem { targets: Some(vec![1]), ..problem.clone() };
        assert_eq!(wanted.chosen_base(&[0, 1, 2], &Vector3::z()).parts, [0]);
        let fixed = Problem { fixed: vec![2], ..problem };
        assert_eq!(fixed.chosen_base(&[0, 1, 2], &Vector3::z()), Base::default());
        // What is only in the way is none, and leaves the choice.
        let in_the_way = Problem { keep_out: vec![2], ..fixed };
        assert_eq!(in_the_way.chosen_base(&[0, 1, 2], &Vector3::z()).parts, [0]);
    }
}
