//! Rigid displacements as screws: a turn about an axis and a travel along it.

use std::f64::consts::TAU;

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::Pose;

/// Turns smaller than this (radians) have no axis.
const LEAST_TURN: f64 = 1e-9;

/// A rigid displacement of space as a screw (M. Chasles 1830): any fraction or multiple of it is
/// the motion at constant twist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screw {
    /// Axis times angle.
    turn: Vector3<f64>,
    /// A point on the axis (the origin for pure translations).
    centre: Vector3<f64>,
    /// Along the axis; the whole displacement for pure translations.
    travel: Vector3<f64>,
}

impl Screw {
    /// The screw of a displacement.
    #[must_use]
    pub fn of(displacement: &Pose) -> Self {
        let t = displacement.translation.vector;
        let turn = displacement.rotation.scaled_axis();
        let angle = turn.norm();
        if angle < LEAST_TURN {
            return Self { turn: Vector3::zeros(), centre: Vector3::zeros(), travel: t };
        }
        let axis = turn / angle;
        let travel = axis * axis.dot(&t);
        let across = t - travel;
        let centre = (across + axis.cross(&across) / (angle / 2.0).tan()) / 2.0;
        Self { turn, centre, travel }
    }

    /// The displacement that takes `from` to `to`, done `count` times at constant twist, once.
    #[must_use]
    pub fn between(from: &Pose, to: &Pose, count: usize) -> Self {
        let whole = Self::of(&(to * from.inverse()));
        let share = 1.0 / count.max(1) as f64;
        Self { turn: whole.turn * share, travel: whole.travel * share, ..whole }
    }

    /// The same for a displacement of about `angle` (radians) in all about the axis of a screw that is
    /// alike: of all screws that lead there, which differ by whole turns, the one that turns most
    /// nearly so far. Where all is nearly whole turns, nothing tells the axis.
    #[must_use]
    pub fn between_turning(from: &Pose, to: &Pose, count: usize, alike: &Self, angle: f64) -> Self {
        let whole = Self::of(&(to * from.inverse()));
        let Some(axis) = whole.turn.try_normalize(LEAST_TURN) else { return Self::between(from, to, count) };
        let axis = if axis.dot(&alike.turn) < 0.0 { -axis } else { axis };
        let turned = whole.turn.dot(&axis);
        let angle = turned + ((angle - turned) / TAU).round() * TAU;
        let share = 1.0 / count.max(1) as f64;
        Self { turn: axis * (angle * share), travel: whole.travel * share, ..whole }
    }

    /// The displacement done `times` times.
    #[must_use]
    pub fn times(&self, times: f64) -> Pose {
        let rotation = UnitQuaternion::from_scaled_axis(self.turn * times);
        let t = self.centre - rotation * self.centre + self.travel * times;
        Pose::from_parts(Translation3::from(t), rotation)
    }

    /// The travel along the axis in one whole turn; infinite for a pure translation.
    #[must_use]
    pub fn lead(&self) -> f64 {
        self.travel.norm() * std::f64::consts::TAU / self.angle()
    }

    /// The unit vector along its axis, or along its travel if it does not turn; zero if it is nothing.
    #[must_use]
    pub fn axis(&self) -> Vector3<f64> {
        let line = if self.angle() > 0.0 { self.turn } else { self.travel };
        line.try_normalize(0.0).unwrap_or_default()
    }

    /// The angle in radians.
    #[must_use]
    pub fn angle(&self) -> f64 {
        self.turn.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn distance(a: &Pose, b: &Pose) -> f64 {
        (a.to_matrix() - b.to_matrix()).norm()
    }

    #[test]
    fn a_thread_goes_on_by_its_pitch() {
        // A quarter turn about z through (2, 0, 0), a quarter of the pitch 1.
        let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2;
        let there =
            Pose::translation(2.0, 0.0, 0.25) * Pose::rotation(quarter) * Pose::translation(-2.0, 0.0, 0.0);
        let screw = Screw::of(&there);
        assert!((screw.angle() - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!((screw.lead() - 1.0).abs() < 1e-12);
        assert!(distance(&screw.times(4.0), &Pose::translation(0.0, 0.0, 1.0)) < 1e-12);
        assert!(distance(&screw.times(0.0), &Pose::identity()) < 1e-12);
    }

    #[test]
    fn whole_turns_are_told_by_a_screw_that_is_alike() {
        let once = Screw::of(&(Pose::translation(0.3, -0.2, 0.1) * Pose::rotation(Vector3::z() * 0.25)));
        let roughly = Screw { turn: once.turn * 1.01, ..once };
        let from = Pose::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.1, -0.7));
        // From a quarter of a turn to ten turns and a quarter.
        for count in [6, 16, 31, 256] {
            let to = once.times(f64::from(count)) * from;
            let angle = roughly.angle() * f64::from(count);
            let found = Screw::between_turning(&from, &to, count as usize, &roughly, angle);
            assert!(distance(&found.times(1.0), &once.times(1.0)) < 1e-9, "{count}: {found:?}");
            assert!((found.lead() - once.lead()).abs() < 1e-9);
        }
    }

    proptest! {
        #[test]
        fn fractions_make_the_whole(
            t in prop::array::uniform3(-3.0..3.0f64),
            w in prop::array::uniform3(-1.5..1.5f64),
            count in 1usize..9,
        ) {
            let from = Pose::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.1, -0.7));
            let whole = Pose::new(Vector3::from(t), Vector3::from(w));
            prop_assert!(distance(&Screw::of(&whole).times(1.0), &whole) < 1e-9);
            let once = Screw::between(&from, &(whole * from), count).times(1.0);
            let done = (0..count).fold(from, |pose, _| once * pose);
            prop_assert!(distance(&done, &(whole * from)) < 1e-8);
        }

        #[test]
        fn tiny_turns_lose_nothing(t in prop::array::uniform3(-1.0..1.0f64), w in -1e-6..1e-6f64) {
            let whole = Pose::new(Vector3::from(t), Vector3::x() * w);
            prop_assert!(distance(&Screw::of(&whole).times(1.0), &whole) < 1e-7);
        }
    }
}
