//! Surfaces seen along a helix: in its half plane, where screwing changes nothing.
//!
//! In cylindrical coordinates about the axis, screwing by an angle turns a point by that angle and
//! lifts it by `rise` times the angle. Its distance `r` from the axis and its height
//! `u = z − rise · θ` on the helix through it stay the same, only the unrolled angle θ grows. θ and
//! θ + 2π are the same place, and so are (u, θ) and (u − 2π · rise, θ + 2π).

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Point2, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

use super::Pose;

/// Triangles that are seen under a wider angle from the axis have no footprint.
const WIDEST: f64 = 0.7;

/// The screw motion along one helix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Helix {
    /// To the axis frame (z along the axis, the origin on it), from that in which the axis is given.
    pub axis_from_frame: Pose,
    /// Travel along the axis per radian.
    pub rise: f64,
}

impl Helix {
    /// The helix about the line through a point along a unit vector.
    #[must_use]
    pub fn about(axis: &Vector3<f64>, through: &Point3<f64>, rise: f64) -> Self {
        let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
        let basis = Matrix3::from_columns(&[across, axis.cross(&across), *axis]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(basis));
        let frame_from_axis = Pose::from_parts(Translation3::from(through.coords), rotation);
        Self { axis_from_frame: frame_from_axis.inverse(), rise }
    }

    /// The displacement by an angle, in the axis frame.
    #[must_use]
    pub fn screwed(&self, angle: f64) -> Pose {
        Pose::new(Vector3::z() * (self.rise * angle), Vector3::z() * angle)
    }

    /// The distance along the axis from one turn to the next.
    #[must_use]
    pub fn pitch(&self) -> f64 {
        TAU * self.rise
    }
}

/// Where a triangle is in the half plane (r, u): every one of its points is within `error` of the
/// hull of three points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// The images of the corners, moved to where the error is least.
    pub points: [Point2<f64>; 3],
    /// How far the image may be outside the hull of these.
    pub error: f64,
}

impl Footprint {
    /// The footprint of a triangle (axis frame), on the turn of its first corner. `None` if the triangle
    /// is seen under a wide angle from the axis.
    #[must_use]
    pub fn of(corners: &[Point3<f64>; 3], rise: f64) -> Option<Self> {
        let first = corners[0].y.atan2(corners[0].x);
        let angles = [first, 0.0, 0.0];
        let angles = [0, 1, 2].map(|i| match i {
            0 => angles[0],
            _ => beside(corners[i].y.atan2(corners[i].x), first),
        });
        let [low, high] =
            [angles.iter().copied().fold(first, f64::min), angles.iter().copied().fold(first, f64::max)];
        let flat = corners.map(|p| p.xy().coords);
        let nearest = (0..3).map(|i| from_origin(&flat[i], &flat[(i + 1) % 3])).fold(f64::INFINITY, f64::min);
        let longest = (0..3).map(|i| (flat[(i + 1) % 3] - flat[i]).norm()).fold(0.0, f64::max);
        if high - low > WIDEST || nearest <= 0.0 || nearest < longest / 2.0 {
            return None;
        }
        // Of a function with second derivatives up to M, linear interpolation over a triangle is off
        // by no more than M · side² / 6. The radius is convex, and 1/r is its M, 1/r² that of the angle.
        let side = longest * longest / 6.0;
        let (inward, along) = (side / nearest, rise.abs() * side / (nearest * nearest));
        let points =
            [0, 1, 2].map(|i| Point2::new(flat[i].norm() - inward / 2.0, corners[i].z - rise * angles[i]));
        Some(Self { points, error: (inward / 2.0).hypot(along) })
    }
}

/// An angle, by whole turns as near to another as can be.
fn beside(angle: f64, near: f64) -> f64 {
    angle + TAU * ((near - angle) / TAU).round()
}

/// From how far to how far a triangle (axis frame) is from the axis.
#[must_use]
pub fn radii(corners: &[Point3<f64>; 3]) -> [f64; 2] {
    let flat = corners.map(|p| p.xy().coords);
    let far = flat.iter().map(|p| p.norm()).fold(0.0, f64::max);
    let sides = [0, 1, 2].map(|i| flat[i].perp(&flat[(i + 1) % 3]));
    if sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0) {
        return [0.0, far];
    }
    [(0..3).map(|i| from_origin(&flat[i], &flat[(i + 1) % 3])).fold(f64::INFINITY, f64::min), far]
}

/// How far a line from one point to another is from the origin.
fn from_origin(a: &Vector2<f64>, b: &Vector2<f64>) -> f64 {
    let along = b - a;
    let share = if along.norm_squared() > 0.0 { -a.dot(&along) / along.norm_squared() } else { 0.0 };
    (a + along * share.clamp(0.0, 1.0)).norm()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// How far a point of the half plane is from the hull of the points of a footprint, at least.
    fn outside(print: &Footprint, p: &Point2<f64>) -> f64 {
        let a = print.points;
        let middle = (a[0].coords + a[1].coords + a[2].coords) / 3.0;
        let sides = (0..3).map(|i| a[(i + 1) % 3] - a[i]).map(|s| Vector2::new(-s.y, s.x));
        let normals = sides.flat_map(|n| [n, -n]).chain([p.coords - middle]);
        let gap =
            |n: Vector2<f64>| n.dot(&p.coords) - a.iter().map(|q| n.dot(&q.coords)).fold(-1e9, f64::max);
        normals.filter_map(|n| n.try_normalize(1e-12)).map(gap).fold(0.0, f64::max)
    }

    fn corner() -> impl Strategy<Value = [f64; 3]> {
        [0.2..1.5f64, -0.5..0.5f64, -1.0..1.0f64]
    }

    proptest! {
        #[test]
        fn a_footprint_holds_its_triangle_however_far_it_is_screwed(
            corners in [corner(), corner(), corner()], rise in -0.5..0.5f64, angle in -30.0..30.0f64,
            weights in prop::array::uniform3(0.01..1.0f64),
        ) {
            let helix = Helix::about(&Vector3::z(), &Point3::origin(), rise);
            let corners = corners.map(Point3::from);
            let sum: f64 = weights.iter().sum();
            let p = Point3::from((0..3).map(|i| corners[i].coords * (weights[i] / sum)).sum::<Vector3<f64>>());
            let screwed = helix.screwed(angle) * p;
            let turned = p.y.atan2(p.x) + angle;
            let at = Point2::new(screwed.xy().coords.norm(), screwed.z - rise * turned);
            if let Some(print) = Footprint::of(&corners, rise) {
                prop_assert!(outside(&print, &at) <= print.error + 1e-9, "{print:?} {at:?}");
            }
        }
    }

    #[test]
    fn the_axis_frame_has_the_axis_as_z() {
        let axis = Vector3::new(1.0, -2.0, 0.5).normalize();
        let helix = Helix::about(&axis, &Point3::new(3.0, 1.0, 2.0), 0.25);
        let on_axis = helix.axis_from_frame * (Point3::new(3.0, 1.0, 2.0) + axis * 2.0);
        assert!((on_axis - Point3::new(0.0, 0.0, 2.0)).norm() < 1e-12);
        assert!(
            (helix.screwed(TAU) * Point3::new(1.0, 0.0, 0.0) - Point3::new(1.0, 0.0, helix.pitch())).norm()
                < 1e-12
        );
    }
}
