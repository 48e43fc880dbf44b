//! Convex regions that a surface does not enter.
//!
//! Grown from a seed as in IRIS (R. Deits and R. Tedrake 2014, the step that separates obstacles):
//! the nearest triangle gets a plane between it and the seed, which rules out all triangles behind
//! it, then the nearest of the rest, until none is left in the ball that was asked for. What is
//! convex has all of a hull in it that has the hull's corners: a few points decide about a whole
//! piece of surface, and about all of its straight motion.

mod growth;

use nalgebra::{Point3, Vector3};

use super::half_space::{Cloud, HalfSpace};
use super::{SignedClosest, Surface};
use growth::grown;

/// A surface may reach so far into a region, in the planning frame: rounding of flush faces.
const TOUCH: f64 = 2e-6;
/// A point so deep in a region is well inside.
const INNER: f64 = 2.0 * TOUCH;
/// Points nearer to the surface than this, in the planning frame, count as on it.
const SKIN: f64 = 1e-6;
/// What is no further below a plane counts as above it.
const ROUNDING: f64 = 1e-12;
/// Steps of alternating projection before a point counts as too far.
const PROJECTIONS: usize = 8;

/// A ball cut by half-spaces into which a surface nowhere reaches further than rounding.
#[derive(Debug, Clone, PartialEq)]
pub struct FreeRegion {
    centre: Point3<f64>,
    radius: f64,
    sides: Vec<HalfSpace>,
    /// The triangle in front of which each side is.
    triangles: Vec<u32>,
    /// A point well inside, which is outside the surface.
    inner: Point3<f64>,
}

/// What a region is to hold.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// Points …
    pub points: &'a [Point3<f64>],
    /// … none of which may be further than this from any of its sides.
    pub most: f64,
    /// Whether triangles may lie behind a side that sees their back, as that of a wall of which
    /// another side is nearer. Not worth its time where points may be inside: what is seen from
    /// behind is entered there, mostly.
    pub from_behind: bool,
    /// A unit vector across the points, towards where they are free, if any is likely; else zero.
    pub facing: Vector3<f64>,
    /// Points may be this far behind a side as if they were before it. Without that, planes askew to all faces are
    /// taken because they leave a little more room before the few points, two of which make a wedge that is far from
    /// these: of a nut that is a hair too tight for its bolt all small pieces by its ends were without a region.
    pub spared: f64,
}

/// Why there is no region worth having.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoRegion {
    /// This triangle is amid the points that were wanted: no plane was found between them.
    Amid(u32),
    /// There is too little room around the seed, or it is too complicated.
    Cramped,
}

impl FreeRegion {
    /// A ball cut by half-spaces, each in front of a triangle, of which it is known from elsewhere that a surface
    /// does not enter it.
    #[must_use]
    pub fn known(
        (centre, radius): (Point3<f64>, f64),
        sides: impl IntoIterator<Item = (Vector3<f64>, f64, u32)>,
    ) -> Self {
        let sides = sides.into_iter().map(|(normal, height, t)| (HalfSpace { normal, height }, t));
        let (sides, triangles) = sides.unzip();
        Self { centre, radius, sides, triangles, inner: centre }
    }

    /// How far a point is inside all sides and the ball; negative outside.
    #[must_use]
    pub fn slack(&self, p: &Point3<f64>) -> f64 {
        let room = self.radius - (p - self.centre).norm();
        self.sides.iter().map(|side| side.above(p)).fold(room, f64::min)
    }

    /// An upper bound of the distance of a point from the region (0 inside), unless that is more
    /// than `most`.
    #[must_use]
    pub fn distance_within(&self, p: &Point3<f64>, most: f64) -> Option<f64> {
        self.nearest_within(p, most, 0.0).map(|q| (q - p).norm())
    }

    /// How far the lowest of some points is above each of its planes, in their order.
    #[must_use]
    pub fn gaps(&self, points: &Cloud) -> Vec<f64> {
        self.sides.iter().map(|side| points.least_above(side)).collect()
    }

