//! Contacts of a pair that is looked at a few times, without fields: to fill these, and to sample all of two surfaces,
//! takes several times as long as what is asked.

use crate::geometry::{Bounds, Pose, SampleTree};

use crate::termination::Interrupt;

use super::nearby_samples::{GatherLimits, MeasuredBody, gather_exactly};
use super::{Contact, ContactSet, ContactSide, MovingBody};

/// How much to look for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GatherExtent {
    /// What is gathered has a smaller gap.
    pub(crate) radius: f64,
    /// What has a smaller gap than this is to be found in …
    pub(crate) reach: f64,
    /// … no more looks at either surface.
    pub(crate) most: usize,
}

/// Of the samples of a moving part and one that stands, both closed, those that may come near each other.
pub(crate) struct PairSamples {
    other: usize,
    mine: SampleTree,
    theirs: SampleTree,
}

impl PairSamples {
    /// Near each other while the mover is shifted from its pose by no more than `way`: nearer than that, too.
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

    /// What is near at a pose, if that is told by few looks.
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
