//! What stands in the file: three tables, and what one transaction does with them.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::ops::RangeBounds;

use redb::{Database, ReadableDatabase, ReadableTable, ReadableTableMetadata, StorageError, TableDefinition};

use super::kind::{Key, Kind};

/// Envelopes by key.
const RECORDS: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("records");
/// When a record was used last, and how long it is.
const USED: TableDefinition<'_, &[u8], (u64, u64)> = TableDefinition::new("used");
/// The count of transactions and of bytes, and how many bytes there were when the file last grew.
/// The files of fields: when one was used last, and how long it is.
const FILES: TableDefinition<'_, &[u8], (u64, u64)> = TableDefinition::new("files");
const META: TableDefinition<'_, &str, u64> = TableDefinition::new("meta");
const GROWN_AT: &str = "grown_at";
const CLOCK: &str = "clock";
const BYTES: &str = "bytes";

/// What a record takes in the file beside its bytes, about: keys, stamps, and pages that are not full.
const OVERHEAD: u64 = 160;
/// Of the budget, what records may take at most: pages are not full, and a transaction writes new ones
/// before old ones are free.
const SHARE: f64 = 0.5;
/// The file grows by this factor, about, …
const GROWTH: f64 = 2.2;
/// … and has room then for so many times as much as when it grew, surely.
const ROOM: f64 = 1.4;

/// A record, or the file of a field, as [`super::Cache::list`] tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listed {
    /// Its key.
    pub key: Key,
    /// Its length with the envelope, in bytes.
    pub bytes: u64,
    /// The transaction in or before which it was used last.
    pub used: u64,
}

impl Listed {
    /// What it takes on disk, about.
    pub(super) fn cost(&self) -> u64 {
        self.bytes + OVERHEAD
    }
}

/// What a transaction failed with.
#[derive(Debug)]
pub(super) enum Failure {
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

/// A transaction after which a crash costs no long repair.
pub(super) fn write(database: &Database) -> Result<redb::WriteTransaction, Failure> {
    let mut transaction = database.begin_write()?;
    transaction.set_quick_repair(true);
    Ok(transaction)
}

/// The tables in one transaction.
pub(super) struct Tables<'t> {
    records: redb::Table<'t, &'static [u8], &'static [u8]>,
    used: redb::Table<'t, &'static [u8], (u64, u64)>,
    files: redb::Table<'t, &'static [u8], (u64, u64)>,
    meta: redb::Table<'t, &'static str, u64>,
    clock: u64,
    pub(super) bytes: u64,
}

impl<'t> Tables<'t> {
    pub(super) fn of(transaction: &'t redb::WriteTransaction) -> Result<Self, Failure> {
        let records = transaction.open_table(RECORDS)?;
        let used = transaction.open_table(USED)?;
        let files = transaction.open_table(FILES)?;
        let meta = transaction.open_table(META)?;
        let number =
            |name: &str| -> Result<u64, StorageError> { Ok(meta.get(name)?.map_or(0, |n| n.value())) };
        let (clock, bytes) = (number(CLOCK)? + 1, number(BYTES)?);
        Ok(Self { records, used, files, meta, clock, bytes })
    }

    pub(super) fn insert(&mut self, key: &Key, bytes: &[u8]) -> Result<(), Failure> {
        let key = key.to_bytes();
        self.remove(&key)?;
        self.records.insert(&key[..], bytes)?;
        self.used.insert(&key[..], (self.clock, bytes.len() as u64))?;
        self.bytes += bytes.len() as u64 + OVERHEAD;
        Ok(())
    }

    pub(super) fn remove(&mut self, key: &[u8]) -> Result<(), Failure> {
        self.records.remove(key)?;
        if let Some(old) = self.used.remove(key)? {
            self.bytes = self.bytes.saturating_sub(old.value().1 + OVERHEAD);
        }
        Ok(())
    }

    pub(super) fn touch(&mut self, key: &Key) -> Result<(), Failure> {
        let table = if key.kind().is_file() { &mut self.files } else { &mut self.used };
        let key = key.to_bytes();
        let length = table.get(&key[..])?.map(|used| used.value().1);
        if let Some(length) = length {
            table.insert(&key[..], (self.clock, length))?;
        }
        Ok(())
    }

    /// Notes a file that was written.
    pub(super) fn insert_file(&mut self, key: &Key, bytes: u64) -> Result<(), Failure> {
        self.files.insert(&key.to_bytes()[..], (self.clock, bytes))?;
        Ok(())
    }

    /// Takes a file out; it is still in its folder.
    pub(super) fn remove_file(&mut self, key: &Key) -> Result<(), Failure> {
        self.files.remove(&key.to_bytes()[..])?;
        Ok(())
    }