    /// An upper bound of the distance of some points from the region when they are shifted, unless that
    /// is more than `most`. `gaps` are those of the points without the shift.
    #[must_use]
    pub fn distance_of_shifted(
        &self,
        points: &[Point3<f64>],
        gaps: &[f64],
        shift: &Vector3<f64>,
        most: f64,
    ) -> Option<f64> {
        // Most points are above all planes, as these tell all at once.
        let sides = self.sides.iter().zip(gaps);
        let passed = sides.filter(|(side, gap)| **gap + side.normal.dot(shift) < -ROUNDING);
        let passed: Vec<&HalfSpace> = passed.map(|(side, _)| side).collect();
        let is_inside = |p: &Point3<f64>| {
            passed.iter().all(|side| side.above(p) >= -ROUNDING)
                && (p - self.centre).norm_squared() <= self.radius * self.radius
        };
        self.furthest(points.iter().map(|p| p + shift).filter(|p| !is_inside(p)), most).map(|(far, _)| far)
    }

    /// The point that is furthest outside, and its [distance](Self::distance_within); `None` if that is more than
    /// `most` of any.
    #[must_use]
    pub fn furthest(
        &self,
        points: impl IntoIterator<Item = Point3<f64>>,
        most: f64,
    ) -> Option<(f64, Point3<f64>)> {
        points.into_iter().try_fold((0.0, Point3::origin()), |far, p| {
            let d = self.distance_within(&p, most)?;
            Some(if d > far.0 { (d, p) } else { far })
        })
    }

    /// A point `inset` inside all sides and no further than `most` from `p`, by alternating
    /// projection.
    fn nearest_within(&self, p: &Point3<f64>, most: f64, inset: f64) -> Option<Point3<f64>> {
        let mut q = *p;
        for _ in 0..PROJECTIONS {
            let mut deepest = (ROUNDING, None);
            for side in &self.sides {
                let below = inset - side.above(&q);
                if below > deepest.0 {
                    deepest = (below, Some(side.normal));
                }
            }
            let Some(normal) = deepest.1 else {
                return ((q - self.centre).norm() <= self.radius).then_some(q);
            };
            q += normal * deepest.0;
            if (q - p).norm_squared() > most * most {
                return None;
            }
        }
        None
    }

    /// The triangles whose planes some of these points have passed by more than `most`.
    pub fn passed(&self, points: &Cloud, most: f64) -> impl Iterator<Item = u32> {
        let sides = self.sides.iter().zip(&self.triangles);
        sides.filter(move |(side, _)| points.least_above(side) < -most).map(|(_, triangle)| *triangle)
    }

    /// The unit normals of the planes that bound it, which point inside, and the triangle in front of which each
    /// of them is.
    pub fn planes(&self) -> impl Iterator<Item = (Vector3<f64>, u32)> {
        self.sides.iter().map(|side| side.normal).zip(self.triangles.iter().copied())
    }

    /// The middle of the ball that it was asked for in.
    #[must_use]
    pub fn centre(&self) -> Point3<f64> {
        self.centre
    }

    /// The radius of that ball, or as much of it as is free.
    #[must_use]
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Whether all of it is outside a surface that does not enter it: of an open one, part of it may be inside.
    #[must_use]
    pub fn is_outside(&self, surface: &Surface) -> bool {
        let farthest = (self.inner - self.centre).norm() + self.radius;
        !surface.is_open() || surface.stays_outside(&self.inner, farthest)
    }

    /// Whether a ball lies inside.
    #[must_use]
    pub fn holds_ball(&self, centre: &Point3<f64>, radius: f64) -> bool {
        (centre - self.centre).norm() + radius <= self.radius
            && self.sides.iter().all(|side| side.above(centre) >= radius)
    }
}

