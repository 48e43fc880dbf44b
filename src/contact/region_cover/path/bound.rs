//! Bounds on the depth of a whole piece: by regions outside the measured surface, and by triangles.

use nalgebra::{Point3, Vector3};

use crate::budgets::{HULL_CORNERS, RECENT_REGIONS, REGION_EFFORT, REGIONS_OF_PLACE};
use crate::geometry::{FreeRegion, HullDepth, Parts, PatchTree, SignedClosest, Wanted};
use crate::tolerances::SWEPT_ROOM;

use super::super::super::course::Leg;
use super::{GridCell, KnownRegion, PathSearch, SearchHint, SideQuestion, SweptBall};

/// How far a piece is outside a region: the distance of its worst corner, and that corner.
pub(super) type Fit = Option<(f64, Point3<f64>)>;

impl PathSearch<'_> {
    /// Whether some region bounds well how deep a piece gets; raises the bound. `corners` returns all corners of the
    /// hull, unless they are too many.
    pub(super) fn is_settled(
        &mut self,
        swept: &SweptBall,
        slack: f64,
        hint: &mut SearchHint,
        fits: impl Fn(&FreeRegion, f64) -> Fit,
        corners: impl Fn() -> Vec<Point3<f64>>,
    ) -> bool {
        let question = self.question;
        let ignored = self.ignored() - slack;
        if ignored < 0.0 || (swept.radius > question.precision.coarse && self.is_beside_rim(swept)) {
            return false;
        }
        let place = place(swept);
        let known = self.places.get(&place).map_or(&[][..], Vec::as_slice);
        let of_place = known.iter().rev().take(REGIONS_OF_PLACE);
        let recent = self.held.iter().rev().take(RECENT_REGIONS);
        for region in of_place.chain(&hint.region).chain(recent).copied() {
            let KnownRegion { free, is_outside } = &self.regions[region as usize];
            if let Some((depth, _)) = fits(free, ignored) {
                hint.region = Some(region);
                return (*is_outside || self.is_outside(swept, ignored, hint.triangle))
                    && self.settled(depth + slack);
            }
        }
        let seen = question.measured.signed_closest(&swept.centre, hint.triangle);
        let signed = seen.signed;
        hint.triangle = seen.closest.triangle;
        // Depth changes by no more than the distance, unless the surface has holes. Then its sign changes in mid-air,
        // too, where the winding number passes one half: a point far outside may lie next to one as far inside.
        if swept.radius - signed <= ignored {
            return (!self.has_rim
                || question.measured.stays_outside(&swept.centre, swept.radius)
                || self.is_outside(swept, ignored, hint.triangle))
                && self.settled(swept.radius - signed + slack);
        }
        if self.is_bounded(swept, signed, slack, hint.triangle) {
            return true;
        }
        // A region that is wider than a large piece needs is useless; of a small piece, a wide region shows how deep
        // it really is.
        let coarse = question.precision.coarse;
        let wide = if swept.radius > coarse { 0.0 } else { swept.radius.min(coarse / 8.0) };
        let most = (question.allowed + question.precision.deep - slack).min(wide).max(ignored);
        if -signed > most {
            return false;
        }
        if std::mem::take(&mut hint.is_vain) {
            return false;
        }
        hint.is_vain = true;
        self.found.effort += REGION_EFFORT;
        let Some(mut free) = self.region(swept, &seen, most, ignored) else { return false };
        let mut fit = fits(&free, most);
        // The planes that leave most room before a few corners may be askew to a wall along which all other corners
        // lie, as of a hole around a pin. One more region takes less time than the pieces that would follow.
        if fit.is_none()
            && let corners = corners()
            && corners.len() > self.wanted.len()
        {
            self.wanted = corners;
            self.found.effort += REGION_EFFORT;
            if let Some(fitted) = self.region(swept, &seen, most, ignored) {
                fit = fits(&fitted, most);
                free = fitted;
            }
        }
        let id = self.regions.len() as u32;
        let is_outside = free.is_outside(question.measured);
        self.regions.push(KnownRegion { free, is_outside });
        hint.region = Some(id);
        hint.is_vain = false;
        let Some((depth, worst)) = fit else { return false };
        self.places.entry(place).or_default().push(id);
        self.held.push(id);
        if depth > ignored && !self.is_told(swept, depth, &worst, hint.triangle) {
            return false;
        }
        (is_outside || self.is_outside(swept, most, hint.triangle)) && self.settled(depth + slack)
    }

    /// Whether the triangles around a piece bound well how deep it gets; raises the bound.
    fn is_bounded(&mut self, swept: &SweptBall, signed: f64, slack: f64, guess: u32) -> bool {
        let ignored = self.ignored() - slack;
        let SideQuestion { measured, allowed, precision, .. } = self.question;
        // Deeper points are to be recorded.
        let most = ignored.max(allowed + precision.deep - slack);
        // No triangle is nearer to the centre than the nearest one.
        if signed > ignored || -signed > most {
            return false;
        }
        let Some(HullDepth { bound, worst }) = measured.hull_depth(&self.hull, guess, ignored) else {
            return false;
        };
        let worst = self.hull[worst];
        bound <= most
            && (bound <= ignored || self.is_told(swept, bound, &worst, guess))
            && self.settled(bound + slack)
    }

    /// A region for a piece: around its centre, or around the nearest point outside.
    fn region(&self, swept: &SweptBall, seen: &SignedClosest, most: f64, ignored: f64) -> Option<FreeRegion> {
        let SweptBall { centre, radius, .. } = swept;
        let wanted =
            Wanted { points: &self.wanted, most, from_behind: false, facing: self.facing, spared: ignored };
        self.question.measured.free_region_around(centre, radius * SWEPT_ROOM, seen, wanted).ok()
    }

    /// Whether a depth is real, as measured at the worst corner, or too small to matter, and not the effect of a
    /// region that is too narrow.
    fn is_told(&mut self, swept: &SweptBall, depth: f64, worst: &Point3<f64>, guess: u32) -> bool {
        let SideQuestion { measured, allowed, precision, .. } = self.question;
        let real = -measured.signed_closest(worst, guess).signed;
        let beyond = depth - allowed;
        let small = swept.radius <= precision.coarse && beyond <= precision.deep / 2.0;
        let exact = real >= depth - precision.ignored.max(precision.margin_of(depth));
        // Real or not, a depth on the other side of the limit would decide the verdict by its error.
        let decides = beyond > precision.deep && real - allowed <= precision.deep;
        let told = !decides && (exact || (small && precision.deep.is_finite()));
        if !told {
            return false;
        }
        self.found.depth = self.found.depth.max(real - allowed);
        true
    }

    /// Raises the bound.
    pub(super) fn settled(&mut self, depth: f64) -> bool {
        self.found.bound = self.found.bound.max(depth - self.question.allowed);
        true
    }

    /// Whether a hole is so near that all of a piece cannot have one sign.
    fn is_beside_rim(&self, swept: &SweptBall) -> bool {
        self.question
            .measured
            .rim()
            .is_some_and(|rim| rim.slope(&swept.centre, swept.radius) * swept.radius > 0.5)
    }

    /// Whether a piece is small with its corners no deeper than `most`: beside a surface with holes a region may be
    /// inside.
    fn is_outside(&self, swept: &SweptBall, most: f64, guess: u32) -> bool {
        let SideQuestion { measured, precision, .. } = self.question;
        let depth = |p: &Point3<f64>| -measured.signed_closest(p, guess).signed;
        swept.radius <= precision.coarse && self.wanted.iter().all(|p| depth(p) <= most)
    }
}

