//! Contacts of one pair that are kept from pose to pose: each pose is measured once and, of translations, without
//! distance fields.
//!
//! A pair is new in most changed requests, and a few short steps in six directions are asked of it. Its surfaces are
//! sampled only where they face each other, and all samples around the start are measured there once. A shift changes a
//! signed distance by no more than its length: at each pose, only those samples are measured again that may have come
//! near since.

use nalgebra::Point3;

use crate::budgets::LOOKS_BY_SAMPLES;
use crate::geometry::Pose;
use crate::termination::Interrupt;
use crate::tolerances::{FREE_STEP, KNOWN_SAMPLE_STEPS};

use super::pair_samples::{GatherExtent, PairSamples};
use super::{ContactSet, ContactSource, MovingBody};

/// The rounding error of a length, as a share of it.
const ROUNDING: f64 = 1e-9;

/// The contacts around a part where its translations start.
pub(crate) struct StartContacts {
    vicinity: PairSamples,
    centre: Point3<f64>,
    /// `near` has all contacts with a smaller gap.
    radius: f64,
    pub(crate) near: ContactSet,
}

impl StartContacts {
    /// Contacts of a part that is moved in steps of length `step`, and no further than `least` and one free step, as
    /// far as needed to know all within `reach`. `None` if that takes many measurements; this depends on the arguments
    /// alone.
    ///
    /// # Errors
    /// The mover's termination condition became true.
    pub(crate) fn gather(
        mover: &MovingBody<'_>,
        other: usize,
        step: f64,
        (least, reach): (f64, f64),
    ) -> Result<Option<Self>, Interrupt> {
        let radius = KNOWN_SAMPLE_STEPS * step + reach;
        let vicinity = PairSamples::new(mover, other, least + FREE_STEP + radius);
        let near = vicinity.near(mover, GatherExtent { radius, reach, most: LOOKS_BY_SAMPLES })?;
        Ok(near.map(|near| Self { vicinity, centre: mover.centre(), radius, near }))
    }
}

/// The contacts of a part with one other at the poses of a motion.
pub(crate) struct ContactCache<'a> {
    other: usize,
    reach: f64,
    shifted: Option<Shifted<'a>>,
    /// In the current step: the pose, the reach, and the contacts.
    seen: Vec<(Pose, f64, ContactSet)>,
}

impl<'a> ContactCache<'a> {
    /// With the contacts around the start of a translation; without them, by fields.
    pub(crate) fn new(other: usize, reach: f64, start: Option<&'a StartContacts>) -> Self {
        Self { other, reach, shifted: start.map(Shifted::from), seen: Vec::new() }
    }

    /// The contacts from which a step starts; the last step may have ended there.
    pub(crate) fn at_start_of_step(&mut self, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        let mut near = self.within(self.reach, mover)?;
        if near.contacts.is_empty() {
            // The clearance bounds the step, and samples that were passed over tell it less well.
            near = self.all_within(self.reach, mover)?;
        }
        self.seen.clear();
        Ok(near)
    }

    fn within(&mut self, reach: f64, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        let is_seen = |(pose, by, _): &&(Pose, f64, ContactSet)| *pose == mover.pose && *by == reach;
        if let Some((.., near)) = self.seen.iter().find(is_seen) {
            return Ok(near.clone());
        }
        let known = self.shifted.as_mut().and_then(|shifted| shifted.near(mover, reach));
        let near = known.map_or_else(|| self.all_within(reach, mover), Ok)?;
        self.seen.push((mover.pose, reach, near.clone()));
        Ok(near)
    }

    fn all_within(&self, reach: f64, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        let mut near = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
        match &self.shifted {
            Some(shifted) => {
                let all = GatherExtent { radius: reach, reach, most: usize::MAX };
                near = shifted.start.vicinity.near(mover, all)?.unwrap_or(near);
            }
            None => mover.near_pair(self.other, reach, &mut near)?,
        }
        Ok(near)
    }
}

impl ContactSource for ContactCache<'_> {
    /// Only what enters at the end of a step decides whether it can be made. What is merely near there matters only if
    /// another step follows; without fields it costs next to nothing.
    fn near(&mut self, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        self.within(if self.shifted.is_some() { self.reach } else { 0.0 }, mover)
    }
}

/// The contacts around the start, for a part that was shifted from there.
struct Shifted<'a> {
    start: &'a StartContacts,
    /// The part's centre at each pose that was measured.
    at: Vec<Point3<f64>>,
    /// Of each contact around the start, the gap as measured last, and the pose (in `at`) of that.
    last: Vec<(f64, u32)>,
}

impl<'a> Shifted<'a> {
    fn from(start: &'a StartContacts) -> Self {
        let last = start.near.contacts.iter().map(|contact| (contact.gap, 0)).collect();
        Self { start, at: vec![start.centre], last }
    }

    /// The contacts at a pose; `None` if it is too far from the start.
    fn near(&mut self, mover: &MovingBody<'_>, reach: f64) -> Option<ContactSet> {
        let StartContacts { near: around, radius, .. } = self.start;
        let here = mover.centre();
        let ways: Vec<f64> = self.at.iter().map(|there| (here - there).norm() * (1.0 + ROUNDING)).collect();
        let mut near =
            ContactSet { contacts: Vec::new(), clearance: around.clearance.min(*radius) - ways[0] };
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
    use crate::tolerances::CONTACT_STEP;

    const REACH: f64 = 0.01;
    const LEAST: f64 = 0.1;
    const FAR: f64 = 100.0;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        /// The same contacts are found by the cache, by all samples around the start, and by fields.
        #[test]
        fn kept_contacts_are_those_that_are_there(
            excess in prop_oneof![Just(-0.01), Just(0.0), Just(5e-4)],
            shifts in prop::collection::vec(vector(0.2), 1..6),
        ) {
            let (scene, _) = scene(peg_in_hole(excess));
            let start = MovingBody::new(&scene, 1, scene.bodies[1].planning_from_shape);
            let around = StartContacts::gather(&start.exactly(), 0, CONTACT_STEP, (LEAST, REACH)).unwrap().unwrap();
            let mut cache = ContactCache::new(0, REACH, Some(&around));
            for shift in [Vector3::zeros()].into_iter().chain(shifts) {
                let mut mover = start;
                mover.pose.translation.vector += shift;
                let told = |near: &ContactSet| {
                    let mut told: Vec<i64> = near.contacts.iter().map(|c| (c.gap * 1e8).round() as i64).collect();
                    told.sort_unstable();
                    told
                };
                let mut by_fields = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
                mover.near_pair(0, REACH, &mut by_fields).unwrap();
                let remembered = cache.near(&mover.exactly()).unwrap();
                let all = cache.all_within(REACH, &mover.exactly()).unwrap();
                prop_assert_eq!(told(&remembered), told(&by_fields));
                prop_assert_eq!(told(&all), told(&by_fields));
                // No other sample is nearer than they say.
                let everything = PairSamples::new(&mover.exactly(), 0, FAR);
                let all_of_all = GatherExtent { radius: FAR, reach: REACH, most: usize::MAX };
                let everything = everything.near(&mover.exactly(), all_of_all).unwrap().unwrap();
                let others = everything.contacts.iter().map(|c| c.gap).filter(|gap| *gap >= REACH);
                let nearest = others.fold(f64::INFINITY, f64::min);
                prop_assert!(remembered.clearance <= nearest + 1e-9 && all.clearance <= nearest + 1e-9);
                // Twice at one pose is the same.
                prop_assert_eq!(told(&cache.near(&mover.exactly()).unwrap()), told(&remembered));
            }
        }
    }
}
