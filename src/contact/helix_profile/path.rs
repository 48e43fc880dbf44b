//! The helix that a path follows, and how far it strays from it.
//!
//! At every time the part is where a fixed reference pose was screwed to, up to a small displacement: a nut rattles
//! in its play. The direction of the axis is the one that the part and space keep in common (the largest singular
//! value of the sum of all rotations), and its place follows from points that keep their distance (least squares).
//! What lies far off, such as a last pull, is left out.

use nalgebra::{Matrix3, Point3, Quaternion, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use crate::budgets::{KNOTS_PER_SEGMENT, OUTLIER_ROUNDS};
use crate::geometry::{Bounds, Helix, Pose, interpolate};
use crate::tolerances::{KNOT_TRAVEL, LEAST_PITCH, OUTLIER};

use super::super::course::{Course, Interval, PathSegment};
use super::range;

/// A short piece of the path.
#[derive(Debug, Clone)]
struct Knot {
    /// Its begin and end on the path.
    way: [f64; 2],
    /// The angles there, counted from the start.
    angles: [f64; 2],
    /// The pose of the shape in the middle of the piece.
    pose: Pose,
    /// The same in the axis frame, screwed back by the angle there.
    unscrewed: Pose,
    /// The largest displacement of the part's centre from there, when screwed back.
    strays: f64,
    /// The largest rotation from there.
    turns: f64,
}

/// A path as motion along a helix.
#[derive(Debug, Clone)]
pub(super) struct ScrewPath {
    pub(super) helix: Helix,
    /// The pose (axis frame) that is screwed along.
    pub(super) reference: Pose,
    length: f64,
    centre: Point3<f64>,
    knots: Vec<Knot>,
}

/// Two parts in the axis frame, the moving one at the reference pose: boxes along the axis do not depend on how the
/// parts lie in the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisBoxes {
    pub(super) moving: Bounds,
    pub(super) standing: Bounds,
}

/// A stretch of the path, as far as the two parts can meet there.
#[derive(Debug, Clone, Copy)]
pub(super) struct ScrewStretch {
    /// How much further along the axis it is than the reference.
    pub(super) shift: f64,
    /// The largest distance, from the place that the reference gives, of the centre of where it can meet the other
    /// part.
    pub(super) strays: f64,
    /// The largest rotation against the reference.
    pub(super) tilt: f64,
    /// How far along the axis the parts can meet on either side of that centre.
    pub(super) height: f64,
    /// The ranges along the axis in which the parts can meet: of the moving part at the reference pose, and of the
    /// standing one.
    pub(super) places_of_moving: [f64; 2],
    pub(super) places_of_standing: [f64; 2],
}

impl ScrewStretch {
    /// The largest distance of a point at some radius from the place that the reference gives, if it can meet the
    /// other part.
    pub(super) fn stray(&self, radius: f64) -> f64 {
        (self.strays + self.tilt * radius.hypot(self.height)) / (1.0 - self.tilt)
    }
}

impl ScrewPath {
    /// The helix to which most of some stretches are close, from pieces on which no point strays much further than
    /// `finest`.
    pub(super) fn new(course: &Course, stretches: &[Interval], finest: f64) -> Option<Self> {
        let stretches: Vec<[f64; 2]> = stretches.iter().map(|i| i.of(course.length)).collect();
        let is_in = |s: &&PathSegment| {
            let way = [s.before, s.before + s.length];
            stretches.iter().any(|[from, to]| way[0] < *to && *from < way[1])
        };
        let samples: Vec<SegmentSample> =
            course.segments.iter().filter(is_in).map(|s| SegmentSample::of(s, course)).collect();
        let helix = fit(&samples, &course.centre)?;
        let (length, centre) = (course.length, course.centre);
        let knots = knots(course, &helix, finest);
        let mut path = Self { helix, reference: Pose::identity(), length, centre, knots };
        path.reference = path.mean(&stretches)?;
        Some(path)
    }

    /// A pose close to most of those that were screwed back.
    fn mean(&self, stretches: &[[f64; 2]]) -> Option<Pose> {
        let is_in = |k: &Knot| stretches.iter().any(|[from, to]| k.way[0] < *to && *from < k.way[1]);
        let weight = |k: &Knot| if is_in(k) { (k.angles[1] - k.angles[0]).abs() } else { 0.0 };
        let mut weights: Vec<f64> = self.knots.iter().map(weight).collect();
        let mut mean = None;
        for _ in 0..OUTLIER_ROUNDS {
            let first = self.knots.iter().zip(&weights).find(|(_, w)| **w > 0.0)?.0.unscrewed.rotation;
            let (mut rotation, mut middle) = (Quaternion::from_imag(Vector3::zeros()), Vector3::zeros());
            for (k, &w) in self.knots.iter().zip(&weights) {
                let q = k.unscrewed.rotation.quaternion();
                rotation += q * w.copysign(q.dot(first.quaternion()));
                middle += (k.unscrewed * self.centre).coords * w;
            }
            let rotation = UnitQuaternion::from_quaternion(rotation);
            let sum: f64 = weights.iter().sum();
            let translation = Translation3::from(middle / sum - rotation * self.centre.coords);
            let pose = Pose::from_parts(translation, rotation);
            let off = self.knots.iter().map(|k| (k.unscrewed * self.centre - pose * self.centre).norm());
            leave_out(&mut weights, &off.collect::<Vec<_>>());
            mean = Some(pose);
        }
        mean
    }

