//! A path as the motion of points: for any stretch, a few affine maps such that a point stays in the convex hull of
//! its images.
//!
//! Between two poses the part's centre moves on a line and its rotation slerps. Under rotation alone, the arc of a
//! point lies in the triangle of its ends and the point where the tangents there meet; each of these three is a
//! linear map of the point. With the shift this holds up to a remainder, which [`Leg::slack`] bounds.

use std::collections::HashMap;
use std::rc::Rc;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::budgets::{LEG_BENDS, REMEMBERED_LEG_LEVELS};
use crate::geometry::{Pose, interpolate};
use crate::tolerances::{LEG_TURN, SCREW_TURN};

/// Whether a path turns so far that it may be a screw of many turns.
pub(crate) fn turns_far(path: &[Pose]) -> bool {
    let turns = path.iter().zip(path.iter().skip(1)).map(|(a, b)| a.rotation.angle_to(&b.rotation));
    turns.sum::<f64>() > SCREW_TURN
}

/// The path of a part, in the frame of the part that it passes.
#[derive(Debug)]
pub(crate) struct Course {
    pub(crate) segments: Vec<PathSegment>,
    /// The point of the shape that moves on straight lines.
    pub(crate) centre: Point3<f64>,
    /// The largest distance of a point of the shape from the centre.
    pub(crate) reach: f64,
    pub(crate) length: f64,
}

#[derive(Debug)]
pub(crate) struct PathSegment {
    pub(crate) from: Pose,
    pub(crate) to: Pose,
    /// The length of the path before this segment.
    pub(crate) before: f64,
    /// The largest displacement of a point on it.
    pub(crate) length: f64,
}

impl Course {
    /// The path through some poses of a shape. Its point `centre` moves on lines, and no point of the shape is
    /// further than `reach` from it.
    pub(crate) fn new(path: &[Pose], centre: Point3<f64>, reach: f64) -> Self {
        let mut course = Self { segments: Vec::new(), centre, reach, length: 0.0 };
        for (from, to) in path.iter().zip(path.iter().skip(1).chain(path.last())) {
            let shift = (to * centre - from * centre).norm();
            let length = shift + reach * from.rotation.angle_to(&to.rotation);
            if length > 0.0 || path.len() == 1 {
                course.segments.push(PathSegment { from: *from, to: *to, before: course.length, length });
                course.length += length;
            }
        }
        if let (true, Some(only)) = (course.segments.is_empty(), path.first()) {
            course.segments.push(PathSegment { from: *only, to: *only, before: 0.0, length: 0.0 });
        }
        course
    }

    /// The bends of a stretch: segments with the shares at which they begin and end.
    fn bends(&self, from: f64, to: f64) -> Vec<(&PathSegment, f64, f64)> {
        let first = self.segments.partition_point(|s| s.before + s.length < from);
        let share = |s: &PathSegment, at: f64| {
            if s.length > 0.0 { ((at - s.before) / s.length).clamp(0.0, 1.0) } else { 0.0 }
        };
        let mut bends: Vec<_> = self.segments[first.min(self.segments.len().saturating_sub(1))..]
            .iter()
            .take_while(|s| s.before <= to)
            .map(|s| (s, share(s, from), share(s, to)))
            .collect();
        // A segment that is only touched at an end adds nothing.
        if bends.iter().any(|(_, a, b)| b > a) {
            bends.retain(|(_, a, b)| b > a);
        } else {
            bends.truncate(1);
        }
        bends
    }

    /// The angle by which the part turns on a stretch, in radians.
    pub(crate) fn turn(&self, interval: Interval) -> f64 {
        let [from, to] = interval.of(self.length);
        let turn = |(s, a, b): &(&PathSegment, f64, f64)| s.from.rotation.angle_to(&s.to.rotation) * (b - a);
        self.bends(from, to).iter().map(turn).sum()
    }

    /// The path between two places on it.
    pub(crate) fn path_between(&self, [from, to]: [f64; 2]) -> Vec<Pose> {
        let bends = self.bends(from, to);
        let at = |(s, a, _): &(&PathSegment, f64, f64)| interpolate(&s.from, &s.to, &self.centre, *a);
        let last = bends.last().map(|(s, _, b)| interpolate(&s.from, &s.to, &self.centre, *b));
        bends.iter().map(at).chain(last).collect()
    }

    fn pose(&self, at: f64) -> Option<Pose> {
        let (segment, share, _) = *self.bends(at, at).first()?;
        Some(interpolate(&segment.from, &segment.to, &self.centre, share))
    }
}

/// Stretch `index` of the `2^level` equal stretches of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Interval {
    level: u32,
    index: u64,
}

