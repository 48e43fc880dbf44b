//! The tier on disk: one redb file, which one process holds, and the files of fields beside it.
//!
//! redb may panic or fail on a file that was damaged from outside, so everything that touches it is
//! contained: such a file is set aside and another begun. A file that cannot be written (a full disk)
//! is closed, and the process goes on in memory; it is opened again after a while, if there is something to
//! write. Only the writer's thread ([`super::writer`]) writes.

use std::collections::{HashMap, HashSet};
use std::os::unix::fs::DirBuilderExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, TryLockError};
use std::time::{Duration, Instant};

use redb::Database;

use super::fields::FieldFiles;
use super::file;
use super::kind::{Key, Kind};
use super::tables::{Failure, Listed, Tables, agree, grew, listed, make_tables, read, write};
use super::tally::Tally;
use crate::sdf::Field;

const FILE: &str = "records.redb";
const DAMAGED: &str = "records.redb.damaged";
/// Of the budget, what the files of fields may take: the rest is for the file of records.
const FOR_FIELDS: f64 = 0.25;
/// Of a file that has become too large all the same, so much of what records may take is left.
const AFTER_OVERGROWTH: f64 = 0.5;
/// Evicting goes on down to this share of what records may take, so that it is not done all the time.
const AFTER_EVICTION: f64 = 0.9;
/// A file that could not be read or written is left alone for so long.
const PAUSE: Duration = Duration::from_secs(30);
/// So many records are remembered as used until the next transaction notes it.
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
    /// Bytes that the file may take.
    budget: u64,
    /// Bytes that the files of fields may take.
    for_fields: u64,
    pub(super) fields: FieldFiles,
    database: RwLock<Option<Database>>,
    /// Counts the files that were opened: who failed on one must not set the next one aside.
    generation: AtomicU64,
    /// When the file failed that is closed for this.
    failed_at: Mutex<Option<Instant>>,
    pause: Duration,
    touched: Mutex<HashSet<Key>>,
    /// The records in the file of kinds that are noted: whoever asks for one that is not there does not wait
    /// for the disk to hear so.
    noted: Mutex<HashSet<Key>>,
    tally: Arc<Tally>,
}

impl Disk {
    /// Opens the store of a folder, or makes one; `budget` is for all of it, in bytes.
    pub(super) fn open(folder: &Path, budget: u64, tally: Arc<Tally>) -> Result<Self, DiskError> {
        let unusable = |reason: String| DiskError::Unusable { path: folder.to_owned(), reason };
        let mut builder = std::fs::DirBuilder::new();
        builder.recursive(true).mode(0o700).create(folder).map_err(|e| unusable(e.to_string()))?;
        let for_fields = (budget as f64 * FOR_FIELDS) as u64;
        let disk = Self {
            folder: folder.to_owned(),
            budget: budget - for_fields,
            for_fields,
            fields: FieldFiles::beside(folder),
            database: RwLock::new(None),
            generation: AtomicU64::new(0),
            failed_at: Mutex::default(),
            pause: PAUSE,
            touched: Mutex::default(),
            noted: Mutex::default(),
            tally,
        };
        let database = match disk.database_or_new() {
            Ok(database) => database,
            Err(Failure::InUse) => return Err(DiskError::InUse(folder.join(FILE))),
            Err(Failure::Io(reason)) => return Err(unusable(reason)),
            Err(Failure::Damaged(reason)) => {
                return Err(unusable(format!("cannot begin anew after: {reason}")));
            }
        };
        disk.begin(database);
        Ok(disk)
    }

    /// Works with a file from now on.
    fn begin(&self, database: Database) {
        *self.database.write().unwrap_or_else(PoisonError::into_inner) = Some(database);
        for kind in Kind::ALL.into_iter().filter(|kind| kind.is_noted()) {
            let listed = self.list(Some(kind)).unwrap_or_default();
            self.noted().extend(listed.iter().map(|l| l.key));
        }
    }

    /// The file; another one, if it is damaged.
    fn database_or_new(&self) -> Result<Database, Failure> {
        match self.database_at() {
            Err(Failure::Damaged(reason)) => {
                self.rename(&reason);
                self.database_at()
            }
            opened => opened,
        }
    }

