//! Rays that know for sure on which side of an edge they pass.
//!
//! Source: S. Woop, C. Benthin and I. Wald, "Watertight Ray/Triangle Intersection" (2013). Points are
//! projected along the ray into the plane of two coordinates, where the ray is the origin. Each
//! point is rounded once, wherever it is used; on which side of the origin the edge of two projected
//! points passes is the sign of a difference of two products, which rounding keeps, but for 0. So
//! all that meet in an edge or a vertex agree about it, and a closed surface is left as often as it
//! is entered. Who finds an edge that passes through the origin takes another ray.

use nalgebra::{Point3, Vector3};

use super::Bounds;

/// By how much rays lean from their axes: nothing of a part that is drawn along the axes lies along them.
const LEANINGS: [[f64; 2]; 6] = [
    [0.013_719, -0.021_917],
    [-0.031_333, 0.017_137],
    [0.007_123, 0.039_317],
    [-0.023_831, -0.011_173],
    [0.041_161, 0.005_669],
    [-0.005_153, -0.033_527],
];

/// A ray.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    from: Point3<f64>,
    axis: usize,
    /// Along the axis or against it: 1 or -1.
    sense: f64,
    lean: [f64; 2],
}

/// A point as seen along a ray: beside it, in two directions, and how far along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) along: f64,
}

impl Seen {
    /// On which side of the ray the edge to another point passes: positive if, seen against the ray, it goes
    /// around it counter-clockwise.
    #[inline]
    pub(super) fn edge(&self, to: &Self) -> f64 {
        self.x * to.y - self.y * to.x
    }
}

impl Ray {
    /// Rays from a point, to be tried in this order: out of a box by the nearest side first.
    pub(super) fn out_of(bounds: &Bounds, from: &Point3<f64>) -> impl Iterator<Item = Self> {
        let (below, above) = (from - bounds.min, bounds.max - from);
        let mut sides: [(f64, usize, f64); 6] =
            std::array::from_fn(|i| if i < 3 { (below[i], i, -1.0) } else { (above[i - 3], i - 3, 1.0) });
        sides.sort_by(|a, b| a.0.total_cmp(&b.0));
        let from = *from;
        sides.into_iter().zip(LEANINGS).map(move |((_, axis, sense), lean)| Self { from, axis, sense, lean })
    }

    /// Where it begins.
    pub(super) fn from(&self) -> &Point3<f64> {
        &self.from
    }

    /// Its direction: of length 1 along its axis.
    pub(super) fn direction(&self) -> Vector3<f64> {
        let mut out = Vector3::zeros();
        out[self.axis] = self.sense;
        // Along the ray, not along the axis.
        out[(self.axis + 1) % 3] = self.lean[0];
        out[(self.axis + 2) % 3] = self.lean[1];
        out
    }

    /// The sides on which the edge of two points passes are told in a plane that mirrors them if the ray goes
    /// against its axis: this is what makes up for that.
    pub(super) fn sense(&self) -> f64 {
        self.sense
    }

    /// A point as it is seen along the ray.
    #[inline]
    pub(super) fn see(&self, coordinate: impl Fn(usize) -> f64) -> Seen {
        let at = |i: usize| coordinate(i) - self.from[i];
        let along = self.sense * at(self.axis);
        let x = at((self.axis + 1) % 3) - self.lean[0] * along;
        let y = at((self.axis + 2) % 3) - self.lean[1] * along;
        Seen { x, y, along }
    }
}
