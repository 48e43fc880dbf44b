//! What the cache counts.

use std::sync::atomic::{AtomicU64, Ordering};

use super::kind::ByKind;

/// Counters since the start, for all threads.
#[derive(Debug, Default)]
pub(super) struct CacheTally {
    pub(super) kinds: ByKind<KindTally>,
    /// Records that were not written because too many waited.
    pub(super) overflows: Counter,
    /// Failures to write a file.
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

impl KindTally {
    /// Counts a hit or a miss.
    pub(super) fn looked_up(&self, is_hit: bool) {
        if is_hit { &self.hits } else { &self.misses }.one_more();
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
