//! How near a part passes others on its way: the least distance, and a bound that is certified.
//!
//! Branch and bound, the nearest first. An item is a piece of the moving surface on a stretch of the path, and a piece of
//! a standing surface. Pieces are patches (bounding spheres) at first, triangles in the end. On the stretch, the moving
//! piece lies in the hull of its images (`course`), so the distance of that hull from the standing piece bounds the item:
//! between triangles, by a plane that GJK proposes and projections certify. Where the part does not turn, a triangle
//! sweeps just this hull, and the distance is found at once; where it turns, stretches are halved. The search ends when no
//! item can be nearer than what was found by more than `APPROACH_PRECISION`.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use nalgebra::{Point3, center};

use crate::budgets::{APPROACH_HULL, APPROACH_ITEMS, LONG_STEPS_PER_POLL};
use crate::geometry::{
    HullDistance, Parts, PatchTree, Pose, Shape, Surface, closest_on_triangle, hull_distance, interpolate,
};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::{APPROACH_PRECISION, TOUCHED};

use super::course::{Course, CourseView, Interval, Leg};

/// A part that passes another.
#[derive(Debug, Clone)]
pub struct PassedPair<'a> {
    /// The shape of the moving and that of the standing part.
    pub shapes: [&'a Shape; 2],
    /// Poses of the moving shape in the frame of the standing one.
    pub path: Vec<Pose>,
    /// The point of the moving shape, in its frame, that moves on a line between two poses.
    pub centre: Point3<f64>,
}

/// Where some parts pass others the nearest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestApproach {
    /// Which of the pairs.
    pub pair: usize,
    /// The distance there; 0 where the surfaces meet. Where the search was given up before anything came nearer than what it
    /// looked for, that length.
    pub distance: f64,
    /// No two surfaces of any pair come nearer than this on their way.
    pub at_least: f64,
    /// The segment of the path, 0 for that from its first pose to its second.
    pub segment: usize,
    /// How far along the segment, from 0 to 1.
    pub share: f64,
    /// A point of the moving and one of the standing surface, in the frame of the standing shape; `None` where they meet.
    pub points: Option<[Point3<f64>; 2]>,
}