impl Interval {
    pub(crate) const WHOLE: Self = Self { level: 0, index: 0 };

    pub(crate) fn halves(self) -> [Self; 2] {
        [0, 1].map(|k| Self { level: self.level + 1, index: 2 * self.index + k })
    }

    /// Whether another stretch is part of it.
    pub(crate) fn holds(self, other: Self) -> bool {
        other.level >= self.level && other.index >> (other.level - self.level) == self.index
    }

    /// Its begin and end on a path of some length.
    pub(crate) fn of(self, length: f64) -> [f64; 2] {
        let own = length * self.share();
        [own * self.index as f64, own * (self.index + 1) as f64]
    }

    /// Its share of the whole.
    pub(crate) fn share(self) -> f64 {
        0.5f64.powi(self.level as i32)
    }
}

/// x ↦ linear · x + shift.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Affine {
    linear: Matrix3<f64>,
    shift: Vector3<f64>,
}

impl Affine {
    pub(crate) fn apply(&self, p: &Point3<f64>) -> Point3<f64> {
        Point3::from(self.linear * p.coords + self.shift)
    }
}

/// A stretch of a path, as maps.
#[derive(Debug)]
pub(crate) struct Leg {
    /// A point stays in the hull of its images under these, up to `slack`; empty if the stretch is too bent.
    pub(crate) maps: Vec<Affine>,
    /// The remainder.
    pub(crate) slack: f64,
    /// The largest factor by which a map stretches.
    pub(crate) stretch: f64,
    /// The map at its end.
    pub(crate) end: Pose,
    /// The largest displacement of a point.
    pub(crate) length: f64,
    /// The direction in which all points move, if it is the same for all.
    pub(crate) along: Option<Vector3<f64>>,
}

impl Leg {
    /// The images of points, point by point: the points stay in the hull of these, up to the slack.
    pub(crate) fn images<'l>(
        &'l self,
        points: impl IntoIterator<Item = &'l Point3<f64>> + 'l,
    ) -> impl Iterator<Item = Point3<f64>> + 'l {
        points.into_iter().flat_map(|p| self.maps.iter().map(|m| m.apply(p)))
    }
}

/// A course seen from one of the two parts: points of the moving part in the frame of the standing one, or the other
/// way round.
pub(crate) struct CourseView<'a> {
    course: &'a Course,
    /// Whether the points are the moving part's.
    on_moving: bool,
    /// A shorter stretch counts as one point, however bent it is.
    shortest: f64,
    legs: HashMap<Interval, Rc<Leg>>,
}

impl<'a> CourseView<'a> {
    pub(crate) fn new(course: &'a Course, on_moving: bool, shortest: f64) -> Self {
        Self { course, on_moving, shortest, legs: HashMap::new() }
    }

    pub(crate) fn leg(&mut self, interval: Interval) -> Rc<Leg> {
        if let Some(leg) = self.legs.get(&interval) {
            return Rc::clone(leg);
        }
        let leg = Rc::new(self.measured(interval));
        if interval.level <= REMEMBERED_LEG_LEVELS {
            self.legs.insert(interval, Rc::clone(&leg));
        }
        leg
    }

    fn measured(&self, interval: Interval) -> Leg {
        let length = self.course.length * interval.share();
        let from = length * interval.index as f64;
        let to_standing = self.course.pose(from + length).unwrap_or_else(Pose::identity);
        let mut leg = Leg {
            maps: Vec::new(),
            slack: 0.0,
            stretch: 1.0,
            end: if self.on_moving { to_standing } else { to_standing.inverse() },
            length,
            along: None,
        };
        let bends = self.course.bends(from, from + length);
        let turns = |(segment, a, b): &(&PathSegment, f64, f64)| {
            segment.from.rotation.angle_to(&segment.to.rotation) * (b - a)
        };
        if bends.len() > LEG_BENDS || bends.iter().any(|bend| turns(bend) > LEG_TURN) {
            if length <= self.shortest {
                let linear = *leg.end.rotation.to_rotation_matrix().matrix();
                leg.maps.push(Affine { linear, shift: leg.end.translation.vector });
                leg.slack = length;
            }
            return leg;
        }
        for (segment, a, b) in bends {
            let [a, b] = [a, b].map(|u| interpolate(&segment.from, &segment.to, &self.course.centre, u));
            self.bend(&a, &b, &mut leg);
        }
        // A bend that does not turn has two maps.
        if let [first, last] = &leg.maps[..] {
            leg.along = (last.shift - first.shift).try_normalize(0.0);
        }
        leg
    }

