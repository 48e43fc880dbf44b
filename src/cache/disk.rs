//! The tier on disk: one redb file, which one process holds, and the records that are files beside it.
//!
//! redb may panic or fail on a file that was damaged from outside, so every use of it is contained: such a file is set
//! aside and another begun. A file that cannot be written (a full disk) is closed, and the process goes on in memory;
//! it opens the file again after a while, if there is something to write. Only the writer's thread
//! ([`super::writer`]) writes.

use std::collections::{HashMap, HashSet};
use std::os::unix::fs::DirBuilderExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, TryLockError};
use std::time::{Duration, Instant};

use redb::Database;

use super::database_file;
use super::files::{FileSource, RecordFiles};
use super::key::RecordKey;
use super::kind::RecordKind;
use super::stored::StoredTally;
use super::tables::{DiskFailure, Listed, StoreTables, agree, grew, listed, make_tables, read, write};
use super::tally::CacheTally;

const FILE: &str = "records.redb";
const DAMAGED: &str = "records.redb.damaged";
/// The share of the budget for records that are files; the rest is for the file of records.
const FOR_FILES: f64 = 0.25;
/// When the file exceeds its budget all the same, records are evicted down to this share of their bytes.
const AFTER_OVERGROWTH: f64 = 0.5;
/// Records are evicted down to this share of what they may take. Nearer to 1, transactions evict more often.
const AFTER_EVICTION: f64 = 0.9;
/// After it could not be read or written, the file is left alone for this long.
const PAUSE: Duration = Duration::from_secs(30);
/// Keys that are noted as used until the next transaction writes that down; more are not.
const MOST_TOUCHED: usize = 1 << 16;

/// Why a store cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum DiskError {
    /// Another process holds it.
    #[error("{0}: in use by another process")]
    InUse(PathBuf),
    /// The folder or the file cannot be made, read or written.
    #[error("{path}: {reason}")]
    Unusable {
        /// The folder.
        path: PathBuf,
        /// What the system or the database said.
        reason: String,
    },
}