    fn database_at(&self) -> Result<Database, Failure> {
        contained(|| {
            let database = file::database_at(&self.folder.join(FILE))?;
            // Nobody else writes to the folder from here on.
            let files = self.fields.look().map_err(|e| Failure::Io(e.to_string()))?;
            make_tables(&database, &files)?;
            Ok(database)
        })
    }

    /// Whether there is a file to work with.
    pub(super) fn is_open(&self) -> bool {
        self.database.read().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Whether something may be written: to the open file, or to one that is worth another try.
    pub(super) fn may_write(&self) -> bool {
        self.is_open() || self.is_due()
    }

    fn is_due(&self) -> bool {
        self.failed_at().is_some_and(|at| at.elapsed() >= self.pause)
    }

    fn failed_at(&self) -> MutexGuard<'_, Option<Instant>> {
        self.failed_at.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Opens a file that failed a while ago. Only the writer's thread does: nobody else opens or closes it then.
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
    pub(super) fn get(&self, key: &Key) -> Option<Vec<u8>> {
        if key.kind().is_noted() && !self.contains(key) {
            return None;
        }
        self.get_all(std::slice::from_ref(key))?.pop()?
    }

    /// The envelopes of keys, as they were written.
    pub(super) fn get_all(&self, keys: &[Key]) -> Option<Vec<Option<Vec<u8>>>> {
        self.with_free(|database| read(database, keys))
    }

    /// Whether there is an envelope of a key of a kind that is noted.
    pub(super) fn contains(&self, key: &Key) -> bool {
        self.noted().contains(key)
    }

    /// A holder that panicked cannot have left it half-changed.
    fn noted(&self) -> MutexGuard<'_, HashSet<Key>> {
        self.noted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a record was used; the next transaction writes it down.
    pub(super) fn touch(&self, key: Key) {
        let mut touched = self.touched.lock().unwrap_or_else(PoisonError::into_inner);
        if touched.len() < MOST_TOUCHED {
            touched.insert(key);
        }
    }

    /// Writes envelopes in one transaction, with what was used since the last one and the files of fields.
    pub(super) fn write(&self, records: &[(Key, Vec<u8>)], fields: &HashMap<Key, Arc<Field>>) {
        self.try_again();
        let files = self.written(fields);
        let touched = std::mem::take(&mut *self.touched.lock().unwrap_or_else(PoisonError::into_inner));
        let before = self.file_bytes();
        let written = self.with(|database| {
            let transaction = write(database)?;
            let (evicted, bytes) = {
                let mut tables = Tables::of(&transaction)?;
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
                evicted.extend(tables.evict_files_above(self.for_fields)?);
                tables.finish()?;
                (evicted, tables.bytes)
            };
            transaction.commit()?;
            Ok((evicted, bytes))
        });
        let Some((evicted, bytes)) = written else { return };
        self.fields.remove(&evicted);
        let new = records.iter().map(|(key, _)| *key).filter(|key| key.kind().is_noted());
        self.noted().extend(new);
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

    /// Writes the files of fields; those that were written, with their bytes.
    fn written(&self, fields: &HashMap<Key, Arc<Field>>) -> Vec<(Key, u64)> {
        let mut files = Vec::new();
        for (key, field) in fields {
            if !self.is_open() || !self.fields.may_write() || field.unwritten() == 0 {
                continue;
            }
            match self.fields.write(key, field) {
                Ok(bytes) => files.push((*key, bytes)),
                Err(error) => {
                    self.tally.write_failures.one_more();
                    tracing::warn!(folder = %self.folder.display(), %error, "a distance field is not written");
                }
            }
        }
        files
    }

    fn note_growth(&self, bytes: u64) {
        self.with(|database| grew(database, bytes));
    }

    /// Takes records out; whether that was done.
    pub(super) fn remove(&self, keys: &[Key]) -> bool {
        let done = self.with(|database| {
            let transaction = write(database)?;
            let mut tables = Tables::of(&transaction)?;
            for key in keys {
                if key.kind().is_file() {
                    tables.remove_file(key)?;
                } else {
                    tables.remove(&key.to_bytes())?;
                }
            }
            tables.finish()?;
            drop(tables);
            Ok(transaction.commit()?)
        });
        self.fields.remove(keys);
        let mut noted = self.noted();
        keys.iter().for_each(|key| {
            noted.remove(key);
        });
        done.is_some()
    }

    /// Takes out what was used least recently, records and files alike, until so many bytes are left; how
    /// much left.
    pub(super) fn evict_all_above(&self, bytes: u64) -> Option<usize> {
        let mut list = self.list(None)?;
        list.sort_by_key(|listed| (listed.used, listed.key));
        let mut left: u64 = list.iter().map(Listed::cost).sum();
        let surplus = |listed: &&Listed| {
            let more = left > bytes;
            left -= listed.cost();
            more
        };
        let evicted: Vec<Key> = list.iter().take_while(surplus).map(|listed| listed.key).collect();
        if !evicted.is_empty() && self.remove(&evicted) {
            self.count(&evicted);
        }
        Some(evicted.len())
    }

    /// Evicts down to so many bytes of records; how many left.
    fn evict(&self, budget: u64) -> Option<usize> {
        let evicted = self.with(|database| {
            let transaction = write(database)?;
            let mut tables = Tables::of(&transaction)?;
            let evicted = tables.evict_above(budget, budget)?;
            tables.finish()?;
            drop(tables);
            transaction.commit()?;
            Ok(evicted)
        })?;
        self.count(&evicted);
        Some(evicted.len())
    }

    /// Notes what left the file for others.
    fn count(&self, evicted: &[Key]) {
        let mut noted = self.noted();
        for key in evicted {
            noted.remove(key);
            self.tally.of(key.kind()).disk_evictions.one_more();
        }
    }

    /// The records of a kind, or all, in the order of their keys.
    pub(super) fn list(&self, kind: Option<Kind>) -> Option<Vec<Listed>> {
        self.with(|database| listed(database, kind))
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
            if agree(database)? { Ok(()) } else { Err(Failure::Damaged(reason.to_owned())) }
        });
        agrees.is_some()
    }

