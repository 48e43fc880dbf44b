//! Verification: what the check of a path found, with the rule of motions. A verdict depends on the path
//! and on the standing parts that it comes near, and those are known beforehand: they are in the key.

use nalgebra::Point3;

use super::motion::add_standing;
use super::pair::add_pose;
use super::recall::About;
use super::records::{EntryRecord, VerdictRecord};
use super::{Digest, Key, Kind, Recall};
use crate::geometry::Pose;
use crate::plan::{Entry, Verdict};
use crate::simulation::Scene;
use crate::termination::Interrupt;

/// The check of a path, to be refused at a depth of `limit`, among the standing parts that it comes near
/// (ascending).
#[derive(Debug, Clone, Copy)]
pub struct VerdictQuestion<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// The parts that the path comes near.
    pub near: &'a [usize],
    /// What moves.
    pub part: usize,
    /// Poses of its shape.
    pub path: &'a [Pose],
    /// The depth that is refused.
    pub limit: f64,
}

impl Recall {
    /// What the check of a path found, as remembered, or else as checked, which is then remembered.
    ///
    /// # Errors
    /// What `check` returns.
    pub fn verdict(
        &self,
        question: &VerdictQuestion<'_>,
        check: impl FnOnce() -> Result<Verdict, Interrupt>,
    ) -> Result<Verdict, Interrupt> {
        if !self.remembers() {
            return check();
        }
        let key = question.key();
        if let Some(verdict) = self.get(&key).and_then(|record| question.verdict(record)) {
            self.count(About::Verdict);
            return Ok(verdict);
        }
        let verdict = check()?;
        if let Some(record) = question.record(&verdict) {
            self.put(key, &record);
        }
        Ok(verdict)
    }
}

impl VerdictQuestion<'_> {
    fn key(&self) -> Key {
        let Self { scene, near, part, path, limit } = *self;
        let mut digest = Digest::new();
        digest.hash(scene.bodies[part].shape.content());
        digest.numbers([limit, scene.longest_side]);
        // Between waypoints, this point moves on a line.
        digest.numbers(scene.centre_in_shape(part).iter().copied());
        digest.integer(path.len() as u64);
        path.iter().for_each(|pose| add_pose(&mut digest, pose));
        near.iter().for_each(|&other| add_standing(&mut digest, scene, part, other));
        digest.key(Kind::Verdict)
    }

    fn record(&self, verdict: &Verdict) -> Option<VerdictRecord> {
        let entry = |e: &Entry| {
            let other = self.near.binary_search(&e.other).ok()? as u32;
            Some(EntryRecord { other, on_moving: e.on_moving, point: e.point.into(), over: e.over })
        };
        let entries = verdict.entries.iter().map(entry).collect::<Option<_>>()?;
        Some(VerdictRecord { depth: verdict.depth, entries })
    }

    fn verdict(&self, record: VerdictRecord) -> Option<Verdict> {
        let entry = |e: EntryRecord| {
            let other = *self.near.get(e.other as usize)?;
            Some(Entry { other, on_moving: e.on_moving, point: Point3::from(e.point), over: e.over })
        };
        let entries = record.entries.into_iter().map(entry).collect::<Option<_>>()?;
        Some(Verdict { depth: record.depth, entries })
    }
}
