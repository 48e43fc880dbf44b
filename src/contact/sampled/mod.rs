//! Contacts of a moving body with standing ones, at samples.
//!
//! Samples of either surface that are near the other are measured exactly against the triangles around them. A
//! contact becomes linear constraints on the twist of the moving body, one for each plane of the closest feature.
//! Where the feature is convex, any one of them is enough; where it is not, the check at the trial pose finds what is
//! missing.

pub(crate) mod along_path;
mod contact_cache;
mod nearby_samples;
mod pair_samples;
mod penetration;
mod planes;
#[cfg(test)]
mod tests;

use nalgebra::{Point3, Vector3, Vector6};

use crate::geometry::{Bounds, Closest, Pose};
use crate::scene::{Body, Scene, StandingParts};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{FREE_STEP, ON_SURFACE};

pub(crate) use contact_cache::{ContactCache, StartContacts};
use nearby_samples::{MeasuredBody, gather};
pub(crate) use penetration::is_deeper;
pub use penetration::{passes_straight, seems_clear};
use planes::{ContactSample, Planes};

use super::constraint::VelocityConstraint;

/// The surface that a sample lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ContactSide {
    Moving,
    Standing,
}

/// A sample near the other body's surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Contact {
    /// The standing part of the pair.
    pub(crate) other: usize,
    side: ContactSide,
    /// The sample in the frame of the shape it lies on.
    sample: Point3<f64>,
    /// Signed distance plus the pair's allowed penetration: negative is deeper than allowed.
    pub(crate) gap: f64,
    closest: Closest,
    allowed: f64,
}

impl Contact {
    /// A point of the moving part's surface, or of the standing one's (in its shape's frame), that was measured
    /// against the other: its gap is negative where it is deeper than allowed.
    pub(crate) fn measured(
        other: usize,
        is_moving: bool,
        sample: Point3<f64>,
        (gap, closest): (f64, Closest),
        allowed: f64,
    ) -> Self {
        let side = if is_moving { ContactSide::Moving } else { ContactSide::Standing };
        Self { other, side, sample, gap, closest, allowed }
    }

    /// Whether both are the same point of the same pair.
    pub(crate) fn is_of_same_point(&self, other: &Self) -> bool {
        (self.other, self.side, self.sample) == (other.other, other.side, other.sample)
    }
}

/// The contacts near a pose.
#[derive(Debug, Clone)]
pub(crate) struct ContactSet {
    /// All samples with a gap below the reach of the query.
    pub(crate) contacts: Vec<Contact>,
    /// No other sample has a smaller gap than this.
    pub(crate) clearance: f64,
}

impl ContactSet {
    /// Adds other contacts.
    fn add(&mut self, Self { contacts, clearance }: Self) {
        self.clearance = self.clearance.min(clearance);
        self.contacts.extend(contacts);
    }

    /// The same with a smaller reach.
    pub(crate) fn within(&self, reach: f64) -> Self {
        let (contacts, others) = self.contacts.iter().partition::<Vec<Contact>, _>(|c| c.gap < reach);
        let clearance = others.iter().map(|c| c.gap).fold(self.clearance, f64::min);
        Self { contacts, clearance }
    }
}

/// Where a step gets its contacts from.
pub(crate) trait ContactSource {
    /// The contacts near a body's pose: if any is deeper than the engine allows, at least some of these.
    fn near(&mut self, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt>;

    /// Adds contacts that were found at other poses and may matter at this one, too.
    fn add_known(&mut self, mover: &MovingBody<'_>, near: &mut ContactSet) -> Result<(), Interrupt> {
        let _ = (mover, near);
        Ok(())
    }

    /// Whether nothing is too deep at a pose between the start of the step and the pose of the last query, apart from
    /// what the contacts at both ends show.
    fn is_clear_at(&mut self, between: &MovingBody<'_>) -> Result<bool, Interrupt> {
        let _ = between;
        Ok(true)
    }
}

/// A function that gathers contacts.
impl<F: Fn(&MovingBody<'_>) -> Result<ContactSet, Interrupt>> ContactSource for F {
    fn near(&mut self, mover: &MovingBody<'_>) -> Result<ContactSet, Interrupt> {
        self(mover)
    }
}

/// The moving body at a pose.
#[derive(Clone, Copy)]
pub(crate) struct MovingBody<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) body: &'a Body,
    pub(crate) part: usize,
    pub(crate) pose: Pose,
    /// See [`Self::until`].
    pub(crate) termination: Option<&'a Termination>,
    /// See [`Self::exactly`].
    pub(crate) is_exact: bool,
}

impl<'a> MovingBody<'a> {
    pub(crate) fn new(scene: &'a Scene, part: usize, pose: Pose) -> Self {
        Self { scene, body: &scene.bodies[part], part, pose, termination: None, is_exact: false }
    }