    /// The angle up to which all places are as near to the helix as `near`.
    pub(super) fn angle_within(&self, near: f64) -> f64 {
        let followed = self.knots.iter().take_while(|k| self.off(k) <= near);
        followed.last().map_or(0.0, |k| k.angles[1])
    }

    /// How far a piece of the path is from the helix.
    fn off(&self, knot: &Knot) -> f64 {
        (knot.unscrewed * self.centre - self.reference * self.centre).norm()
    }

    /// The last place as near to the helix as `near`: the angle, and the place on the path.
    pub(super) fn leaves(&self, near: f64) -> Option<(f64, f64)> {
        self.knots.iter().rev().find(|k| self.off(k) <= near).map(|k| (k.angles[1], k.way[1]))
    }

    /// The data of a stretch; `None` if the two parts are nowhere near each other.
    pub(super) fn stretch(
        &self,
        interval: Interval,
        AxisBoxes { moving, standing }: &AxisBoxes,
    ) -> Option<ScrewStretch> {
        let frame_from_axis = self.helix.axis_from_frame.inverse();
        let [from, to] = interval.of(self.length);
        let first = self.knots.partition_point(|k| k.way[1] < from);
        let knots = || self.knots[first..].iter().take_while(|k| k.way[0] <= to);
        // The place where the moving part can meet the other, and its distance from the reference there.
        let zones = knots().map(|k| {
            let near = standing
                .grown((k.way[1] - k.way[0]) / 2.0)
                .transformed(&(self.reference * k.pose.inverse() * frame_from_axis));
            Bounds { min: near.min.sup(&moving.min), max: near.max.inf(&moving.max) }
        });
        let zone = zones
            .filter(|z| (0..3).all(|a| z.min[a] <= z.max[a]))
            .fold(Bounds::EMPTY, |all, z| all.union(&z));
        if !zone.meets(moving) {
            return None;
        }
        let middle = Point3::new(0.0, 0.0, zone.centre().z);
        let own = self.reference.inverse() * middle;
        let off = |k: &Knot| k.unscrewed * own - middle;
        let [low, high] = range(knots().map(|k| off(k).z));
        let shift = f64::midpoint(low, high);
        let (mut strays, mut tilt) = (0.0f64, 0.0f64);
        for k in knots() {
            let off = off(k) - Vector3::z() * shift;
            strays = strays.max(off.norm() + k.strays + k.turns * (own - self.centre).norm());
            tilt = tilt.max(k.unscrewed.rotation.angle_to(&self.reference.rotation) + k.turns);
        }
        let angles = range(knots().flat_map(|k| k.angles));
        let mut stretch = ScrewStretch {
            shift,
            strays,
            tilt: tilt.min(0.5),
            height: zone.extents().z / 2.0,
            places_of_moving: [zone.min.z, zone.max.z],
            places_of_standing: [0.0; 2],
        };
        let [low, high] = range(angles.map(|angle| angle * self.helix.rise).into_iter());
        let stray = stretch.stray(zone.extents().norm());
        stretch.places_of_standing = [zone.min.z + low + shift - stray, zone.max.z + high + shift + stray];
        Some(stretch)
    }
}

/// The middle of a segment, the angle by which it turns, and the angle before it.
struct SegmentSample {
    pose: Pose,
    turn: Vector3<f64>,
    before: Vector3<f64>,
}

impl SegmentSample {
    fn of(segment: &PathSegment, course: &Course) -> Self {
        let pose = interpolate(&segment.from, &segment.to, &course.centre, 0.5);
        let before = course.segments.iter().take_while(|s| s.before < segment.before).map(turn).sum();
        Self { pose, turn: turn(segment), before }
    }
}

/// The rotation of a segment.
fn turn(segment: &PathSegment) -> Vector3<f64> {
    (segment.to.rotation * segment.from.rotation.inverse()).scaled_axis()
}