/// Where some parts pass others the nearest, if any comes nearer than `reach`. `None` is certain: nothing does.
///
/// # Errors
/// The termination condition became true.
pub fn closest_approach(
    pairs: &[PassedPair<'_>],
    reach: f64,
    termination: &Termination,
) -> Result<Option<ClosestApproach>, Interrupt> {
    let segments = segments(pairs);
    let mut search = ApproachSearch::new(pairs, &segments, reach, termination);
    search.run()?;
    Ok(search.answer())
}

/// One segment of a pair's path.
struct ApproachSegment {
    pair: usize,
    number: usize,
    course: Course,
}

fn segments(pairs: &[PassedPair<'_>]) -> Vec<ApproachSegment> {
    let of_pair = |(pair, passed): (usize, &PassedPair<'_>)| {
        let reach = passed.shapes[0].hull.iter().map(|p| (p - passed.centre).norm()).fold(0.0, f64::max);
        let alone = (passed.path.len() == 1).then(|| &passed.path[..]);
        let segments = passed.path.windows(2).chain(alone).enumerate();
        let segment = |(number, path): (usize, &[Pose])| ApproachSegment {
            pair,
            number,
            course: Course::new(path, passed.centre, reach),
        };
        segments.map(segment).collect::<Vec<_>>()
    };
    pairs.iter().enumerate().flat_map(of_pair).collect()
}

/// The moving and the standing piece of an item.
#[derive(Debug, Clone, Copy)]
enum ItemPieces {
    /// The whole surfaces, whose patches are not known yet.
    Wholes,
    /// Nodes of their trees.
    Patches([u32; 2]),
    /// One triangle of each.
    Triangles([u32; 2]),
}

#[derive(Debug, Clone, Copy)]
struct Item {
    /// A bound of the distance.
    at_least: f64,
    /// How large the pieces are. Of items with the same bound the smallest comes first: a distance is found sooner.
    size: f64,
    segment: u32,
    interval: Interval,
    pieces: ItemPieces,
}

impl Ord for Item {
    fn cmp(&self, other: &Self) -> Ordering {
        self.at_least.total_cmp(&other.at_least).then(self.size.total_cmp(&other.size))
    }
}

impl PartialOrd for Item {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Item {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Item {}

/// Two triangles that come near each other.
#[derive(Debug, Clone, Copy)]
struct NearTriangles {
    distance: f64,
    segment: u32,
    interval: Interval,
    triangles: [u32; 2],
    /// Whether this is the distance of the whole stretch, and not that in its middle.
    is_exact: bool,
}

struct ApproachSearch<'a> {
    pairs: &'a [PassedPair<'a>],
    segments: &'a [ApproachSegment],
    views: Vec<CourseView<'a>>,
    items: BinaryHeap<Reverse<Item>>,
    nearest: Option<NearTriangles>,
    /// Distances from here on are not looked for.
    reach: f64,
    /// The least bound of items that are done.
    done: f64,
    /// The item at which the search was given up.
    given_up: Option<Item>,
    termination: &'a Termination,
}

impl<'a> ApproachSearch<'a> {
    fn new(
        pairs: &'a [PassedPair<'a>],
        segments: &'a [ApproachSegment],
        reach: f64,
        termination: &'a Termination,
    ) -> Self {
        let views = segments.iter().map(|segment| CourseView::new(&segment.course, true, 0.0)).collect();
        let (items, nearest) = (BinaryHeap::new(), None);
        Self {
            pairs,
            segments,
            views,
            items,
            nearest,
            reach,
            done: f64::INFINITY,
            given_up: None,
            termination,
        }
    }

    /// What is no nearer than this is not looked into.
    fn limit(&self) -> f64 {
        self.nearest.map_or(self.reach, |nearest| nearest.distance * (1.0 - APPROACH_PRECISION))
    }

    fn run(&mut self) -> Result<(), Interrupt> {
        let poll = Poll::every(LONG_STEPS_PER_POLL, Some(self.termination));
        for segment in 0..self.segments.len() as u32 {
            self.add_pieces(segment, Interval::WHOLE, ItemPieces::Wholes)?;
        }
        let mut looked_into = 0;
        while let Some(Reverse(item)) = self.items.pop() {
            poll.check()?;
            if item.at_least >= self.limit() || self.nearest.is_some_and(|n| n.distance <= TOUCHED) {
                break;
            }
            looked_into += 1;
            if looked_into > APPROACH_ITEMS {
                self.done = self.done.min(item.at_least);
                self.given_up = Some(item);
                break;
            }
            self.split(&item)?;
        }
        Ok(())
    }

    /// Replaces an item by smaller ones.
    fn split(&mut self, item: &Item) -> Result<(), Interrupt> {
        let Item { segment, interval, pieces, .. } = *item;
        let leg = self.views[segment as usize].leg(interval);
        let halved = |search: &mut Self| {
            interval.halves().into_iter().try_for_each(|half| search.add_pieces(segment, half, pieces))
        };
        match pieces {
            ItemPieces::Wholes => {
                let [a, b] = self.trees(segment)?.map(PatchTree::root);
                let (Some(a), Some(b)) = (a, b) else { return Ok(()) };
                self.add_pieces(segment, interval, ItemPieces::Patches([a, b]))
            }
            ItemPieces::Triangles(_) => halved(self),
            ItemPieces::Patches(patches) => {
                let [a, b] = self.spheres(segment, pieces)?;
                if leg.maps.is_empty() || bulge(&leg, &a) > a.radius + b.radius {
                    return halved(self);
                }
                for pieces in self.smaller(segment, patches, a.radius > b.radius)? {
                    self.add_pieces(segment, interval, pieces)?;
                }
                Ok(())
            }
        }
    }

    /// The pieces of two patches: the moving one is split if it can be and `moving_first`, or the other one cannot.
    fn smaller(
        &self,
        segment: u32,
        [a, b]: [u32; 2],
        moving_first: bool,
    ) -> Result<Vec<ItemPieces>, Interrupt> {
        let [of_a, of_b] = self.trees(segment)?;
        Ok(match (of_a.parts(a), of_b.parts(b)) {
            (Parts::Triangles(ones), Parts::Triangles(others)) => {
                let pairs = ones.iter().flat_map(|one| others.iter().map(|other| [*one, *other]));
                pairs.map(ItemPieces::Triangles).collect()
            }
            (Parts::Patches(children), Parts::Patches(_)) if moving_first => {
                children.map(|a| ItemPieces::Patches([a, b])).to_vec()
            }
            (Parts::Patches(children), Parts::Triangles(_)) => {
                children.map(|a| ItemPieces::Patches([a, b])).to_vec()
            }
            (_, Parts::Patches(children)) => children.map(|b| ItemPieces::Patches([a, b])).to_vec(),
        })
    }

    fn add_pieces(&mut self, segment: u32, interval: Interval, pieces: ItemPieces) -> Result<(), Interrupt> {
        let leg = self.views[segment as usize].leg(interval);
        let (at_least, size) = match pieces {
            ItemPieces::Triangles(triangles) => {
                return self.add_triangles(segment, interval, triangles, &leg);
            }
            _ => {
                let [a, b] = self.spheres(segment, pieces)?;
                (distance_of_spheres(&leg, &a, &b), a.radius + b.radius)
            }
        };
        // Spheres around long triangles reach far beyond them, hulls do not.
        let at_least = match pieces {
            ItemPieces::Patches(patches) if at_least < self.limit() => {
                at_least.max(self.distance_of_hulls(segment, patches, &leg)?)
            }
            _ => at_least,
        };
        self.add(Item { at_least, size, segment, interval, pieces });
        Ok(())
    }

    /// A bound of the distance between patches on a leg, if they have few vertices.
    fn distance_of_hulls(&self, segment: u32, patches: [u32; 2], leg: &Leg) -> Result<f64, Interrupt> {
        let trees = self.trees(segment)?;
        let [moving, standing] = [0, 1].map(|side| trees[side].vertices(patches[side]));
        if leg.maps.is_empty() || moving.len().max(standing.len()) > APPROACH_HULL {
            return Ok(0.0);
        }
        let swept: Vec<Point3<f64>> = leg.images(moving).collect();
        Ok(hull_distance(&swept, standing).at_least - leg.slack)
    }

    fn add(&mut self, item: Item) {
        if item.at_least < self.limit() {
            self.items.push(Reverse(item));
        }
    }

    fn add_triangles(
        &mut self,
        segment: u32,
        interval: Interval,
        triangles: [u32; 2],
        leg: &Leg,
    ) -> Result<(), Interrupt> {
        let surfaces = self.surfaces(segment);
        let [moving, standing] = [0, 1].map(|side| surfaces[side].corners(triangles[side]));
        let swept: Vec<Point3<f64>> = leg.images(&moving).collect();
        let normal = surfaces[1].face_normal(triangles[1]);
        let heights = swept.iter().map(|p| (p - standing[0]).dot(&normal));
        let [low, high] =
            heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], h| [low.min(h), high.max(h)]);
        // All on one side of the plane, and far enough.
        if low.max(-high) - leg.slack >= self.limit() {
            return Ok(());
        }
        let found = match swept[..] {
            [] => HullDistance { at_least: 0.0, points: None },
            _ => hull_distance(&swept, &standing),
        };
        let at_least = (found.at_least - leg.slack).max(0.0);
        if at_least >= self.limit() {
            return Ok(());
        }
        // On a leg that does not turn the part, the hull is just what the triangle sweeps.
        let is_exact = matches!(leg.maps.len(), 1 | 2);
        let pose = self.pose(segment, interval, 0.5);
        let found = if is_exact { found } else { hull_distance(&moving.map(|p| pose * p), &standing) };
        let distance = distance(&found);
        if distance < self.nearest.map_or(self.reach, |nearest| nearest.distance) {
            self.nearest = Some(NearTriangles { distance, segment, interval, triangles, is_exact });
        }
        if is_exact {
            self.done = self.done.min(at_least);
        } else {
            let size = leg.length;
            let pieces = ItemPieces::Triangles(triangles);
            self.add(Item { at_least, size, segment, interval, pieces });
        }
        Ok(())
    }

    fn answer(&self) -> Option<ClosestApproach> {
        let Some(nearest) = self.nearest else { return self.given_up.map(|item| self.doubtful(&item)) };
        let NearTriangles { segment, interval, triangles, is_exact, .. } = nearest;
        let surfaces = self.surfaces(segment);
        let [moving, standing] = [0, 1].map(|side| surfaces[side].corners(triangles[side]));
        let between = |share: f64| {
            let pose = self.pose(segment, interval, share);
            hull_distance(&moving.map(|p| pose * p), &standing)
        };
        let gap = |share: f64| distance(&between(share));
        // Of two convex bodies of which one is shifted evenly, the distance is a convex function of the shift.
        let share = if is_exact { least_of_convex(gap) } else { 0.5 };
        let ApproachSegment { pair, number, course } = &self.segments[segment as usize];
        let [from, to] = interval.of(course.length);
        let along = from + share * (to - from);
        let at_least = self.done.min(self.limit()).min(nearest.distance);
        Some(ClosestApproach {
            pair: *pair,
            distance: nearest.distance,
            at_least: if nearest.distance <= TOUCHED { 0.0 } else { at_least },
            segment: *number,
            share: if course.length > 0.0 { (along / course.length).clamp(0.0, 1.0) } else { 0.0 },
            points: between(share).points,
        })
    }

    /// The answer of a search that was given up before it found a distance below `reach`: the bound is lower than that.
    fn doubtful(&self, item: &Item) -> ClosestApproach {
        let ApproachSegment { pair, number, .. } = &self.segments[item.segment as usize];
        let [from, to] = item.interval.of(1.0);
        ClosestApproach {
            pair: *pair,
            distance: self.reach,
            at_least: self.done.min(self.reach),
            segment: *number,
            share: (from + to) / 2.0,
            points: None,
        }
    }

    /// The pose at a share of a stretch.
    fn pose(&self, segment: u32, interval: Interval, share: f64) -> Pose {
        let ApproachSegment { course, .. } = &self.segments[segment as usize];
        let own = interval.share();
        let [from, _] = interval.of(1.0);
        let course_segment = &course.segments[0];
        interpolate(&course_segment.from, &course_segment.to, &course.centre, from + share * own)
    }

    fn surfaces(&self, segment: u32) -> [&'a Surface; 2] {
        let pair = self.segments[segment as usize].pair;
        self.pairs[pair].shapes.map(|shape| &*shape.surface)
    }

    fn trees(&self, segment: u32) -> Result<[&'a PatchTree; 2], Interrupt> {
        let pair = self.segments[segment as usize].pair;
        let [moving, standing] = self.pairs[pair].shapes;
        Ok([moving.patches(self.termination)?, standing.patches(self.termination)?])
    }

    /// Spheres around the pieces of an item, each in the frame of its shape.
    fn spheres(&self, segment: u32, pieces: ItemPieces) -> Result<[BoundingSphere; 2], Interrupt> {
        let pair = self.segments[segment as usize].pair;
        Ok(match pieces {
            ItemPieces::Patches(patches) => {
                let trees = self.trees(segment)?;
                [0, 1].map(|side| {
                    let patch = trees[side].patch(patches[side]);
                    BoundingSphere { centre: patch.centre, radius: patch.radius }
                })
            }
            ItemPieces::Wholes | ItemPieces::Triangles(_) => self.pairs[pair].shapes.map(|shape| {
                let bounds = shape.bounds();
                BoundingSphere { centre: bounds.centre(), radius: bounds.extents().norm() / 2.0 }
            }),
        })
    }
}