    /// As [`Disk::with`], unless the file is being looked after: nobody waits for that.
    fn with_free<T>(&self, work: impl FnOnce(&Database) -> Result<T, Failure>) -> Option<T> {
        if matches!(self.database.try_read(), Err(TryLockError::WouldBlock)) {
            return None;
        }
        self.with(work)
    }

    /// Something with the open file, if it is open; what fails closes the file or sets it aside.
    fn with<T>(&self, work: impl FnOnce(&Database) -> Result<T, Failure>) -> Option<T> {
        let slot = self.database.read().unwrap_or_else(PoisonError::into_inner);
        let database = slot.as_ref()?;
        let done = contained(|| work(database));
        let generation = self.generation.load(Ordering::Relaxed);
        drop(slot);
        done.map_err(|failure| self.failed(failure, generation)).ok()
    }

    /// Closes the file that failed, unless somebody did; a damaged one is kept for whoever wants to look at
    /// it, and another begun.
    fn failed(&self, failure: Failure, generation: u64) {
        let mut slot = self.database.write().unwrap_or_else(PoisonError::into_inner);
        if self.generation.load(Ordering::Relaxed) != generation {
            return;
        }
        self.generation.store(generation + 1, Ordering::Relaxed);
        self.noted().clear();
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
            Failure::Damaged(reason) => {
                self.rename(&reason);
                *slot = self.database_at().ok();
            }
            Failure::Io(reason) => {
                self.tally.write_failures.one_more();
                *self.failed_at() = Some(Instant::now());
                tracing::warn!(folder = %self.folder.display(), reason, "the store on disk fails: on in memory");
            }
            // Not of an open file.
            Failure::InUse => {}
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
fn contained<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| Err(Failure::Damaged("redb panicked".into())))
}

/// How many bytes of records there are of each kind, in the order of [`Kind::ALL`].
pub(super) fn by_kind(list: &[Listed]) -> Vec<(u64, u64)> {
    let of = |kind: Kind| {
        let listed = list.iter().filter(|l| l.key.kind() == kind);
        listed.fold((0, 0), |(entries, bytes), l| (entries + 1, bytes + l.bytes))
    };
    Kind::ALL.into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::super::kind::Digest;
    use super::*;

    #[test]
    fn a_file_that_failed_is_opened_again_after_a_while() {
        let folder = tempfile::tempdir().unwrap();
        let mut disk = Disk::open(folder.path(), 64 << 20, Arc::default()).unwrap();
        let key = |n: u64| Digest::new().integer(n).key(Kind::Source);
        let fail = |disk: &Disk| {
            disk.failed(Failure::Io("no space left".into()), disk.generation.load(Ordering::Relaxed));
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