/// A ball that holds balls around the corners of a hull.
pub(super) fn swept(points: &[Point3<f64>], ball: f64) -> SweptBall {
    let sum: Vector3<f64> = points.iter().map(|p| p.coords).sum();
    let centre = Point3::from(sum / points.len().max(1) as f64);
    let reach = points.iter().map(|p| (p - centre).norm_squared()).fold(0.0, f64::max).sqrt();
    SweptBall { centre, radius: reach + ball }
}

/// The image of a vertex of a node that is furthest outside a region, and how far; `None` if that is more than `most`.
/// The region holds the balls of most of them.
pub(super) fn furthest_of(tree: &PatchTree, index: u32, leg: &Leg, region: &FreeRegion, most: f64) -> Fit {
    if tree.vertices(index).len() <= HULL_CORNERS {
        return region.furthest(leg.images(tree.vertices(index)), most);
    }
    // If a point is outside, mostly one of these is.
    let mut far = region.furthest(leg.images(tree.extremes(index)), most)?;
    for map in &leg.maps {
        let mut stack = vec![index];
        while let Some(node) = stack.pop() {
            let patch = tree.patch(node);
            if region.holds_ball(&map.apply(&patch.centre), patch.radius * leg.stretch) {
                continue;
            }
            match tree.parts(node) {
                Parts::Patches([left, right]) => stack.extend([right, left]),
                Parts::Triangles(_) => {
                    let images = tree.vertices(node).iter().map(|p| map.apply(p));
                    let (d, worst) = region.furthest(images, most)?;
                    if d > far.0 {
                        far = (d, worst);
                    }
                }
            }
        }
    }
    Some(far)
}

fn place(swept: &SweptBall) -> GridCell {
    let level = swept.radius.max(1e-9).log2().ceil();
    let cell = level.exp2();
    (level as i32, (swept.centre.coords / cell).map(|x| x.floor() as i64).into())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::contact::course::{Course, CourseView, Interval};
    use crate::fixtures::{ball, surface, tube, vector};
    use crate::geometry::Pose;
    use crate::termination::Poll;

    proptest! {
        #[test]
        fn the_tree_tells_the_furthest_vertex_as_all_of_them_do(
            shift in vector(0.4), turn in vector(0.1), centre in vector(2.0), radius in 0.1..4.0f64,
            most in 0.0..2.0f64,
        ) {
            let (moving, standing) = (surface(ball(4)), surface(tube(1.2, 2.0, [-1.0, 1.0], 24)));
            let tree = PatchTree::new(&moving, &Poll::every(1, None)).unwrap();
            let path = [Pose::identity(), Pose::new(shift, turn)];
            let course = Course::new(&path, Point3::origin(), 1.0);
            let leg = CourseView::new(&course, true, 1e-3).leg(Interval::WHOLE);
            let wanted = Wanted { points: &[], most: 0.0, from_behind: false, facing: Vector3::zeros(), spared: 0.0 };
            let centre = Point3::from(centre);
            let Ok(region) = standing.free_region(&centre, radius, wanted) else { return Ok(()) };
            for node in [0, 1] {
                let images = leg.images(tree.vertices(node));
                let (all, by_tree) = (region.furthest(images, most), furthest_of(&tree, node, &leg, &region, most));
                prop_assert_eq!(all.map(|(far, _)| far), by_tree.map(|(far, _)| far));
                prop_assert!(tree.vertices(node).len() > 100);
            }
        }
    }
}
