//! How long the steps of a plan take.

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

use crate::geometry::Pose;

/// How long it takes to move a part. All times are in seconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotionTimes {
    /// To reach for a part and grasp it.
    pub grasp: f64,
    /// To put it down and let it go.
    pub put_down: f64,
    /// Along a path, in mm/s.
    pub speed: f64,
    /// To turn it once around: with a wrench some 2, with a power tool 0.2.
    pub turn: f64,
}

impl Default for MotionTimes {
    /// A worker at a bench: some 2 s to reach and to put down, 100 mm/s where parts touch, a turn of a wrench in 2 s.
    fn default() -> Self {
        Self { grasp: 2.0, put_down: 2.0, speed: 100.0, turn: 2.0 }
    }
}

impl MotionTimes {
    /// The name of a time that is no finite number from 0 up, or of a speed that is not above 0.
    #[must_use]
    pub fn out_of_range(&self) -> Option<&'static str> {
        let Self { grasp, put_down, speed, turn } = *self;
        let times = [("grasp", grasp), ("put_down", put_down), ("turn", turn)];
        let is_time = |time: f64| time.is_finite() && time >= 0.0;
        let wrong = times.into_iter().find(|(_, time)| !is_time(*time)).map(|(name, _)| name);
        wrong.or((!(speed.is_finite() && speed > 0.0)).then_some("speed"))
    }

    /// Seconds to grasp a part, move it along a path, and put it down. `centre` is the point of the part that moves on lines
    /// between waypoints; `unit` is the path's unit of length in mm. Turning and shifting go on at once.
    #[must_use]
    pub fn of(&self, path: &[Pose], centre: &Point3<f64>, unit: f64) -> f64 {
        let leg = |pair: &[Pose]| {
            let length = (pair[1] * centre - pair[0] * centre).norm() * unit;
            let turns = pair[0].rotation.angle_to(&pair[1].rotation) / std::f64::consts::TAU;
            (length / self.speed).max(turns * self.turn)
        };
        self.grasp + path.windows(2).map(leg).sum::<f64>() + self.put_down
    }
}
