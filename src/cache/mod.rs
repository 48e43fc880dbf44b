//! A store of records by key: in memory, and on disk across restarts. It knows nothing of planning.
//!
//! A stage declares a kind for each type of record that it remembers ([`RecordKind`], `kind`), and makes a [`RecordKey`]
//! of all that the record depends on (`key`). The payload of a record (`record`) goes to the tier in memory (`memory`,
//! with a budget in bytes) and in an envelope (`envelope`, drawn in `FORMAT.md`) to the tier on disk (`disk`: a redb
//! file that one process holds, opened by `database_file`, with its `tables`, counted in `stored`; large records are
//! files beside it, `files`, which are mapped, `mapping`). One thread writes to disk (`writer`). Both tiers evict what was used least
//! recently. A process that starts can read ahead what was used last (`recent`). A request uses a cache through its
//! [`RequestCache`] (`request`), which counts what it reused.
//!
//! Invalidation: `src/build.rs` hashes the sources of each stage together with those that it depends on. A kind names
//! the hash of its stage ([`Validity::Sources`]), and [`Digest::key`] adds it to every key. So after a change in a
//! stage, the records of this stage and of those that depend on it are not found any more, and are evicted in time; all
//! others stay. Records that every build must read are found by their content alone ([`Validity::Format`]); their
//! format has a version, which is raised when it changes.
//!
//! Invariants: a record that is found is, to the bit, the one that would be computed, so its key has all that it depends
//! on. A record that is damaged, of another version or evicted is a miss and never an error. No request waits for
//! a write to disk.

mod database_file;
mod disk;
mod envelope;
mod files;
mod key;
mod kind;
mod mapping;
mod memory;
mod recent;
mod record;
mod request;
mod settings;
mod statistics;
mod stored;
mod tables;
mod tally;
#[cfg(test)]
mod tests;
mod writer;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

pub use disk::DiskError;
pub use files::FileSource;
pub use key::{Digest, RecordKey};
pub use kind::{RecordKind, Storage, Validity};
pub use mapping::{Mapping, MappingTally};
pub use record::Storable;
#[cfg(test)]
pub(crate) use record::payload;
pub use request::RequestCache;
pub use settings::CacheSettings;
pub use statistics::{CacheStatistics, KindStatistics, Verified};
pub use tables::Listed;

use disk::Disk;
use memory::Memory;
use tally::CacheTally;
use writer::DiskWriter;

