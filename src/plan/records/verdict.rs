//! Verification: the result of the check of a path past one standing part. It depends only on the two shapes and on
//! how one passes the other ([`PairPath`]). So a change costs only the checks of the paths near it, and parts that
//! leave congruent pairs are checked once.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::SOURCES;
use crate::budgets::KEPT_VERDICTS;
use crate::cache::{Digest, RecordKey, RecordKind, RequestCache, Storage};
use crate::contact::PairPath;
use crate::geometry::add_pose;
use crate::plan::Verdict;
use crate::termination::Interrupt;

/// What verification found along a path past one part.
pub(crate) static VERDICT: RecordKind =
    RecordKind::of::<Verdict>(5, "verdict", Storage::MemoryAndDisk, SOURCES);

/// The check of a path past a part that stands.
#[derive(Debug, Clone, Copy)]
pub struct VerdictQuestion<'a> {
    /// The moving part, the standing part, and the path.
    pub pair_path: &'a PairPath<'a>,
    /// The depth at which the path is refused, in the planning frame.
    pub limit: f64,
}

/// What one request found, which serves the request without a cache, too.
#[derive(Debug, Default)]
pub struct KnownVerdicts(Mutex<HashMap<RecordKey, Verdict>>);

impl KnownVerdicts {
    /// The verdict on a question, as known or remembered, or else as checked, which is then remembered.
    ///
    /// # Errors
    /// Those of `check`.
    pub fn verdict(
        &self,
        question: &VerdictQuestion<'_>,
        cache: &RequestCache,
        check: impl FnOnce() -> Result<Verdict, Interrupt>,
    ) -> Result<Verdict, Interrupt> {
        let key = question.key();
        let known = self.lock().get(&key).cloned();
        let mut verdict = match known {
            Some(verdict) => verdict,
            None => {
                let found = cache.get_or(key, check)?;
                let mut known = self.lock();
                if known.len() >= KEPT_VERDICTS {
                    known.clear();
                }
                known.insert(key, found.clone());
                found
            }
        };
        // The record may be of a congruent pair.
        let [_, other] = question.pair_path.parts;
        verdict.penetrations.iter_mut().for_each(|entry| entry.other = other);
        Ok(verdict)
    }

    /// A mutex that was poisoned still holds consistent data.
    fn lock(&self) -> MutexGuard<'_, HashMap<RecordKey, Verdict>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl VerdictQuestion<'_> {
    fn key(&self) -> RecordKey {
        let PairPath { shapes, path, centre, allowed, .. } = self.pair_path;
        let mut digest = Digest::new();
        shapes.iter().for_each(|shape| {
            digest.hash(shape.content());
        });
        digest.numbers([self.limit, *allowed]).numbers(centre.iter().copied());
        digest.integer(path.len() as u64);
        path.iter().for_each(|pose| add_pose(&mut digest, pose));
        digest.key(&VERDICT)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use nalgebra::Point3;

    use super::*;
    use crate::contact::sampled::along_path::Penetration;
    use crate::fixtures::{cuboid, moved, scene};
    use crate::geometry::Pose;

    #[test]
    fn parts_that_leave_alike_are_checked_once() {
        let place = Pose::translation(4.0, 1.0, 0.0) * Pose::rotation(nalgebra::Vector3::z() * 0.7);
        let foot = || cuboid([-1.0, -1.5, 0.0], [2.0, 1.0, 0.5]);
        let post = || cuboid([0.0, 0.0, 0.5], [1.0, 0.75, 3.0]);
        let (scene, _) = scene([foot(), post(), moved(foot(), &place), moved(post(), &place)]);
        let (cache, known, checks) = (RequestCache::default(), KnownVerdicts::default(), Cell::new(0));
        let verdict_on = |parts: [usize; 2], height: f64, aside: f64| {
            let start = scene.bodies[parts[0]].planning_from_shape;
            let path = [start, Pose::translation(aside, 0.0, height) * start];
            let pair_path = &PairPath::new(&scene, &scene.allowed, parts, &path);
            let check = || {
                checks.set(checks.get() + 1);
                let point = Point3::new(0.5, 0.0, height);
                let entry = Penetration { other: parts[1], on_moving: true, point, over: 0.5 };
                Ok(Verdict { depth: 0.5, penetrations: vec![entry], limit: 0.1 })
            };
            known.verdict(&VerdictQuestion { pair_path, limit: 2e-3 }, &cache, check).unwrap()
        };
        let (one, other) = (verdict_on([1, 0], 0.25, 0.0), verdict_on([3, 2], 0.5, 0.0));
        assert_eq!((checks.get(), one.depth, other.depth), (1, 0.5, 0.5));
        assert_eq!((one.penetrations[0].other, other.penetrations[0].other), (0, 2));
        assert_eq!(
            one.penetrations[0].point, other.penetrations[0].point,
            "past the foot, both are out of its sight"
        );
        verdict_on([1, 0], 0.0, 0.25);
        verdict_on([1, 2], 0.25, 0.0);
        assert_eq!(checks.get(), 3, "another way, and past another part");
        assert_eq!(cache.reused(&VERDICT), 0, "nothing was there before the request");
    }
}
