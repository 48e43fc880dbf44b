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
    direction: Vector3<f64>,
    length: f64,
}

/// A point as seen along a ray: where beside it, and how far along it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) beside: [f64; 2],
    pub(super) along: f64,
}

/// On which side of a ray the edge of two points beside it passes: positive if it goes around it
/// counter-clockwise, seen along its axis.
#[inline]
pub(super) fn edge(from: [f64; 2], to: [f64; 2]) -> f64 {
    from[0] * to[1] - from[1] * to[0]
}

impl Ray {
    /// Rays from a point, to be tried in this order: the first leaves a box by its nearest side.
    pub(super) fn out_of(bounds: &Bounds, from: &Point3<f64>) -> impl Iterator<Item = Self> {
        let (below, above) = (from - bounds.min, bounds.max - from);
        let (down, up) = (below.imin(), above.imin());
        let (nearest, sense) = if below[down] < above[up] { (down, -1.0) } else { (up, 1.0) };
        let from = *from;
        (0..).zip(LEANINGS).map(move |(i, lean)| {
            let sense = if i < 3 { sense } else { -sense };
            Self::leaning(from, (nearest + i) % 3, sense, lean)
        })
    }

    fn leaning(from: Point3<f64>, axis: usize, sense: f64, lean: [f64; 2]) -> Self {
        let mut direction = Vector3::zeros();
        direction[axis] = sense;
        direction[(axis + 1) % 3] = lean[0];
        direction[(axis + 2) % 3] = lean[1];
        Self { from, axis, sense, lean, direction, length: direction.norm() }
    }

    /// Where it begins.
    pub(super) fn from(&self) -> &Point3<f64> {
        &self.from
    }

    /// Its direction: of length 1 along its axis.
    pub(super) fn direction(&self) -> &Vector3<f64> {
        &self.direction
    }

    /// The length of its direction.
    pub(super) fn length(&self) -> f64 {
        self.length
    }

    /// The sides on which the edge of two points passes are told in a plane that mirrors them if the ray goes
    /// against its axis: this is what makes up for that.
    pub(super) fn sense(&self) -> f64 {
        self.sense
    }

    /// Whether it passes a ball, or nearly.
    pub(super) fn passes(&self, centre: &Point3<f64>, radius: f64) -> bool {
        let seen = self.see(centre);
        // Across the axis it is no further than so many times the distance.
        let reach = 1.1 * radius;
        seen.along > -reach && seen.beside.iter().all(|x| x.abs() < reach)
    }

    /// The axes beside the ray, and that along it.
    #[inline]
    pub(super) fn axes(&self) -> [usize; 3] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3, self.axis]
    }

    /// A point as it is seen along the ray.
    #[inline]
    pub(super) fn see(&self, p: &Point3<f64>) -> Seen {
        let axes = self.axes();
        let [x, y, along] = self.seen(axes.map(|a| p[a]), axes.map(|a| self.from[a]));
        Seen { beside: [x, y], along }
    }

    /// What is seen of a point, given by its coordinates along [`Ray::axes`] as where the ray begins is.
    #[inline]
    pub(super) fn seen(&self, p: [f64; 3], from: [f64; 3]) -> [f64; 3] {
        let along = self.sense * (p[2] - from[2]);
        [p[0] - from[0] - self.lean[0] * along, p[1] - from[1] - self.lean[1] * along, along]
    }
}
