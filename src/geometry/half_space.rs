//! Half-spaces, and what lies beyond them: many points, triangles or boxes at once, so that the
//! loops become vector instructions.

#![allow(clippy::needless_range_loop, reason = "loops over all lanes alike become vector instructions")]

use nalgebra::{Point3, Vector3};

use super::triangle_tree::{Corners, WIDTH};

/// A half-space: points with normal · x ≥ height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct HalfSpace {
    pub(super) normal: Vector3<f64>,
    pub(super) height: f64,
}

impl HalfSpace {
    /// The half-space behind which some points just disappear, with this normal.
    pub(super) fn before(corners: &[Point3<f64>], normal: Vector3<f64>) -> Self {
        let height = corners.iter().map(|v| normal.dot(&v.coords)).fold(f64::NEG_INFINITY, f64::max);
        Self { normal, height }
    }

    /// How far a point is inside.
    pub(super) fn above(&self, p: &Point3<f64>) -> f64 {
        self.normal.dot(&p.coords) - self.height
    }

    /// How far eight triangles reach inside.
    #[inline]
    pub(super) fn triangles_above(&self, corners: &Corners) -> [f64; WIDTH] {
        let mut out = [f64::NEG_INFINITY; WIDTH];
        for [x, y, z] in corners {
            for k in 0..WIDTH {
                let above = self.normal.x * x[k] + self.normal.y * y[k] + self.normal.z * z[k] - self.height;
                out[k] = larger(above, out[k]);
            }
        }
        out
    }

    /// How far eight boxes, given by their corners relative to `origin`, reach inside.
    #[inline]
    pub(super) fn boxes_above(
        &self,
        origin: &Point3<f64>,
        min: &[[f32; WIDTH]; 3],
        max: &[[f32; WIDTH]; 3],
    ) -> [f64; WIDTH] {
        let mut out = [self.above(origin); WIDTH];
        for axis in 0..3 {
            let along = self.normal[axis];
            let far = if along > 0.0 { &max[axis] } else { &min[axis] };
            for k in 0..WIDTH {
                out[k] += along * f64::from(far[k]);
            }
        }
        out
    }
}

/// So many fours are looked at before it is asked whether one of them lies further than those before.
const BLOCK: usize = 8;

/// Points, four by four.
#[derive(Debug, Clone, Default)]
pub struct Cloud {
    fours: Vec<[[f64; 4]; 3]>,
}

impl Cloud {
    /// Of some points, and one more that also fills the last four up.
    pub(super) fn new(points: &[Point3<f64>], one: &Point3<f64>) -> Self {
        let mut cloud = Self::default();
        cloud.fill(points, one);
        cloud
    }

    /// Of some points in place of those that it had.
    pub fn refill(&mut self, points: &[Point3<f64>]) {
        self.fours.clear();
        if let Some((one, others)) = points.split_last() {
            self.fill(others, one);
        }
    }

    fn fill(&mut self, points: &[Point3<f64>], one: &Point3<f64>) {
        let at = |i: usize| points.get(i).unwrap_or(one);
        let four = |g: usize| [0, 1, 2].map(|axis| std::array::from_fn(|k| at(4 * g + k)[axis]));
        self.fours.extend((0..=points.len() / 4).map(four));
    }

    /// How far the furthest point lies along a direction, and which it is: the first of those that lie as
    /// far. None of no points.
    #[inline]
    pub(super) fn furthest(&self, along: &Vector3<f64>) -> Option<(f64, usize)> {
        let reaches = |[x, y, z]: &[[f64; 4]; 3]| -> [f64; 4] {
            std::array::from_fn(|k| x[k] * along.x + y[k] * along.y + z[k] * along.z)
        };
        // Which it is, is looked for only among those of the best block: that takes no vector instructions.
        let (mut most, mut best) = (f64::NEG_INFINITY, 0);
        for (at, block) in self.fours.chunks(BLOCK).enumerate() {
            let mut lanes = [f64::NEG_INFINITY; 4];
            for four in block {
                let reaches = reaches(four);
                for k in 0..4 {
                    lanes[k] = larger(reaches[k], lanes[k]);
                }
            }
            let reach = lanes.into_iter().fold(f64::NEG_INFINITY, larger);
            if reach > most {
                (most, best) = (reach, at);
            }
        }
        let first = best * BLOCK;
        let at = self.fours.get(first..)?.iter().flat_map(reaches).position(|reach| reach == most)?;
        Some((most, 4 * first + at))
    }

