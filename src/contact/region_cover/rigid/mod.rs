//! What is near a part that may turn.
//!
//! Of each pair one surface is in pieces, each with a convex region that the other surface does not
//! enter (those of [`shift`](super::shift) to begin with). A piece whose corners are in its region is
//! outside the other solid, however it came there: a few planes tell what hundreds of samples would have
//! to be measured for. Of what leaves its region, corners that are inside the other solid are contacts, or else
//! points inside it of the triangles whose planes it has passed. Where there are none in any pair, another
//! region is looked for that holds the piece at both ends of the step; else it is split. Where that takes too
//! many regions, samples tell of the pair from there on. Of contacts, those that were found to matter are kept
//! from step to step and measured again.

mod pair;
mod piece;
#[cfg(test)]
mod tests;

use crate::geometry::Pose;
use crate::scene::{Scene, StandingParts};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::DEPTH_TOLERANCE;

use super::super::sampled::{ContactSet, ContactSource, MovingBody};
use pair::RigidPair;

/// What is around a moving part.
pub(crate) struct RigidCover<'a> {
    scene: &'a Scene,
    standing_parts: &'a StandingParts,
    part: usize,
    reach: f64,
    termination: &'a Termination,
    start: Pose,
    /// The pose at which all pieces are known to be free.
    base: Pose,
    /// The pose that was looked at last.
    looked_at: Option<Pose>,
    pairs: Vec<RigidPair<'a>>,
    /// Standing parts that only samples tell of.
    sampled: Vec<usize>,
    /// Whether they tell of all.
    all_sampled: bool,
}

impl<'a> RigidCover<'a> {
    /// With samples alone, or with regions where these tell.
    pub(crate) fn new(
        scene: &'a Scene,
        standing_parts: &'a StandingParts,
        (part, start): (usize, &Pose),
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

    /// Whether samples tell of some part that is near or was.
    pub(crate) fn samples(&self) -> bool {
        self.all_sampled || !self.sampled.is_empty()
    }

    /// Goes on from a pose: what is near it, if that is not known yet.
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
        // What is out of reach is found anew when it comes near.
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

    /// Whether a standing part's pair is told by regions; takes it in if it is new.
    fn pair_of(&mut self, other: usize) -> Result<Option<usize>, Interrupt> {
        if self.all_sampled || self.sampled.contains(&other) {
            return Ok(None);
        }
        if let Some(known) = self.pairs.iter().position(|pair| pair.surfaces.other == other) {
            return Ok(Some(known));
        }
        let is_start = self.base == self.start;
        match RigidPair::new(self.scene, (self.part, &self.base), other, is_start, self.termination)? {
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
        // Of a pose that is refused already it does not matter what else may be entered.
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
