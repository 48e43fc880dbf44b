//! The tables in the file of records, and what one transaction does with them.

use std::collections::{BTreeMap, HashMap};
use std::io::ErrorKind;
use std::ops::RangeBounds;

use redb::{Database, ReadableDatabase, ReadableTable, ReadableTableMetadata, StorageError, TableDefinition};

use super::key::RecordKey;
use super::kind::RecordKind;
use super::stored::StoredTally;

/// Envelopes by key.
const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
/// When a record was used last, and how long it is.
const USED: TableDefinition<'_, &[u8], (u64, u64)> = TableDefinition::new("used");
/// The same of the records that are files.
const FILES: TableDefinition<'_, &[u8], (u64, u64)> = TableDefinition::new("files");
/// The count of transactions and of bytes, and how many bytes there were when the file last grew.
const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");
const GROWN_AT: &str = "grown_at";
const CLOCK: &str = "clock";
const BYTES: &str = "bytes";

/// Bytes that a record takes in the file beside its own, about: keys, stamps, and pages that are not full.
const OVERHEAD: u64 = 160;
/// Records take at most this share of the budget: pages are not full, and a transaction writes new pages
/// before old ones are free.
const SHARE: f64 = 0.5;
/// redb grows its file by this factor, about. If it is too small here, the file exceeds its budget.
const GROWTH: f64 = 2.2;
/// After the file grew, it has room for this many times the records that it had then. If it is too large here, the
/// file grows again, beyond its budget.
const ROOM: f64 = 1.4;

/// A record, as [`Cache::list`](super::Cache::list) returns it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listed {
    /// Its key.
    pub key: RecordKey,
    /// Its length with the envelope, in bytes.
    pub bytes: u64,
    /// The transaction in or before which it was used last.
    pub used: u64,
}

impl Listed {
    /// How many there are of each kind in a list, and their bytes.
    pub(super) fn tally(list: &[Self]) -> StoredTally {
        StoredTally::of(list.iter().map(|listed| (listed.key.kind().number, listed.bytes)))
    }

    /// Bytes that it takes on disk, about.
    pub(super) fn cost(&self) -> u64 {
        self.bytes.saturating_add(OVERHEAD)
    }
}

/// What a transaction failed with.
#[derive(Debug)]
pub(super) enum DiskFailure {
    /// Another process has the file.
    InUse,
    /// The system refused to read or write.
    Io(String),
    /// The file is not what was written to it.
    Damaged(String),
}

const DAMAGE: [ErrorKind; 3] = [ErrorKind::UnexpectedEof, ErrorKind::InvalidData, ErrorKind::InvalidInput];

impl<E: Into<redb::Error>> From<E> for DiskFailure {
    fn from(error: E) -> Self {
        let error = error.into();
        match &error {
            redb::Error::DatabaseAlreadyOpen | redb::Error::LockProtocolMismatch => Self::InUse,
            // The file refers to something that is not there.
            redb::Error::Io(e) if DAMAGE.contains(&e.kind()) => Self::Damaged(error.to_string()),
            redb::Error::Io(_) | redb::Error::PreviousIo => Self::Io(error.to_string()),
            _ => Self::Damaged(error.to_string()),
        }
    }
}

/// A transaction after which a crash costs no long repair.
pub(super) fn write(database: &Database) -> Result<redb::WriteTransaction, DiskFailure> {
    let mut transaction = database.begin_write()?;
    transaction.set_quick_repair(true);
    Ok(transaction)
}

/// The tables in one transaction.
pub(super) struct StoreTables<'t> {
    kinds: &'t [&'static RecordKind],
    records: redb::Table<'t, &'static [u8], &'static [u8]>,
    used: redb::Table<'t, &'static [u8], (u64, u64)>,
    files: redb::Table<'t, &'static [u8], (u64, u64)>,
    meta: redb::Table<'t, &'static str, u64>,
    clock: u64,
    pub(super) bytes: u64,
    /// What the transaction changes.
    changes: StoredTally,
}

