//! What the cache counts.

use std::sync::atomic::{AtomicU64, Ordering};

use super::kind::Kind;

/// Counters since the start, for all threads.
#[derive(Debug, Default)]
pub(super) struct Tally {
    kinds: [KindTally; Kind::ALL.len()],
    /// Records that were not written because too many waited.
    pub(super) overflows: Counter,
    /// Times that the file could not be written, and the store went on in memory.
    pub(super) write_failures: Counter,
    /// Files that were set aside as damaged.
    pub(super) set_aside: Counter,
}

/// Of one kind.
#[derive(Debug, Default)]
pub(super) struct KindTally {
    pub(super) hits: Counter,
    pub(super) misses: Counter,
    pub(super) evictions: Counter,
    pub(super) disk_evictions: Counter,
    pub(super) damaged: Counter,
}

impl Tally {
    pub(super) fn of(&self, kind: Kind) -> &KindTally {
        &self.kinds[kind.index()]
    }
}

/// Counts up.
#[derive(Debug, Default)]
pub(super) struct Counter(AtomicU64);

impl Counter {
    /// The count with this one.
    pub(super) fn one_more(&self) -> u64 {
        self.0.fetch_add(1, Ordering::Relaxed) + 1
    }

    pub(super) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}
