//! What is remembered across requests, clients, assemblies and restarts, by content.
//!
//! Data flow: a kind of record and everything that it depends on make a [`Key`] (`kind`) → the tier in
//! memory (`memory`, a budget in bytes, the least recently used leave) → the tier on disk (`disk`, a redb
//! file that one process holds, with its `tables`; `writer`, the one thread that writes to it) → bytes
//! (`format`, drawn in `FORMAT.md`; `records`, what is in them). Distance fields have a file each (`fields`),
//! which is mapped. A process that begins reads what was used last ahead (`recent`). What is asked, under which
//! key, and when an old answer still holds, is said once for each kind: `pair`, `touching`, `motion`, `swept`,
//! `verdict`, `plan`, `hull`, `source`, `healed`, `answer`.
//! A request sees it all through its [`Recall`], which counts what was reused; with none of it, it
//! remembers nothing.
//!
//! Invariants: an answer that is found is, to the bit, the one that would be computed; so whatever an
//! answer depends on is in its key, or in what is compared when it is found. A record that is damaged, of
//! another version, or gone is a miss and never an error. No request waits for the disk to be written.

mod answer;
mod disk;
mod fields;
mod file;
mod format;
mod healed;
mod hostile;
mod hull;
mod kind;
mod memory;
mod motion;
mod pair;
mod plan;
mod recall;
mod recent;
mod records;
mod settings;
mod source;
mod statistics;
mod swept;
mod tables;
mod tally;
#[cfg(test)]
mod tests;
mod touching;
mod verdict;
mod writer;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use answer::AnsweredQuestion;
pub use disk::DiskError;
pub use format::Record;
pub(crate) use hostile::read_as_records;
pub use kind::{Digest, Key, Kind};
pub use motion::MotionQuestion;
pub use pair::{blocking_key, overlap_key};
pub use plan::{Answered, PlanQuestion};
pub use recall::{Recall, Reused};
pub use settings::CacheSettings;
pub use source::Source;
pub use statistics::{CacheStatistics, KindStatistics, Verified};
pub use tables::Listed;
pub use verdict::VerdictQuestion;

use disk::Disk;
use memory::Memory;
use tally::Tally;
use writer::Writer;

/// The store: memory, and a file on disk if one is wanted and can be had. Shared by all threads.
#[derive(Debug)]
pub struct Cache {
    memory: Mutex<Memory>,
    // Before the disk: what it has left to write is written when it is dropped.
    writer: Option<Writer>,
    disk: Option<Arc<Disk>>,
    tally: Arc<Tally>,
}

impl Cache {
    /// A store in memory alone, with a budget in bytes.
    #[must_use]
    pub fn in_memory(budget: usize) -> Self {
        Self { memory: Mutex::new(Memory::new(budget)), writer: None, disk: None, tally: Arc::default() }
    }

    /// A store in memory and on disk.
    ///
    /// # Errors
    /// The folder cannot be used, or another process holds the store.
    pub fn open(settings: &CacheSettings) -> Result<Self, DiskError> {
        let cache = Self::in_memory(settings.memory_bytes);
        let Some(folder) = &settings.folder else { return Ok(cache) };
        let tally = Arc::clone(&cache.tally);
        let disk = Arc::new(Disk::open(folder, settings.disk_bytes, Arc::clone(&tally))?);
        let writer = Writer::start(Arc::clone(&disk), tally)
            .map_err(|e| DiskError::Unusable { path: folder.clone(), reason: e.to_string() })?;
        Ok(Self { writer: Some(writer), disk: Some(disk), ..cache })
    }

    /// The record of a key, from memory or else from disk.
    #[must_use]
    pub fn get<R: Record>(&self, key: &Key) -> Option<R> {
        let tally = self.tally.of(key.kind());
        let found = self.payload(key).and_then(|payload| {
            let record = format::decode(&payload);
            if record.is_none() {
                tally.damaged.one_more();
                self.memory().remove(key);
            }
            record
        });
        if found.is_some() {
            tally.hits.one_more()
        } else {
            tally.misses.one_more()
        };
        found
    }

    fn payload(&self, key: &Key) -> Option<Arc<[u8]>> {
        let known = self.memory().get(key);
        let disk = self.disk.as_ref();
        if known.is_some() {
            disk.inspect(|d| d.touch(*key));
            return known;
        }
        let bytes = disk?.get(key)?;
        let Some(payload) = format::opened(key, &bytes) else {
            self.tally.of(key.kind()).damaged.one_more();
            return None;
        };
        disk?.touch(*key);
        let payload: Arc<[u8]> = payload.into();
        self.keep(*key, Arc::clone(&payload));
        Some(payload)
    }

    /// Whether there is a record of a key of a kind that is noted; told without looking on disk.
    fn contains(&self, key: &Key) -> bool {
        self.disk.as_ref().is_some_and(|d| d.contains(key))
    }

    /// Notes that a record on disk was used.
    fn touch(&self, key: Key) {
        if let Some(disk) = &self.disk {
            disk.touch(key);
        }
    }

    /// Remembers a record, in place of one with the same key.
    pub fn put(&self, key: Key, record: &impl Record) {
        let Some(payload) = format::encode(record) else { return };
        if let Some(writer) = &self.writer
            && self.disk.as_ref().is_some_and(|d| d.may_write())
            && let Some(bytes) = format::sealed(&key, &payload)
        {
            writer.write(key, bytes);
        }
        self.keep(key, payload.into());
    }

    fn keep(&self, key: Key, payload: Arc<[u8]>) {
        if !key.kind().stays_in_memory() {
            return;
        }
        for kind in self.memory().put(key, payload) {
            self.tally.of(kind).evictions.one_more();
        }
    }

    /// Bytes of the records in memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.memory().bytes()
    }

    /// Waits until everything remembered so far is on disk, if there is one.
    pub fn flush(&self) {
        if let Some(writer) = &self.writer {
            writer.flush();
        }
    }

    /// Whether there is a file that works.
    #[must_use]
    pub fn is_on_disk(&self) -> bool {
        self.disk.as_ref().is_some_and(|d| d.is_open())
    }

    /// A thread that panicked while it held the map cannot have left an entry half-changed.
    fn memory(&self) -> MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
