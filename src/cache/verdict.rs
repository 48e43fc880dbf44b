//! Verification: what the check of a path found past one part that stands. It depends on the path and on
//! that part alone, so a change costs only the checks of the paths that come near it.

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

/// The check of a path, to be refused at a depth.
#[derive(Debug, Clone)]
pub struct VerdictQuestion<'a> {
    scene: &'a Scene,
    part: usize,
    /// Of all but the part that stands.
    digest: Digest,
}

impl Recall {
    /// What the check of a path found past a part that stands, as remembered, or else as checked, which is
    /// then remembered.
    ///
    /// # Errors
    /// What `check` returns.
    pub fn verdict(
        &self,
        question: &VerdictQuestion<'_>,
        other: usize,
        check: impl FnOnce() -> Result<Verdict, Interrupt>,
    ) -> Result<Verdict, Interrupt> {
        if !self.remembers() {
            return check();
        }
        let key = question.key(other);
        if let Some(record) = self.get(&key) {
            self.count(About::Verdict);
            return Ok(verdict(record, other));
        }
        let verdict = check()?;
        self.put(key, &record(&verdict));
        Ok(verdict)
    }
}

impl<'a> VerdictQuestion<'a> {
    /// About a part on a path of poses of its shape; `limit` is the depth that is refused.
    #[must_use]
    pub fn new(scene: &'a Scene, part: usize, path: &[Pose], limit: f64) -> Self {
        let mut digest = Digest::new();
        digest.hash(scene.bodies[part].shape.content());
        digest.numbers([limit, scene.longest_side]);
        // Between waypoints, this point moves on a line.
        digest.numbers(scene.centre_in_shape(part).iter().copied());
        digest.integer(path.len() as u64);
        path.iter().for_each(|pose| add_pose(&mut digest, pose));
        Self { scene, part, digest }
    }

    fn key(&self, other: usize) -> Key {
        let mut digest = self.digest.clone();
        add_standing(&mut digest, self.scene, self.part, other);
        digest.key(Kind::Verdict)
    }
}

fn record(verdict: &Verdict) -> VerdictRecord {
    let entry = |e: &Entry| EntryRecord { on_moving: e.on_moving, point: e.point.into(), over: e.over };
    VerdictRecord { depth: verdict.depth, entries: verdict.entries.iter().map(entry).collect() }
}

fn verdict(record: VerdictRecord, other: usize) -> Verdict {
    let entry =
        |e: EntryRecord| Entry { other, on_moving: e.on_moving, point: Point3::from(e.point), over: e.over };
    Verdict { depth: record.depth, entries: record.entries.into_iter().map(entry).collect() }
}