impl<'t> StoreTables<'t> {
    pub(super) fn of(
        transaction: &'t redb::WriteTransaction,
        kinds: &'t [&'static RecordKind],
    ) -> Result<Self, DiskFailure> {
        let records = transaction.open_table(RECORDS)?;
        let used = transaction.open_table(USED)?;
        let files = transaction.open_table(FILES)?;
        let meta = transaction.open_table(META)?;
        let number =
            |name: &str| -> Result<u64, StorageError> { Ok(meta.get(name)?.map_or(0, |n| n.value())) };
        let (clock, bytes) = (number(CLOCK)? + 1, number(BYTES)?);
        Ok(Self { kinds, records, used, files, meta, clock, bytes, changes: StoredTally::default() })
    }

    pub(super) fn insert(&mut self, key: &RecordKey, bytes: &[u8]) -> Result<(), DiskFailure> {
        let key = key.to_bytes();
        self.remove(&key)?;
        self.records.insert(&key[..], bytes)?;
        self.used.insert(&key[..], (self.clock, bytes.len() as u64))?;
        self.bytes += bytes.len() as u64 + OVERHEAD;
        self.changes.add(key[0], bytes.len() as u64);
        Ok(())
    }

    pub(super) fn remove(&mut self, key: &[u8]) -> Result<(), DiskFailure> {
        self.records.remove(key)?;
        if let Some(old) = self.used.remove(key)? {
            let bytes = old.value().1;
            self.bytes = self.bytes.saturating_sub(bytes.saturating_add(OVERHEAD));
            self.changes.take(key[0], bytes);
        }
        Ok(())
    }

    pub(super) fn touch(&mut self, key: &RecordKey) -> Result<(), DiskFailure> {
        let table = if key.kind().files().is_some() { &mut self.files } else { &mut self.used };
        let key = key.to_bytes();
        let length = table.get(&key[..])?.map(|used| used.value().1);
        if let Some(length) = length {
            table.insert(&key[..], (self.clock, length))?;
        }
        Ok(())
    }

    /// Notes a file that was written.
    pub(super) fn insert_file(&mut self, key: &RecordKey, bytes: u64) -> Result<(), DiskFailure> {
        self.remove_file(key)?;
        self.files.insert(&key.to_bytes()[..], (self.clock, bytes))?;
        self.changes.add(key.kind().number, bytes);
        Ok(())
    }

    /// Takes a file out; it is still in its folder.
    pub(super) fn remove_file(&mut self, key: &RecordKey) -> Result<(), DiskFailure> {
        if let Some(old) = self.files.remove(&key.to_bytes()[..])? {
            self.changes.take(key.kind().number, old.value().1);
        }
        Ok(())
    }

    /// Takes out the files used least recently while there are more bytes than `limit`.
    pub(super) fn evict_files_above(&mut self, limit: u64) -> Result<Vec<RecordKey>, DiskFailure> {
        let mut files = listed_in(&self.files, self.kinds, ..)?;
        files.sort_by_key(|file| (file.used, file.key.to_bytes()));
        let mut bytes: u64 = files.iter().map(|file| file.bytes).sum();
        let mut evicted = Vec::new();
        for Listed { key, bytes: freed, .. } in files {
            if bytes <= limit {
                break;
            }
            self.remove_file(&key)?;
            bytes -= freed;
            evicted.push(key);
        }
        Ok(evicted)
    }

    /// Bytes that records may take in a file of some length, so that it keeps a budget.
    pub(super) fn limit(&self, budget: u64, length: u64) -> Result<u64, DiskFailure> {
        let most = budget as f64 * SHARE;
        let grown_at = self.meta.get(GROWN_AT)?.map(|bytes| bytes.value() as f64);
        let may_grow = length as f64 * GROWTH <= budget as f64;
        Ok(grown_at.filter(|_| !may_grow).map_or(most, |bytes| most.min(bytes * ROOM)) as u64)
    }

    /// Above a limit: takes out the least recently used until no more than `goal` bytes are left.
    pub(super) fn evict_above(&mut self, limit: u64, goal: u64) -> Result<Vec<RecordKey>, DiskFailure> {
        if self.bytes <= limit {
            return Ok(Vec::new());
        }
        // Bytes by last use first, so that only records that are evicted are collected.
        let mut by_stamp: BTreeMap<u64, u64> = BTreeMap::new();
        for entry in self.used.iter()? {
            let (stamp, bytes) = entry?.1.value();
            let sum = by_stamp.entry(stamp).or_default();
            *sum = sum.saturating_add(bytes).saturating_add(OVERHEAD);
        }
        let mut surplus = self.bytes.saturating_sub(goal);
        let last = by_stamp.into_iter().find_map(|(stamp, bytes)| {
            surplus = surplus.saturating_sub(bytes);
            (surplus == 0).then_some(stamp)
        });
        let mut oldest = Vec::new();
        for entry in self.used.iter()? {
            let (key, value) = entry?;
            let (stamp, _) = value.value();
            if last.is_none_or(|last| stamp <= last) {
                oldest.push((stamp, key.value().to_vec()));
            }
        }
        oldest.sort_unstable();
        let mut evicted = Vec::new();
        for (_, key) in oldest {
            if self.bytes <= goal {
                break;
            }
            self.remove(&key)?;
            evicted.extend(RecordKey::from_bytes(self.kinds, &key));
        }
        Ok(evicted)
    }

    /// Closes the tables; what changed, if the transaction is committed.
    pub(super) fn finish(mut self) -> Result<StoredTally, DiskFailure> {
        self.meta.insert(CLOCK, self.clock)?;
        self.meta.insert(BYTES, self.bytes)?;
        Ok(self.changes)
    }
}

