//! A triangle as planes: distances from the points of a small lattice, all at once and in single
//! precision, only to tell which triangles cannot be the nearest; heights in double precision.

#![allow(clippy::needless_range_loop, reason = "loops over all lanes alike become vector instructions")]

use nalgebra::{Point3, Vector3};

use crate::geometry::area_normal;

/// Points along a side of the lattice.
pub(super) const ACROSS: usize = 3;
/// Points of the lattice.
pub(super) const POINTS: usize = ACROSS * ACROSS * ACROSS;
/// Rounded up to whole vectors; what lies in the last lane means nothing.
const WIDTH: usize = 28;

/// A number for each point of the lattice, x fastest.
pub(super) type FacetLanes = [f32; WIDTH];

const STEPS: [FacetLanes; 3] = steps();

const fn steps() -> [FacetLanes; 3] {
    let mut out = [[0.0; WIDTH]; 3];
    let mut i = 0;
    while i < POINTS {
        out[0][i] = (i % ACROSS) as f32 - 1.0;
        out[1][i] = (i / ACROSS % ACROSS) as f32 - 1.0;
        out[2][i] = (i / (ACROSS * ACROSS)) as f32 - 1.0;
        i += 1;
    }
    out
}

/// A coordinate along a unit vector: the vector, then what is added.
type FacetAxis = [f32; 4];

/// A triangle, in units of a cell and from the middle of a brick.
#[derive(Debug, Clone)]
pub(super) struct Facet {
    /// Height above its plane.
    height: FacetAxis,
    /// Per side, how far outside it is, in the plane.
    beyond: [FacetAxis; 3],
    /// Per side, how far along it, from its first corner.
    along: [FacetAxis; 3],
    length: [f32; 3],
    /// Height and the ways beyond the sides, in double precision.
    exact: [[f64; 4]; 4],
}

impl Facet {
    /// A triangle given by its corners and the frame; `None` if it is too thin to have a plane.
    pub(super) fn new(corners: &[Point3<f64>; 3], middle: &Point3<f64>, cell: f64) -> Option<Self> {
        /// Triangles with a smaller ratio of height to length have no plane that exceeds rounding.
        const THIN: f64 = 1e-6;
        let corners = corners.map(|p| (p - middle) / cell);
        let sides = [0, 1, 2].map(|e| corners[(e + 1) % 3] - corners[e]);
        let lengths = sides.map(|s| s.norm());
        let longest = lengths.iter().copied().fold(0.0, f64::max);
        let [a, b, c] = corners.map(Point3::from);
        let normal = area_normal(&a, &b, &c);
        let shortest = lengths.iter().copied().fold(f64::INFINITY, f64::min);
        let sound = normal.norm() > THIN * longest * longest && shortest > THIN * longest;
        let normal = sound.then(|| normal.normalize())?;
        let axis = |n: &Vector3<f64>, on: &Vector3<f64>| [n.x, n.y, n.z, -n.dot(on)];
        let single = |axis: [f64; 4]| axis.map(|x| x as f32);
        let direction = |e: usize| sides[e] / lengths[e];
        let beyond = |e: usize| axis(&direction(e).cross(&normal), &corners[e]);
        let exact = [axis(&normal, &corners[0]), beyond(0), beyond(1), beyond(2)];
        Some(Self {
            height: single(exact[0]),
            beyond: [1, 2, 3].map(|k| single(exact[k])),
            along: [0, 1, 2].map(|e| single(axis(&direction(e), &corners[e]))),
            length: lengths.map(|l| l as f32),
            exact,
        })
    }

    /// The signed height of a point that lies straight above or below the triangle: the distance.
    #[inline]
    pub(super) fn height_over(&self, p: &Vector3<f64>) -> Option<f64> {
        let at = |axis: &[f64; 4]| axis[0] * p.x + axis[1] * p.y + axis[2] * p.z + axis[3];
        let [height, sides @ ..] = &self.exact;
        sides.iter().all(|side| at(side) <= 0.0).then(|| at(height))
    }