/// The store: memory, and a folder on disk if one is wanted and can be used. Shared by all threads.
#[derive(Debug)]
pub struct Cache {
    kinds: Arc<[&'static RecordKind]>,
    memory: Mutex<Memory>,
    // Before the disk: when it is dropped, it writes what still waits.
    writer: Option<DiskWriter>,
    disk: Option<Arc<Disk>>,
    tally: Arc<CacheTally>,
}

impl Cache {
    /// A store of some kinds of records in memory alone, with a budget in bytes.
    #[must_use]
    pub fn in_memory(budget: usize, kinds: &[&'static RecordKind]) -> Self {
        Self {
            kinds: kinds.into(),
            memory: Mutex::new(Memory::new(budget)),
            writer: None,
            disk: None,
            tally: Arc::default(),
        }
    }

    /// A store of some kinds of records in memory and on disk. Records of other kinds in the folder are left alone, but
    /// evicted when they were used least recently.
    ///
    /// # Errors
    /// The folder cannot be used, or another process holds the store.
    pub fn open(settings: &CacheSettings, kinds: &[&'static RecordKind]) -> Result<Self, DiskError> {
        let cache = Self::in_memory(settings.memory_bytes, kinds);
        let Some(folder) = &settings.folder else { return Ok(cache) };
        let tally = Arc::clone(&cache.tally);
        let disk = Disk::open(folder, Arc::clone(&cache.kinds), settings.disk_bytes, Arc::clone(&tally))?;
        let disk = Arc::new(disk);
        let writer = DiskWriter::start(Arc::clone(&disk), tally)
            .map_err(|e| DiskError::Unusable { path: folder.clone(), reason: e.to_string() })?;
        Ok(Self { writer: Some(writer), disk: Some(disk), ..cache })
    }

    /// The record of a key, from memory or else from disk.
    #[must_use]
    pub fn get<R: Storable>(&self, key: &RecordKey) -> Option<R> {
        let tally = &self.tally.kinds[key.kind()];
        let found = self.payload(key).and_then(|payload| {
            let record = record::decode(&payload);
            if record.is_none() {
                tally.damaged.one_more();
                self.memory().remove(key);
            }
            record
        });
        tally.looked_up(found.is_some());
        found
    }

    fn payload(&self, key: &RecordKey) -> Option<Arc<[u8]>> {
        let known = self.memory().get(key);
        let disk = self.disk.as_ref();
        if known.is_some() {
            disk.inspect(|d| d.touch(*key));
            return known;
        }
        let bytes = disk?.get(key)?;
        let Some(payload) = envelope::opened(key, &bytes) else {
            self.tally.kinds[key.kind()].damaged.one_more();
            return None;
        };
        disk?.touch(*key);
        let payload: Arc<[u8]> = payload.into();
        self.keep(*key, Arc::clone(&payload));
        Some(payload)
    }

    /// Whether there is a record of a key of a kind with an index, without a look at the disk.
    #[must_use]
    pub fn contains(&self, key: &RecordKey) -> bool {
        self.disk.as_ref().is_some_and(|d| d.contains(key))
    }

    /// Notes that a record on disk was used.
    pub fn touch(&self, key: RecordKey) {
        if let Some(disk) = &self.disk {
            disk.touch(key);
        }
    }

    /// Remembers a record, in place of one with the same key.
    pub fn put(&self, key: RecordKey, record: &impl Storable) {
        let Some(payload) = record::payload(record) else { return };
        if let Some(writer) = &self.writer
            && self.disk.as_ref().is_some_and(|d| d.may_write())
            && let Some(bytes) = envelope::sealed(&key, &payload)
        {
            writer.write(key, bytes);
        }
        self.keep(key, payload.into());
    }

    fn keep(&self, key: RecordKey, payload: Arc<[u8]>) {
        if !key.kind().stays_in_memory() {
            return;
        }
        for kind in self.memory().put(key, payload) {
            self.tally.kinds[kind].evictions.one_more();
        }
    }

    /// What `read` makes of the file of a key. Where it returns none, the file is damaged, and not used again.
    pub fn mapped<T>(&self, key: &RecordKey, read: impl FnOnce(Mapping) -> Option<T>) -> Option<T> {
        let found = self.disk.as_ref().and_then(|disk| {
            let found = read(disk.files.open(key)?);
            if found.is_some() {
                disk.touch(*key);
            } else {
                disk.files.forget(key);
            }
            found
        });
        self.tally.kinds[key.kind()].looked_up(found.is_some());
        found
    }

    /// Writes the file of a key, if there is a store on disk and `wanted`; else notes that the file was used, if there is
    /// one. If too much waits to be written, the caller can try again later.
    pub fn keep_file(&self, key: RecordKey, source: Arc<dyn FileSource>, wanted: bool) {
        self.keep_file_by(key, wanted, |writer| {
            let _waits = writer.write_file(key, &source);
        });
    }

    /// The same for the last time: waits until there is room.
    pub fn keep_file_at_end(&self, key: RecordKey, source: Arc<dyn FileSource>, wanted: bool) {
        self.keep_file_by(key, wanted, |writer| writer.write_last_of_file(key, &source));
    }

    fn keep_file_by(&self, key: RecordKey, wanted: bool, write: impl FnOnce(&DiskWriter)) {
        let (Some(disk), Some(writer)) = (&self.disk, &self.writer) else { return };
        if wanted && disk.may_write() && disk.files.may_write() {
            write(writer);
        } else if disk.files.has(&key) {
            disk.touch(key);
        }
    }

    /// Bytes of the records in memory.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.memory().bytes()
    }

    /// Waits until all that was remembered so far is on disk, if there is a store on disk.
    pub fn flush(&self) {
        if let Some(writer) = &self.writer {
            writer.flush();
        }
    }

    /// Whether there is a store on disk that works.
    #[must_use]
    pub fn is_on_disk(&self) -> bool {
        self.disk.as_ref().is_some_and(|d| d.is_open())
    }

    /// Takes records out of the store on disk.
    #[cfg(test)]
    pub(crate) fn remove(&self, keys: &[RecordKey]) {
        assert!(self.disk.as_ref().is_some_and(|disk| disk.remove(keys)));
    }

    /// A thread that panicked while it held the map cannot have left an entry half-changed.
    fn memory(&self) -> MutexGuard<'_, Memory> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether any bytes can be read as a record of a kind, in its envelope or as its payload, or as its file; for fuzzing.
pub(crate) fn can_be_read(kind: &'static RecordKind, bytes: &[u8]) -> bool {
    let hash = [0; 32];
    (kind.is_content)(&hash, envelope::opened(&RecordKey::new(kind, hash), bytes).unwrap_or(bytes))
}
