//! One request's view of a cache.

use std::sync::Arc;

use super::kind::{ByKind, RecordKind};
use super::tally::Counter;
use super::{Cache, RecordKey, Storable};

/// What one request reads and writes of a cache, and how many answers it found there. Without a cache it finds nothing.
/// Copies count together.
#[derive(Debug, Clone, Default)]
pub struct RequestCache {
    cache: Option<Arc<Cache>>,
    reused: Arc<ByKind<Counter>>,
}

impl RequestCache {
    /// A new request's view.
    #[must_use]
    pub fn of(cache: Arc<Cache>) -> Self {
        Self { cache: Some(cache), ..Self::default() }
    }

    /// Whether there is a cache.
    #[must_use]
    pub fn remembers(&self) -> bool {
        self.cache.is_some()
    }

    /// How many answers of a kind were found.
    #[must_use]
    pub fn reused(&self, kind: &RecordKind) -> u64 {
        self.reused[kind].count()
    }

    /// Counts an answer of a kind that was found. For stages: a record that is found may be no answer yet.
    pub fn count_reused(&self, kind: &RecordKind) {
        self.reused[kind].one_more();
    }

    /// The record of a key.
    #[must_use]
    pub fn get<R: Storable>(&self, key: &RecordKey) -> Option<R> {
        self.cache.as_ref()?.get(key)
    }

    /// Remembers a record.
    pub fn put(&self, key: RecordKey, record: &impl Storable) {
        if let Some(cache) = &self.cache {
            cache.put(key, record);
        }
    }

    /// The answer that is the record of a key, or else the one that is computed, which is then remembered.
    ///
    /// # Errors
    /// Those of `compute`.
    pub fn get_or<R: Storable, E>(
        &self,
        key: RecordKey,
        compute: impl FnOnce() -> Result<R, E>,
    ) -> Result<R, E> {
        if let Some(record) = self.get(&key) {
            self.count_reused(key.kind());
            return Ok(record);
        }
        let record = compute()?;
        self.put(key, &record);
        Ok(record)
    }
}
