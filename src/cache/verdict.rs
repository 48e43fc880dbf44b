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

/// The check of a path, to be refused at a depth of `limit`, past a part that stands.
#[derive(Debug, Clone, Copy)]
pub struct VerdictQuestion<'a> {
    /// The bodies.
    pub scene: &'a Scene,
    /// What stands.
    pub other: usize,
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
        if let Some(record) = self.get(&key) {
            self.count(About::Verdict);
            return Ok(verdict(record, question.other));
        }
        let verdict = check()?;
        self.put(key, &record(&verdict));
        Ok(verdict)
    }
}

impl VerdictQuestion<'_> {
    fn key(&self) -> Key {
        let Self { scene, other, part, path, limit } = *self;
        let mut digest = Digest::new();
        digest.hash(scene.bodies[part].shape.content());
        digest.numbers([limit, scene.longest_side]);
        // Between waypoints, this point moves on a line.
        digest.numbers(scene.centre_in_shape(part).iter().copied());
        digest.integer(path.len() as u64);
        path.iter().for_each(|pose| add_pose(&mut digest, pose));
        add_standing(&mut digest, scene, part, other);
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
