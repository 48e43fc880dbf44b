//! Convex hulls and the test whether two of them are apart.
//!
//! Hulls are kept as their vertices. Separation is proved by a plane: GJK (parry) proposes a
//! direction and the projections of both vertex sets certify it, so an answer of "apart" never
//! rests on an algorithm that gave up.

use nalgebra::{Point3, Vector3};
use parry3d_f64::math::{Pose as ParryPose, Vector as ParryVector};
use parry3d_f64::query::gjk::CsoPoint;
use parry3d_f64::query::gjk::{GJKResult, VoronoiSimplex, closest_points};
use parry3d_f64::shape::SupportMap;
use parry3d_f64::transformation::try_convex_hull;
use rayon::prelude::*;

use super::{Bounds, Cloud, Pose};

/// Quickhull takes ever longer per point where most points are on the hull: of 10,000 such points 1.9 µs each on a slow
/// core, of 1,000 0.7 µs, of half a million 19 µs. At half of this, chunks are used where the whole takes no longer; at
/// double, a hull takes more than 1 µs per triangle.
const WHOLE: usize = 10_000;
/// Points of a chunk. At half, more points of the chunks' borders are left; at double, each point takes a fifth longer.
const CHUNK: usize = 1_000;
/// The next pass is worth its time if the last one left no more than this share.
const SHRUNK: f64 = 0.8;

/// The vertices of the convex hull of `points`; all points where they are too flat for a hull. Of very many there may be
/// some points among them that are no vertices, but none that is missing.
#[must_use]
pub fn hull_vertices(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    if points.len() <= WHOLE {
        return hull_of_few(points);
    }
    let mut left = points.to_vec();
    loop {
        let count = left.len();
        let found = hulls_of_chunks(left);
        if found.len() <= WHOLE {
            return hull_of_few(&found);
        }
        if found.len() as f64 > SHRUNK * count as f64 {
            return found;
        }
        left = found;
    }
}

/// The points that are vertices of the hull of a chunk of points near each other and the centre of all. A vertex of the
/// hull of all points is one of the hull of any of them; and the centre, which lies within the hull of all, keeps the
/// inner side of a chunk from being left.
fn hulls_of_chunks(mut points: Vec<Point3<f64>>) -> Vec<Point3<f64>> {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let centre = Point3::from(sum / points.len() as f64);
    let mut chunks = vec![&mut *points];
    while chunks.first().is_some_and(|chunk| chunk.len() > CHUNK) {
        chunks = chunks.into_par_iter().flat_map_iter(halves).collect();
    }
    let hull = |chunk: &mut [Point3<f64>]| {
        let mut hull = hull_of_few(&[&*chunk, &[centre]].concat());
        hull.retain(|p| *p != centre);
        hull
    };
    chunks.into_par_iter().flat_map_iter(hull).collect()
}

/// Halves of some points, apart along the longest side of their box.
fn halves(points: &mut [Point3<f64>]) -> [&mut [Point3<f64>]; 2] {
    let axis = Bounds::of(&*points).extents().imax();
    let middle = points.len() / 2;
    // By all coordinates: so the halves do not depend on the order of equal ones.
    let order = |p: &Point3<f64>, q: &Point3<f64>| {
        let by = |k: usize| p[(axis + k) % 3].total_cmp(&q[(axis + k) % 3]);
        by(0).then_with(|| by(1)).then_with(|| by(2))
    };
    points.select_nth_unstable_by(middle, order);
    points.split_at_mut(middle).into()
}

fn hull_of_few(points: &[Point3<f64>]) -> Vec<Point3<f64>> {
    let input: Vec<ParryVector> = points.iter().map(|p| ParryVector::new(p.x, p.y, p.z)).collect();
    match try_convex_hull(&input) {
        Ok((vertices, _)) if covers(&vertices, points) => {
            vertices.iter().map(|v| Point3::new(v.x, v.y, v.z)).collect()
        }
        _ => points.to_vec(),
    }
}

/// Whether a computed hull reaches as far as the points it is meant to hold, in 26 directions.
/// Guards against numerical failure of the hull algorithm on coplanar input.
fn covers(hull: &[ParryVector], points: &[Point3<f64>]) -> bool {
    let size = Bounds::of(points).extents().norm();
    (0..27).filter(|i| *i != 13).all(|i| {
        let d = Vector3::new(f64::from(i % 3 - 1), f64::from(i / 3 % 3 - 1), f64::from(i / 9 - 1));
        let reach = points.iter().map(|p| p.coords.dot(&d)).fold(f64::NEG_INFINITY, f64::max);
        hull.iter().any(|v| v.x * d.x + v.y * d.y + v.z * d.z >= reach - 1e-7 * size)
    })
}