    /// The same with a condition whose interruption every query returns as an error.
    pub(crate) fn until(self, termination: &'a Termination) -> Self {
        Self { termination: Some(termination), ..self }
    }

    /// The same, measuring without distance fields; all surfaces must be closed.
    pub(crate) fn exactly(self) -> Self {
        Self { is_exact: true, ..self }
    }

    /// # Errors
    /// The termination condition is true.
    pub(crate) fn check(&self) -> Result<(), Interrupt> {
        self.termination.map_or(Ok(()), Termination::check)
    }

    /// The centre of mass, about which twists turn.
    pub(crate) fn centre(&self) -> Point3<f64> {
        self.pose * self.body.shape.mass.centre
    }

    /// Gathers all contacts with a gap below `reach`.
    ///
    /// # Errors
    /// The termination condition became true; so of all questions below.
    pub(crate) fn near(&self, standing_parts: &StandingParts, reach: f64) -> Result<ContactSet, Interrupt> {
        self.near_by(standing_parts, reach, |other, near| self.near_pair(other, reach, near))
    }

    /// The same; `gather` adds the contacts with a standing part that may be within reach.
    pub(crate) fn near_by(
        &self,
        standing_parts: &StandingParts,
        reach: f64,
        mut gather: impl FnMut(usize, &mut ContactSet) -> Result<(), Interrupt>,
    ) -> Result<ContactSet, Interrupt> {
        let mut near = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
        let bounds = self.body.shape.bounds().transformed(&self.pose);
        // The clearance need not exceed the longest step.
        let horizon = reach.max(FREE_STEP);
        near.clearance = horizon;
        for other in self.scene.broad_phase.meeting_of(&standing_parts.standing, &bounds.grown(horizon)) {
            let apart = box_distance(&bounds, &self.scene.bodies[other].bounds);
            if apart > reach {
                near.clearance = near.clearance.min(apart);
            } else {
                gather(other, &mut near)?;
            }
        }
        Ok(near)
    }

    /// Gathers the contacts with one standing part.
    pub(crate) fn near_pair(&self, other: usize, reach: f64, near: &mut ContactSet) -> Result<(), Interrupt> {
        // The sides are measured one after the other: several motions are simulated in parallel, and a thread that
        // waited for half a query would begin another motion meanwhile.
        near.add(self.side(ContactSide::Moving, other, reach, near.clearance)?);
        near.add(self.side(ContactSide::Standing, other, reach, near.clearance)?);
        Ok(())
    }

    /// The contacts with one part alone, both sides in parallel: where distance fields are new, filling their cells
    /// takes most of the time.
    pub(crate) fn near_first(&self, other: usize, reach: f64) -> Result<ContactSet, Interrupt> {
        let standing = &self.scene.bodies[other];
        let (mine, theirs) = rayon::join(|| self.prepare_field(self.body), || self.prepare_field(standing));
        mine.and(theirs)?;
        let mut near = ContactSet { contacts: Vec::new(), clearance: f64::INFINITY };
        let side = |side| self.side(side, other, reach, f64::INFINITY);
        let (mine, theirs) = rayon::join(|| side(ContactSide::Moving), || side(ContactSide::Standing));
        near.add(mine?);
        near.add(theirs?);
        Ok(near)
    }

    /// The contacts at the samples of one surface of a pair.
    fn side(
        &self,
        side: ContactSide,
        other: usize,
        reach: f64,
        clearance: f64,
    ) -> Result<ContactSet, Interrupt> {
        let mut found = ContactSet { contacts: Vec::new(), clearance };
        let (sampled, body, to_measured, allowed) = self.sides(side, other);
        if !body.shape.surface.has_inside_for(&sampled.shape.surface) {
            return Ok(found);
        }
        self.prepare_fields(&self.scene.bodies[other])?;
        let measured = MeasuredBody { body, to_measured: &to_measured, allowed, reach };
        let tag = |sample, gap, closest| Contact { other, side, sample, gap, closest, allowed };
        for tree in [sampled.shape.samples(), &sampled.extra_samples] {
            gather(tree, &measured, self.termination, &mut found, tag)?;
        }
        Ok(found)
    }

    /// The sampled and the measured body, the pose from the one's frame to the other's, and the allowed penetration.
    fn sides(&self, side: ContactSide, other: usize) -> (&'a Body, &'a Body, Pose, f64) {
        let standing = &self.scene.bodies[other];
        let allowed = self.scene.allowed.of(self.part, other);
        let standing_from_moving = standing.planning_from_shape.inverse() * self.pose;
        match side {
            ContactSide::Moving => (self.body, standing, standing_from_moving, allowed),
            ContactSide::Standing => (standing, self.body, standing_from_moving.inverse(), allowed),
        }
    }

