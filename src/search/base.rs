//! The base: the part that stays, and that the rest is taken off.
//!
//! A fitter leaves standing what is large, low and in touch with much: a base plate, a housing. So the choice is by the
//! sum of three shares: of the largest volume, of the most neighbours, and, with half the weight, of the way down to the
//! lowest part. Up is where most parts can go at first: screws leave away from what they are screwed into, and files do
//! not say which way an assembly stands. Whether a part lies under others matters less than whether it is the large
//! one: a table is put together on its top.

use nalgebra::Vector3;

use crate::plan::Base;
use crate::scene::{Body, Scene};
use crate::tolerances::HULL_MARGIN;

use super::problem::Problem;

/// Share. The weight of how low a part lies, against 1 for its size and 1 for its neighbours. Chosen, not derived: of
/// `gearbox_1stage`, whose halves are nearly equal, it chooses the lower one. At double, a small foot may be chosen before
/// the plate that stands on it; at half, of two equal plates the upper one, for a few neighbours more.
const LOW_WEIGHT: f64 = 0.5;

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

impl Problem<'_> {
    /// The part that the rest is best taken off, given which way is up. None where parts are fixed: the rest is taken off
    /// those.
    pub(super) fn chosen_base(&self, up: &Vector3<f64>) -> Option<Base> {
        let Self { scene, present, fixed, targets, .. } = self;
        let is_target = |part: &usize| targets.as_ref().is_some_and(|t| t.contains(part));
        if present.len() < 2 || present.iter().any(|part| fixed.contains(part)) {
            return None;
        }
        let candidates: Vec<Candidate> =
            present.iter().filter(|p| !is_target(p)).map(|&p| Candidate::of(scene, present, p, up)).collect();
        let most = |of: fn(&Candidate) -> f64| candidates.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (size, neighbours) = (most(|c| c.size), most(|c| c.neighbours as f64));
        let (highest, lowest) = (most(|c| c.low), -most(|c| -c.low));
        let share = |of: f64, all: f64| if all > 0.0 { of / all } else { 1.0 };
        let score = |c: &Candidate| {
            let down = share(highest - c.low, highest - lowest);
            share(c.size, size) + share(c.neighbours as f64, neighbours) + LOW_WEIGHT * down
        };
        let best = candidates.iter().rev().max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let words = [
            (best.size >= size).then(|| "it is the largest".to_owned()),
            (best.low <= lowest + HULL_MARGIN).then(|| "no other lies lower".to_owned()),
            Some(match best.neighbours {
                1 => "it touches 1 other".to_owned(),
                n => format!("it touches {n} others"),
            }),
        ];
        let reason = words.into_iter().flatten().collect::<Vec<_>>().join(", ");
        Some(Base { part: best.part, reason })
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
