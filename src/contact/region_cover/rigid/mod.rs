//! A cover for motions that turn: contacts of a part at the poses of a motion.
//!
//! One surface of each pair is in pieces, each in a convex region that the other surface does not enter; at the start
//! these are the regions of [`shift`](super::shift). A piece whose corners are in its region is outside the other
//! solid, whatever its motion was: a few planes replace hundreds of samples. Of a piece that leaves its region, the
//! corners inside the other solid are contacts; so are the points of the triangles whose planes it passed that lie
//! inside its solid. If no pair has a contact, the piece gets another region that holds it at both ends of the step,
//! or is split. A pair that takes too many regions is measured at samples from then on. Contacts that mattered are
//! kept from step to step and measured again.

mod pair;
mod piece;
#[cfg(test)]
mod tests;

use crate::geometry::Pose;
use crate::scene::{PosedPart, Scene, StandingParts};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::DEPTH_TOLERANCE;

use super::super::sampled::{ContactSet, ContactSource, MovingBody};
use pair::RigidPair;

/// The cover of all pairs of a moving part.
pub(crate) struct RigidCover<'a> {
    scene: &'a Scene,
    standing_parts: &'a StandingParts,
    part: usize,
    reach: f64,
    termination: &'a Termination,
    start: Pose,
    /// The pose at which all pieces are known to be free.
    base: Pose,
    /// The pose of the last query.
    looked_at: Option<Pose>,
    pairs: Vec<RigidPair<'a>>,
    /// Standing parts that are measured at samples.
    sampled: Vec<usize>,
    /// Whether all standing parts are.
    all_sampled: bool,
}

impl<'a> RigidCover<'a> {
    /// Measures everything at samples, or only what regions cannot cover.
    pub(crate) fn new(
        scene: &'a Scene,
        standing_parts: &'a StandingParts,
        PosedPart { part, pose: start }: PosedPart<'_>,
        reach: f64,
        all_sampled: bool,
        termination: &'a Termination,
    ) -> Self {
        Self {
            scene,
            standing_parts,
            part,
            reach,
            termination,
            start: *start,
            base: *start,
            looked_at: None,
            pairs: Vec::new(),
            sampled: Vec::new(),
            all_sampled,
        }
    }

    /// Whether some part that is or was near is measured at samples.
    pub(crate) fn samples(&self) -> bool {
        self.all_sampled || !self.sampled.is_empty()
    }

    /// Makes a pose the base of the next step, and returns the contacts there, computing them if they are not known
    /// yet.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn settle(
        &mut self,
        mover: &MovingBody<'_>,
        near: Option<ContactSet>,
    ) -> Result<ContactSet, Interrupt> {
        let mut near = match near {
            Some(near) if self.looked_at == Some(mover.pose) => near,
            _ => self.near(mover)?,
        };
        self.base = mover.pose;
        let mut told = Vec::with_capacity(self.pairs.len());
        // A pair that is out of reach gets a new cover when it comes near again.
        for mut pair in self.pairs.drain(..).filter(|pair| pair.is_near) {
            if !pair.is_left_to_samples && pair.settle(mover, self.reach, self.termination)? {
                told.push(pair);
            } else {
                self.sampled.push(pair.surfaces.other);
            }
        }
        self.pairs = told;
        for contact in self.pairs.iter().flat_map(|pair| &pair.known) {
            if !near.contacts.iter().any(|c| c.is_of_same_point(contact)) {
                near.contacts.push(*contact);
            }
        }
        Ok(near)
    }

    /// The index of a standing part's pair if regions cover it; adds the pair if it is new.
    fn pair_of(&mut self, other: usize) -> Result<Option<usize>, Interrupt> {
        if self.all_sampled || self.sampled.contains(&other) {
            return Ok(None);
        }
        if let Some(known) = self.pairs.iter().position(|pair| pair.surfaces.other == other) {
            return Ok(Some(known));
        }
        let is_start = self.base == self.start;
        match RigidPair::new(
            self.scene,
            PosedPart::new(self.part, &self.base),
            other,
            is_start,
            self.termination,
        )? {
            Some(pair) => {
                self.pairs.push(pair);
                Ok(Some(self.pairs.len() - 1))
            }
            None => {
                self.sampled.push(other);
                Ok(None)
            }
        }
    }
}

impl ContactSource for RigidCover<'_> {
    fn near(&mut self, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        self.pairs.iter_mut().for_each(|pair| pair.is_near = false);
        self.looked_at = Some(mover.pose);
        let (standing_parts, reach, base) = (self.standing_parts, self.reach, self.base);
        let mut left = Vec::new();
        let mut near = mover.near_by(standing_parts, reach, |other, near| {
            let Some(pair) = self.pair_of(other)? else { return mover.near_pair(other, reach, near) };
            left.extend(self.pairs[pair].near(&base, mover, reach, near).map(|l| (pair, l)));
            Ok(())
        })?;
        // A pose that is refused already needs no further contacts.
        if near.contacts.iter().any(|c| c.gap < -DEPTH_TOLERANCE) {
            return Ok(near);
        }
        for (pair, left) in left {
            self.pairs[pair].renewed(&left, mover, reach, &mut near)?;
        }
        Ok(near)
    }

    fn add_known(&mut self, mover: &MovingBody<'_>, near: &mut ContactSet) -> Result<(), Interrupt> {
        for pair in self.pairs.extract_if(.., |pair| pair.is_left_to_samples) {
            let other = pair.surfaces.other;
            near.contacts.retain(|c| c.other != other);
            mover.near_pair(other, self.reach, near)?;
            self.sampled.push(other);
        }
        for contact in self.pairs.iter().flat_map(|pair| &pair.known) {
            if !near.contacts.iter().any(|c| c.is_of_same_point(contact)) {
                let here = mover.remeasured(contact, self.reach).filter(|c| c.gap < self.reach);
                near.contacts.extend(here);
            }
        }
        Ok(())
    }

    fn is_clear_at(&mut self, between: &MovingBody<'_>) -> Result<bool, Interrupt> {
        Ok(self.pairs.iter_mut().all(|pair| pair.is_clear_at(between)))
    }
}
