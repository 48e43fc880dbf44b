//! The way of a part from where it waits to where its insertion begins.

use nalgebra::{Translation3, Vector3};

use crate::geometry::{Bounds, Pose};
use crate::rrt::{PoseSampler, Space, rrt_connect, shortened};
use crate::scene::PartMetric;
use crate::termination::{Interrupt, Termination};

use super::room::Room;

/// Random poses after which no way is looked for any more.
pub(super) const MOST_SAMPLES: usize = 1000;
/// The same for a way with room to spare.
const FEW_SAMPLES: usize = 300;
/// Shortcuts that are tried on a way.
const SHORTCUTS: usize = 24;
/// Count. Mostly the part need not turn: this number of poses has the rotation of one of the way's ends, or one between
/// them. At half, ways that turn come a little earlier and straight ones later; at double the reverse.
const UNTURNED: usize = 100;
/// Directions away from an end of the way.
const LIFTS: [[f64; 3]; 6] =
    [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]];

/// A part that moves among others.
pub(super) struct Transfer<'a> {
    room: &'a Room,
    /// What is in its way, as numbers in the room, ascending.
    among: &'a [usize],
    part: usize,
    ends: [Pose; 2],
    /// Where to leave the second end to, a unit vector.
    away: Vector3<f64>,
    metric: PartMetric,
    /// Where its centre may be.
    bounds: Bounds,
    sampler: PoseSampler,
    /// Poses sampled so far.
    sampled: usize,
    /// Ways are free that the check finds free, not those that seem clear.
    exact: bool,
    termination: &'a Termination,
}

impl<'a> Transfer<'a> {
    pub(super) fn new(
        room: &'a Room,
        among: &'a [usize],
        part: usize,
        ends: [Pose; 2],
        away: Vector3<f64>,
        termination: &'a Termination,
    ) -> Self {
        let metric = *room.metric(part);
        let bounds = ends.iter().fold(room.bounds, |b, pose| b.with_point(&(pose * metric.centre)));
        let bounds = bounds.grown(2.0 * metric.reach);
        let sampler = sampler(part, metric, bounds, &ends);
        let (sampled, exact) = (0, false);
        Self { room, among, part, ends, away, metric, bounds, sampler, sampled, exact, termination }
    }

    /// The way with what its check found, if there is one: straight, else by RRT-Connect, shortened. It is
    /// tried with room to spare, at a glance; where that finds none, or overlooked something, with the check
    /// itself.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn path(mut self) -> Result<Option<(Vec<Pose>, f64)>, Interrupt> {
        for exact in [false, true] {
            self.exact = exact;
            let Some(way) = self.tried(if exact { MOST_SAMPLES } else { FEW_SAMPLES })? else { continue };
            let verdict = self.room.check(self.among, self.part, &way, self.termination)?;
            if verdict.penetrations.is_empty() {
                return Ok(Some((way, verdict.depth)));
            }
        }
        Ok(None)
    }

    fn tried(&mut self, most_samples: usize) -> Result<Option<Vec<Pose>>, Interrupt> {
        let [start, goal] = self.ends;
        self.sampler = sampler(self.part, self.metric, self.bounds, &self.ends);
        self.sampled = 0;
        let Some(path) = rrt_connect(self, &start, &goal, most_samples)? else { return Ok(None) };
        let mut uniform = self.sampler.uniform.clone();
        let path = shortened(self, path, SHORTCUTS, &mut uniform)?;
        let pieces = path.windows(2).flat_map(|p| self.metric.way(&p[0], &p[1]).into_iter().skip(1));
        Ok(Some(std::iter::once(start).chain(pieces).collect()))
    }

    /// A pose away from one end of the way, out of everything's reach: from where the part waits and from
    /// where its insertion begins in turn. What is put together by hand is mostly reached like that.
    fn lifted(&self, number: usize) -> Option<Pose> {
        let (end, number) = (number % 2, number / 2);
        let (pose, away) = (self.ends[end], [Vector3::from(LIFTS[0]), self.away][end]);
        let direction = if number == 0 { away } else { Vector3::from(*LIFTS.get(number - 1)?) };
        let at = (pose * self.metric.centre).coords;
        let far = self.room.bounds.support(&direction) + self.metric.reach;
        Some(Translation3::from(direction * (far - at.dot(&direction)).max(0.0)) * pose)
    }
}

fn sampler(part: usize, metric: PartMetric, bounds: Bounds, ends: &[Pose; 2]) -> PoseSampler {
    PoseSampler::new(&(part as u64).to_le_bytes(), metric, bounds, ends.map(|pose| pose.rotation))
}

impl Space for Transfer<'_> {
    fn metric(&self) -> PartMetric {
        self.metric
    }

    fn is_free(&self, from: &Pose, to: &Pose) -> Result<bool, Interrupt> {
        if !self.exact {
            return self.room.seems_clear(self.among, self.part, [from, to], self.termination);
        }
        let way = self.metric.way(from, to);
        let verdict = self.room.check(self.among, self.part, &way, self.termination)?;
        Ok(verdict.penetrations.is_empty())
    }

    fn sample(&mut self) -> Pose {
        let number = self.sampled;
        self.sampled += 1;
        self.lifted(number).unwrap_or_else(|| self.sampler.pose(self.sampled >= UNTURNED))
    }

    fn extent(&self) -> f64 {
        self.bounds.extents().norm()
    }
}
