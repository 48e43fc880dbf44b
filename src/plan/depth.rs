//! How deep one surface gets into another on the way of a part: an upper bound, by branch and bound
//! over surface and way.
//!
//! A piece of surface on a stretch of the way lies in the hull of a few points ([`super::course`]).
//! If all of these are within some distance of one convex region that the other surface does not
//! enter ([`FreeRegion`]), so is the whole piece all the way, and it gets no deeper than that: what
//! slides along a face, in a hole or in a groove is settled at once. Pieces that no region holds
//! are split, in space or in time, whichever is longer, and regions are remembered by their place,
//! for what comes by later. Pieces of the smallest size are measured; their size is added.
//!
//! Where facets of two curved surfaces with granted overlap lie across each other, or a sheet in the
//! middle of another, this takes too long: a count ends it ([`Found::gave_up`]).
//!
//! So for closed surfaces the answer is a bound for all points and all times, not for samples (but
//! for [`FreeRegion`]'s rounding). Of surfaces with holes that holds where the winding number cannot
//! come near one half in a region ([`Rim`](crate::geometry::Rim)); in sight of holes a region may be partly
//! inside, and only small pieces are settled, by their corners.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};

use crate::geometry::{Closest, FreeRegion, Parts, PatchTree, Surface, Wanted, area_normal, bisected};
use crate::termination::{Interrupt, Termination};

use super::course::{Interval, Leg, View};

/// How finely depth is told, in the planning frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Precision {
    /// Depth beyond what is granted that is not looked into.
    pub(super) spare: f64,
    /// Depth beyond what is granted from which on points are recorded, but not looked for any
    /// closer.
    pub(super) deep: f64,
    /// Pieces of a smaller radius are not split.
    pub(super) finest: f64,
    /// The same once something deep was found.
    pub(super) coarse: f64,
}

/// One surface that is measured against another.
pub(super) struct Question<'a> {
    /// The surface whose points are asked for, and its triangles' tree.
    pub(super) surface: &'a Surface,
    pub(super) tree: &'a PatchTree,
    /// The surface into which they may get.
    pub(super) measured: &'a Surface,
    /// The depth that counts as none.
    pub(super) granted: f64,
    pub(super) precision: Precision,
}

/// What was found.
#[derive(Debug, Clone, Default)]
pub(super) struct Found {
    /// No point gets deeper than this beyond what is granted.
    pub(super) bound: f64,
    /// The largest depth that was measured beyond what is granted.
    pub(super) depth: f64,
    /// Points (frame of the surface asked about) that were measured deeper than
    /// [`Precision::deep`], or of which no less can be told: a good path has none, of a bad one these
    /// are the first found.
    pub(super) deep: Vec<(Point3<f64>, f64)>,
    /// Stretches of the way on which the search was given up: the bound is none there.
    pub(super) open: Vec<Interval>,
    /// How much was looked at: pieces, and regions that were looked for.
    pub(super) effort: usize,
}

/// So much is looked at before a question is given up.
pub(super) const MOST_EFFORT: usize = 200_000;
/// What a region costs, in pieces.
const REGION_EFFORT: usize = 40;

impl Found {
    /// Adds what was found elsewhere.
    pub(super) fn add(&mut self, other: Self) {
        self.bound = self.bound.max(other.bound);
        self.depth = self.depth.max(other.depth);
        self.deep.extend(other.deep);
        self.open.extend(other.open);
        self.effort += other.effort;
    }

    /// Whether so much is deep that more would not change the answer.
    pub(super) fn is_enough(&self) -> bool {
        self.deep.len() >= ENOUGH
    }
}

impl Question<'_> {
    /// Looks for the deepest points on a stretch of the way, with no more than some effort.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn answer(
        &self,
        view: View<'_>,
        interval: Interval,
        most_effort: usize,
        termination: &Termination,
    ) -> Result<Found, Interrupt> {
        let mut search = Search {
            asked: self,
            has_rim: self.measured.rim().is_some(),
            most_effort,
            view,
            termination,
            regions: Vec::new(),
            places: HashMap::new(),
            wanted: Vec::new(),
            facing: Vector3::zeros(),
            found: Found::default(),
        };
        if let Some(root) = self.tree.root() {
            search.patch(root, interval, Hint { triangle: 0, region: None })?;
        }
        if search.gave_up() {
            search.found.open.push(interval);
        }
        Ok(search.found)
    }
}

/// What is likely to be of use for a piece: a triangle near it, a region around it.
#[derive(Debug, Clone, Copy)]
struct Hint {
    triangle: u32,
    region: Option<u32>,
}