/// Makes the tables, unless they are there, and notes exactly the files that are there: a writer may have been killed
/// between a file and its note, and anybody may have removed a file.
pub(super) fn make_tables(
    database: &Database,
    kinds: &[&'static RecordKind],
    files: &[(RecordKey, u64)],
) -> Result<(), DiskFailure> {
    let transaction = write(database)?;
    // One after the other: redb may panic when it opens a table of a damaged file. If it then drops another open table,
    // it panics again, which ends the process.
    transaction.open_table(RECORDS)?;
    transaction.open_table(USED)?;
    let clock = transaction.open_table(META)?.get(CLOCK)?.map_or(0, |clock| clock.value());
    let mut table = transaction.open_table(FILES)?;
    let noted: HashMap<RecordKey, u64> =
        listed_in(&table, kinds, ..)?.iter().map(|l| (l.key, l.bytes)).collect();
    let there: HashMap<RecordKey, u64> = files.iter().copied().collect();
    for key in noted.keys().filter(|key| !there.contains_key(key)) {
        table.remove(&key.to_bytes()[..])?;
    }
    for (key, bytes) in there.iter().filter(|(key, bytes)| noted.get(key) != Some(bytes)) {
        table.insert(&key.to_bytes()[..], (clock, *bytes))?;
    }
    drop(table);
    Ok(transaction.commit()?)
}

/// Notes how many bytes of records there were when the file had grown.
pub(super) fn grew(database: &Database, bytes: u64) -> Result<(), DiskFailure> {
    let transaction = write(database)?;
    transaction.open_table(META)?.insert(GROWN_AT, bytes)?;
    Ok(transaction.commit()?)
}

/// The envelopes of keys, in one transaction.
pub(super) fn read(database: &Database, keys: &[RecordKey]) -> Result<Vec<Option<Vec<u8>>>, DiskFailure> {
    let records = database.begin_read()?.open_table(RECORDS)?;
    let of = |key: &RecordKey| -> Result<Option<Vec<u8>>, DiskFailure> {
        Ok(records.get(&key.to_bytes()[..])?.map(|bytes| bytes.value().to_vec()))
    };
    keys.iter().map(of).collect()
}

/// The records of one kind, or of all, in the order of their keys.
pub(super) fn listed(
    database: &Database,
    kinds: &[&'static RecordKind],
    kind: Option<&RecordKind>,
) -> Result<Vec<Listed>, DiskFailure> {
    let transaction = database.begin_read()?;
    let (from, to) = kind.map_or((0, u8::MAX), |kind| (kind.number, kind.number.saturating_add(1)));
    let range = &[from][..]..&[to][..];
    let mut out = listed_in(&transaction.open_table(USED)?, kinds, range.clone())?;
    out.extend(listed_in(&transaction.open_table(FILES)?, kinds, range)?);
    Ok(out)
}

fn listed_in<'k>(
    table: &impl ReadableTable<&'static [u8], (u64, u64)>,
    kinds: &[&'static RecordKind],
    range: impl RangeBounds<&'k [u8]> + 'k,
) -> Result<Vec<Listed>, DiskFailure> {
    let mut out = Vec::new();
    for entry in table.range(range)? {
        let (key, value) = entry?;
        let (used, bytes) = value.value();
        out.extend(RecordKey::from_bytes(kinds, key.value()).map(|key| Listed { key, bytes, used }));
    }
    Ok(out)
}

/// Whether the tables agree with each other, and have every key once.
pub(super) fn agree(database: &Database) -> Result<bool, DiskFailure> {
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
}
