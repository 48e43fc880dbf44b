//! Cylinders of a surface about a given line: holes, shanks and rods.

use super::CentreLine;
use crate::geometry::Surface;
use crate::tolerances::{FLAT_SPREAD, ROUND_COSINE, ROUND_SHARE, ROUND_SPREAD};

/// A cylinder about a line, most of which the surface has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RoundFace {
    pub(super) radius: f64,
    /// Where it begins and ends along the line.
    pub(super) along: [f64; 2],
    /// Whether the surface faces the line.
    pub(super) is_hole: bool,
}

impl RoundFace {
    pub(super) fn length(&self) -> f64 {
        self.along[1] - self.along[0]
    }

    /// How long both are beside each other.
    pub(super) fn shared_length(&self, other: &Self) -> f64 {
        self.along[1].min(other.along[1]) - self.along[0].max(other.along[0])
    }
}

/// A triangle of a cylinder.
struct Facet {
    radius: f64,
    along: [f64; 2],
    area: f64,
    is_hole: bool,
}

/// The cylinders of a surface about a line.
pub(super) fn round_faces(surface: &Surface, line: &CentreLine) -> Vec<RoundFace> {
    let mut facets: Vec<Facet> =
        (0..surface.triangles().len() as u32).filter_map(|t| facet(surface, t, line)).collect();
    facets.sort_by(|a, b| a.is_hole.cmp(&b.is_hole).then(a.radius.total_cmp(&b.radius)));
    let is_same =
        |a: &Facet, b: &Facet| a.is_hole == b.is_hole && b.radius - a.radius <= ROUND_SPREAD * a.radius;
    facets.chunk_by(is_same).filter_map(round_face).collect()
}

/// The triangle as one of a cylinder about the line, if it is.
fn facet(surface: &Surface, triangle: u32, line: &CentreLine) -> Option<Facet> {
    let normal = surface.face_normal(triangle);
    if normal.dot(&line.direction).abs() > FLAT_SPREAD {
        return None;
    }
    let corners = surface.corners(triangle);
    let away = corners.map(|p| line.to(&p));
    let of_corners = away.iter().map(|v| v.norm()).sum::<f64>() / 3.0;
    let outward = away[0].dot(&normal);
    let is_round = away.iter().all(|v| (v.norm() - of_corners).abs() <= ROUND_SPREAD * of_corners)
        && outward.abs() >= ROUND_COSINE * of_corners;
    // The circle is around the facets, or inside them.
    let (radius, is_hole) = ((of_corners + outward.abs()) / 2.0, outward < 0.0);
    let heights = corners.map(|p| line.along(&p));
    let along =
        [heights.into_iter().fold(f64::INFINITY, f64::min), heights.into_iter().fold(f64::MIN, f64::max)];
    let [a, b, c] = corners;
    let area = (b - a).cross(&(c - a)).norm() / 2.0;
    is_round.then_some(Facet { radius, along, area, is_hole })
}

/// The cylinder that facets of one radius make, if they are most of it.
fn round_face(facets: &[Facet]) -> Option<RoundFace> {
    let area: f64 = facets.iter().map(|facet| facet.area).sum();
    let radius = facets.iter().map(|facet| facet.radius * facet.area).sum::<f64>() / area;
    let along = facets.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], facet| {
        [lo.min(facet.along[0]), hi.max(facet.along[1])]
    });
    let whole = std::f64::consts::TAU * radius * (along[1] - along[0]);
    (area >= ROUND_SHARE * whole && whole > 0.0).then_some(RoundFace {
        radius,
        along,
        is_hole: facets[0].is_hole,
    })
}
