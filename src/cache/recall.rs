//! What one request sees of the cache: asks for records, and counts what was reused.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::verdict::KnownVerdicts;
use super::{Cache, Key, Record};

/// One request's view of the cache; without a cache, nothing outlives the request. Copies count together.
#[derive(Debug, Clone, Default)]
pub struct Recall {
    cache: Option<Arc<Cache>>,
    reused: Arc<Counts>,
    /// What this request found itself, which also serves without a cache.
    pub(super) verdicts: Arc<KnownVerdicts>,
}

#[derive(Debug, Default)]
struct Counts {
    overlaps: AtomicU64,
    blocking: AtomicU64,
    motions: AtomicU64,
    verdicts: AtomicU64,
}

/// How many answers were there already.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Reused {
    /// Overlaps of pairs.
    pub overlaps: u64,
    /// Blocking relations of pairs, and planes that parts touch.
    pub blocking: u64,
    /// Motions.
    pub motions: u64,
    /// Verified paths.
    pub verdicts: u64,
}

/// What a question that is asked through [`Recall`] is about.
#[derive(Debug, Clone, Copy)]
pub(super) enum About {
    Overlap,
    Blocking,
    Motion,
    Verdict,
}

impl Recall {
    /// A new request's view.
    #[must_use]
    pub fn of(cache: Arc<Cache>) -> Self {
        Self { cache: Some(cache), ..Self::default() }
    }

    /// Whether anything is remembered at all.
    #[must_use]
    pub fn remembers(&self) -> bool {
        self.cache.is_some()
    }

    /// What was reused so far.
    #[must_use]
    pub fn reused(&self) -> Reused {
        let count = |c: &AtomicU64| c.load(Ordering::Relaxed);
        let Counts { overlaps, blocking, motions, verdicts } = &*self.reused;
        Reused {
            overlaps: count(overlaps),
            blocking: count(blocking),
            motions: count(motions),
            verdicts: count(verdicts),
        }
    }

    pub(super) fn count(&self, about: About) {
        let counter = match about {
            About::Overlap => &self.reused.overlaps,
            About::Blocking => &self.reused.blocking,
            About::Motion => &self.reused.motions,
            About::Verdict => &self.reused.verdicts,
        };
        counter.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn get<R: Record>(&self, key: &Key) -> Option<R> {
        self.cache.as_ref()?.get(key)
    }

    pub(super) fn put(&self, key: Key, record: &impl Record) {
        if let Some(cache) = &self.cache {
            cache.put(key, record);
        }
    }
}
