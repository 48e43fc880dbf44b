//! How a region grows: triangle by triangle, the nearest first, each behind a plane of its own unless one
//! that is there hides it.

use nalgebra::{Point3, Vector3};

use super::super::half_space::{Cloud, HalfSpace};
use super::super::surface::NO_TRIANGLE;
use super::super::triangle::Clipped;
use super::super::triangle_tree::{Corners, Visitor, WIDTH};
use super::super::{Bounds, Closest, Surface, separating_direction};
use super::{FreeRegion, NoRegion, TOUCH, Wanted};

/// A box so far inside may hold nothing that reaches further than [`TOUCH`].
const BOX_TOUCH: f64 = 1e-6;
/// With more planes than this, a region is not worth its tests.
const MOST_PLANES: usize = 160;
/// So far towards the seed, as a share of the way, hulls are taken to be apart from what they touch.
const INSET: f64 = 0.02;
/// A triangle's own plane is taken if this share of what the best one leaves is left before it.
const OWN: f64 = 0.15;

/// A ball about `seed` cut by planes in front of all triangles of a surface that it meets.
pub(super) fn grown(
    surface: &Surface,
    seed: &Point3<f64>,
    radius: f64,
    wanted: Wanted<'_>,
) -> Result<FreeRegion, NoRegion> {
    let reach = wanted.points.iter().map(|p| (p - seed).norm()).fold(0.0, f64::max);
    let mut growth = RegionGrowth {
        surface,
        wanted,
        cloud: Cloud::new(wanted.points, seed),
        inset: Vec::new(),
        least: (radius * 0.5).max(reach - wanted.most),
        region: FreeRegion {
            centre: *seed,
            radius,
            sides: Vec::with_capacity(8),
            triangles: Vec::with_capacity(8),
            inner: *seed,
        },
        amid: None,
    };
    surface.nearest_first(seed, &mut growth);
    let RegionGrowth { region, least, amid, .. } = growth;
    match amid {
        Some(triangle) => Err(NoRegion::Amid(triangle)),
        None if region.radius < least => Err(NoRegion::Cramped),
        None => Ok(region),
    }
}

/// A region as its planes are found.
struct RegionGrowth<'a> {
    surface: &'a Surface,
    wanted: Wanted<'a>,
    /// The wanted points and the seed.
    cloud: Cloud,
    /// The wanted points, a little towards the seed, so that hulls which touch are apart: made when
    /// first needed.
    inset: Vec<Point3<f64>>,
    /// A smaller region is not worth having: some wanted point is further than [`Wanted::most`] from it.
    least: f64,
    region: FreeRegion,
    /// The triangle that ended it.
    amid: Option<u32>,
}

/// A half-space, and how far the worst of the wanted points is inside.
type Candidate = Option<(f64, HalfSpace)>;

