//! Verification: what the check of a path found past one part that stands. It depends on the two shapes and
//! on how one passes the other alone ([`Passing`]), so a change costs only the checks of the paths that come
//! near it, and what leaves alike is checked once.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use nalgebra::Point3;

use super::pair::add_pose;
use super::recall::About;
use super::records::{EntryRecord, VerdictRecord};
use super::{Digest, Key, Kind, Recall};
use crate::contact::Passing;
use crate::contact::sampled::along_path::Entry;
use crate::plan::Verdict;
use crate::termination::Interrupt;

/// The check of a path past a part that stands, to be refused at some depth.
#[derive(Debug, Clone, Copy)]
pub struct VerdictQuestion<'a> {
    /// What moves, past what, and how.
    pub passing: &'a Passing<'a>,
    /// The depth that is refused.
    pub limit: f64,
}

/// What one request found.
#[derive(Debug, Default)]
pub(super) struct KnownVerdicts(Mutex<HashMap<Key, VerdictRecord>>);

/// Of more, all are forgotten.
const MOST_KNOWN: usize = 4096;

impl KnownVerdicts {
    fn get(&self, key: &Key) -> Option<VerdictRecord> {
        self.lock().get(key).cloned()
    }

    fn put(&self, key: Key, record: VerdictRecord) {
        let mut known = self.lock();
        if known.len() >= MOST_KNOWN {
            known.clear();
        }
        known.insert(key, record);
    }

    /// It holds plain data: it is whole even if a holder panicked.
    fn lock(&self) -> MutexGuard<'_, HashMap<Key, VerdictRecord>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
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
        let ([_, other], key) = (question.passing.parts, question.key());
        if let Some(record) = self.verdicts.get(&key) {
            return Ok(verdict(record, other));
        }
        let record = if let Some(record) = self.get(&key) {
            self.count(About::Verdict);
            record
        } else {
            let record = record(&check()?);
            self.put(key, &record);
            record
        };
        self.verdicts.put(key, record.clone());
        Ok(verdict(record, other))
    }
}

impl VerdictQuestion<'_> {
    fn key(&self) -> Key {
        let Passing { shapes, path, centre, granted, longest_side, .. } = self.passing;
        let mut digest = Digest::new();
        shapes.iter().for_each(|shape| {
            digest.hash(shape.content());
        });
        digest.numbers([self.limit, *granted, *longest_side]).numbers(centre.iter().copied());
        digest.integer(path.len() as u64);
        path.iter().for_each(|pose| add_pose(&mut digest, pose));
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

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;
    use crate::cache::recall::Reused;
    use crate::fixtures::{cuboid, moved, scene};
    use crate::geometry::Pose;

    #[test]
    fn what_leaves_alike_is_checked_once_and_told_of_each() {
        let place = Pose::translation(4.0, 1.0, 0.0) * Pose::rotation(nalgebra::Vector3::z() * 0.7);
        let foot = || cuboid([-1.0, -1.5, 0.0], [2.0, 1.0, 0.5]);
        let post = || cuboid([0.0, 0.0, 0.5], [1.0, 0.75, 3.0]);
        let (scene, _) = scene([foot(), post(), moved(foot(), &place), moved(post(), &place)]);
        let (recall, checks) = (Recall::default(), Cell::new(0));
        let told = |parts: [usize; 2], height: f64, aside: f64| {
            let start = scene.bodies[parts[0]].planning_from_shape;
            let path = [start, Pose::translation(aside, 0.0, height) * start];
            let passing = &Passing::new(&scene, &scene.allowances, parts, &path);
            let check = || {
                checks.set(checks.get() + 1);
                let point = Point3::new(0.5, 0.0, height);
                let entry = Entry { other: parts[1], on_moving: true, point, over: 0.5 };
                Ok(Verdict { depth: 0.5, entries: vec![entry] })
            };
            recall.verdict(&VerdictQuestion { passing, limit: 2e-3 }, check).unwrap()
        };
        let (one, other) = (told([1, 0], 0.25, 0.0), told([3, 2], 0.5, 0.0));
        assert_eq!((checks.get(), one.depth, other.depth), (1, 0.5, 0.5));
        assert_eq!((one.entries[0].other, other.entries[0].other), (0, 2));
        assert_eq!(one.entries[0].point, other.entries[0].point, "past the foot, both are out of its sight");
        told([1, 0], 0.0, 0.25);
        told([1, 2], 0.25, 0.0);
        assert_eq!(checks.get(), 3, "another way, and past another part");
        assert_eq!(recall.reused(), Reused::default(), "nothing was there before the request");
    }
}
