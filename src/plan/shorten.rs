//! Thinning: few waypoints that reproduce a dense path.
//!
//! A path is a polyline in the space of poses. Waypoints are dropped by the scheme of D. Douglas
//! and T. Peucker (1973): a stretch is replaced by its ends if every pose between lies within
//! [`PATH_TOLERANCE`] of the interpolation between them, measured at the corners of the part's box.

use nalgebra::Point3;

use crate::geometry::{Bounds, Pose, interpolate};
use crate::tolerances::{PATH_TOLERANCE, WAYPOINT_TURN};

/// Thins a path. `centre` (shape frame) is the point that moves on a line between waypoints.
#[must_use]
pub fn thinned(path: &[Pose], bounds: &Bounds, centre: &Point3<f64>) -> Vec<Pose> {
    if path.len() < 3 {
        return path.to_vec();
    }
    let mut keep = vec![false; path.len()];
    keep[0] = true;
    let mut stack = vec![(0, path.len() - 1)];
    while let Some((a, b)) = stack.pop() {
        keep[b] = true;
        if b > a + 1
            && let Some(split) = worst_between(path, a, b, bounds, centre)
        {
            stack.push((split, b));
            stack.push((a, split));
        }
    }
    path.iter().zip(keep).filter(|(_, k)| *k).map(|(p, _)| *p).collect()
}

/// Where to split the stretch a..b, if it cannot be replaced by its ends.
fn worst_between(path: &[Pose], a: usize, b: usize, bounds: &Bounds, centre: &Point3<f64>) -> Option<usize> {
    let turned: f64 = (a..b).map(|i| path[i].rotation.angle_to(&path[i + 1].rotation)).sum();
    if turned > WAYPOINT_TURN {
        return Some(usize::midpoint(a, b));
    }
    let mut worst = (PATH_TOLERANCE, None);
    for i in a + 1..b {
        let off = deviation(&path[a], &path[b], &path[i], bounds, centre);
        if off > worst.0 {
            worst = (off, Some(i));
        }
    }
    worst.1
}

/// How far a pose lies from the interpolation, at the closest parameter (by rotation and travel
/// of the centre projected on the stretch).
fn deviation(a: &Pose, b: &Pose, p: &Pose, bounds: &Bounds, centre: &Point3<f64>) -> f64 {
    let (ca, cb, cp) = (a * centre, b * centre, p * centre);
    let d = cb - ca;
    let angle = a.rotation.angle_to(&b.rotation);
    let lever = bounds.extents().norm() / 2.0;
    // Least squares over travel and turn, the turn weighed by the size of the part.
    let (l2, t2) = (d.norm_squared(), (lever * angle).powi(2));
    if l2 + t2 < 1e-24 {
        return (cp - ca).norm() + lever * a.rotation.angle_to(&p.rotation);
    }
    let turned = a.rotation.angle_to(&p.rotation);
    let u = (((cp - ca).dot(&d) + lever * lever * angle * turned) / (l2 + t2)).clamp(0.0, 1.0);
    let q = interpolate(a, b, centre, u);
    let corner = |i: usize| {
        Point3::new(
            if i & 1 == 0 { bounds.min.x } else { bounds.max.x },
            if i & 2 == 0 { bounds.min.y } else { bounds.max.y },
            if i & 4 == 0 { bounds.min.z } else { bounds.max.z },
        )
    };
    (0..8).map(|i| (q * corner(i) - p * corner(i)).norm()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    const UNIT: Bounds = Bounds { min: Point3::new(-1.0, -1.0, -1.0), max: Point3::new(1.0, 1.0, 1.0) };

    #[test]
    fn a_straight_path_keeps_its_ends_and_a_bent_one_its_bend() {
        let at = |x: f64, y: f64| Pose::translation(x, y, 0.0);
        let mut path: Vec<_> = (0..=10).map(|i| at(f64::from(i) * 0.1, 0.0)).collect();
        assert_eq!(thinned(&path, &UNIT, &Point3::origin()).len(), 2);
        path.extend((1..=10).map(|i| at(1.0, f64::from(i) * 0.1)));
        let thin = thinned(&path, &UNIT, &Point3::origin());
        assert_eq!(thin.len(), 3);
        assert_eq!(thin[1], at(1.0, 0.0));
    }

    #[test]
    fn a_screw_motion_of_many_turns_keeps_every_turn() {
        let screw = |i: i32| {
            let t = f64::from(i) * 0.1;
            Pose::new(Vector3::new(0.0, 0.0, t * 0.05), Vector3::z() * t)
        };
        let path: Vec<_> = (0..=250).map(screw).collect();
        let thin = thinned(&path, &UNIT, &Point3::origin());
        assert!(thin.len() < 40, "{}", thin.len());
        let total: f64 = thin.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).sum();
        assert!((total - 25.0).abs() < 1e-6);
    }
}