    /// How far the outermost point is inside a half-space.
    #[inline]
    pub(super) fn least_above(&self, side: &HalfSpace) -> f64 {
        let mut least = [f64::INFINITY; 4];
        for [x, y, z] in &self.fours {
            for k in 0..4 {
                let above = side.normal.x * x[k] + side.normal.y * y[k] + side.normal.z * z[k] - side.height;
                least[k] = -larger(-above, -least[k]);
            }
        }
        least.into_iter().fold(f64::INFINITY, f64::min)
    }
}

/// One vector instruction, which `f64::max` with its rule for NaN is not.
#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::spread;

    #[test]
    fn many_are_as_far_inside_as_each_of_them() {
        let points: Vec<_> = spread([-2.0; 3], [3.0; 3], 24).collect();
        for normal in spread([-1.0; 3], [1.0; 3], 50) {
            let side = HalfSpace { normal: normal.coords.normalize(), height: 0.3 };
            let mut corners: Corners = [[[0.0; WIDTH]; 3]; 3];
            for (i, p) in points.iter().enumerate() {
                (0..3).for_each(|axis| corners[i % 3][axis][i / 3] = p[axis]);
            }
            let of_triangles = side.triangles_above(&corners);
            for (k, triangle) in points.chunks(3).enumerate() {
                let most = triangle.iter().map(|p| side.above(p)).fold(f64::NEG_INFINITY, f64::max);
                assert_eq!(of_triangles[k], most);
            }
            for n in 0..points.len() {
                let cloud = Cloud::new(&points[..n], &points[n]);
                let least = points[..=n].iter().map(|p| side.above(p)).fold(f64::INFINITY, f64::min);
                assert_eq!(cloud.least_above(&side), least);
            }
        }
    }

    #[test]
    fn the_furthest_of_many_is_the_first_of_those_that_lie_furthest() {
        // Each twice: whichever lies furthest, one before it and one after it lie as far.
        let points: Vec<_> = spread([-2.0; 3], [3.0; 3], 11).flat_map(|p| [p, p]).collect();
        let mut cloud = Cloud::default();
        assert_eq!(cloud.furthest(&Vector3::x()), None);
        for along in spread([-1.0; 3], [1.0; 3], 50).map(|p| p.coords) {
            for n in 1..=points.len() {
                cloud.refill(&points[..n]);
                let reaches: Vec<f64> = points[..n].iter().map(|p| p.coords.dot(&along)).collect();
                let most = reaches.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let first = reaches.iter().position(|&reach| reach == most).unwrap();
                assert_eq!(cloud.furthest(&along), Some((most, first)));
            }
        }
    }

    #[test]
    fn a_box_is_as_far_inside_as_its_best_corner() {
        let origin = Point3::new(0.5, -1.0, 2.0);
        let (min, max) =
            ([[-1.0f32; WIDTH], [-0.5; WIDTH], [0.25; WIDTH]], [[2.0f32; WIDTH], [0.5; WIDTH], [1.0; WIDTH]]);
        for normal in spread([-1.0; 3], [1.0; 3], 50) {
            let side = HalfSpace { normal: normal.coords.normalize(), height: -0.7 };
            let corner = |i: usize| {
                let pick = |a: usize| f64::from(if i >> a & 1 == 0 { min[a][0] } else { max[a][0] });
                origin + Vector3::new(pick(0), pick(1), pick(2))
            };
            let most = (0..8).map(|i| side.above(&corner(i))).fold(f64::NEG_INFINITY, f64::max);
            assert!((side.boxes_above(&origin, &min, &max)[3] - most).abs() < 1e-12);
        }
    }
}
