//! The closest point of a triangle, with the feature it lies on.

use nalgebra::{Point3, Vector3};

use super::Bounds;

/// The feature of a triangle on which a closest point lies. Edge `i` joins corners `i` and `i + 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// The interior.
    Face,
    /// An edge.
    Edge(u8),
    /// A corner.
    Vertex(u8),
}

/// The closest point of a triangle, or of a surface, to some point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The triangle it lies on.
    pub triangle: u32,
    /// Where on the triangle.
    pub feature: Feature,
    /// The point.
    pub point: Point3<f64>,
    /// Distance, not negative.
    pub distance: f64,
}

/// Where the line from `p` along `direction` meets a triangle, borders included (T. Möller and
/// B. Trumbore 1997).
#[must_use]
pub(super) fn crossing(p: &Point3<f64>, direction: &Vector3<f64>, corners: &[Point3<f64>; 3]) -> Option<f64> {
    /// Barycentric slack, so that no line passes between two triangles.
    const BORDER: f64 = 1e-9;
    let [a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let across = direction.cross(&ac);
    let determinant = ab.dot(&across);
    if determinant == 0.0 {
        return None;
    }
    let u = ap.dot(&across) / determinant;
    let q = ap.cross(&ab);
    let v = direction.dot(&q) / determinant;
    let inside = u >= -BORDER && v >= -BORDER && u + v <= 1.0 + BORDER;
    inside.then(|| ac.dot(&q) / determinant)
}

/// How far the edge `[a, b]` gets along the unit vector `direction` until it meets a triangle with a unit normal;
/// 0 where it is through it already. The border belongs to the triangle. Seen against the direction, the corners may
/// follow each other in either sense.
#[must_use]
pub(super) fn met_by_edge(
    [a, b]: &[Point3<f64>; 2],
    direction: &Vector3<f64>,
    corners: &[Point3<f64>; 3],
    normal: &Vector3<f64>,
) -> Option<f64> {
    /// Slack, in units of the planning frame, so that no edge passes between two triangles.
    const BORDER: f64 = 1e-9;
    // The stretch of the edge that is before the triangle, seen along the direction.
    let (mut from, mut to) = (0.0f64, 1.0f64);
    let against = normal.dot(direction);
    for (i, p) in corners.iter().enumerate() {
        let outline = (corners[(i + 1) % 3] - p).cross(direction) * -against.signum();
        let slack = BORDER * outline.norm();
        let [at_a, at_b] = [a, b].map(|x| (x - p).dot(&outline) + slack);
        if at_a < 0.0 && at_b < 0.0 {
            return None;
        }
        if at_a < 0.0 {
            from = from.max(at_a / (at_a - at_b));
        } else if at_b < 0.0 {
            to = to.min(at_a / (at_a - at_b));
        }
    }
    if from > to {
        return None;
    }
    let [at_a, at_b] = [a, b].map(|x| (corners[0] - x).dot(normal) / against);
    let [at_from, at_to] = [from, to].map(|t| at_a + (at_b - at_a) * t);
    (at_from.max(at_to) >= 0.0).then(|| at_from.min(at_to).max(0.0))
}

/// The point of triangle `abc` closest to `p`, and its feature (C. Ericson, Real-Time Collision
/// Detection, 5.1.5: Voronoi regions in barycentric terms).
#[must_use]
#[inline]
pub fn closest_on_triangle(
    p: &Point3<f64>,
    a: &Point3<f64>,
    b: &Point3<f64>,
    c: &Point3<f64>,
) -> (Point3<f64>, Feature) {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (*a, Feature::Vertex(0));
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (*b, Feature::Vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (a + ab * (d1 / (d1 - d3)), Feature::Edge(0));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (*c, Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (a + ac * (d2 / (d2 - d6)), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (b + (c - b) * w, Feature::Edge(1));
    }
    let scale = 1.0 / (va + vb + vc);
    (a + ab * (vb * scale) + ac * (vc * scale), Feature::Face)
}

/// Twice the area times the unit normal; zero for a degenerate triangle.
#[must_use]
#[inline]
pub fn area_normal(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Vector3<f64> {
    (b - a).cross(&(c - a))
}

/// The length of a triangle's longest side, and its two halves when it is cut across that.
#[must_use]
pub fn bisected(corners: &[Point3<f64>; 3]) -> (f64, [[Point3<f64>; 3]; 2]) {
    let length = |i: usize| (corners[(i + 1) % 3] - corners[i]).norm();
    let side = (1..3).fold(0, |best, i| if length(i) > length(best) { i } else { best });
    let [a, b, c] = [0, 1, 2].map(|k| corners[(side + k) % 3]);
    let cut = nalgebra::center(&a, &b);
    (length(side), [[a, cut, c], [cut, b, c]])
}

/// The part of a triangle that lies in a box: a convex polygon, of nine corners at most.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clipped {
    corners: [Point3<f64>; 9],
    count: usize,
}

impl Clipped {
    /// Cut off plane by plane (I. E. Sutherland and G. W. Hodgman 1974). What lies on a plane stays. None if
    /// rounding makes more corners than there is room for.
    pub(super) fn new(triangle: &[Point3<f64>; 3], bounds: &Bounds) -> Option<Self> {
        let mut clipped = Self { corners: [Point3::origin(); 9], count: 3 };
        clipped.corners[..3].copy_from_slice(triangle);
        for axis in 0..3 {
            clipped = clipped.cut(|p| bounds.max[axis] - p[axis])?;
            clipped = clipped.cut(|p| p[axis] - bounds.min[axis])?;
        }
        Some(clipped)
    }

    /// What is left where a linear function is not negative.
    fn cut(&self, inside: impl Fn(&Point3<f64>) -> f64) -> Option<Self> {
        let corners = self.corners();
        if corners.iter().all(|p| inside(p) >= 0.0) {
            return Some(*self);
        }
        let mut left = Self { corners: [Point3::origin(); 9], count: 0 };
        for (p, q) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            let (here, there) = (inside(p), inside(q));
            if here >= 0.0 {
                left.push(*p)?;
            }
            if (here < 0.0 && there > 0.0) || (here > 0.0 && there < 0.0) {
                left.push(p + (q - p) * (here / (here - there)))?;
            }
        }
        Some(left)
    }

    fn push(&mut self, p: Point3<f64>) -> Option<()> {
        *self.corners.get_mut(self.count)? = p;
        self.count += 1;
        Some(())
    }

    pub(super) fn corners(&self) -> &[Point3<f64>] {
        &self.corners[..self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Point3<f64>> {
        prop::array::uniform3(-2.0..2.0f64).prop_map(Point3::from)
    }

    proptest! {
        #[test]
        fn what_is_left_of_a_triangle_is_all_that_lies_in_the_box(
            triangle in prop::array::uniform3(point()),
            corners in prop::array::uniform2(point()),
            direction in point(),
        ) {
            let bounds = Bounds::of(&corners);
            let clipped = Clipped::new(&triangle, &bounds).unwrap();
            prop_assert!(clipped.corners().iter().all(|p| bounds.grown(1e-9).contains(p)));
            let on_triangle = |p: &Point3<f64>| {
                let [a, b, c] = &triangle;
                (closest_on_triangle(p, a, b, c).0 - p).norm() < 1e-9
            };
            prop_assert!(clipped.corners().iter().all(on_triangle));
            let reach = |points: &mut dyn Iterator<Item = Point3<f64>>| {
                points.map(|p| p.coords.dot(&direction.coords)).fold(f64::NEG_INFINITY, f64::max)
            };
            let weights = (0..=40u32).flat_map(|i| (0..=40 - i).map(move |j| [i, j, 40 - i - j]));
            let at = |w: [u32; 3]| {
                Point3::from((0..3).map(|k| triangle[k].coords * f64::from(w[k]) / 40.0).sum::<Vector3<f64>>())
            };
            let within = reach(&mut weights.map(at).filter(|p| bounds.contains(p)));
            prop_assert!(within <= reach(&mut clipped.corners().iter().copied()) + 1e-9);
        }

        #[test]
        fn no_point_of_the_triangle_is_closer(p in point(), a in point(), b in point(), c in point()) {
            let (q, _) = closest_on_triangle(&p, &a, &b, &c);
            let best = (p - q).norm();
            for i in 0..=20 {
                for j in 0..=(20 - i) {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let r = a + (b - a) * u + (c - a) * v;
                    prop_assert!((p - r).norm() >= best - 1e-9);
                }
            }
        }
    }

    #[test]
    fn a_triangle_is_cut_across_its_longest_side() {
        let [a, b, c] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]].map(Point3::from);
        let (length, halves) = bisected(&[a, b, c]);
        assert!((length - 5f64.sqrt()).abs() < 1e-12);
        let area = |[p, q, r]: [Point3<f64>; 3]| area_normal(&p, &q, &r).z;
        assert!(halves.iter().all(|h| (area(*h) - area([a, b, c]) / 2.0).abs() < 1e-12));
    }
}