impl RegionGrowth<'_> {
    /// The better of two half-spaces: that in front of some corners with this normal, and the best
    /// so far.
    fn better(
        &self,
        triangle: u32,
        corners: &[Point3<f64>],
        normal: Vector3<f64>,
        best: Candidate,
    ) -> Candidate {
        // Seen from behind, a surface is entered already, mostly.
        let from_behind = normal.dot(&self.surface.face_normal(triangle)) < -0.6;
        if from_behind { best } else { self.any_better(corners, normal, best) }
    }

    /// The same, also from behind: the back of a wall of which another side is nearer.
    fn any_better(&self, corners: &[Point3<f64>], normal: Vector3<f64>, best: Candidate) -> Candidate {
        if normal == Vector3::zeros() {
            return best;
        }
        let side = HalfSpace::before(corners, normal);
        let worth = self.cloud.least_above(&side);
        if best.is_none_or(|(most, _)| worth > most) { Some((worth, side)) } else { best }
    }

    /// The best half-space in front of a triangle, of those that are worth trying.
    fn best(&mut self, triangle: u32, corners: &[Point3<f64>], closest: &Closest) -> Candidate {
        let seed = self.region.centre;
        let spared = self.wanted.spared;
        let enough = |best: Candidate| best.is_some_and(|(worth, _)| worth >= -spared);
        // The faces that meet where the triangle is nearest, and the way there.
        let mut best = None;
        self.surface.feature_normals(closest, |n| best = self.better(triangle, corners, n, best));
        if closest.distance > TOUCH {
            best = self.better(triangle, corners, (seed - closest.point) / closest.distance, best);
        }
        // What is wanted stands for points between, too, and these may be nearer to another plane than to
        // the triangle's own.
        let own = self.better(triangle, corners, self.surface.face_normal(triangle), None);
        if let (Some((of_own, _)), Some((most, _))) = (own, best)
            && of_own >= OWN * most.max(0.0)
        {
            return own;
        }
        if !enough(best) {
            best = self.better(triangle, corners, self.wanted.facing, best);
        }
        if !enough(best) {
            // Beside the triangle: along the faces across its sides, and in its own plane.
            let ends = self.surface.corners(triangle);
            for edge in 0..3 {
                let across = self.surface.neighbour(triangle, edge as u8);
                if across != NO_TRIANGLE {
                    best = self.better(triangle, corners, self.surface.face_normal(across), best);
                }
                let along = ends[(edge + 1) % 3] - ends[edge];
                let outward = along.cross(&self.surface.face_normal(triangle));
                if let Some(outward) = outward.try_normalize(0.0) {
                    best = self.better(triangle, corners, outward, best);
                }
            }
        }
        if !enough(best)
            && let Some(apart) = separating_direction(corners, self.inset(), f64::NEG_INFINITY, None)
        {
            best = self.better(triangle, corners, apart, best);
            if self.wanted.from_behind && best.is_none_or(|(worth, _)| worth < -self.wanted.most) {
                best = self.any_better(corners, apart, best);
            }
        }
        best
    }

    /// Whether some side has all of these points behind it.
    fn is_behind(&self, points: &[Point3<f64>]) -> bool {
        self.region.sides.iter().any(|side| points.iter().all(|v| side.above(v) <= TOUCH))
    }

    /// The part of a triangle that is in sight, if that is much less than all of it: only this must be behind
    /// a side. Of long triangles that lie a little askew, the rest would be in the way.
    fn clipped(&self, corners: &[Point3<f64>; 3]) -> Option<Clipped> {
        let FreeRegion { centre, radius, .. } = self.region;
        let bounds = Bounds::of([&centre]).grown(radius);
        let beyond = |p: &Point3<f64>| (p - centre).amax() > 2.0 * radius;
        let clipped = corners.iter().any(beyond).then(|| Clipped::new(corners, &bounds))??;
        (!clipped.corners().is_empty()).then_some(clipped)
    }

    fn inset(&mut self) -> &[Point3<f64>] {
        if self.inset.is_empty() {
            let (seed, most) = (self.region.centre, self.wanted.most);
            let inset = |p: &Point3<f64>| p + (seed - p) * (most / (seed - p).norm().max(most)).max(INSET);
            self.inset = self.wanted.points.iter().map(inset).collect();
        }
        &self.inset
    }
}

impl Visitor for RegionGrowth<'_> {
    fn reach(&self) -> f64 {
        self.region.radius
    }

    fn hides_boxes(
        &self,
        origin: &Point3<f64>,
        min: &[[f32; WIDTH]; 3],
        max: &[[f32; WIDTH]; 3],
    ) -> [bool; WIDTH] {
        any_of(&self.region.sides, |side| side.boxes_above(origin, min, max).map(|above| above <= BOX_TOUCH))
    }

    fn hides_triangles(&self, corners: &Corners) -> [bool; WIDTH] {
        any_of(&self.region.sides, |side| side.triangles_above(corners).map(|above| above <= TOUCH))
    }

    fn visit(&mut self, triangle: u32) {
        let corners = self.surface.corners(triangle);
        if self.is_behind(&corners) {
            return;
        }
        let closest = self.surface.closest_on(triangle, &self.region.centre);
        // Beyond the tip of a needle the tree tells no more than the distance from the planes of its sides.
        if closest.distance > self.region.radius {
            return;
        }
        let mut best = self.best(triangle, &corners, &closest);
        if best.is_none_or(|(worth, _)| worth < 0.0)
            && let Some(clipped) = self.clipped(&corners)
        {
            if self.is_behind(clipped.corners()) {
                return;
            }
            best = self.best(triangle, clipped.corners(), &closest);
        }
        match best {
            // What cannot be held for this triangle cannot be held at all.
            Some((worth, side)) if worth >= -self.wanted.most && self.region.sides.len() < MOST_PLANES => {
                self.region.sides.push(side);
                self.region.triangles.push(triangle);
            }
            Some((worth, _)) if worth < -self.wanted.most => {
                self.amid = Some(triangle);
                self.region.radius = 0.0;
            }
            _ => {
                self.region.radius = closest.distance.min(self.region.radius);
                if self.region.radius < self.least {
                    self.region.radius = 0.0;
                }
            }
        }
    }
}

/// Which of eight some side hides.
#[inline]
fn any_of(sides: &[HalfSpace], hides: impl Fn(&HalfSpace) -> [bool; WIDTH]) -> [bool; WIDTH] {
    let mut hidden = [false; WIDTH];
    for side in sides {
        let by = hides(side);
        (0..WIDTH).for_each(|k| hidden[k] |= by[k]);
        if hidden == [true; WIDTH] {
            break;
        }
    }
    hidden
}