/// Few points.
struct Few<'a>(&'a [Point3<f64>]);

impl Few<'_> {
    /// How far the furthest along a direction lies, and which it is.
    fn furthest(&self, along: &Vector3<f64>) -> (f64, usize) {
        let mut best = (f64::NEG_INFINITY, 0);
        for (i, p) in self.0.iter().enumerate() {
            let reach = p.coords.dot(along);
            if reach > best.0 {
                best = (reach, i);
            }
        }
        best
    }
}

impl SupportMap for Few<'_> {
    fn local_support_point(&self, dir: ParryVector) -> ParryVector {
        let p = self.0[self.furthest(&Vector3::new(dir.x, dir.y, dir.z)).1];
        ParryVector::new(p.x, p.y, p.z)
    }
}

/// The vertices of a hull, of which the furthest along a direction is asked for again and again.
#[derive(Debug)]
pub struct Support<'a> {
    points: &'a [Point3<f64>],
    /// The same, if they are many.
    cloud: Option<Cloud>,
}

/// Of fewer points, the furthest is found in all tests of a pair before they are in a cloud. Regions, which grow
/// by one test of many pairs, ask no cloud at all.
const MANY: usize = 128;

impl<'a> Support<'a> {
    /// That of some points.
    #[must_use]
    pub fn of(points: &'a [Point3<f64>]) -> Self {
        let cloud = (points.len() >= MANY).then(|| {
            let mut cloud = Cloud::default();
            cloud.refill(points);
            cloud
        });
        Self { points, cloud }
    }

    /// How far another lies beyond it along a unit direction.
    #[must_use]
    pub fn gap_along(&self, direction: &Vector3<f64>, other: &Self) -> f64 {
        -other.furthest(&-direction).0 - self.furthest(direction).0
    }

    fn furthest(&self, along: &Vector3<f64>) -> (f64, usize) {
        let found = self.cloud.as_ref().and_then(|cloud| cloud.furthest(along));
        found.unwrap_or_else(|| Few(self.points).furthest(along))
    }
}

impl SupportMap for Support<'_> {
    fn local_support_point(&self, dir: ParryVector) -> ParryVector {
        let p = self.points[self.furthest(&Vector3::new(dir.x, dir.y, dir.z)).1];
        ParryVector::new(p.x, p.y, p.z)
    }
}

/// How far apart two vertex sets are along a unit direction (positive: `b` lies beyond `a`).
#[must_use]
pub fn gap_along(direction: &Vector3<f64>, a: &[Point3<f64>], b: &[Point3<f64>]) -> f64 {
    let far = a.iter().map(|p| p.coords.dot(direction)).fold(f64::NEG_INFINITY, f64::max);
    let near = b.iter().map(|p| p.coords.dot(direction)).fold(f64::INFINITY, f64::min);
    near - far
}

/// A unit direction along which hull `b` lies at least `margin` beyond hull `a`, if one was found.
/// `hint` is tried first.
#[must_use]
pub fn separating_direction(
    a: &[Point3<f64>],
    b: &[Point3<f64>],
    margin: f64,
    hint: Option<Vector3<f64>>,
) -> Option<Vector3<f64>> {
    if let Some(d) = hint
        && gap_along(&d, a, b) >= margin
    {
        return Some(d);
    }
    if a.is_empty() || b.is_empty() {
        return Some(Vector3::x());
    }
    proposed(&Few(a), &Few(b)).filter(|d| gap_along(d, a, b) >= margin)
}

/// The same of large hulls, or such of which more is asked, without a hint.
#[must_use]
pub fn separating(a: &Support<'_>, b: &Support<'_>, margin: f64) -> Option<Vector3<f64>> {
    if a.points.is_empty() || b.points.is_empty() {
        return Some(Vector3::x());
    }
    proposed(a, b).filter(|d| a.gap_along(d, b) >= margin)
}

/// The direction that GJK proposes for two hulls that have points.
fn proposed<S: SupportMap>(a: &S, b: &S) -> Option<Vector3<f64>> {
    let d = match gjk(a, b) {
        GJKResult::ClosestPoints(_, _, d) | GJKResult::Proximity(d) | GJKResult::NoIntersection(d) => d,
        GJKResult::Intersection => return None,
    };
    Vector3::new(d.x, d.y, d.z).try_normalize(1e-12)
}