/// The file, open until it fails.
#[derive(Debug)]
pub(super) struct Disk {
    folder: PathBuf,
    kinds: Arc<[&'static RecordKind]>,
    /// Bytes that the file of records may take.
    budget: u64,
    /// Bytes that the records that are files may take.
    for_files: u64,
    pub(super) files: RecordFiles,
    database: RwLock<Option<Database>>,
    /// Counts the files that were opened: a failure on one must not set the next one aside.
    generation: AtomicU64,
    /// When the file failed, if it is closed because of that.
    failed_at: Mutex<Option<Instant>>,
    pause: Duration,
    touched: Mutex<HashSet<RecordKey>>,
    /// All keys in the file of the kinds with an index.
    index: Mutex<HashSet<RecordKey>>,
    stored: Mutex<StoredTally>,
    tally: Arc<CacheTally>,
}

impl Disk {
    /// Opens the store of a folder, or makes one; `budget` is for all of it, in bytes.
    pub(super) fn open(
        folder: &Path,
        kinds: Arc<[&'static RecordKind]>,
        budget: u64,
        tally: Arc<CacheTally>,
    ) -> Result<Self, DiskError> {
        let unusable = |reason: String| DiskError::Unusable { path: folder.to_owned(), reason };
        let mut builder = std::fs::DirBuilder::new();
        builder.recursive(true).mode(0o700).create(folder).map_err(|e| unusable(e.to_string()))?;
        let for_files = (budget as f64 * FOR_FILES) as u64;
        let disk = Self {
            folder: folder.to_owned(),
            files: RecordFiles::of(folder, &kinds),
            kinds,
            budget: budget - for_files,
            for_files,
            database: RwLock::new(None),
            generation: AtomicU64::new(0),
            failed_at: Mutex::default(),
            pause: PAUSE,
            touched: Mutex::default(),
            index: Mutex::default(),
            stored: Mutex::default(),
            tally,
        };
        let database = match disk.database_or_new() {
            Ok(database) => database,
            Err(DiskFailure::InUse) => return Err(DiskError::InUse(folder.join(FILE))),
            Err(DiskFailure::Io(reason)) => return Err(unusable(reason)),
            Err(DiskFailure::Damaged(reason)) => {
                return Err(unusable(format!("cannot begin anew after: {reason}")));
            }
        };
        disk.begin(database);
        Ok(disk)
    }

    /// Uses a file from now on.
    fn begin(&self, database: Database) {
        *self.database.write().unwrap_or_else(PoisonError::into_inner) = Some(database);
        let list = self.list(None).unwrap_or_default();
        self.index().extend(list.iter().map(|l| l.key).filter(|key| key.kind().is_indexed()));
        *self.stored() = Listed::tally(&list);
    }

    /// The file; another one, if it is damaged.
    fn database_or_new(&self) -> Result<Database, DiskFailure> {
        match self.database_at() {
            Err(DiskFailure::Damaged(reason)) => {
                self.rename(&reason);
                self.database_at()
            }
            opened => opened,
        }
    }

    fn database_at(&self) -> Result<Database, DiskFailure> {
        contained(|| {
            let database = database_file::database_at(&self.folder.join(FILE))?;
            // Nobody else writes to the folder from here on.
            let files = self.files.look().map_err(|e| DiskFailure::Io(e.to_string()))?;
            make_tables(&database, &self.kinds, &files)?;
            Ok(database)
        })
    }

    /// Whether there is a file to use.
    pub(super) fn is_open(&self) -> bool {
        self.database.read().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Whether something may be written: the file is open, or worth another try.
    pub(super) fn may_write(&self) -> bool {
        self.is_open() || self.is_due()
    }

    fn is_due(&self) -> bool {
        self.failed_at().is_some_and(|at| at.elapsed() >= self.pause)
    }

    fn failed_at(&self) -> MutexGuard<'_, Option<Instant>> {
        self.failed_at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens a file that failed a while ago. Only the writer's thread does this.
    fn try_again(&self) {
        if self.is_open() || !self.is_due() {
            return;
        }
        match self.database_or_new() {
            Ok(database) => {
                *self.failed_at() = None;
                self.begin(database);
                tracing::info!(folder = %self.folder.display(), "the store on disk is open again");
            }
            Err(_) => *self.failed_at() = Some(Instant::now()),
        }
    }

    /// The envelope of a key, as it was written.
    pub(super) fn get(&self, key: &RecordKey) -> Option<Vec<u8>> {
        if key.kind().is_indexed() && !self.contains(key) {
            return None;
        }
        self.get_all(std::slice::from_ref(key))?.pop()?
    }

    /// The envelopes of keys, as they were written.
    pub(super) fn get_all(&self, keys: &[RecordKey]) -> Option<Vec<Option<Vec<u8>>>> {
        self.with_free(|database| read(database, keys))
    }

    /// Whether the index has a key.
    pub(super) fn contains(&self, key: &RecordKey) -> bool {
        self.index().contains(key)
    }

    /// A holder that panicked cannot have left it half-changed.
    fn index(&self) -> MutexGuard<'_, HashSet<RecordKey>> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The records of a kind, and their bytes, without a look at the disk.
    pub(super) fn count_of(&self, kind: &RecordKind) -> (u64, u64) {
        self.stored().count(kind)
    }

    fn stored(&self) -> MutexGuard<'_, StoredTally> {
        self.stored.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a record was used; the next transaction writes that down.
    pub(super) fn touch(&self, key: RecordKey) {
        let mut touched = self.touched.lock().unwrap_or_else(PoisonError::into_inner);
        if touched.len() < MOST_TOUCHED {
            touched.insert(key);
        }
    }

    /// Writes files, and in one transaction envelopes, the files' bytes and what was used since the last one.
    pub(super) fn write(
        &self,
        records: &[(RecordKey, Vec<u8>)],
        files: &HashMap<RecordKey, Arc<dyn FileSource>>,
    ) {
        self.try_again();
        let files = self.written(files);
        let touched = std::mem::take(&mut *self.touched.lock().unwrap_or_else(PoisonError::into_inner));
        let before = self.file_bytes();
        let written = self.with(|database| {
            let transaction = write(database)?;
            let (evicted, bytes, changes) = {
                let mut tables = StoreTables::of(&transaction, &self.kinds)?;
                for (key, bytes) in records {
                    tables.insert(key, bytes)?;
                }
                for (key, bytes) in &files {
                    tables.insert_file(key, *bytes)?;
                }
                for key in touched.iter() {
                    tables.touch(key)?;
                }
                let limit = tables.limit(self.budget, before)?;
                let mut evicted = tables.evict_above(limit, (limit as f64 * AFTER_EVICTION) as u64)?;
                evicted.extend(tables.evict_files_above(self.for_files)?);
                (evicted, tables.bytes, tables.finish()?)
            };
            transaction.commit()?;
            Ok((evicted, bytes, changes))
        });
        let Some((evicted, bytes, changes)) = written else { return };
        self.stored().merge(&changes);
        self.files.remove(&evicted);
        let new = records.iter().map(|(key, _)| *key).filter(|key| key.kind().is_indexed());
        self.index().extend(new);
        self.count(&evicted);
        let after = self.file_bytes();
        if after > before {
            self.note_growth(bytes);
        }
        if after > self.budget {
            self.evict((bytes as f64 * AFTER_OVERGROWTH) as u64);
            self.check(true);
        }
    }

    /// Writes files; those that were written, with their bytes.
    fn written(&self, sources: &HashMap<RecordKey, Arc<dyn FileSource>>) -> Vec<(RecordKey, u64)> {
        let mut files = Vec::new();
        for (key, source) in sources {
            if !self.is_open() || !self.files.may_write() || !source.is_unwritten() {
                continue;
            }
            match self.files.write(key, &**source) {
                Ok(bytes) => files.push((*key, bytes)),
                Err(error) => {
                    self.tally.write_failures.one_more();
                    let kind = key.kind().name;
                    tracing::warn!(folder = %self.folder.display(), kind, %error, "a file is not written");
                }
            }
        }
        files
    }

    fn note_growth(&self, bytes: u64) {
        self.with(|database| grew(database, bytes));
    }

    /// Takes records out; whether that was done.
    pub(super) fn remove(&self, keys: &[RecordKey]) -> bool {
        let done = self.with(|database| {
            let transaction = write(database)?;
            let mut tables = StoreTables::of(&transaction, &self.kinds)?;
            for key in keys {
                if key.kind().files().is_some() {
                    tables.remove_file(key)?;
                } else {
                    tables.remove(&key.to_bytes())?;
                }
            }
            let changes = tables.finish()?;
            transaction.commit()?;
            Ok(changes)
        });
        self.files.remove(keys);
        done.iter().for_each(|changes| self.stored().merge(changes));
        let mut index = self.index();
        keys.iter().for_each(|key| {
            index.remove(key);
        });
        done.is_some()
    }

    /// Evicts the least recently used records and files until no more than `bytes` are left; how many were evicted.
    pub(super) fn evict_all_above(&self, bytes: u64) -> Option<usize> {
        let mut list = self.list(None)?;
        list.sort_by_key(|listed| (listed.used, listed.key.to_bytes()));
        let mut left: u64 = list.iter().map(Listed::cost).sum();
        let surplus = |listed: &&Listed| {
            let more = left > bytes;
            left -= listed.cost();
            more
        };
        let evicted: Vec<RecordKey> = list.iter().take_while(surplus).map(|listed| listed.key).collect();
        if !evicted.is_empty() && self.remove(&evicted) {
            self.count(&evicted);
        }
        Some(evicted.len())
    }

    /// Evicts records until no more than `budget` bytes are left; how many were evicted.
    fn evict(&self, budget: u64) -> Option<usize> {
        let (evicted, changes) = self.with(|database| {
            let transaction = write(database)?;
            let mut tables = StoreTables::of(&transaction, &self.kinds)?;
            let evicted = tables.evict_above(budget, budget)?;
            let changes = tables.finish()?;
            transaction.commit()?;
            Ok((evicted, changes))
        })?;
        self.stored().merge(&changes);
        self.count(&evicted);
        Some(evicted.len())
    }

    /// Counts what was evicted.
    fn count(&self, evicted: &[RecordKey]) {
        let mut index = self.index();
        for key in evicted {
            index.remove(key);
            self.tally.kinds[key.kind()].disk_evictions.one_more();
        }
    }

    /// The records of one kind, or of all, in the order of their keys.
    pub(super) fn list(&self, kind: Option<&RecordKind>) -> Option<Vec<Listed>> {
        self.with(|database| listed(database, &self.kinds, kind))
    }

    /// The folder of the files.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Bytes of the file.
    pub(super) fn file_bytes(&self) -> u64 {
        std::fs::metadata(self.folder.join(FILE)).map_or(0, |m| m.len())
    }

    /// redb's own check of the whole file; `None` if there is no file any more. Gives back unused space.
    pub(super) fn check(&self, compact: bool) -> Option<bool> {
        let mut slot = self.database.write().unwrap_or_else(PoisonError::into_inner);
        let database = slot.as_mut()?;
        let checked = contained(|| {
            let clean = database.check_integrity()?;
            if compact {
                database.compact()?;
            }
            Ok(clean)
        });
        let generation = self.generation.load(Ordering::Relaxed);
        drop(slot);
        Some(checked.unwrap_or_else(|failure| {
            self.failed(failure, generation);
            false
        }))
    }

    /// Whether the tables agree with each other; a file where they do not is set aside.
    pub(super) fn holds_together(&self) -> bool {
        let agrees = self.with(|database| {
            let reason = "its tables contradict each other";
            if agree(database)? { Ok(()) } else { Err(DiskFailure::Damaged(reason.to_owned())) }
        });
        agrees.is_some()
    }

    /// As [`Disk::with`], but does not wait while the file is checked or replaced: then it does nothing.
    fn with_free<T>(&self, work: impl FnOnce(&Database) -> Result<T, DiskFailure>) -> Option<T> {
        if matches!(self.database.try_read(), Err(TryLockError::WouldBlock)) {
            return None;
        }
        self.with(work)
    }

    /// Does something with the file, if it is open. A failure closes the file or sets it aside.
    fn with<T>(&self, work: impl FnOnce(&Database) -> Result<T, DiskFailure>) -> Option<T> {
        let slot = self.database.read().unwrap_or_else(PoisonError::into_inner);
        let database = slot.as_ref()?;
        let done = contained(|| work(database));
        let generation = self.generation.load(Ordering::Relaxed);
        drop(slot);
        done.map_err(|failure| self.failed(failure, generation)).ok()
    }

    /// Closes the file that failed, unless another thread did; a damaged one is set aside, and another begun.
    fn failed(&self, failure: DiskFailure, generation: u64) {
        let mut slot = self.database.write().unwrap_or_else(PoisonError::into_inner);
        if self.generation.load(Ordering::Relaxed) != generation {
            return;
        }
        self.generation.store(generation + 1, Ordering::Relaxed);
        self.index().clear();
        *self.stored() = StoredTally::default();
        let database = slot.take();
        // redb writes when it is dropped.
        let closed = contained(|| {
            drop(database);
            Ok(())
        });
        if closed.is_err() {
            tracing::warn!(folder = %self.folder.display(), "the store on disk was not closed cleanly");
        }
        match failure {
            DiskFailure::Damaged(reason) => {
                self.rename(&reason);
                *slot = self.database_at().ok();
                // It has no records, but the files that are there.
                let list = slot.as_ref().map(|database| contained(|| listed(database, &self.kinds, None)));
                *self.stored() = Listed::tally(&list.and_then(Result::ok).unwrap_or_default());
            }
            DiskFailure::Io(reason) => {
                self.tally.write_failures.one_more();
                *self.failed_at() = Some(Instant::now());
                tracing::warn!(folder = %self.folder.display(), reason, "the store on disk fails: on in memory");
            }
            // An open file does not fail so.
            DiskFailure::InUse => {}
        }
    }

    fn rename(&self, reason: &str) {
        self.tally.set_aside.one_more();
        tracing::warn!(folder = %self.folder.display(), reason, "the store on disk is damaged: set aside, begun anew");
        let (from, to) = (self.folder.join(FILE), self.folder.join(DAMAGED));
        if let Err(error) = std::fs::rename(&from, to) {
            tracing::warn!(file = %from.display(), %error, "cannot be set aside");
        }
    }
}

/// A panic of the database is a damaged file.
fn contained<T>(work: impl FnOnce() -> Result<T, DiskFailure>) -> Result<T, DiskFailure> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(DiskFailure::Damaged("redb panicked".into())))
}

#[cfg(test)]
mod tests {
    use super::super::key::Digest;
    use super::super::tests::{INDEXED, KINDS};
    use super::*;