    /// How far the corners reach from the middle: rounding grows with it.
    pub(super) fn extent(&self) -> f32 {
        let far = |axes: &[FacetAxis; 3]| axes.iter().map(|a| a[3].abs()).fold(0.0, f32::max);
        self.height[3].abs().max(far(&self.beyond)).max(far(&self.along))
            + self.length.iter().copied().fold(0.0, f32::max)
    }

    /// Squared distances from the points of the lattice around `centre`, `spacing` apart.
    ///
    /// The point of a triangle that is nearest lies below or above it, or else on one of its sides:
    /// there the distance is joined from the height, the way beyond the side in the plane, and the
    /// way beyond its ends.
    #[inline]
    pub(super) fn squared_distances(&self, centre: &[f32; 3], spacing: f32) -> FacetLanes {
        let (mut side, mut beyond) = ([f32::INFINITY; WIDTH], [0.0f32; WIDTH]);
        for e in 0..3 {
            let off = coordinates(&self.beyond[e], centre, spacing);
            let along = coordinates(&self.along[e], centre, spacing);
            for i in 0..WIDTH {
                let past = larger(larger(-along[i], along[i] - self.length[e]), 0.0);
                let squared = off[i] * off[i] + past * past;
                side[i] = if squared < side[i] { squared } else { side[i] };
                beyond[i] = larger(beyond[i], off[i]);
            }
        }
        let height = coordinates(&self.height, centre, spacing);
        let mut out = [0.0; WIDTH];
        for i in 0..WIDTH {
            let in_plane = if beyond[i] > 0.0 { side[i] } else { 0.0 };
            out[i] = height[i] * height[i] + in_plane;
        }
        out
    }
}

#[inline]
fn coordinates(axis: &FacetAxis, centre: &[f32; 3], spacing: f32) -> FacetLanes {
    let base = axis[0] * centre[0] + axis[1] * centre[1] + axis[2] * centre[2] + axis[3];
    let [x, y, z] = [axis[0] * spacing, axis[1] * spacing, axis[2] * spacing];
    let mut out = [0.0; WIDTH];
    for i in 0..WIDTH {
        out[i] = base + (x * STEPS[0][i] + y * STEPS[1][i] + z * STEPS[2][i]);
    }
    out
}

/// One vector instruction, which `f32::max` with its rule for NaN is not.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::closest_on_triangle;

    fn corner(size: f64) -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-size..size).prop_map(Point3::from)
    }

    fn agrees(corners: &[Point3<f64>; 3]) -> Result<(), TestCaseError> {
        let (middle, cell) = (Point3::new(0.3, -0.2, 0.1), 0.5);
        let Some(facet) = Facet::new(corners, &middle, cell) else { return Ok(()) };
        let (centre, spacing) = ([1.0f32, -2.0, 0.5], 3.0f32);
        let squared = facet.squared_distances(&centre, spacing);
        for i in 0..POINTS {
            let at = Vector3::from_fn(|a, _| f64::from(centre[a] + STEPS[a][i] * spacing));
            let p = middle + at * cell;
            let (q, _) = closest_on_triangle(&p, &corners[0], &corners[1], &corners[2]);
            let (found, exact) = (f64::from(squared[i]).sqrt(), (p - q).norm() / cell);
            let rounding = 1e-6 * f64::from(facet.extent() + 16.0);
            prop_assert!((found - exact).abs() < rounding, "{found} for {exact} at {p}");
            if let Some(height) = facet.height_over(&at) {
                prop_assert!((height.abs() - exact).abs() < 1e-9, "{height} for {exact} at {p}");
            }
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn distances_are_those_to_the_closest_point(a in corner(4.0), b in corner(4.0), c in corner(4.0)) {
            agrees(&[a, b, c])?;
        }

        #[test]
        fn also_to_long_and_thin_triangles(a in corner(900.0), b in corner(1.0), thin in 1e-4..1.0f64) {
            agrees(&[a, b, b + (a - b) * 0.4 + Vector3::new(thin, -thin, 0.5 * thin)])?;
        }
    }
}
