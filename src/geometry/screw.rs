//! Rigid displacements as screws: a turn about an axis and a travel along it.

use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::Pose;

/// Turns smaller than this (radians) have no axis.
const LEAST_TURN: f64 = 1e-9;

/// A rigid displacement of space as a screw (M. Chasles 1830): any fraction or multiple of it is
/// the motion at constant twist.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Screw {
    /// Axis times angle; shorter than half a turn.
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