fn gjk<S: SupportMap>(a: &S, b: &S) -> GJKResult {
    let start = a.local_support_point(ParryVector::X) - b.local_support_point(-ParryVector::X);
    let mut simplex = VoronoiSimplex::new();
    simplex.reset(CsoPoint::from_shapes(&ParryPose::IDENTITY, a, b, start));
    closest_points(&ParryPose::IDENTITY, a, b, f64::MAX, true, &mut simplex)
}

/// How far two hulls of a few points are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HullDistance {
    /// A bound that projections certify: they are no nearer. 0 where they meet.
    pub at_least: f64,
    /// A point of either, nearest to each other up to rounding; `None` where they meet.
    pub points: Option<[Point3<f64>; 2]>,
}

/// The distance of two hulls of at least one point each.
#[must_use]
pub fn hull_distance(a: &[Point3<f64>], b: &[Point3<f64>]) -> HullDistance {
    let (d, points) = match gjk(&Few(a), &Few(b)) {
        GJKResult::ClosestPoints(p, q, d) => (d, Some([p, q].map(|p| Point3::new(p.x, p.y, p.z)))),
        GJKResult::Proximity(d) | GJKResult::NoIntersection(d) => (d, None),
        GJKResult::Intersection => return HullDistance { at_least: 0.0, points: None },
    };
    let direction = Vector3::new(d.x, d.y, d.z).try_normalize(1e-12);
    HullDistance { at_least: direction.map_or(0.0, |d| gap_along(&d, a, b).max(0.0)), points }
}

/// Points after a pose.
#[must_use]
pub fn transformed(points: &[Point3<f64>], pose: &Pose) -> Vec<Point3<f64>> {
    points.iter().map(|p| pose * p).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::spread;

    fn cube(at: f64) -> Vec<Point3<f64>> {
        (0..8).map(|i| Point3::new(at + f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect()
    }

    #[test]
    fn apart_is_certified_and_touching_is_not_apart() {
        assert!(separating_direction(&cube(0.0), &cube(1.5), 1e-3, None).is_some());
        assert!(separating_direction(&cube(0.0), &cube(1.0), 1e-3, None).is_none());
        assert!(separating_direction(&cube(0.0), &cube(0.3), 1e-3, None).is_none());
    }

    #[test]
    fn a_contained_hull_is_not_apart() {
        let inner: Vec<_> =
            cube(0.0).iter().map(|p| Point3::from(p.coords * 0.2 + Vector3::repeat(0.4))).collect();
        assert!(separating_direction(&cube(0.0), &inner, 0.0, None).is_none());
    }

    #[test]
    fn hulls_of_many_points_reach_as_far_as_these() {
        let ball: Vec<_> = spread([-1.0; 3], [1.0; 3], 30_000).collect();
        let on_sphere: Vec<_> = ball.iter().map(|p| Point3::from(p.coords.normalize())).collect();
        let flat: Vec<_> = ball.iter().map(|p| Point3::new(p.x, p.y, 0.3)).collect();
        let cup = [on_sphere.clone(), cube(-0.5), ball.clone()].concat();
        let found = [&ball, &on_sphere, &flat, &cup].map(|points| hull_vertices(points));
        for (points, hull) in [&ball, &on_sphere, &flat, &cup].into_iter().zip(&found) {
            assert!(hull.iter().all(|p| points.contains(p)));
            let reach = |of: &[Point3<f64>], d: &Vector3<f64>| Few(of).furthest(d).0;
            let along = spread([-1.0; 3], [1.0; 3], 200).map(|p| p.coords);
            for d in along.chain([Vector3::x(), Vector3::y(), -Vector3::z()]) {
                assert!((reach(points, &d) - reach(hull, &d)).abs() < 1e-12, "{} along {d}", hull.len());
            }
        }
        let [ball, on_sphere, _, cup] = found.map(|hull| hull.len());
        assert!(ball < 2000 && on_sphere > 29_000 && cup < 2000, "{ball}, {on_sphere}, {cup}");
    }

    #[test]
    fn interior_points_leave_the_hull() {
        let mut points = cube(0.0);
        points.push(Point3::new(0.5, 0.5, 0.5));
        assert_eq!(hull_vertices(&points).len(), 8);
    }
}