    /// Adds the maps of the way between two poses.
    fn bend(&self, a: &Pose, b: &Pose, leg: &mut Leg) {
        let centre = self.course.centre;
        let start = a * centre;
        let shift = b * centre - start;
        let turn = (b.rotation * a.rotation.inverse()).scaled_axis();
        let [first, last] = [a, b].map(|p| *p.rotation.to_rotation_matrix().matrix());
        if leg.maps.is_empty() {
            leg.maps.push(self.map(first, start.coords));
        }
        if let Some(axis) = turn.try_normalize(1e-9) {
            let angle = turn.norm();
            let along = axis * axis.transpose();
            let widened = 1.0 / (angle / 2.0).cos().powi(2);
            let tangents = along * first + (Matrix3::identity() - along) * (first + last) * (widened / 2.0);
            leg.maps.push(self.map(tangents, start.coords + shift / 2.0));
            leg.stretch = leg.stretch.max(widened);
            // How far t strays from where the three maps put it: 0.008 of the square, as measured.
            let mut slack = 0.01 * angle * angle * shift.norm();
            if !self.on_moving {
                slack += angle * (1.0 + angle) / 8.0 * axis.cross(&shift).norm();
            }
            leg.slack = leg.slack.max(slack);
        }
        // A part that stands still has one map.
        if a != b {
            leg.maps.push(self.map(last, (start + shift).coords));
        }
    }

    /// The map of a part turned by `rotation` (or by its tangent) with its centre at `at`.
    fn map(&self, rotation: Matrix3<f64>, at: Vector3<f64>) -> Affine {
        let centre = self.course.centre.coords;
        if self.on_moving {
            Affine { linear: rotation, shift: at - rotation * centre }
        } else {
            let linear = rotation.transpose();
            Affine { linear, shift: centre - linear * at }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::vector;

    proptest! {
        #[test]
        fn where_a_point_passes_is_in_the_hull_of_its_images(
            turns in prop::collection::vec(vector(1.0), 2..5),
            shifts in prop::collection::vec(vector(2.0), 5),
            point in vector(3.0),
            directions in prop::collection::vec(vector(1.0), 20),
            share in 0.0..1.0f64,
        ) {
            let path: Vec<Pose> = turns.iter().zip(&shifts).map(|(t, s)| Pose::new(*s, *t)).collect();
            let centre = Point3::new(0.3, -0.2, 0.5);
            let course = Course::new(&path, centre, 4.0);
            let point = Point3::from(point);
            for on_moving in [true, false] {
                let mut view = CourseView::new(&course, on_moving, 1e-3);
                let mut interval = Interval::WHOLE;
                for _ in 0..7 {
                    let leg = view.leg(interval);
                    let at = course.length * (interval.index as f64 + share) * interval.share();
                    let pose = course.pose(at).unwrap();
                    let pose = if on_moving { pose } else { pose.inverse() };
                    let p = pose * point;
                    for n in directions.iter().filter_map(|d| d.try_normalize(1e-3)) {
                        let images = leg.maps.iter().map(|m| n.dot(&m.apply(&point).coords));
                        let least = images.fold(f64::INFINITY, f64::min);
                        prop_assert!(leg.maps.is_empty() || n.dot(&p.coords) >= least - leg.slack - 1e-9);
                    }
                    interval = interval.halves()[usize::from(share > 0.5)];
                }
            }
        }
    }

    #[test]
    fn a_straight_way_has_two_maps_and_a_turn_three() {
        let to = Pose::translation(2.0, 0.0, 0.0);
        let turned = to * Pose::rotation(Vector3::z() * 0.5);
        let course = Course::new(&[Pose::identity(), to, turned], Point3::origin(), 1.0);
        assert!((course.length - 2.5).abs() < 1e-12);
        let mut view = CourseView::new(&course, true, 1e-3);
        let whole = view.leg(Interval::WHOLE);
        assert_eq!((whole.maps.len(), whole.slack), (4, 0.0));
        let [first, second] = Interval::WHOLE.halves();
        assert_eq!(view.leg(first).maps.len(), 2);
        assert_eq!(view.leg(first).along, Some(Vector3::x()));
        assert_eq!((whole.along, view.leg(second).along), (None, None));
        assert!((view.leg(first).end.translation.vector.x - 1.25).abs() < 1e-12);
        assert_eq!(view.leg(second).maps.len(), 4);
    }

    #[test]
    fn a_path_of_one_pose_is_a_point() {
        let course = Course::new(&[Pose::translation(1.0, 2.0, 3.0)], Point3::origin(), 1.0);
        let leg = CourseView::new(&course, true, 1e-3).leg(Interval::WHOLE);
        assert!(course.length == 0.0 && leg.length == 0.0);
        for m in &leg.maps {
            assert_eq!(m.apply(&Point3::origin()), Point3::new(1.0, 2.0, 3.0));
        }
    }
}