/// The distance of two triangles.
fn distance(found: &HullDistance) -> f64 {
    found.points.map_or(found.at_least, |[p, q]| (p - q).norm())
}

#[derive(Debug, Clone, Copy)]
struct BoundingSphere {
    centre: Point3<f64>,
    radius: f64,
}

/// A bound of the distance between what is in a sphere that moves along a leg and what is in one that stands.
fn distance_of_spheres(leg: &Leg, moving: &BoundingSphere, standing: &BoundingSphere) -> f64 {
    let images: Vec<Point3<f64>> = leg.maps.iter().map(|map| map.apply(&moving.centre)).collect();
    let q = standing.centre;
    let distance = match images[..] {
        [] => return 0.0,
        [p] => (q - p).norm(),
        [a, b] => (q - closest_on_triangle(&q, &a, &b, &b).0).norm(),
        [a, b, c] => (q - closest_on_triangle(&q, &a, &b, &c).0).norm(),
        _ => hull_distance(&images, &[q]).at_least,
    };
    (distance - leg.stretch * moving.radius - standing.radius - leg.slack).max(0.0)
}

/// How far the hull of a sphere's images reaches beyond where the sphere moves, at most.
fn bulge(leg: &Leg, moving: &BoundingSphere) -> f64 {
    let images: Vec<Point3<f64>> = leg.maps.iter().map(|map| map.apply(&moving.centre)).collect();
    let bend = match images[..] {
        [a, b, c] => (b - center(&a, &c)).norm(),
        _ => 0.0,
    };
    bend + leg.slack + (leg.stretch - 1.0) * moving.radius
}