impl Surface {
    /// A convex region that holds the middle of a ball, or what is outside nearest to that: as
    /// [`Surface::free_region`]. `seen` is what of the surface is nearest to the centre.
    ///
    /// # Errors
    /// There is none worth having.
    pub fn free_region_around(
        &self,
        centre: &Point3<f64>,
        radius: f64,
        seen: &SignedClosest,
        wanted: Wanted<'_>,
    ) -> Result<FreeRegion, NoRegion> {
        let seed = if seen.signed > SKIN {
            *centre
        } else {
            let outward = self.pseudo_normal(&seen.closest).try_normalize(0.0);
            seen.closest.point + outward.ok_or(NoRegion::Cramped)? * (seen.closest.distance + SKIN)
        };
        self.free_region(&seed, radius + wanted.most + (seed - centre).norm(), wanted)
    }

    /// A convex region around `seed`, within `radius`, that the surface does not enter. If
    /// the surface is closed, all of the region is outside. No wanted point, nor the seed, is
    /// further than [`Wanted::most`] from any of its sides.
    ///
    /// # Errors
    /// There is none worth having.
    pub fn free_region(
        &self,
        seed: &Point3<f64>,
        radius: f64,
        wanted: Wanted<'_>,
    ) -> Result<FreeRegion, NoRegion> {
        let most = wanted.most;
        let region = grown(self, seed, radius, wanted)?;
        let nearest = region.triangles.first().copied().unwrap_or(0);
        // No surface passes through: all of the region is where one point well inside is. (A region
        // too thin to have one may follow the plane of a face into the solid.)
        let inner = region.nearest_within(seed, most + 4.0 * INNER, INNER).ok_or(NoRegion::Cramped)?;
        let is_outside = self.signed_closest(&inner, nearest).signed > 0.0;
        if is_outside { Ok(FreeRegion { inner, ..region }) } else { Err(NoRegion::Cramped) }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{ball, cuboid, joined, l_shape, rod, spread, surface, tube};
    use crate::geometry::SourceMesh;

    fn near(points: &[Point3<f64>]) -> Wanted<'_> {
        Wanted { points, most: 0.1, from_behind: true, facing: Vector3::zeros(), spared: 0.0 }
    }

    #[test]
    fn across_the_ridge_of_a_long_bar_there_is_room_for_what_lies_a_little_askew() {
        // A strip 0.0003 below the ridge at x = 1, not quite along it: below the planes of both faces it is
        // too deep, and a plane along it would have to be far out to be clear of the bar's other end.
        let bar = surface(rod(1.0, [-4.0, 4.0], 24));
        let (tilt, below) = (1e-3, 3e-4);
        for z in [-3.0, 0.0, 3.0] {
            let corner = |y: f64, along: f64| Point3::new(1.0 - below - tilt * along, y, z + along);
            let points = [corner(-0.008, -0.1), corner(0.008, -0.1), corner(0.0, 0.1)];
            let facing = Vector3::new(1.0, 0.0, tilt).normalize();
            let wanted = Wanted { most: 1e-3, facing, ..near(&points) };
            let region = bar.free_region(&Point3::new(1.0 + 1e-6, 0.0, z), 0.2, wanted).unwrap();
            assert!(points.iter().all(|p| region.distance_within(p, 1e-3).is_some()));
        }
    }