    /// Builds the fields of a pair that are not there yet.
    fn prepare_fields(&self, standing: &Body) -> Result<(), Interrupt> {
        self.prepare_field(self.body)?;
        self.prepare_field(standing)
    }

    fn prepare_field(&self, body: &Body) -> Result<(), Interrupt> {
        self.termination.map_or(Ok(()), |t| body.field.prepare_here(t))
    }

    /// A contact's sample measured with the body at its pose, if its gap is still below `reach`.
    pub(crate) fn remeasured(&self, contact: &Contact, reach: f64) -> Option<Contact> {
        let standing = &self.scene.bodies[contact.other];
        let (measured, p) = match contact.side {
            ContactSide::Moving => (
                standing,
                standing.planning_from_shape.inverse_transform_point(&(self.pose * contact.sample)),
            ),
            ContactSide::Standing => {
                let world = standing.planning_from_shape * contact.sample;
                (self.body, self.pose.inverse_transform_point(&world))
            }
        };
        let (closest, distance) = if self.is_exact {
            measured.closest_from(&p, contact.closest.triangle)
        } else {
            measured.closest(&p, (reach - contact.allowed).max(0.0))?
        };
        Some(Contact { gap: distance + contact.allowed, closest, ..*contact })
    }

    /// An upper bound on how far a twist that ended at this pose moved a contact's sample against the other surface:
    /// the chord of the arc, and the second-order part of the turn.
    pub(crate) fn displacement(&self, contact: &Contact, twist: &Vector6<f64>) -> f64 {
        let arm = self.arm(contact);
        let turn: Vector3<f64> = twist.fixed_rows::<3>(3).into();
        let linear = twist.fixed_rows::<3>(0) + turn.cross(&arm);
        linear.norm() + turn.norm_squared() * arm.norm()
    }

    /// From the centre of mass to a contact's sample.
    pub(crate) fn arm(&self, contact: &Contact) -> Vector3<f64> {
        let world = match contact.side {
            ContactSide::Moving => self.pose * contact.sample,
            ContactSide::Standing => self.scene.bodies[contact.other].planning_from_shape * contact.sample,
        };
        world - self.centre()
    }

    /// The constraints of a contact on twists about the centre of mass (linear part first), any one of which is
    /// enough, for a wanted twist. Appends at least one to `out`.
    pub(crate) fn options(
        &self,
        contact: &Contact,
        wanted: &Vector6<f64>,
        out: &mut Vec<VelocityConstraint>,
    ) {
        let standing = &self.scene.bodies[contact.other];
        let (world, measured, frame, sense) = match contact.side {
            ContactSide::Moving => (self.pose * contact.sample, standing, &standing.planning_from_shape, 1.0),
            ContactSide::Standing => {
                (standing.planning_from_shape * contact.sample, self.body, &self.pose, -1.0)
            }
        };
        let arm = world - self.centre();
        let (v, turn) = (wanted.fixed_rows::<3>(0), wanted.fixed_rows::<3>(3));
        // The motion of the sample against the measured surface.
        let motion: Vector3<f64> = (v + turn.cross(&arm)) * sense;
        let sample = ContactSample {
            point: frame.inverse_transform_point(&world),
            motion: frame.rotation.inverse() * motion,
            closest: contact.closest,
            distance: contact.gap - contact.allowed,
            below: contact.allowed + ON_SURFACE,
        };
        let mut planes = Planes::default();
        let closest_to = |p: &Point3<f64>, reach: f64| {
            if !self.is_exact {
                return measured.closest(p, reach).map(|(closest, _)| closest);
            }
            let (closest, _) = measured.closest_from(p, contact.closest.triangle);
            (closest.distance < reach).then_some(closest)
        };
        sample.planes(&measured.shape.surface, closest_to, &mut planes);
        for plane in planes.iter() {
            let n = frame.rotation * plane.normal * sense;
            let moment = arm.cross(&n);
            let a = Vector6::new(n.x, n.y, n.z, moment.x, moment.y, moment.z);
            out.push(VelocityConstraint { a, b: plane.height + contact.allowed, other: contact.other });
        }
    }

    /// The constraint that moves a sample that is too deep out the shortest way.
    pub(crate) fn way_out(
        &self,
        contact: &Contact,
        rows: &mut Vec<VelocityConstraint>,
    ) -> Option<VelocityConstraint> {
        rows.clear();
        self.options(contact, &Vector6::zeros(), rows);
        rows.first().copied()
    }
}

fn box_distance(a: &Bounds, b: &Bounds) -> f64 {
    (a.min - b.max).sup(&(b.min - a.max)).sup(&Vector3::zeros()).norm()
}
