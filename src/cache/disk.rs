//! The tier on disk: one redb file, which one process holds.
//!
//! redb may panic or fail on a file that was damaged from outside, so everything that touches it is
//! contained: such a file is set aside and another begun. A file that cannot be written (a full disk)
//! is closed, and the process goes on in memory. Only the writer's thread ([`super::writer`]) writes.

use std::collections::HashSet;
use std::io::ErrorKind;
use std::os::unix::fs::DirBuilderExt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError, RwLock, TryLockError};

use redb::{Database, ReadableDatabase, ReadableTable, ReadableTableMetadata, StorageError, TableDefinition};

use super::kind::{Key, Kind};
use super::tally::Tally;

/// Envelopes by key.
const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
/// When a record was used last, and how long it is.
const USED: TableDefinition<'_, &[u8], (u64, u64)> = TableDefinition::new("used");
/// The count of transactions and of bytes, and how many bytes there were when the file last grew.
const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");
const GROWN_AT: &str = "grown_at";
const CLOCK: &str = "clock";
const BYTES: &str = "bytes";

const FILE: &str = "records.redb";
const DAMAGED: &str = "records.redb.damaged";
/// redb's own cache of pages.
const PAGE_CACHE: usize = 16 << 20;
/// What a record takes in the file beside its bytes, about: keys, stamps, and pages that are not full.
const OVERHEAD: u64 = 160;
/// Of the budget, what records may take at most: pages are not full, and a transaction writes new ones
/// before old ones are free.
const SHARE: f64 = 0.5;
/// The file grows by this factor, about, …
const GROWTH: f64 = 2.2;
/// … and has room then for so many times as much as when it grew, surely.
const ROOM: f64 = 1.4;
/// Of a file that has become too large all the same, so much of what records may take is left.
const AFTER_OVERGROWTH: f64 = 0.5;
/// Evicting goes on down to this share of what records may take, so that it is not done all the time.
const AFTER_EVICTION: f64 = 0.9;
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

/// A record as [`Disk::list`] tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listed {
    /// Its key.
    pub key: Key,
    /// Its length with the envelope, in bytes.
    pub bytes: u64,
    /// The transaction in or before which it was used last.
    pub used: u64,
}

/// What a transaction failed with.
#[derive(Debug)]
enum Failure {
    /// Another process has the file.
    InUse,
    /// The system refused to read or write.
    Io(String),
    /// The file is not what was written to it.
    Damaged(String),
}

const DAMAGE: [ErrorKind; 3] = [ErrorKind::UnexpectedEof, ErrorKind::InvalidData, ErrorKind::InvalidInput];

impl<E: Into<redb::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        let error = error.into();
        match &error {
            redb::Error::DatabaseAlreadyOpen | redb::Error::LockProtocolMismatch => Self::InUse,
            // Where the file says that something is which is not there.
            redb::Error::Io(e) if DAMAGE.contains(&e.kind()) => Self::Damaged(error.to_string()),
            redb::Error::Io(_) | redb::Error::PreviousIo => Self::Io(error.to_string()),
            _ => Self::Damaged(error.to_string()),
        }
    }
}

/// The file, open until it fails.
#[derive(Debug)]
pub(super) struct Disk {
    folder: PathBuf,
    /// Bytes that the file may take.
    budget: u64,
    database: RwLock<Option<Database>>,
    touched: Mutex<HashSet<Key>>,
    tally: Arc<Tally>,
}

impl Disk {
    /// Opens the store of a folder, or makes one; `budget` is for the whole file, in bytes.
    pub(super) fn open(folder: &Path, budget: u64, tally: Arc<Tally>) -> Result<Self, DiskError> {
        let unusable = |reason: String| DiskError::Unusable { path: folder.to_owned(), reason };
        let mut builder = std::fs::DirBuilder::new();
        builder.recursive(true).mode(0o700).create(folder).map_err(|e| unusable(e.to_string()))?;
        let disk = Self {
            folder: folder.to_owned(),
            budget,
            database: RwLock::new(None),
            touched: Mutex::default(),
            tally,
        };
        let database = match disk.database_at() {
            Ok(database) => database,
            Err(Failure::InUse) => return Err(DiskError::InUse(folder.join(FILE))),
            Err(Failure::Io(reason)) => return Err(unusable(reason)),
            Err(Failure::Damaged(reason)) => {
                disk.rename(&reason);
                disk.database_at().map_err(|_| unusable(format!("cannot begin anew after: {reason}")))?
            }
        };
        *disk.database.write().unwrap_or_else(PoisonError::into_inner) = Some(database);
        Ok(disk)
    }

    fn database_at(&self) -> Result<Database, Failure> {
        contained(|| {
            let database = Database::builder().set_cache_size(PAGE_CACHE).create(self.folder.join(FILE))?;
            let transaction = write(&database)?;
            transaction.open_table(RECORDS)?;
            transaction.open_table(USED)?;
            transaction.open_table(META)?;
            transaction.commit()?;
            Ok(database)
        })
    }