/// The helix along which most of some poses are screwed.
fn fit(samples: &[SegmentSample], centre: &Point3<f64>) -> Option<Helix> {
    let mut weights: Vec<f64> = samples.iter().map(|s| s.turn.norm()).collect();
    let mut found = None;
    for _ in 0..OUTLIER_ROUNDS {
        let weighted = || samples.iter().zip(weights.iter().copied());
        let rotations: Matrix3<f64> =
            weighted().map(|(s, w)| *s.pose.rotation.to_rotation_matrix().matrix() * w).sum();
        let svd = rotations.svd(true, true);
        let largest = svd.singular_values.imax();
        let (u, v) = (svd.u?, svd.v_t?);
        let (axis, own) = (u.column(largest).into_owned(), v.row(largest).transpose());
        let along: f64 = weighted().map(|(s, w)| s.turn.dot(&axis) * w).sum();
        let (axis, own) = if along < 0.0 { (-axis, -own) } else { (axis, own) };
        // A point of space and one of the part that stay together across the axis.
        let across = Matrix3::identity() - axis * axis.transpose();
        let mut normal = SMatrix::<f64, 6, 6>::identity() * 1e-9;
        let mut right = SVector::<f64, 6>::zeros();
        for (s, w) in weighted() {
            let mut row = SMatrix::<f64, 3, 6>::zeros();
            row.fixed_columns_mut::<3>(0)
                .copy_from(&(across * s.pose.rotation.to_rotation_matrix().matrix()));
            row.fixed_columns_mut::<3>(3).copy_from(&-across);
            let target = -(across * (s.pose * centre).coords);
            normal += row.transpose() * row * w;
            right += row.transpose() * target * w;
        }
        let solved = normal.cholesky()?.solve(&right);
        let point = centre + solved.fixed_rows::<3>(0);
        let through = Point3::from(solved.fixed_rows::<3>(3).into_owned());
        let angle = |s: &SegmentSample| (s.before + s.turn / 2.0).dot(&axis);
        let angles: Vec<f64> = samples.iter().map(angle).collect();
        let heights: Vec<f64> = samples.iter().map(|s| axis.dot(&(s.pose * point).coords)).collect();
        let (rise, level) = line(&angles, &heights, &weights)?;
        let rise = if (rise * std::f64::consts::TAU).abs() < LEAST_PITCH { 0.0 } else { rise };
        found = Some(Helix::about(&axis, &through, rise));
        let off: Vec<f64> = samples
            .iter()
            .enumerate()
            .map(|(i, s)| {
                let beside = (across * (s.pose * point - through)).norm();
                let tilt = (s.pose.rotation * own - axis).norm();
                beside + tilt + (heights[i] - level - rise * angles[i]).abs()
            })
            .collect();
        leave_out(&mut weights, &off);
    }
    found
}

/// Slope and level of the line through weighted points.
fn line(x: &[f64], y: &[f64], weights: &[f64]) -> Option<(f64, f64)> {
    let sum: f64 = weights.iter().sum();
    let mean = |v: &[f64]| v.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>() / sum;
    let (mx, my) = (mean(x), mean(y));
    let mut of_x = 0.0;
    let mut of_both = 0.0;
    for ((x, y), w) in x.iter().zip(y).zip(weights) {
        of_x += (x - mx).powi(2) * w;
        of_both += (x - mx) * (y - my) * w;
    }
    (sum > 0.0 && of_x > 0.0).then(|| (of_both / of_x, my - mx * of_both / of_x))
}

/// Takes the weight from points that are much further off than most.
fn leave_out(weights: &mut [f64], off: &[f64]) {
    let mut order: Vec<usize> = (0..off.len()).collect();
    order.sort_by(|&i, &j| off[i].total_cmp(&off[j]));
    let half: f64 = weights.iter().sum::<f64>() / 2.0;
    let mut passed = 0.0;
    let median = order.iter().find(|&&i| {
        passed += weights[i];
        passed >= half
    });
    let Some(&median) = median else { return };
    let most = off[median] * OUTLIER + 1e-9;
    weights.iter_mut().zip(off).filter(|(_, off)| **off > most).for_each(|(w, _)| *w = 0.0);
}

/// The path in pieces on which nothing moves much when it is screwed back.
fn knots(course: &Course, helix: &Helix, finest: f64) -> Vec<Knot> {
    let frame = helix.axis_from_frame;
    let mut angle = 0.0;
    let mut knots = Vec::new();
    for s in &course.segments {
        let turn = frame.rotation * turn(s);
        let by = turn.z;
        let [a, b] = [s.from, s.to].map(|pose| frame * (pose * course.centre));
        // Speeds per segment: of the centre against a point that is screwed along (linear in the place, so largest at
        // an end), and of the rotation.
        let along = |p: &Point3<f64>| (b - a) - Vector3::new(-p.y, p.x, helix.rise) * by;
        let speed = along(&a).norm().max(along(&b).norm());
        let turning = (turn - Vector3::z() * by).norm();
        let by_stray = (speed + turning * course.reach) / (2.0 * finest);
        // Where the parts can meet is known as well as points travel little.
        let by_travel = s.length / (KNOT_TRAVEL * helix.pitch().abs()).max(LEAST_PITCH);
        let count = by_stray.max(by_travel).ceil().clamp(1.0, KNOTS_PER_SEGMENT);
        for i in 0..count as usize {
            let share = |k: f64| (i as f64 + k) / count;
            let pose = interpolate(&s.from, &s.to, &course.centre, share(0.5));
            let unscrewed = helix.screwed(-(angle + by * share(0.5))) * frame * pose;
            knots.push(Knot {
                way: [0.0, 1.0].map(|k| s.before + s.length * share(k)),
                angles: [0.0, 1.0].map(|k| angle + by * share(k)),
                pose,
                unscrewed,
                strays: speed / (2.0 * count),
                turns: turning / (2.0 * count),
            });
        }
        angle += by;
    }
    knots
}