    /// Takes out the files used least recently, for as long as there are more bytes than `limit`.
    pub(super) fn evict_files_above(&mut self, limit: u64) -> Result<Vec<Key>, Failure> {
        let mut files = listed_in(&self.files, ..)?;
        files.sort_by_key(|file| (file.used, file.key));
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

    /// What records may take in a file of some length, so that it keeps a budget.
    pub(super) fn limit(&self, budget: u64, length: u64) -> Result<u64, Failure> {
        let most = budget as f64 * SHARE;
        let grown_at = self.meta.get(GROWN_AT)?.map(|bytes| bytes.value() as f64);
        let may_grow = length as f64 * GROWTH <= budget as f64;
        Ok(grown_at.filter(|_| !may_grow).map_or(most, |bytes| most.min(bytes * ROOM)) as u64)
    }

    /// Above a limit: takes out the least recently used until no more than `goal` bytes are left.
    pub(super) fn evict_above(&mut self, limit: u64, goal: u64) -> Result<Vec<Key>, Failure> {
        if self.bytes <= limit {
            return Ok(Vec::new());
        }
        // By the transactions in which they were used: of the records, only those that leave are collected.
        let mut by_stamp: BTreeMap<u64, u64> = BTreeMap::new();
        for entry in self.used.iter()? {
            let (stamp, bytes) = entry?.1.value();
            *by_stamp.entry(stamp).or_default() += bytes + OVERHEAD;
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
            evicted.extend(Key::from_bytes(&key));
        }
        Ok(evicted)
    }

    pub(super) fn finish(&mut self) -> Result<(), Failure> {
        self.meta.insert(CLOCK, self.clock)?;
        self.meta.insert(BYTES, self.bytes)?;
        Ok(())
    }
}

/// Makes the tables, unless they are there, and notes exactly the files that are: a writer may have been killed
/// between a file and its note, and anybody may have removed one.
pub(super) fn make_tables(database: &Database, files: &[(Key, u64)]) -> Result<(), Failure> {
    let transaction = write(database)?;
    // One after the other: where a file is damaged, redb may panic when a table is opened, and would again, which
    // ends the process, when another one that is open is dropped for that.
    transaction.open_table(RECORDS)?;
    transaction.open_table(USED)?;
    let clock = transaction.open_table(META)?.get(CLOCK)?.map_or(0, |clock| clock.value());
    let mut table = transaction.open_table(FILES)?;
    let noted: BTreeMap<Key, u64> = listed_in(&table, ..)?.iter().map(|l| (l.key, l.bytes)).collect();
    let there: BTreeMap<Key, u64> = files.iter().copied().collect();
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
pub(super) fn grew(database: &Database, bytes: u64) -> Result<(), Failure> {
    let transaction = write(database)?;
    transaction.open_table(META)?.insert(GROWN_AT, bytes)?;
    Ok(transaction.commit()?)
}

/// The envelopes of keys, in one transaction.
pub(super) fn read(database: &Database, keys: &[Key]) -> Result<Vec<Option<Vec<u8>>>, Failure> {
    let records = database.begin_read()?.open_table(RECORDS)?;
    let of = |key: &Key| -> Result<Option<Vec<u8>>, Failure> {
        Ok(records.get(&key.to_bytes()[..])?.map(|bytes| bytes.value().to_vec()))
    };
    keys.iter().map(of).collect()
}

/// The records of a kind, or all, in the order of their keys.
pub(super) fn listed(database: &Database, kind: Option<Kind>) -> Result<Vec<Listed>, Failure> {
    let transaction = database.begin_read()?;
    let (from, to) = kind.map_or((0, u8::MAX), |kind| (kind as u8, kind as u8 + 1));
    let range = &[from][..]..&[to][..];
    let mut out = listed_in(&transaction.open_table(USED)?, range.clone())?;
    out.extend(listed_in(&transaction.open_table(FILES)?, range)?);
    Ok(out)
}

fn listed_in<'k>(
    table: &impl ReadableTable<&'static [u8], (u64, u64)>,
    range: impl RangeBounds<&'k [u8]> + 'k,
) -> Result<Vec<Listed>, Failure> {
    let mut out = Vec::new();
    for entry in table.range(range)? {
        let (key, value) = entry?;
        let (used, bytes) = value.value();
        out.extend(Key::from_bytes(key.value()).map(|key| Listed { key, bytes, used }));
    }
    Ok(out)
}

/// Whether the tables agree with each other, and have every key once.
pub(super) fn agree(database: &Database) -> Result<bool, Failure> {
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