/// Where a piece passes: a ball that holds the hull.
#[derive(Debug, Clone, Copy)]
struct Swept {
    centre: Point3<f64>,
    radius: f64,
}

/// Size and cell of a place.
type Place = (i32, [i64; 3]);

/// How far a piece is from a region: the distance of its worst corner, and that.
type Fit = Option<(f64, Point3<f64>)>;

/// A region, and whether all of it is outside the surface that is measured: of one with holes, part of it may be
/// inside.
struct Region {
    free: FreeRegion,
    is_outside: bool,
}

/// So many regions of a place are tried.
const TRIED: usize = 3;

struct Search<'a> {
    asked: &'a Question<'a>,
    /// Whether the measured surface has holes, so that depth changes its sign off it, too.
    has_rim: bool,
    most_effort: usize,
    view: View<'a>,
    termination: &'a Termination,
    regions: Vec<Region>,
    /// Regions by the places of pieces that they held.
    places: HashMap<Place, Vec<u32>>,
    /// The corners of the hull in question.
    wanted: Vec<Point3<f64>>,
    facing: Vector3<f64>,
    found: Found,
}

impl Search<'_> {
    fn gave_up(&self) -> bool {
        self.found.effort > self.most_effort
    }

    fn is_enough(&self) -> bool {
        self.gave_up() || self.found.is_enough()
    }

    /// Looks into a node of the tree on a stretch of the way.
    fn patch(&mut self, index: u32, interval: Interval, hint: Hint) -> Result<(), Interrupt> {
        self.termination.check()?;
        self.found.effort += 1;
        if self.is_enough() {
            return Ok(());
        }
        let tree = self.asked.tree;
        let patch = tree.patch(index);
        let leg = self.view.leg(interval);
        let mut hint = hint;
        let mut in_time = leg.maps.is_empty();
        if !in_time {
            let centres: Vec<_> = leg.maps.iter().map(|m| m.apply(&patch.centre)).collect();
            let ball = patch.radius * leg.stretch + leg.slack;
            if self.is_apart(&centres, ball) {
                return Ok(());
            }
            let swept = swept(&centres, ball);
            // What is beyond the ball is half of the way.
            in_time = swept.radius - ball > 2.0 * patch.radius;
            self.wanted.clear();
            self.facing = Vector3::zeros();
            self.wanted.extend(tree.extremes(index).flat_map(|p| leg.maps.iter().map(move |m| m.apply(p))));
            let points = tree.vertices(index);
            let fits = |region: &FreeRegion, most: f64| {
                if centres.iter().all(|c| region.holds_ball(c, ball)) {
                    return Some((0.0, swept.centre));
                }
                furthest(points.iter().flat_map(|p| leg.maps.iter().map(|m| m.apply(p))), region, most)
            };
            if self.is_settled(&swept, leg.slack, &mut hint, fits) {
                return Ok(());
            }
        }
        if in_time && leg.length > self.finest() / (2.0 * DOUBT) {
            return interval.halves().into_iter().try_for_each(|half| self.patch(index, half, hint));
        }
        match tree.parts(index) {
            Parts::Patches(children) => {
                children.into_iter().try_for_each(|child| self.patch(child, interval, hint))
            }
            Parts::Triangles(list) => {
                list.iter().try_for_each(|&t| self.triangle(self.asked.surface.corners(t), interval, hint))
            }
        }
    }

    /// Looks at a triangle, or a piece of one, on a stretch of the way.
    fn triangle(
        &mut self,
        corners: [Point3<f64>; 3],
        interval: Interval,
        hint: Hint,
    ) -> Result<(), Interrupt> {
        let mut stack = vec![(corners, interval, hint)];
        while let Some((corners, interval, mut hint)) = stack.pop() {
            self.termination.check()?;
            self.found.effort += 1;
            if self.is_enough() {
                break;
            }
            let leg = self.view.leg(interval);
            let (longest, halves) = bisected(&corners);
            let mut in_time = leg.maps.is_empty();
            if !in_time {
                let points: Vec<_> = leg.maps.iter().flat_map(|m| corners.map(|p| m.apply(&p))).collect();
                if self.is_apart(&points, leg.slack) {
                    continue;
                }
                let swept = swept(&points, leg.slack);
                self.wanted.clone_from(&points);
                let outward = area_normal(&corners[0], &corners[1], &corners[2]);
                self.facing = leg.end.rotation * -outward.try_normalize(0.0).unwrap_or_default();
                let fits = |region: &FreeRegion, most: f64| furthest(points.iter().copied(), region, most);
                if self.is_settled(&swept, leg.slack, &mut hint, fits)
                    || self.is_measured(&corners, &leg, &swept, hint.triangle)
                {
                    continue;
                }
                in_time = points[..points.len() - 3]
                    .iter()
                    .zip(&points[3..])
                    .any(|(a, b)| (b - a).norm() > longest);
            }
            if in_time && leg.length > self.finest() / (2.0 * DOUBT) {
                stack.extend(interval.halves().map(|half| (corners, half, hint)));
            } else {
                stack.extend(halves.map(|half| (half, interval, hint)));
            }
        }
        Ok(())
    }

    /// Whether the box of the measured surface lies beside a hull, given by balls.
    fn is_apart(&self, centres: &[Point3<f64>], radius: f64) -> bool {
        let bounds = self.asked.measured.bounds();
        (0..3).any(|a| {
            centres.iter().all(|c| c[a] - radius >= bounds.max[a])
                || centres.iter().all(|c| c[a] + radius <= bounds.min[a])
        })
    }

    /// Whether some region tells well how deep a piece gets; the bound is raised by that.
    fn is_settled(
        &mut self,
        swept: &Swept,
        slack: f64,
        hint: &mut Hint,
        fits: impl Fn(&FreeRegion, f64) -> Fit,
    ) -> bool {
        let asked = self.asked;
        let spared = self.spared() - slack;
        if spared < 0.0 || (swept.radius > asked.precision.coarse && self.is_beside_rim(swept)) {
            return false;
        }
        let place = place(swept);
        let known = self.places.get(&place).map_or(&[][..], Vec::as_slice);
        for region in known.iter().rev().take(TRIED).copied().chain(hint.region) {
            let Region { free, is_outside } = &self.regions[region as usize];
            if let Some((depth, _)) = fits(free, spared) {
                hint.region = Some(region);
                return (*is_outside || self.is_outside(swept, spared, hint.triangle))
                    && self.settled(depth + slack);
            }
        }
        let closest = asked.measured.closest_from(&swept.centre, hint.triangle);
        hint.triangle = closest.triangle;
        let signed = asked.measured.signed(&swept.centre, &closest);
        // Depth changes by no more than the distance, unless the surface has holes. Then it changes its
        // sign in mid-air, too, where the winding number passes a half: next to a point far outside
        // may be one as far inside.
        if swept.radius - signed <= spared {
            return (!self.has_rim
                || asked.measured.stays_outside(&swept.centre, swept.radius)
                || self.is_outside(swept, spared, hint.triangle))
                && self.settled(swept.radius - signed + slack);
        }
        // Wider regions than large pieces need are vain; small ones tell how deep they really are.
        let coarse = asked.precision.coarse;
        let wide = if swept.radius > coarse { 0.0 } else { swept.radius.min(coarse / 8.0) };
        let most = (asked.granted + asked.precision.deep - slack).min(wide).max(spared);
        if -signed > most {
            return false;
        }
        self.found.effort += REGION_EFFORT;
        let Some(free) = self.region(swept, &closest, signed, most) else { return false };
        let fit = fits(&free, most);
        let id = self.regions.len() as u32;
        let is_outside = free.is_outside(asked.measured);
        self.regions.push(Region { free, is_outside });
        hint.region = Some(id);
        let Some((depth, worst)) = fit else { return false };
        self.places.entry(place).or_default().push(id);
        if depth > spared && !self.is_told(swept, depth, &worst, hint.triangle) {
            return false;
        }
        (is_outside || self.is_outside(swept, most, hint.triangle)) && self.settled(depth + slack)
    }

    /// A region for a piece, around its middle or what is outside nearest to that.
    fn region(&self, swept: &Swept, closest: &Closest, signed: f64, most: f64) -> Option<FreeRegion> {
        let Swept { centre, radius, .. } = swept;
        let seen = (closest, signed);
        let wanted = Wanted { points: &self.wanted, most, from_behind: false, facing: self.facing };
        self.asked.measured.free_region_around(centre, radius * ROOM, seen, wanted).ok()
    }

    /// Whether a depth is what it is, as measured at the worst corner, or small enough not to matter:
    /// not only that of a region which is too narrow.
    fn is_told(&mut self, swept: &Swept, depth: f64, worst: &Point3<f64>, guess: u32) -> bool {
        let Question { measured, granted, precision, .. } = self.asked;
        let real = -measured.signed(worst, &measured.closest_from(worst, guess));
        let beyond = depth - granted;
        let small = swept.radius <= precision.coarse && beyond <= precision.deep / 2.0;
        let exact = real >= depth - precision.spare.max(NEARLY * depth);
        let told = exact || (small && precision.deep.is_finite());
        if !told {
            return false;
        }
        self.found.depth = self.found.depth.max(real - granted);
        true
    }

    /// Raises the bound.
    fn settled(&mut self, depth: f64) -> bool {
        self.found.bound = self.found.bound.max(depth - self.asked.granted);
        true
    }

    /// Whether holes are so near that no sign would hold for all of a piece.
    fn is_beside_rim(&self, swept: &Swept) -> bool {
        self.asked
            .measured
            .rim()
            .is_some_and(|rim| rim.slope(&swept.centre, swept.radius) * swept.radius > 0.5)
    }

    /// Whether a piece is small, and its corners no deeper than `most`: a region beside a surface with holes
    /// may be inside.
    fn is_outside(&self, swept: &Swept, most: f64, guess: u32) -> bool {
        let Question { measured, precision, .. } = self.asked;
        let depth = |p: &Point3<f64>| -measured.signed(p, &measured.closest_from(p, guess));
        swept.radius <= precision.coarse && self.wanted.iter().all(|p| depth(p) <= most)
    }

    /// Measures the corners of a piece at its end; whether that is all that can be said about it.
    fn is_measured(&mut self, corners: &[Point3<f64>; 3], leg: &Leg, swept: &Swept, guess: u32) -> bool {
        let asked = self.asked;
        let over = |at: &Point3<f64>| {
            -asked.measured.signed(at, &asked.measured.closest_from(at, guess)) - asked.granted
        };
        for p in corners {
            let over = over(&(leg.end * p));
            self.found.depth = self.found.depth.max(over);
            if over > asked.precision.deep {
                self.found.deep.push((*p, over));
            }
        }
        self.found.bound = self.found.bound.max(self.found.depth);
        if swept.radius > self.finest() {
            return self.is_enough();
        }
        if !self.found.deep.is_empty() {
            return true;
        }
        // As in `is_settled`: depth changes by no more than the distance, but for surfaces with holes.
        let mut bound = over(&swept.centre) + swept.radius;
        if self.has_rim {
            bound = self.wanted.iter().map(over).fold(bound, f64::max);
        }
        if bound > asked.precision.deep {
            if swept.radius > self.finest() / DOUBT {
                return false;
            }
            self.found.deep.push((corners[0], bound));
        }
        self.settled(asked.granted + bound)
    }

    /// The depth up to which nothing is looked into: it is granted, spared, or as good as found.
    fn spared(&self) -> f64 {
        let Precision { spare, deep, .. } = self.asked.precision;
        self.asked.granted + (self.found.depth * (1.0 + NEARLY)).min(deep).max(spare)
    }

    /// The smallest size of pieces, for now.
    fn finest(&self) -> f64 {
        let Precision { deep, finest, coarse, .. } = self.asked.precision;
        if self.found.depth > deep { coarse } else { finest }
    }
}

