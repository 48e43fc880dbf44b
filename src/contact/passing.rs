//! Whether a part keeps a distance from another on its way.

use nalgebra::Point3;

use crate::geometry::{Pose, Shape};
use crate::scene::Scene;
use crate::termination::{Interrupt, Termination};
use crate::tolerances::{APPROACH_PRECISION, ASSEMBLED_CONTACT, SCREW_TURN};

use super::closest_approach::{ClosestApproach, PassedPair, closest_approach};
use super::course::turns_far;
use super::helix_profile::turn_along_helix;

/// A moving and a standing part.
#[derive(Debug, Clone)]
pub struct PassingPair<'a> {
    /// The moving and the standing part.
    pub parts: [usize; 2],
    /// Where the standing shape stands, in the planning frame.
    pub standing: Pose,
    /// The two on the way.
    pub passed: PassedPair<'a>,
    /// The two as they stand, before the first moves or after.
    pub stand: PassedPair<'a>,
}

impl<'a> PassingPair<'a> {
    /// The parts of a body on a path (poses of its shape, of which the first is where it stands) and a standing part.
    pub(crate) fn of_members(scene: &'a Scene, [body, other]: [usize; 2], path: &[Pose]) -> Vec<Self> {
        let from_body = scene.bodies[body].planning_from_shape.inverse();
        let centre = scene.centre_in_shape(body);
        let standing = scene.bodies[other].planning_from_shape;
        let into = standing.inverse();
        let of_member = |&part: &usize| {
            let body_from_part = from_body * scene.bodies[part].planning_from_shape;
            let path: Vec<Pose> = path.iter().map(|pose| into * pose * body_from_part).collect();
            let shapes = [part, other].map(|part| &*scene.bodies[part].shape);
            let centre = body_from_part.inverse_transform_point(&centre);
            let stand = PassedPair { shapes, path: path[..path.len().min(1)].to_vec(), centre };
            Self { parts: [part, other], standing, passed: PassedPair { shapes, path, centre }, stand }
        };
        scene.members(&body).iter().map(of_member).collect()
    }

    /// The distance from which on the two do not touch as they stand.
    fn contact(&self) -> f64 {
        let size = |shape: &Shape| shape.bounds().extents().max();
        let [a, b] = self.passed.shapes.map(size);
        ASSEMBLED_CONTACT * a.min(b)
    }

    /// Whether the two touch as they stand.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn touches(&self, termination: &Termination) -> Result<bool, Interrupt> {
        Ok(self.assembled(self.contact(), termination)?.is_some())
    }

    /// How far the two are apart as they stand, if less than `reach`.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn assembled(&self, reach: f64, termination: &Termination) -> Result<Option<f64>, Interrupt> {
        let found = closest_approach(std::slice::from_ref(&self.stand), reach, termination)?;
        Ok(found.map(|found| found.distance))
    }

    /// The distance that the two keep if one is wanted: what they have as they stand, if that is less. None if they touch:
    /// then they may touch on the way, too.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn kept(&self, wanted: f64, termination: &Termination) -> Result<Option<f64>, Interrupt> {
        let Some(assembled) = self.assembled(wanted, termination)? else { return Ok(Some(wanted)) };
        Ok((assembled >= self.contact()).then_some(assembled))
    }

    /// Whether the way begins along a helix and turns far there, within a play of it: off a thread.
    pub(crate) fn follows_thread(&self, play: f64) -> bool {
        let PassedPair { shapes: [moving, _], path, centre } = &self.passed;
        turns_far(path) && turn_along_helix(path, centre, moving.reach, play) > SCREW_TURN
    }

    /// Where the two come nearer than the distance that they keep, or where that is not certain.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn too_near(
        &self,
        kept: f64,
        termination: &Termination,
    ) -> Result<Option<ClosestApproach>, Interrupt> {
        // Below the distance, or else all that is just as far apart all along the way would be looked into.
        let reach = kept * (1.0 - APPROACH_PRECISION);
        let found = closest_approach(std::slice::from_ref(&self.passed), reach, termination)?;
        // Where the search was given up, the bound tells.
        let is_kept = |found: &ClosestApproach| {
            found.distance >= reach && found.at_least >= kept * (1.0 - 2.0 * APPROACH_PRECISION)
        };
        Ok(found.filter(|found| !is_kept(found)))
    }

    /// The same pair on one segment of the way.
    pub(crate) fn on_segment(&self, segment: usize) -> Self {
        let passed =
            PassedPair { path: self.passed.path[segment..=segment + 1].to_vec(), ..self.passed.clone() };
        Self { passed, ..self.clone() }
    }

    /// A point of the standing shape, in the planning frame.
    #[must_use]
    pub fn in_planning_frame(&self, point: &Point3<f64>) -> Point3<f64> {
        self.standing * point
    }
}
