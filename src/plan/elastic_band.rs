//! A path that gives way to pushes, as an elastic band (S. Quinlan, O. Khatib 1993).

use nalgebra::{Point3, Translation3, Vector3};

use crate::budgets::BAND_PROJECTIONS;
use crate::geometry::{Pose, interpolate};
use crate::tolerances::BAND_LEVER;

/// How far a part should be shifted at a place of its path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BandPush {
    /// The segment, 0 for that from the first waypoint to the second.
    pub(crate) segment: usize,
    /// How far along the segment, from 0 to 1.
    pub(crate) share: f64,
    /// The shift, in the frame of the path.
    pub(crate) shift: Vector3<f64>,
}

impl BandPush {
    /// How far a shift of the waypoints before and after it shifts the place. The first waypoint stays.
    fn levers(&self) -> [f64; 2] {
        [if self.segment == 0 { 0.0 } else { 1.0 - self.share }, self.share]
    }

    /// Whether the waypoints beside it are too far away to shift it: then it needs one of its own.
    #[must_use]
    pub(crate) fn needs_waypoint(&self) -> bool {
        self.levers().map(|lever| lever * lever).iter().sum::<f64>() < BAND_LEVER * BAND_LEVER
    }
}

/// The path with its waypoints, but for the first, shifted by little, so that each place is shifted as far as its push in
/// the direction of that. One push after the other is satisfied by the least shift (the projections of S. Kaczmarz); where
/// pushes are opposed, none is satisfied for good.
#[must_use]
pub(crate) fn pushed(path: &[Pose], pushes: &[BandPush]) -> Vec<Pose> {
    let mut shifts = vec![Vector3::zeros(); path.len()];
    for push in (0..BAND_PROJECTIONS).flat_map(|_| pushes).filter(|push| !push.needs_waypoint()) {
        let Some(direction) = push.shift.try_normalize(0.0) else { continue };
        let (levers, places) = (push.levers(), [push.segment, push.segment + 1]);
        let there: Vector3<f64> = (0..2).map(|i| shifts[places[i]] * levers[i]).sum();
        let lacking = push.shift.norm() - there.dot(&direction);
        if lacking > 0.0 {
            let lever = levers[0] * levers[0] + levers[1] * levers[1];
            (0..2).for_each(|i| shifts[places[i]] += direction * (lacking * levers[i] / lever));
        }
    }
    path.iter().zip(shifts).map(|(pose, shift)| Translation3::from(shift) * pose).collect()
}

/// The path with one more waypoint, at the place of a push. `centre` (shape frame) moves on a line between waypoints.
#[must_use]
pub(crate) fn with_waypoint(path: &[Pose], push: &BandPush, centre: &Point3<f64>) -> Vec<Pose> {
    let (before, after) = path.split_at(push.segment + 1);
    let there = interpolate(&before[push.segment], &after[0], centre, push.share);
    before.iter().copied().chain([there]).chain(after.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn straight(count: usize) -> Vec<Pose> {
        (0..count).map(|i| Pose::translation(i as f64, 0.0, 0.0)).collect()
    }

    fn push(segment: usize, share: f64, up: f64) -> BandPush {
        BandPush { segment, share, shift: Vector3::z() * up }
    }

    #[test]
    fn each_place_is_shifted_as_far_as_it_is_pushed_and_the_start_stays() {
        let (path, centre) = (straight(4), Point3::origin());
        let pushes = [push(0, 0.8, 0.1), push(1, 0.5, 0.4), push(2, 1.0, 0.2)];
        let wide = pushed(&path, &pushes);
        assert_eq!(wide[0], path[0]);
        for BandPush { segment, share, shift } in pushes {
            let there = interpolate(&wide[segment], &wide[segment + 1], &centre, share) * centre;
            assert!(there.z >= shift.z - 1e-9, "{there}");
        }
        assert!(wide.iter().all(|pose| (pose * centre).z < 0.9), "{wide:?}");
    }

    #[test]
    fn a_place_near_the_start_needs_a_waypoint_of_its_own() {
        let (path, centre) = (straight(2), Point3::origin());
        let near = push(0, 0.05, 0.1);
        assert!(near.needs_waypoint() && !push(0, 0.6, 0.1).needs_waypoint());
        assert_eq!(pushed(&path, &[near]), path);
        let path = with_waypoint(&path, &near, &centre);
        assert_eq!(path.len(), 3);
        assert!((path[1] * centre - Point3::new(0.05, 0.0, 0.0)).norm() < 1e-12);
        let wide = pushed(&path, &[push(0, 1.0, 0.1)]);
        assert!(((wide[1] * centre).z - 0.1).abs() < 1e-12 && (wide[2] * centre).z == 0.0);
    }
}
