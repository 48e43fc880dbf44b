//! How many records there are on disk, and their bytes, by kind: counted once when the file is opened, and kept up by
//! each transaction, so that asking does not wait for the disk.

use std::collections::HashMap;

use super::kind::RecordKind;

/// Records by the number of their kind; or by how much a transaction changes that.
#[derive(Debug, Default)]
pub(super) struct StoredTally(HashMap<u8, Stored>);

/// Of one kind. Changes may be negative.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Stored {
    records: i64,
    bytes: i64,
}

impl StoredTally {
    /// The count of records, each with the number of its kind and its bytes.
    pub(super) fn of(records: impl Iterator<Item = (u8, u64)>) -> Self {
        let mut tally = Self::default();
        records.for_each(|(number, bytes)| tally.add(number, bytes));
        tally
    }

    /// One record of a kind more.
    pub(super) fn add(&mut self, number: u8, bytes: u64) {
        self.change(number, Stored { records: 1, bytes: signed(bytes) });
    }

    /// One less.
    pub(super) fn take(&mut self, number: u8, bytes: u64) {
        self.change(number, Stored { records: -1, bytes: -signed(bytes) });
    }

    /// Adds what a transaction changed.
    pub(super) fn merge(&mut self, changes: &Self) {
        changes.0.iter().for_each(|(number, change)| self.change(*number, *change));
    }

    /// The records of a kind, and their bytes.
    pub(super) fn count(&self, kind: &RecordKind) -> (u64, u64) {
        let stored = self.0.get(&kind.number).copied().unwrap_or_default();
        (u64::try_from(stored.records).unwrap_or(0), u64::try_from(stored.bytes).unwrap_or(0))
    }

    fn change(&mut self, number: u8, change: Stored) {
        let stored = self.0.entry(number).or_default();
        // A damaged file may name any length.
        stored.records = stored.records.saturating_add(change.records);
        stored.bytes = stored.bytes.saturating_add(change.bytes);
    }
}

/// No record is as long as that.
fn signed(bytes: u64) -> i64 {
    i64::try_from(bytes).unwrap_or(i64::MAX)
}
