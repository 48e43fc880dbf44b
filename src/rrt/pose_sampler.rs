//! Random poses of a part.

use nalgebra::{Translation3, UnitQuaternion};

use crate::geometry::{Bounds, Pose, Uniform};
use crate::scene::PartMetric;

/// Mostly a part need not turn. So this share of the poses has a rotation that the part has anyway, as at half it takes
/// twice as many poses to find ways that turn nothing, and with all of them none that turns.
const TURNED_ALIKE: f64 = 0.5;

/// A row of random poses: the part's centre is uniform in a box.
#[derive(Debug)]
pub(crate) struct PoseSampler {
    pub(crate) uniform: Uniform,
    metric: PartMetric,
    bounds: Bounds,
    /// The rotations that the part has anyway are between these.
    rotations: [UnitQuaternion<f64>; 2],
}

impl PoseSampler {
    pub(crate) fn new(
        seed: &[u8],
        metric: PartMetric,
        bounds: Bounds,
        rotations: [UnitQuaternion<f64>; 2],
    ) -> Self {
        Self { uniform: Uniform::seeded(seed), metric, bounds, rotations }
    }

    /// The next pose; without turns, with a rotation that the part has anyway.
    pub(crate) fn pose(&mut self, turns: bool) -> Pose {
        let [from, to] = self.rotations;
        let alike = if turns { TURNED_ALIKE } else { 1.0 };
        let rotation = if self.uniform.number() < alike {
            from.try_slerp(&to, self.uniform.number(), 1e-9).unwrap_or(to)
        } else {
            self.uniform.rotation()
        };
        let extents = self.bounds.extents();
        let at = self.bounds.min + extents.map(|side| side * self.uniform.number());
        Pose::from_parts(Translation3::from(at - rotation * self.metric.centre), rotation)
    }
}