    #[test]
    fn a_file_that_failed_is_opened_again_after_a_while() {
        let folder = tempfile::tempdir().unwrap();
        let mut disk = Disk::open(folder.path(), Arc::new(KINDS), 64 << 20, Arc::default()).unwrap();
        let key = |n: u64| Digest::new().integer(n).key(&INDEXED);
        let fail = |disk: &Disk| {
            disk.failed(DiskFailure::Io("no space left".into()), disk.generation.load(Ordering::Relaxed));
        };
        disk.write(&[(key(1), vec![1; 9])], &HashMap::new());
        fail(&disk);
        assert!(!disk.is_open() && !disk.may_write() && !disk.contains(&key(1)));
        disk.write(&[(key(2), vec![2; 9])], &HashMap::new());
        assert!(!disk.is_open(), "so soon it is left alone");
        disk.pause = Duration::ZERO;
        assert!(disk.may_write());
        disk.write(&[(key(3), vec![3; 9])], &HashMap::new());
        assert!(disk.is_open() && disk.get(&key(2)).is_none());
        assert_eq!([1, 3].map(|n| disk.get(&key(n))), [Some(vec![1; 9]), Some(vec![3; 9])]);
        assert_eq!(disk.tally.write_failures.count(), 1);
        // Where nothing can be opened it stays closed, and is tried again.
        fail(&disk);
        std::fs::remove_dir_all(folder.path()).unwrap();
        disk.write(&[(key(4), vec![4; 9])], &HashMap::new());
        assert!(!disk.is_open() && disk.may_write());
    }
}