/// Where in [0, 1] a convex function is the least, by golden sections.
fn least_of_convex(f: impl Fn(f64) -> f64) -> f64 {
    /// Each leaves 0.62 of the range: a millionth after 29. At half, a thousandth; at double, nothing a double resolves.
    const SECTIONS: usize = 29;
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..SECTIONS {
        let [p, q] = [high - golden * (high - low), low + golden * (high - low)];
        if f(p) <= f(q) { high = q } else { low = p }
    }
    let middle = (low + high) / 2.0;
    [0.0, middle, 1.0].into_iter().min_by(|p, q| f(*p).total_cmp(&f(*q))).unwrap_or(middle)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{cuboid, healed, l_shape, shape_of, tube, vector};
    use crate::geometry::SourceMesh;

    fn shape(mesh: SourceMesh) -> Shape {
        shape_of(&healed(mesh))
    }

    fn approach(shapes: [&Shape; 2], path: &[Pose]) -> ClosestApproach {
        within(shapes, path, f64::INFINITY).unwrap()
    }

    fn within(shapes: [&Shape; 2], path: &[Pose], reach: f64) -> Option<ClosestApproach> {
        let pair = PassedPair { shapes, path: path.to_vec(), centre: shapes[0].bounds().centre() };
        closest_approach(&[pair], reach, &Termination::default()).unwrap()
    }

    fn at(x: f64, y: f64, z: f64) -> Pose {
        Pose::translation(x, y, z)
    }

    /// All pairs of triangles of two surfaces, one moved.
    fn measured(shapes: [&Shape; 2], pose: &Pose) -> f64 {
        let triangles = |shape: &Shape| {
            let surface = &shape.surface;
            (0..surface.triangles().len() as u32).map(|t| surface.corners(t)).collect::<Vec<_>>()
        };
        let [moving, standing] = shapes.map(triangles);
        let moved = moving.iter().map(|corners| corners.map(|p| pose * p));
        let gap = |a: [Point3<f64>; 3]| {
            standing.iter().map(|b| distance(&hull_distance(&a, b))).fold(f64::INFINITY, f64::min)
        };
        moved.map(gap).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn a_box_that_passes_another_has_the_gap_between_their_sides() {
        let one = shape(cuboid([0.0; 3], [1.0; 3]));
        let found = approach([&one, &one], &[at(-5.0, 1.25, 0.0), at(5.0, 1.25, 0.3)]);
        assert!((found.distance - 0.25).abs() < 1e-9, "{found:?}");
        assert!((0.2475..=found.distance).contains(&found.at_least), "{found:?}");
        let [p, q] = found.points.unwrap();
        assert!((p.y - 1.25).abs() < 1e-9 && (q.y - 1.0).abs() < 1e-9, "{found:?}");
        // Further off than this, it is not looked for.
        let path = [at(-5.0, 1.25, 0.0), at(5.0, 1.25, 0.3)];
        assert_eq!(within([&one, &one], &path, 0.24), None);
        assert!(within([&one, &one], &path, 0.26).is_some());
    }

    #[test]
    fn what_meets_has_no_distance() {
        let one = shape(cuboid([0.0; 3], [1.0; 3]));
        let found = approach([&one, &one], &[at(-5.0, 0.5, 0.2), at(-1.0, 0.5, 0.2)]);
        assert!(found.distance < TOUCHED && found.at_least == 0.0, "{found:?}");
        assert!((found.share - 1.0).abs() < 1e-3, "{found:?}");
        let found = approach([&one, &one], &[at(-5.0, 0.5, 0.2), at(4.0, 0.5, 0.2)]);
        assert!(found.distance == 0.0 && found.at_least == 0.0, "{found:?}");
    }

    #[test]
    fn the_corner_of_a_bar_that_turns_comes_the_nearest_where_it_points_at_the_wall() {
        let bar = shape(cuboid([-1.0, -0.1, 0.0], [1.0, 0.1, 1.0]));
        let wall = shape(cuboid([1.2, -3.0, -1.0], [1.5, 3.0, 2.0]));
        let turned = |angle: f64| Pose::new(Vector3::zeros(), Vector3::z() * angle);
        let found = approach([&bar, &wall], &[turned(-1.0), turned(1.0)]);
        let gap = 1.2 - 1.01f64.sqrt();
        assert!((gap * (1.0 - APPROACH_PRECISION)..=gap).contains(&found.at_least), "{found:?}");
        assert!((gap..=gap / (1.0 - APPROACH_PRECISION)).contains(&found.distance), "{found:?}");
    }

    #[test]
    fn a_part_that_stands_still_has_the_distance_where_it_stands() {
        let [ring, block] = [tube(1.0, 2.0, [0.0, 1.0], 12), cuboid([-0.5; 3], [0.5; 3])].map(shape);
        let found = approach([&block, &ring], &[at(0.0, 0.0, 0.5)]);
        let expected = measured([&block, &ring], &at(0.0, 0.0, 0.5));
        assert!((found.distance - expected).abs() < 1e-9 && found.segment == 0, "{found:?}, {expected}");
    }

    #[test]
    fn of_several_pairs_the_nearest_is_found() {
        let one = shape(cuboid([0.0; 3], [1.0; 3]));
        let pair = |height: f64| PassedPair {
            shapes: [&one, &one],
            path: vec![at(-5.0, 0.0, height), at(0.0, 0.0, height), at(5.0, 0.0, height + 0.1)],
            centre: one.bounds().centre(),
        };
        let pairs = [3.0, 1.5, 2.0].map(pair);
        let found = closest_approach(&pairs, f64::INFINITY, &Termination::default()).unwrap().unwrap();
        assert_eq!((found.pair, found.segment), (1, 0));
        assert!((found.distance - 0.5).abs() < 1e-9);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn no_pose_on_the_way_is_nearer_than_the_bound(
            turns in prop::collection::vec(vector(1.5), 3),
            shifts in prop::collection::vec(vector(4.0), 3),
        ) {
            let [moving, standing] = [l_shape(), tube(0.6, 1.0, [0.0, 0.5], 5)].map(shape);
            let shapes = [&moving, &standing];
            let path: Vec<Pose> = turns.iter().zip(&shifts).map(|(t, s)| Pose::new(*s, *t)).collect();
            let centre = moving.bounds().centre();
            let found = approach(shapes, &path);
            let pose = |segment: usize, share| interpolate(&path[segment], &path[segment + 1], &centre, share);
            let there = measured(shapes, &pose(found.segment, found.share));
            prop_assert!((found.at_least..=found.distance + 1e-6).contains(&there), "{found:?}, but {there}");
            let steps = 40;
            let sampled = (0..2).flat_map(|segment| (0..=steps).map(move |step| (segment, step)));
            let sampled = sampled.map(|(s, step)| measured(shapes, &pose(s, f64::from(step) / f64::from(steps))));
            let sampled = sampled.fold(f64::INFINITY, f64::min);
            prop_assert!(found.at_least <= sampled + 1e-9, "{found:?}, but {sampled}");
            prop_assert!(found.distance * (1.0 - APPROACH_PRECISION) <= sampled + TOUCHED, "{found:?}, but {sampled}");
            let precise = found.distance * (1.0 - APPROACH_PRECISION) - TOUCHED;
            prop_assert!(found.at_least >= precise, "{found:?}");
        }
    }
}
