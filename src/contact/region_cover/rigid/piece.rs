//! A piece in its region, and the poses of a step.

use std::sync::Arc;

use nalgebra::Point3;

use crate::budgets::POSES_BETWEEN;
use crate::geometry::{FreeRegion, Pose, Screw};
use crate::tolerances::{DEPTH_TOLERANCE, STEPS_AHEAD};

use super::super::pieces::PlacedPiece;
use super::super::shift::ShiftPiece;
use super::super::surface_pair::{CoverPiece, SurfacePair};

/// A piece in its region.
#[derive(Clone)]
pub(crate) struct RigidPiece {
    pub(crate) spot: CoverPiece,
    /// In the measured surface's frame.
    pub(crate) region: Arc<FreeRegion>,
    /// A ball that holds the piece, in the covered surface's frame.
    pub(crate) centre: Point3<f64>,
    pub(crate) radius: f64,
    /// The ball's centre at the base, in the measured surface's frame.
    pub(crate) stands: Point3<f64>,
    /// How far inside its region all of the piece is at the base.
    pub(crate) slack: f64,
    /// The same at the pose of the last query; `None` if the piece was not in its region.
    pub(crate) next: Option<f64>,
}

/// Maps from the covered surface's frame to the measured one's, at the base and at other poses of a step.
#[derive(Clone, Copy)]
pub(crate) struct StepPoses {
    pub(crate) here: Pose,
    pub(crate) there: Pose,
    /// Between the two, if they differ.
    pub(crate) between: [Pose; POSES_BETWEEN],
    /// At the pose to which the motion would continue.
    pub(crate) ahead: Pose,
}

impl StepPoses {
    pub(crate) fn of(surfaces: &SurfacePair<'_>, base: &Pose, there: &Pose) -> Self {
        let screw = Screw::between(base, there, 1);
        let after = |share: f64| surfaces.with_part_at(&(screw.times(share) * base));
        let between = std::array::from_fn(|i| after((i + 1) as f64 / (POSES_BETWEEN + 1) as f64));
        let [here, there] = [base, there].map(|pose| surfaces.with_part_at(pose));
        Self { here, there, between, ahead: after(STEPS_AHEAD) }
    }

    /// One pose instead of a step.
    pub(crate) fn at(there: Pose) -> Self {
        Self { here: there, there, between: [there; POSES_BETWEEN], ahead: there }
    }
}

impl RigidPiece {
    pub(crate) fn new(
        spot: CoverPiece,
        region: Arc<FreeRegion>,
        surfaces: &SurfacePair<'_>,
        here: &Pose,
    ) -> Self {
        let (centre, radius) = surfaces.covered.ball(&spot.piece);
        let stands = here * centre;
        Self { spot, region, centre, radius, stands, slack: f64::NEG_INFINITY, next: None }
    }

    /// A piece in the region of a cover for shifts, at zero shift.
    pub(crate) fn of_shift_piece(
        piece: &ShiftPiece,
        surfaces: &SurfacePair<'_>,
        here: &Pose,
        placed: &mut PlacedPiece,
    ) -> Self {
        surfaces.covered.place(&piece.spot.piece, here, placed);
        let sides = piece.limits.iter().map(|limit| {
            let normal = surfaces.shifted * limit.normal;
            (normal, placed.lowest(&normal) + limit.height, limit.triangle)
        });
        let region = Arc::new(FreeRegion::known(piece.ball, sides));
        Self::new(piece.spot, region, surfaces, here)
    }

    /// How far outside its region the piece may be.
    pub(crate) fn most(&self, surfaces: &SurfacePair<'_>) -> f64 {
        surfaces.allowed + self.spot.held.max(DEPTH_TOLERANCE)
    }

    /// How far inside its region all of the piece is at a pose: negative if it is outside by no more than allowed and
    /// `more`, `None` if it is further outside.
    pub(crate) fn slack_at(
        &self,
        surfaces: &SurfacePair<'_>,
        there: &Pose,
        more: f64,
        placed: &mut PlacedPiece,
    ) -> Option<f64> {
        let of_ball = self.region.slack(&(there * self.centre)) - self.radius;
        if of_ball > 0.0 {
            return Some(of_ball);
        }
        surfaces.covered.place(&self.spot.piece, there, placed);
        placed.slack_in(&self.region, self.most(surfaces) + more)
    }
}
