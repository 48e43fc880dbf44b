//! The edges at which a surface is open, and how quickly its winding number changes in their sight.
//!
//! Away from triangles the winding number changes only with the view of the openings: its gradient
//! is ∮ r×dl/|r|³ / 4π around them (the law of Biot and Savart for the solid angle), so at most
//! Σ length/(4π·distance²) over their edges. From a point whose winding number is known, its
//! sign therefore holds for all that is reached without meeting the surface, as long as the
//! number cannot have come near one half.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use super::incidence::{Side, Sides};
use super::ray::{Ray, edge};
use super::solid_angle::SolidAngle;

/// Winding numbers nearer to one half tell no sign that holds beside their point, too: twice what those of
/// [`Surface::winding`](super::Surface::winding) are off by.
pub const WINDING_DOUBT: f64 = 0.1;
/// Openings of more edges are not looked at edge by edge.
const MOST_EDGES: usize = 4096;

/// Openings further away than so many of their radii count as dipoles: off by a sixteenth part of what is at
/// most a hundredth of a turn.
const FAR: f64 = 4.0;

/// The edges at which a surface is open.
#[derive(Debug, Clone)]
pub struct Rim {
    /// Opening by opening.
    edges: Vec<RimEdge>,
    openings: Vec<RimOpening>,
}

/// Edges of the rim that hang together: as often as one leads to a vertex, another one leads away.
#[derive(Debug, Clone)]
struct RimOpening {
    edges: std::ops::Range<usize>,
    /// A ball that holds them.
    centre: Point3<f64>,
    radius: f64,
    /// The sum of their weights.
    weight: f64,
    /// Of what closes it: the sum of normals times areas, outward.
    dipole: Vector3<f64>,
}

/// Openings by which the winding number changes less than this are not looked at more closely.
const FLAT: f64 = 1e-3;

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

impl RimEdge {
    /// Adds the solid angle of the strip from the edge to infinity against a ray. `None` if the ray passes
    /// through the edge.
    fn strip(&self, ray: &Ray, sum: &mut SolidAngle) -> Option<()> {
        let side = edge(ray.see(&self.ends[0]).beside, ray.see(&self.ends[1]).beside);
        let [a, b] = self.ends.map(|p| p - ray.from());
        let (la, lb) = (a.norm(), b.norm());
        // Of the triangle whose third corner is infinitely far behind. The strip runs along the edge the other
        // way round than the surface does.
        let along = (a * lb + b * la).dot(ray.direction()) / ray.length();
        let re = la * lb + a.dot(&b) - along;
        if side == 0.0 && re <= 0.0 {
            return None;
        }
        let im = ray.sense() * side / ray.length();
        (0..self.times).for_each(|_| sum.add(re, im));
        Some(())
    }
}

impl Rim {
    /// The rim of triangles: edges that they do not use as often in one direction as in the other.
    #[must_use]
    pub fn of(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> Self {
        let used = |(edge, sides): ([u32; 2], &[Side])| {
            let excess = sides.iter().map(|s| if s.upwards() { 1i32 } else { -1 }).sum::<i32>();
            let [low, high] = edge.map(|i| vertices[i as usize]);
            let ends = if excess > 0 { [low, high] } else { [high, low] };
            let (times, length) = (excess.unsigned_abs(), (high - low).norm());
            let (middle, weight) = (nalgebra::center(&low, &high), length * f64::from(times));
            (times > 0).then_some((edge, RimEdge { ends, times, middle, length, weight }))
        };
        let edges = Sides::of(triangles).iter().filter_map(used).collect();
        Self::of_edges(edges)
    }

    fn of_edges(mut edges: Vec<([u32; 2], RimEdge)>) -> Self {
        let mut hung = UnionFind::default();
        edges.iter().for_each(|([a, b], _)| hung.unite(*a, *b));
        edges.sort_by_cached_key(|([a, _], _)| hung.root(*a));
        let opening = |some: &[([u32; 2], RimEdge)], start: usize| {
            let edges = some.iter().map(|(_, e)| e);
            let sum: Vector3<f64> = edges.clone().map(|e| e.middle.coords).sum();
            let centre = Point3::from(sum / some.len() as f64);
            let radius = edges.clone().flat_map(|e| e.ends).map(|p| (p - centre).norm()).fold(0.0, f64::max);
            // Closed by a cone, which runs along the edges the other way round than the surface does.
            let cone = |e: &RimEdge| {
                let [a, b] = e.ends.map(|p| p - centre);
                b.cross(&a) * (0.5 * f64::from(e.times))
            };
            let weight = edges.clone().map(|e| e.weight).sum();
            RimOpening {
                edges: start..start + some.len(),
                centre,
                radius,
                weight,
                dipole: edges.map(cone).sum(),
            }
        };
        let mut openings = Vec::new();
        let mut start = 0;
        for some in edges.chunk_by(|([a, _], _), ([b, _], _)| hung.root(*a) == hung.root(*b)) {
            openings.push(opening(some, start));
            start += some.len();
        }
        Self { edges: edges.into_iter().map(|(_, e)| e).collect(), openings }
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
        let mut near = SolidAngle::default();
        let mut far = 0.0;
        for opening in &self.openings {
            match opening.as_dipole(ray) {
                Some(angle) => far += angle,
                None => self.edges[opening.edges.clone()].iter().try_for_each(|e| e.strip(ray, &mut near))?,
            }
        }
        Some(near.sum() + far)
    }

    /// How quickly the winding number may change within `radius` of `p`.
    #[must_use]
    pub fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        if self.is_long() {
            return f64::INFINITY;
        }
        let slope = |o: &RimOpening| {
            let far = o.slope(p, radius);
            // Edge by edge is no less where it is far.
            if far < FLAT {
                return far;
            }
            far.min(self.edges[o.edges.clone()].iter().map(|e| e.slope(p, radius)).sum())
        };
        self.openings.iter().map(slope).sum()
    }

    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of_val(&*self.edges) + size_of_val(&*self.openings)
    }
}

impl RimOpening {
    /// The solid angle of the strips behind a ray, if the ray begins far from the opening and does not pass it:
    /// then it is that of whatever closes the opening.
    fn as_dipole(&self, ray: &Ray) -> Option<f64> {
        let d = self.centre - ray.from();
        let r2 = d.norm_squared();
        let is_far = r2 > (FAR * self.radius).powi(2);
        (is_far && !ray.passes(&self.centre, self.radius)).then(|| self.dipole.dot(&d) / (r2 * r2.sqrt()))
    }

    /// How quickly the winding number may change within `radius` of `p` by all its edges. Their directions add
    /// up to nothing, so only by how much their views differ counts: at most 2·radius/distance³ each.
    fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        let gap = (self.centre - p).norm() - self.radius - radius;
        if gap <= 0.0 {
            return f64::INFINITY;
        }
        self.weight * 2.0 * self.radius / (4.0 * std::f64::consts::PI * gap.powi(3))
    }
}

/// Which vertices hang together.
#[derive(Default)]
struct UnionFind {
    parent: HashMap<u32, u32>,
}

impl UnionFind {
    fn root(&self, mut v: u32) -> u32 {
        while let Some(&up) = self.parent.get(&v).filter(|&&up| up != v) {
            v = up;
        }
        v
    }

    fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent.insert(a.max(b), a.min(b));
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
