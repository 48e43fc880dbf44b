//! Rigid poses.
//!
//! A [`Pose`] named `a_from_b` maps coordinates of frame `b` to frame `a`.

use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// A rigid transform (rotation, then translation).
pub type Pose = Isometry3<f64>;

/// A pose as it stands in plans and on the wire: `[x, y, z, qw, qx, qy, qz]`,
/// the transform x′ = q·x + t.
pub type Waypoint = [f64; 7];

/// The waypoint of a pose, with qw ≥ 0 so that equal rotations print alike.
#[must_use]
pub fn waypoint_from_pose(pose: &Pose) -> Waypoint {
    let t = pose.translation.vector;
    let q = pose.rotation.quaternion();
    let s = if q.w < 0.0 { -1.0 } else { 1.0 };
    [t.x, t.y, t.z, s * q.w, s * q.i, s * q.j, s * q.k]
}

/// The pose of a waypoint; its quaternion is normalised.
#[must_use]
pub fn pose_from_waypoint(w: &Waypoint) -> Pose {
    let q = Quaternion::new(w[3], w[4], w[5], w[6]);
    Pose::from_parts(Translation3::new(w[0], w[1], w[2]), UnitQuaternion::from_quaternion(q))
}

/// The same motion of lengths that are `factor` times as long.
#[must_use]
pub fn scaled_pose(pose: &Pose, factor: f64) -> Pose {
    Pose::from_parts(Translation3::from(pose.translation.vector * factor), pose.rotation)
}

/// Where a pose between `a` (at `u` = 0) and `b` (at `u` = 1) lies: `centre`, a point of the
/// body, moves on a line and the rotation slerps. This is the interpolation that every plan
/// promises between two waypoints (centre: that of the part's bounding box).
#[must_use]
pub fn interpolate(a: &Pose, b: &Pose, centre: &Point3<f64>, u: f64) -> Pose {
    let ca = a * centre;
    let cb = b * centre;
    let c = ca + (cb - ca) * u;
    let q = a.rotation.try_slerp(&b.rotation, u, 1e-12).unwrap_or(b.rotation);
    let t: Vector3<f64> = c.coords - q * centre.coords;
    Pose::from_parts(Translation3::from(t), q)
}