    #[test]
    fn above_a_plate_all_is_free() {
        let plate = surface(cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]));
        for seed in [Point3::new(0.3, 0.2, 0.0), Point3::new(-1.0, 2.0, 0.7)] {
            let region = plate.free_region(&seed, 3.0, near(&[seed])).unwrap();
            assert_eq!(region.sides.len(), 1, "{region:?}");
            assert_eq!(region.distance_within(&Point3::new(1.0, 1.0, 0.0), 0.0), Some(0.0));
            assert_eq!(region.distance_within(&Point3::new(1.0, 1.0, -0.2), 0.1), None);
            let deep = region.distance_within(&Point3::new(1.0, 1.0, -0.2), 1.0).unwrap();
            assert!((deep - 0.2).abs() < 1e-12, "{deep}");
            assert_eq!(region.distance_within(&(seed + Vector3::z() * 3.1), 1.0), None);
            assert!(region.holds_ball(&(seed + Vector3::z()), 0.9));
            assert!(!region.holds_ball(&seed, 0.9) || seed.z >= 0.9);
        }
    }

    #[test]
    fn needles_out_of_reach_are_not_in_the_way() {
        // Beyond the tip of a needle, there is little between a point and the planes of its sides.
        let pyramid = |tip: f64, base: f64, half: f64| SourceMesh {
            vertices: vec![[0.0, 0.0, tip], [half, 0.0, base], [-half, half, base], [-half, -half, base]],
            triangles: vec![[0, 1, 2], [0, 2, 3], [0, 3, 1], [3, 2, 1]],
        };
        let needle = surface(joined([pyramid(0.0, -1.0, 0.01), pyramid(1.5, 2.0, 1.0)]));
        let region = needle.free_region(&Point3::new(0.0, 0.0, 0.5), 0.1, near(&[])).unwrap();
        assert!(region.sides.is_empty() && region.radius == 0.1, "{region:?}");
    }

    #[test]
    fn the_inside_of_a_tube_is_one_region() {
        let tube = surface(tube(1.0, 2.0, [-3.0, 3.0], 24));
        let region = tube.free_region(&Point3::origin(), 2.5, near(&[Point3::origin()])).unwrap();
        assert_eq!(region.sides.len(), 24);
        for k in 0..24 {
            let angle = f64::from(k) * std::f64::consts::TAU / 24.0;
            let on_wall = Point3::new(angle.cos(), angle.sin(), 1.5);
            assert!(region.distance_within(&on_wall, 1e-9).is_some());
        }
    }

    #[test]
    fn a_reentrant_corner_has_two_sides() {
        let l = surface(l_shape());
        let region = l.free_region(&Point3::new(1.0, 1.0, 0.5), 0.4, near(&[])).unwrap();
        assert_eq!(region.sides.len(), 2, "{region:?}");
        // Beside the corner, both walls count.
        let d = region.distance_within(&Point3::new(0.97, 0.96, 0.5), 1.0).unwrap();
        assert!((d - 0.05).abs() < 1e-12, "{d}");
    }

    proptest! {
        #[test]
        fn shifted_points_are_as_far_as_each_of_them(
            seed in prop::array::uniform3(-2.5..2.5f64),
            shift in prop::array::uniform3(-0.3..0.3f64),
        ) {
            let (seed, shift) = (Point3::from(seed), Vector3::from(shift));
            let s = surface(l_shape());
            prop_assume!(s.signed_distance(&seed) >= 0.0);
            let Ok(region) = s.free_region(&seed, 1.5, near(&[seed])) else { return Ok(()) };
            let points: Vec<_> = spread([-0.2; 3], [0.2; 3], 30).map(|p| seed + p.coords).collect();
            let mut cloud = Cloud::default();
            cloud.refill(&points);
            let gaps = region.gaps(&cloud);
            for most in [0.05, 1.0] {
                let each = points.iter().map(|p| region.distance_within(&(p + shift), most));
                let farthest = each.collect::<Option<Vec<_>>>().map(|d| d.into_iter().fold(0.0, f64::max));
                prop_assert_eq!(region.distance_of_shifted(&points, &gaps, &shift, most), farthest);
            }
        }

        #[test]
        fn no_surface_is_inside(seed in prop::array::uniform3(-2.5..2.5f64), radius in 0.05..3.0f64) {
            let seed = Point3::from(seed);
            for s in [surface(ball(2)), surface(l_shape()), surface(tube(1.0, 2.0, [-1.0, 1.0], 12))] {
                prop_assume!(s.signed_distance(&seed) >= 0.0);
                let Ok(region) = s.free_region(&seed, radius, near(&[seed])) else { continue };
                prop_assert!(region.distance_within(&seed, 1e-9).is_some());
                for p in spread([-2.5; 3], [2.5; 3], 400) {
                    if region.distance_within(&p, 0.0).is_some() {
                        prop_assert!(s.signed_distance(&p) >= -TOUCH);
                    }
                    // As deep as the point is, so far it is to the region at least.
                    if let Some(d) = region.distance_within(&p, 0.5) {
                        prop_assert!(-s.signed_distance(&p) <= d + TOUCH);
                    }
                }
            }
        }
    }
}