    /// Whether there is a file to work with.
    pub(super) fn is_open(&self) -> bool {
        self.database.read().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// The envelope of a key, as it was written.
    pub(super) fn get(&self, key: &Key) -> Option<Vec<u8>> {
        let found = self.with_free(|database| {
            let transaction = database.begin_read()?;
            let records = transaction.open_table(RECORDS)?;
            Ok(records.get(&key.to_bytes()[..])?.map(|bytes| bytes.value().to_vec()))
        });
        found.flatten()
    }

    /// Notes that a record was used; the next transaction writes it down.
    pub(super) fn touch(&self, key: Key) {
        let mut touched = self.touched.lock().unwrap_or_else(PoisonError::into_inner);
        if touched.len() < MOST_TOUCHED {
            touched.insert(key);
        }
    }

    /// Writes envelopes in one transaction, with what was used since the last one.
    pub(super) fn write(&self, records: &[(Key, Vec<u8>)]) {
        let touched = std::mem::take(&mut *self.touched.lock().unwrap_or_else(PoisonError::into_inner));
        let before = self.file_bytes();
        let written = self.with(|database| {
            let transaction = write(database)?;
            let (evicted, bytes) = {
                let mut tables = Tables::of(&transaction)?;
                for (key, bytes) in records {
                    tables.insert(key, bytes)?;
                }
                for key in touched.iter() {
                    tables.touch(key)?;
                }
                let limit = tables.limit(self.budget, before)?;
                let evicted = tables.evict_above(limit, (limit as f64 * AFTER_EVICTION) as u64)?;
                tables.finish()?;
                (evicted, tables.bytes)
            };
            transaction.commit()?;
            Ok((evicted, bytes))
        });
        let Some((evicted, bytes)) = written else { return };
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

    fn note_growth(&self, bytes: u64) {
        self.with(|database| {
            let transaction = write(database)?;
            transaction.open_table(META)?.insert(GROWN_AT, bytes)?;
            Ok(transaction.commit()?)
        });
    }

    /// Takes records out; whether that was done.
    pub(super) fn remove(&self, keys: &[Key]) -> bool {
        let done = self.with(|database| {
            let transaction = write(database)?;
            let mut tables = Tables::of(&transaction)?;
            for key in keys {
                tables.remove(&key.to_bytes())?;
            }
            tables.finish()?;
            drop(tables);
            Ok(transaction.commit()?)
        });
        done.is_some()
    }

    /// Evicts down to so many bytes of records; how many left.
    pub(super) fn evict(&self, budget: u64) -> Option<usize> {
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

    fn count(&self, evicted: &[Key]) {
        for key in evicted {
            self.tally.of(key.kind()).disk_evictions.one_more();
        }
    }

    /// All records, in the order of their keys.
    pub(super) fn list(&self) -> Option<Vec<Listed>> {
        self.with(|database| {
            let used = database.begin_read()?.open_table(USED)?;
            let mut out = Vec::new();
            for entry in used.iter()? {
                let (key, value) = entry?;
                let (stamp, bytes) = value.value();
                out.extend(Key::from_bytes(key.value()).map(|key| Listed { key, bytes, used: stamp }));
            }
            Ok(out)
        })
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
        if checked.is_err() {
            drop(slot);
            self.set_aside("its check failed");
            return Some(false);
        }
        checked.ok()
    }

    /// Whether the tables agree with each other, and have every key once.
    pub(super) fn agrees(&self) -> bool {
        let agrees = self.with(|database| {
            let transaction = database.begin_read()?;
            let (records, used) = (transaction.open_table(RECORDS)?, transaction.open_table(USED)?);
            let (mut sum, mut last) = (0, Vec::new());
            for (record, use_of) in records.iter()?.zip(used.iter()?) {
                let ((key, bytes), (same_key, value)) = (record?, use_of?);
                let same = key.value() == same_key.value() && bytes.value().len() as u64 == value.value().1;
                if !same || key.value() <= &last[..] {
                    return Ok(false);
                }
                sum += value.value().1 + OVERHEAD;
                last = key.value().to_vec();
            }
            let noted = transaction.open_table(META)?.get(BYTES)?.map_or(0, |bytes| bytes.value());
            Ok(records.len()? == used.len()? && noted == sum)
        });
        agrees == Some(true)
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
        let failure = {
            let slot = self.database.read().unwrap_or_else(PoisonError::into_inner);
            let database = slot.as_ref()?;
            match contained(|| work(database)) {
                Ok(done) => return Some(done),
                Err(failure) => failure,
            }
        };
        match failure {
            Failure::Damaged(reason) => self.set_aside(&reason),
            // Not of an open file.
            Failure::InUse => {}
            Failure::Io(reason) => {
                self.tally.write_failures.one_more();
                tracing::warn!(folder = %self.folder.display(), reason, "the store on disk fails: on in memory");
                self.close();
            }
        }
        None
    }

    /// Closes the file for good.
    pub(super) fn close(&self) {
        let database = self.database.write().unwrap_or_else(PoisonError::into_inner).take();
        // redb writes when it is dropped.
        if contained(|| Ok(drop(database))).is_err() {
            tracing::warn!(folder = %self.folder.display(), "the store on disk was not closed cleanly");
        }
    }

    /// Keeps a damaged file for whoever wants to look at it, and begins anew.
    pub(super) fn set_aside(&self, reason: &str) {
        self.close();
        self.rename(reason);
        let database = self.database_at().ok();
        *self.database.write().unwrap_or_else(PoisonError::into_inner) = database;
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

/// A transaction after which a crash costs no long repair.
fn write(database: &Database) -> Result<redb::WriteTransaction, Failure> {
    let mut transaction = database.begin_write()?;
    transaction.set_quick_repair(true);
    Ok(transaction)
}

/// The tables in one transaction.
struct Tables<'t> {
    records: redb::Table<'t, &'static [u8], &'static [u8]>,
    used: redb::Table<'t, &'static [u8], (u64, u64)>,
    meta: redb::Table<'t, &'static str, u64>,
    clock: u64,
    bytes: u64,
}

impl<'t> Tables<'t> {
    fn of(transaction: &'t redb::WriteTransaction) -> Result<Self, Failure> {
        let records = transaction.open_table(RECORDS)?;
        let used = transaction.open_table(USED)?;
        let meta = transaction.open_table(META)?;
        let number =
            |name: &str| -> Result<u64, StorageError> { Ok(meta.get(name)?.map_or(0, |n| n.value())) };
        let (clock, bytes) = (number(CLOCK)? + 1, number(BYTES)?);
        Ok(Self { records, used, meta, clock, bytes })
    }

    fn insert(&mut self, key: &Key, bytes: &[u8]) -> Result<(), Failure> {
        let key = key.to_bytes();
        self.remove(&key)?;
        self.records.insert(&key[..], bytes)?;
        self.used.insert(&key[..], (self.clock, bytes.len() as u64))?;
        self.bytes += bytes.len() as u64 + OVERHEAD;
        Ok(())
    }

    fn remove(&mut self, key: &[u8]) -> Result<(), Failure> {
        self.records.remove(key)?;
        if let Some(old) = self.used.remove(key)? {
            self.bytes = self.bytes.saturating_sub(old.value().1 + OVERHEAD);
        }
        Ok(())
    }

    fn touch(&mut self, key: &Key) -> Result<(), Failure> {
        let key = key.to_bytes();
        let length = self.used.get(&key[..])?.map(|used| used.value().1);
        if let Some(length) = length {
            self.used.insert(&key[..], (self.clock, length))?;
        }
        Ok(())
    }

    /// What records may take in a file of some length, so that it keeps a budget.
    fn limit(&self, budget: u64, length: u64) -> Result<u64, Failure> {
        let most = budget as f64 * SHARE;
        let grown_at = self.meta.get(GROWN_AT)?.map(|bytes| bytes.value() as f64);
        let may_grow = length as f64 * GROWTH <= budget as f64;
        Ok(grown_at.filter(|_| !may_grow).map_or(most, |bytes| most.min(bytes * ROOM)) as u64)
    }

    /// Above a limit: takes out the least recently used until no more than `goal` bytes are left.
    fn evict_above(&mut self, limit: u64, goal: u64) -> Result<Vec<Key>, Failure> {
        if self.bytes <= limit {
            return Ok(Vec::new());
        }
        let mut all = Vec::new();
        for entry in self.used.iter()? {
            let (key, value) = entry?;
            let (stamp, bytes) = value.value();
            all.push((stamp, bytes, key.value().to_vec()));
        }
        all.sort_unstable();
        let mut evicted = Vec::new();
        for (_, _, key) in all {
            if self.bytes <= goal {
                break;
            }
            self.remove(&key)?;
            evicted.extend(Key::from_bytes(&key));
        }
        Ok(evicted)
    }

    fn finish(&mut self) -> Result<(), Failure> {
        self.meta.insert(CLOCK, self.clock)?;
        self.meta.insert(BYTES, self.bytes)?;
        Ok(())
    }
}

/// How many bytes of records there are of each kind, in the order of [`Kind::ALL`].
pub(super) fn by_kind(list: &[Listed]) -> Vec<(u64, u64)> {
    let of = |kind: Kind| {
        let listed = list.iter().filter(|l| l.key.kind() == kind);
        listed.fold((0, 0), |(entries, bytes), l| (entries + 1, bytes + l.bytes))
    };
    Kind::ALL.into_iter().map(of).collect()
}
