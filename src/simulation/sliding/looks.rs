//! What the steps of a pair alone look at: each pose once, and, of translations, without fields and only at what may be
//! near.
//!
//! A pair is new in most changed questions, and is asked for a few short steps in six directions. Its surfaces are
//! sampled where they face each other alone, and all samples around the start are measured there once. Shifts change
//! signed distances by no more than their length: at each pose those are measured again that may have come near since
//! they were measured last.

use nalgebra::Point3;

use crate::budgets::LOOKS_BY_SAMPLES;
use crate::contact::sampled::{Around, Extent, Mover, Near, Vicinity};
use crate::geometry::Pose;
use crate::termination::Interrupt;
use crate::tolerances::{FREE_STEP, KNOWN_SAMPLE_STEPS};

use super::drive::contact_step;

/// Of lengths, as a share of these.
const ROUNDING: f64 = 1e-9;

/// What is around a part where its translations start, told without fields.
pub(super) struct Start {
    vicinity: Vicinity,
    centre: Point3<f64>,
    /// All with a gap below this are …
    radius: f64,
    /// … here.
    pub(super) near: Near,
}

impl Start {
    /// Of a part that is moved by no more than a step further than `least`, of which is asked what is within `reach`;
    /// none if that takes many looks, which depends on the question alone.
    pub(super) fn looked_at(
        mover: &Mover<'_>,
        other: usize,
        (least, reach): (f64, f64),
    ) -> Result<Option<Self>, Interrupt> {
        let radius = KNOWN_SAMPLE_STEPS * contact_step(&mover.body.shape) + reach;
        let vicinity = Vicinity::new(mover, other, least + FREE_STEP + radius);
        let near = vicinity.near(mover, Extent { radius, reach, most: LOOKS_BY_SAMPLES })?;
        Ok(near.map(|near| Self { vicinity, centre: mover.centre(), radius, near }))
    }
}

/// What is near a part at the poses of one motion, beside another.
pub(super) struct Looks<'a> {
    other: usize,
    reach: f64,
    shifted: Option<Shifted<'a>>,
    /// In the step that is being made: where, how far was looked, and what is there.
    seen: Vec<(Pose, f64, Near)>,
}

impl<'a> Looks<'a> {
    /// Of a translation, if there is a start; else by fields.
    pub(super) fn new(other: usize, reach: f64, start: Option<&'a Start>) -> Self {
        Self { other, reach, shifted: start.map(Shifted::from), seen: Vec::new() }
    }

    /// What a step from a pose begins with, that the one before may have ended at.
    pub(super) fn from(&mut self, mover: &Mover<'_>) -> Result<Near, Interrupt> {
        let mut near = self.within(self.reach, mover)?;
        if near.contacts.is_empty() {
            // How long the step may be is told by the clearance, which is told less well by samples that are passed by.
            near = self.all_within(self.reach, mover)?;
        }
        self.seen.clear();
        Ok(near)
    }

    fn within(&mut self, reach: f64, mover: &Mover<'_>) -> Result<Near, Interrupt> {
        let is_seen = |(pose, by, _): &&(Pose, f64, Near)| *pose == mover.pose && *by == reach;
        if let Some((.., near)) = self.seen.iter().find(is_seen) {
            return Ok(near.clone());
        }
        let known = self.shifted.as_mut().and_then(|shifted| shifted.near(mover, reach));
        let near = known.map_or_else(|| self.all_within(reach, mover), Ok)?;
        self.seen.push((mover.pose, reach, near.clone()));
        Ok(near)
    }

    fn all_within(&self, reach: f64, mover: &Mover<'_>) -> Result<Near, Interrupt> {
        let mut near = Near { contacts: Vec::new(), clearance: f64::INFINITY };
        match &self.shifted {
            Some(shifted) => {
                let all = Extent { radius: reach, reach, most: usize::MAX };
                near = shifted.start.vicinity.near(mover, all)?.unwrap_or(near);
            }
            None => mover.near_pair(self.other, reach, &mut near)?,
        }
        Ok(near)
    }
}