/// After so many deep points, a path is bad enough.
const ENOUGH: usize = 400;
/// Pieces that might be too deep are split until they are so much smaller than others.
const DOUBT: f64 = 4.0;
/// Depths are told to this share.
const NEARLY: f64 = 0.1;
/// Regions are asked for so much larger than the piece, that others find room.
const ROOM: f64 = 1.25;

/// The ball that holds balls around the corners of a hull.
fn swept(points: &[Point3<f64>], ball: f64) -> Swept {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let centre = Point3::from(sum / points.len().max(1) as f64);
    let reach = points.iter().map(|p| (p - centre).norm_squared()).fold(0.0, f64::max).sqrt();
    Swept { centre, radius: reach + ball }
}

/// How far the furthest of some points is from a region, and which, unless it is beyond `most`.
fn furthest(points: impl IntoIterator<Item = Point3<f64>>, region: &FreeRegion, most: f64) -> Fit {
    points.into_iter().try_fold((0.0, Point3::origin()), |far, p| {
        let d = region.distance_within(&p, most)?;
        Some(if d > far.0 { (d, p) } else { far })
    })
}

fn place(swept: &Swept) -> Place {
    let level = swept.radius.max(1e-9).log2().ceil();
    let cell = level.exp2();
    (level as i32, (swept.centre.coords / cell).map(|x| x.floor() as i64).into())
}
