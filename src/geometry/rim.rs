//! The edges at which a surface is open, and how quickly its winding number changes in their sight.
//!
//! Away from triangles the winding number changes only with the view of the openings: its gradient
//! is ∮ r×dl/|r|³ / 4π around them (the law of Biot and Savart for the solid angle), so at most
//! Σ length/(4π·distance²) over their edges. From a point whose winding number is known, its
//! sign therefore holds for all that is reached without meeting the surface, as long as the
//! number cannot have come near one half.

use nalgebra::Point3;

use super::incidence::{Side, Sides};

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
    middle: Point3<f64>,
    length: f64,
    /// Length times how many triangles more use it in one direction than in the other.
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
            let excess = sides.iter().map(|s| if s.upwards { 1i32 } else { -1 }).sum::<i32>().unsigned_abs();
            let [a, b] = edge.map(|i| vertices[i as usize]);
            let length = (b - a).norm();
            let weight = length * f64::from(excess);
            (excess > 0).then(|| RimEdge { middle: nalgebra::center(&a, &b), length, weight })
        };
        Self { edges: Sides::of(triangles).iter().filter_map(edge).collect() }
    }

    /// Its edges.
    #[must_use]
    pub fn edges(&self) -> &[RimEdge] {
        &self.edges
    }

    /// How quickly the winding number may change within `radius` of `p`.
    #[must_use]
    pub fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        if self.edges.len() > MOST_EDGES {
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
