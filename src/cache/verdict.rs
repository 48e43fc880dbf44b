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
use crate::plan::{Entry, Passing, Verdict};
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