impl Around for Looks<'_> {
    /// Whether a step can be made is told by what enters at its end alone. What is merely near there matters only if
    /// another step follows: without fields it costs next to nothing.
    fn near(&mut self, mover: &Mover<'_>) -> Result<Near, Interrupt> {
        self.within(if self.shifted.is_some() { self.reach } else { 0.0 }, mover)
    }
}

/// What was around the start of a part that is shifted.
struct Shifted<'a> {
    start: &'a Start,
    /// Where it was looked, by the part's centre.
    at: Vec<Point3<f64>>,
    /// Of each contact around the start, the gap as measured last, and at which of these.
    last: Vec<(f64, u32)>,
}

impl<'a> Shifted<'a> {
    fn from(start: &'a Start) -> Self {
        let last = start.near.contacts.iter().map(|contact| (contact.gap, 0)).collect();
        Self { start, at: vec![start.centre], last }
    }

    /// What is near a pose, of what was around the start; none if that is too far away.
    fn near(&mut self, mover: &Mover<'_>, reach: f64) -> Option<Near> {
        let Start { near: around, radius, .. } = self.start;
        let here = mover.centre();
        let ways: Vec<f64> = self.at.iter().map(|there| (here - there).norm() * (1.0 + ROUNDING)).collect();
        let mut near = Near { contacts: Vec::new(), clearance: around.clearance.min(*radius) - ways[0] };
        if near.clearance < reach {
            return None;
        }
        for (contact, last) in around.contacts.iter().zip(&mut self.last) {
            let mut gap = last.0 - ways[last.1 as usize];
            if gap < reach {
                // Nearest to it is much the same triangle as at the start.
                let there = mover.remeasured(contact, f64::INFINITY)?;
                *last = (there.gap, self.at.len() as u32);
                if there.gap < reach {
                    near.contacts.push(there);
                    continue;
                }
                gap = there.gap;
            }
            near.clearance = near.clearance.min(gap);
        }
        self.at.push(here);
        Some(near)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{peg_in_hole, scene, vector};

    const REACH: f64 = 0.01;
    const LEAST: f64 = 0.1;
    const FAR: f64 = 100.0;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// What is near, as told by looks that remember, by a look at all samples around the start, and by fields.
        #[test]
        fn looks_that_remember_see_what_is_there(
            excess in prop_oneof![Just(-0.01), Just(0.0), Just(5e-4)],
            shifts in prop::collection::vec(vector(0.2), 1..6),
        ) {
            let (scene, _) = scene(peg_in_hole(excess));
            let start = Mover::new(&scene, 1, scene.bodies[1].planning_from_shape);
            let around = Start::looked_at(&start.exactly(), 0, (LEAST, REACH)).unwrap().unwrap();
            let mut looks = Looks::new(0, REACH, Some(&around));
            for shift in [Vector3::zeros()].into_iter().chain(shifts) {
                let mut mover = start;
                mover.pose.translation.vector += shift;
                let told = |near: &Near| {
                    let mut told: Vec<i64> = near.contacts.iter().map(|c| (c.gap * 1e8).round() as i64).collect();
                    told.sort_unstable();
                    told
                };
                let mut by_fields = Near { contacts: Vec::new(), clearance: f64::INFINITY };
                mover.near_pair(0, REACH, &mut by_fields).unwrap();
                let remembered = looks.near(&mover.exactly()).unwrap();
                let all = looks.all_within(REACH, &mover.exactly()).unwrap();
                prop_assert_eq!(told(&remembered), told(&by_fields));
                prop_assert_eq!(told(&all), told(&by_fields));
                // No other sample is nearer than they say.
                let everything = Vicinity::new(&mover.exactly(), 0, FAR);
                let all_of_all = Extent { radius: FAR, reach: REACH, most: usize::MAX };
                let everything = everything.near(&mover.exactly(), all_of_all).unwrap().unwrap();
                let others = everything.contacts.iter().map(|c| c.gap).filter(|gap| *gap >= REACH);
                let nearest = others.fold(f64::INFINITY, f64::min);
                prop_assert!(remembered.clearance <= nearest + 1e-9 && all.clearance <= nearest + 1e-9);
                // Twice at one pose is the same.
                prop_assert_eq!(told(&looks.near(&mover.exactly()).unwrap()), told(&remembered));
            }
        }
    }
}
