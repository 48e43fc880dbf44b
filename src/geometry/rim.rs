//! The edges at which a surface is open, and how quickly its winding number changes in their sight.
//!
//! Away from triangles the winding number changes only with the view of the openings: its gradient
//! is ∮ r×dl/|r|³ / 4π around them (the law of Biot and Savart for the solid angle), so at most
//! Σ length/(4π·distance²) over their edges. From a point whose winding number is known, its
//! sign therefore holds for all that is reached without meeting the surface, as long as the
//! number cannot have come near one half.

use nalgebra::Point3;

use super::incidence::{Side, Sides};
use super::ray::Ray;
use super::solid_angle::SolidAngle;

/// Winding numbers nearer to one half tell no sign that holds beside their point, too: twice what those of
/// [`Surface::winding`](super::Surface::winding) are off by.
pub const WINDING_DOUBT: f64 = 0.1;
/// Openings of more edges are not looked at edge by edge.
const MOST_EDGES: usize = 4096;

/// The edges at which a surface is open.
#[derive(Debug, Clone)]
pub struct Rim {
    edges: Vec<RimEdge>,
}

/// An edge of an opening.
#[derive(Debug, Clone)]
pub struct RimEdge {
    /// In the direction in which more triangles use it.
    ends: [Point3<f64>; 2],
    /// How many more.
    times: u32,
    middle: Point3<f64>,
    length: f64,
    /// Length times how many more triangles use it.
    weight: f64,
}

impl RimEdge {
    /// How far it is from a point, at least.
    #[must_use]
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        (self.middle - p).norm() - self.length / 2.0
    }

    /// How quickly the winding number may change within `radius` of `p` by this edge.
    #[must_use]
    pub fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        let gap = self.distance(p) - radius;
        if gap > 0.0 { self.weight / (4.0 * std::f64::consts::PI * gap * gap) } else { f64::INFINITY }
    }
}

impl Rim {
    /// The rim of triangles: edges that they do not use as often in one direction as in the other.
    #[must_use]
    pub fn of(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> Self {
        let edge = |(edge, sides): ([u32; 2], &[Side])| {
            let excess = sides.iter().map(|s| if s.upwards { 1i32 } else { -1 }).sum::<i32>();
            let [low, high] = edge.map(|i| vertices[i as usize]);
            let ends = if excess > 0 { [low, high] } else { [high, low] };
            let (times, length) = (excess.unsigned_abs(), (high - low).norm());
            let (middle, weight) = (nalgebra::center(&low, &high), length * f64::from(times));
            (times > 0).then_some(RimEdge { ends, times, middle, length, weight })
        };
        Self { edges: Sides::of(triangles).iter().filter_map(edge).collect() }
    }

    /// Its edges.
    #[must_use]
    pub fn edges(&self) -> &[RimEdge] {
        &self.edges
    }

    /// Whether it has so many edges that they are not looked at one by one.
    #[must_use]
    pub fn is_long(&self) -> bool {
        self.edges.len() > MOST_EDGES
    }

    /// The solid angle of the strips that go from the edges to infinity against a ray, and close the surface, as
    /// seen from where the ray begins. `None` if the ray passes through an edge.
    #[must_use]
    pub(super) fn strips_behind(&self, ray: &Ray) -> Option<f64> {
        let mut sum = SolidAngle::default();
        let direction = ray.direction();
        let length = direction.norm();
        let back = -direction / length;
        for edge in &self.edges {
            let seen = edge.ends.map(|p| ray.see(|axis| p[axis]));
            let side = seen[0].edge(&seen[1]);
            let [a, b] = edge.ends.map(|p| p - ray.from());
            let (la, lb) = (a.norm(), b.norm());
            // Of the triangle with its third corner infinitely far along `back`: the strip runs along the edge
            // the other way round than the surface does.
            let re = la * lb + a.dot(&b) + a.dot(&back) * lb + b.dot(&back) * la;
            if side == 0.0 && re <= 0.0 {
                return None;
            }
            let im = ray.sense() * side / length;
            (0..edge.times).for_each(|_| sum.add(re, im));
        }
        Some(sum.sum())
    }

    /// How quickly the winding number may change within `radius` of `p`.
    #[must_use]
    pub fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        if self.is_long() {
            return f64::INFINITY;
        }
        self.edges.iter().map(|e| e.slope(p, radius)).sum()
    }

    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of_val(&*self.edges)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, open_box, spread, surface};

    #[test]
    fn the_winding_number_changes_no_faster_than_the_slope_says() {
        let open = surface(open_box([0.0; 3], [1.0; 3]));
        let rim = open.rim().unwrap();
        assert_eq!(rim.edges().len(), 4);
        let points: Vec<_> = spread([-1.0; 3], [2.0; 3], 400).collect();
        for (p, q) in points.iter().zip(&points[1..]) {
            let step = (q - p) * 0.05;
            let to = p + step;
            if open.signed_distance(p).abs() > step.norm() {
                let [a, b] = [p, &to].map(|p| open.winding(p).unwrap());
                let most = rim.slope(p, step.norm()) * step.norm();
                // Dipoles stand for what is far.
                assert!((a - b).abs() <= most + WINDING_DOUBT / 2.0, "{a} {b} {most}");
            }
        }
    }

    #[test]
    fn what_is_far_from_an_opening_stays_outside() {
        let open = surface(open_box([0.0; 3], [1.0; 3]));
        let beside = Point3::new(-0.5, 0.5, 0.1);
        assert!(open.stays_outside(&beside, 0.1));
        // It could get through the opening from above.
        assert!(!open.stays_outside(&Point3::new(0.5, 0.5, 1.4), 1.0));
        assert!(!open.stays_outside(&Point3::new(0.5, 0.5, 0.3), 0.01), "it is inside");
        let closed = surface(cuboid([0.0; 3], [1.0; 3]));
        assert!(closed.rim().is_none() && closed.stays_outside(&beside, 9.0));
        assert!(!closed.stays_outside(&Point3::new(0.5, 0.5, 0.3), 0.01));
    }
}
