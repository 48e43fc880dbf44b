//! A piece of surface, and the shifts at which it is certainly free.

use nalgebra::{Point3, Vector3};

use crate::budgets::LOWEST_POINTS;
use crate::tolerances::{SAME_FACE, SHIFT_SUNK, TILT, TOUCHED};

use super::super::pieces::PlacedPiece;
use super::super::surface_pair::{CoverPiece, Obstacle, Slope, SurfacePair, WantedShift};

/// A piece that is free while the shift stays within limits.
#[derive(Debug, Clone)]
pub(crate) struct ShiftPiece {
    pub(crate) spot: CoverPiece,
    pub(crate) limits: Vec<ShiftLimit>,
    /// The shift must also stay in this ball.
    pub(crate) middle: Vector3<f64>,
    pub(crate) room: f64,
    /// The ball around the region, in the measured surface's frame.
    pub(crate) ball: (Point3<f64>, f64),
}

/// A bound on shifts: normal · shift ≥ height.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShiftLimit {
    pub(crate) normal: Vector3<f64>,
    pub(crate) height: f64,
    /// The triangle of the measured surface behind the bound.
    pub(crate) triangle: u32,
}

impl ShiftPiece {
    /// Bytes in memory.
    pub(crate) fn memory(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.limits)
    }

    /// The same with the other part of the pair moving.
    pub(crate) fn mirrored(&self) -> Self {
        let limits = self.limits.iter().map(|l| ShiftLimit { normal: -l.normal, ..*l }).collect();
        Self { limits, middle: -self.middle, ..*self }
    }

    /// How far the shift may go from `at` along the unit vector `u`.
    pub(crate) fn length(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> f64 {
        let from = at - self.middle;
        let along = from.dot(u);
        let chord = along * along - from.norm_squared() + self.room * self.room;
        let ball = if chord > 0.0 { (chord.sqrt() - along).max(0.0) } else { 0.0 };
        self.limits.iter().fold(ball, |length, limit| {
            let speed = -limit.normal.dot(u);
            let gap = limit.gap(at) + if speed <= TILT { SHIFT_SUNK } else { 0.0 };
            if speed > 0.0 { length.min(gap.max(0.0) / speed) } else { length }
        })
    }

    pub(crate) fn blocks(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        self.limits.iter().any(|limit| limit.blocks(at, u))
    }

    /// The obstacles to a shift from `at` along `u`.
    pub(crate) fn obstacles(
        &self,
        pair: &SurfacePair<'_>,
        at: &Vector3<f64>,
        u: &Vector3<f64>,
    ) -> Vec<Obstacle> {
        let blocking = self.limits.iter().filter(|l| l.blocks(at, u));
        blocking.map(|l| Obstacle { normal: l.normal, other: pair.other }).collect()
    }

    /// The obstacles that are certainly and steeply in the way of a wanted shift: faces that the lowest
    /// points of the piece enter before limits within `reach`, or faces of the piece that the triangles of these
    /// enter.
    pub(crate) fn touched(
        &self,
        pair: &SurfacePair<'_>,
        wish: &WantedShift,
        reach: f64,
        placed: &mut PlacedPiece,
    ) -> Vec<Obstacle> {
        let CoverPiece { piece, guess, .. } = &self.spot;
        let WantedShift { at, along } = wish;
        let ahead = || self.limits.iter().filter(|limit| limit.is_ahead(at, along, reach));
        if ahead().next().is_none() {
            return Vec::new();
        }
        pair.place(piece, at, placed);
        let mut probes = Vec::new();
        for limit in ahead() {
            let inward = pair.shifted * limit.normal;
            let heights = placed.points.iter().map(|p| (inward.dot(&p.coords), p));
            let lowest = placed.lowest(&inward);
            let touching = heights.filter(|(height, _)| *height <= lowest + TOUCHED);
            probes.extend(touching.take(LOWEST_POINTS).map(|(_, p)| *p));
        }
        // A point beside an edge enters a face that it need not pass: the plane of the limit is the other face's.
        let agrees = |limit: &ShiftLimit, o: &Obstacle| limit.normal.dot(&o.normal) > SAME_FACE;
        // The next step sees this contact again, so it needs no witness.
        let mut by_points = pair.obstacles(&probes, wish, (*guess, Slope::Steep), &mut Vec::new());
        by_points.retain(|o| ahead().any(|limit| agrees(limit, o)));
        if !by_points.is_empty() {
            return by_points;
        }
        let guess = pair.covered.triangle_of(piece).unwrap_or(0);
        let by_triangle = |limit: &ShiftLimit| {
            pair.obstacle_of_triangle(limit.triangle, wish, guess).filter(|o| agrees(limit, o))
        };
        ahead().find_map(by_triangle).into_iter().collect()
    }

    /// Whether nothing is left of the region along `u`.
    pub(crate) fn is_exhausted(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        let from = at - self.middle;
        (from + u * TOUCHED).norm() >= self.room
    }
}

impl ShiftLimit {
    fn gap(&self, at: &Vector3<f64>) -> f64 {
        self.normal.dot(at) - self.height
    }

    fn blocks(&self, at: &Vector3<f64>, u: &Vector3<f64>) -> bool {
        self.is_ahead(at, u, TOUCHED)
    }

    /// Whether a limit within `reach` ends a shift along the unit vector `u`.
    pub(crate) fn is_ahead(&self, at: &Vector3<f64>, u: &Vector3<f64>, reach: f64) -> bool {
        self.normal.dot(u) < -TILT && self.gap(at) <= reach
    }
}
