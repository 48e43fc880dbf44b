//! Samples of a pair that is measured a few times, without distance fields: filling these, and sampling all of both
//! surfaces, would take several times as long as the measurements.

use crate::geometry::{Bounds, Pose, SampleTree};

use crate::termination::Interrupt;

use super::nearby_samples::{GatherLimits, MeasuredBody, gather_exactly};
use super::{Contact, ContactSet, ContactSide, MovingBody};

/// How much to gather.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GatherExtent {
    /// Contacts with a smaller gap are gathered.
    pub(crate) radius: f64,
    /// Contacts with a smaller gap must be found with no more than `most` measurements on either surface.
    pub(crate) reach: f64,
    /// See `reach`.
    pub(crate) most: usize,
}

/// The samples of a moving and a standing part, both closed, that may come near each other.
pub(crate) struct PairSamples {
    other: usize,
    mine: SampleTree,
    theirs: SampleTree,
}

impl PairSamples {
    /// The samples that may come nearer to the other part than `way` while the body is shifted from its pose by no
    /// more than `way`.
    pub(crate) fn new(mover: &MovingBody<'_>, other: usize, way: f64) -> Self {
        let standing = &mover.scene.bodies[other];
        let (mine, theirs) = (&mover.body.shape, &standing.shape);
        let bounds = mine.bounds().transformed(&mover.pose);
        let within = |frame: &Pose, bounds: &Bounds| bounds.grown(2.0 * way).transformed(&frame.inverse());
        let (mine, theirs) = rayon::join(
            || mine.samples_within(&within(&mover.pose, &standing.bounds)),
            || theirs.samples_within(&within(&standing.planning_from_shape, &bounds)),
        );
        Self { other, mine, theirs }
    }

    /// The contacts at a pose; `None` if they take too many measurements.
    ///
    /// # Errors
    /// The mover's termination condition became true.
    pub(crate) fn near(
        &self,
        mover: &MovingBody<'_>,
        extent: GatherExtent,
    ) -> Result<Option<ContactSet>, Interrupt> {
        let side = |side| self.side(mover, side, extent);
        let (mine, theirs) = rayon::join(|| side(ContactSide::Moving), || side(ContactSide::Standing));
        let (Some(mut near), Some(theirs)) = (mine?, theirs?) else { return Ok(None) };
        near.add(theirs);
        Ok(Some(near))
    }

    fn side(
        &self,
        mover: &MovingBody<'_>,
        side: ContactSide,
        extent: GatherExtent,
    ) -> Result<Option<ContactSet>, Interrupt> {
        let other = self.other;
        let (sampled, body, to_measured, allowed) = mover.sides(side, other);
        let measured = MeasuredBody { body, to_measured: &to_measured, allowed, reach: extent.radius };
        let few = GatherLimits { most: extent.most, within: extent.reach, termination: mover.termination };
        let tag = |sample, gap, closest| Contact { other, side, sample, gap, closest, allowed };
        let tree = if side == ContactSide::Moving { &self.mine } else { &self.theirs };
        let mut found = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
        for tree in [tree, &sampled.extra_samples] {
            if gather_exactly(tree, &measured, few, &mut found, tag)?.is_none() {
                return Ok(None);
            }
        }
        Ok(Some(found))
    }
}
