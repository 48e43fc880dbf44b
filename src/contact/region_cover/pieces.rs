//! What the models of motion share: a surface in pieces, and the measured surface that no piece may enter.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Cloud, FreeRegion, Parts, PatchTree, Pose, Surface, bisected};

/// A surface that is covered piece by piece.
#[derive(Clone, Copy)]
pub(crate) struct CoveredSurface<'a> {
    pub(crate) surface: &'a Surface,
    pub(crate) tree: &'a PatchTree,
}

/// A piece of the covered surface.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Piece {
    /// A node of the patch tree.
    Patch(u32),
    /// A triangle, or a part of one, by its corners.
    Bit([Point3<f64>; 3]),
}

impl Piece {
    /// Whether the piece is a bit of less than a radius.
    pub(crate) fn is_bit_below(&self, size: f64, radius: f64) -> bool {
        matches!(self, Self::Bit(_)) && radius < size
    }
}

impl CoveredSurface<'_> {
    /// The whole surface, unless it has no triangles.
    pub(crate) fn root(&self) -> Option<Piece> {
        self.tree.root().map(Piece::Patch)
    }

    /// The parts of a piece: the patches or triangles of a patch, the halves of a bit.
    pub(crate) fn parts(&self, piece: &Piece) -> Vec<Piece> {
        match piece {
            Piece::Bit(corners) => bisected(corners).1.map(Piece::Bit).to_vec(),
            Piece::Patch(index) => match self.tree.parts(*index) {
                Parts::Patches(children) => children.map(Piece::Patch).to_vec(),
                Parts::Triangles(list) => list.iter().map(|&t| Piece::Bit(self.surface.corners(t))).collect(),
            },
        }
    }

    /// A corner of a piece, by its index in [`PlacedPiece::points`].
    pub(crate) fn corner(&self, piece: &Piece, number: usize) -> Point3<f64> {
        match piece {
            Piece::Patch(index) => self.tree.vertices(*index)[number],
            Piece::Bit(corners) => corners[number],
        }
    }

    /// A ball that holds a piece.
    pub(crate) fn ball(&self, piece: &Piece) -> (Point3<f64>, f64) {
        match piece {
            Piece::Patch(index) => {
                let patch = self.tree.patch(*index);
                (patch.centre, patch.radius)
            }
            Piece::Bit(corners) => ball_of(corners),
        }
    }

    /// A triangle of a piece, if the piece is a patch.
    pub(crate) fn triangle_of(&self, piece: &Piece) -> Option<u32> {
        match piece {
            Piece::Patch(index) => self.tree.triangles(*index).first().copied(),
            Piece::Bit(_) => None,
        }
    }

    /// Places a piece with the covered surface at a pose in the measured surface's frame.
    pub(crate) fn place(&self, piece: &Piece, measured_from_covered: &Pose, placed: &mut PlacedPiece) {
        let place = |p: &Point3<f64>| measured_from_covered * p;
        placed.points.clear();
        placed.extremes.clear();
        match piece {
            Piece::Patch(index) => {
                let patch = self.tree.patch(*index);
                placed.points.extend(self.tree.vertices(*index).iter().map(place));
                placed.extremes.extend(self.tree.extremes(*index).map(place));
                (placed.centre, placed.radius) = (place(&patch.centre), patch.radius);
            }
            Piece::Bit(corners) => {
                let corners = corners.map(|p| place(&p));
                placed.points.extend(corners);
                placed.extremes.extend(corners);
                (placed.centre, placed.radius) = ball_of(&corners);
            }
        }
        placed.cloud.refill(&placed.points);
    }
}

/// A piece in the measured surface's frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct PlacedPiece {
    /// Its corners.
    pub(crate) points: Vec<Point3<f64>>,
    /// The same points, grouped by four for vector instructions.
    pub(crate) cloud: Cloud,
    /// The points that reach furthest.
    pub(crate) extremes: Vec<Point3<f64>>,
    /// A ball that holds it.
    pub(crate) centre: Point3<f64>,
    pub(crate) radius: f64,
}

impl PlacedPiece {
    /// How far inside a region all of the piece is: negative if it is outside by no more than `most`, `None` if it is
    /// further outside.
    pub(crate) fn slack_in(&self, region: &FreeRegion, most: f64) -> Option<f64> {
        let gaps = region.gaps(&self.cloud);
        let least = gaps.iter().copied().fold(region.radius() - self.reach_from(&region.centre()), f64::min);
        if least >= 0.0 || least < -most {
            return Some(least).filter(|least| *least >= 0.0);
        }
        region.distance_of_shifted(&self.points, &gaps, &Vector3::zeros(), most).map(|distance| -distance)
    }

    /// The distance of a point from the corner that is furthest from it.
    pub(crate) fn reach_from(&self, p: &Point3<f64>) -> f64 {
        self.points.iter().map(|q| (q - p).norm_squared()).fold(0.0, f64::max).sqrt()
    }

    /// How far the lowest corner is along a direction.
    pub(crate) fn lowest(&self, direction: &Vector3<f64>) -> f64 {
        self.points.iter().map(|p| direction.dot(&p.coords)).fold(f64::INFINITY, f64::min)
    }
}

fn ball_of(corners: &[Point3<f64>; 3]) -> (Point3<f64>, f64) {
    let centre = Point3::from(corners.iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0);
    (centre, corners.iter().map(|p| (p - centre).norm()).fold(0.0, f64::max))
}
