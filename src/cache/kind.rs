//! Kinds of records. The cache knows none: each stage declares its own next to its records, and a cache is opened with a
//! list of them.

use std::fmt;
use std::hash::{Hash, Hasher};
use std::ops::{Index, IndexMut};

use super::record::{Storable, is_record};

/// Where records of a kind are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Storage {
    /// In memory and on disk.
    MemoryAndDisk,
    /// On disk: the stage itself has in memory what it makes of them.
    Disk,
    /// On disk, with all keys in memory, so that [`Cache::contains`](super::Cache::contains) does not wait for the
    /// disk. For kinds with few records.
    IndexedDisk,
    /// Each in a file of its own beside the file of records, named by its hash.
    Files {
        /// The folder within the store's.
        folder: &'static str,
        /// The extension of the names.
        extension: &'static str,
    },
}

/// Which builds may use a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Validity {
    /// Builds with this hash of a stage's sources, which `src/build.rs` computes: it is part of the keys.
    Sources(&'static str),
    /// Builds that know this version of the record's format, whatever else they compute: the key is the hash of the
    /// content. To be raised with every change of the format.
    Format(u32),
}

/// A kind of record.
#[derive(Clone, Copy)]
pub struct RecordKind {
    /// From 1 to 254, as the format on disk has it. Two kinds are the same if their numbers are.
    pub number: u8,
    /// The name in statistics.
    pub name: &'static str,
    /// Where records are kept.
    pub storage: Storage,
    /// Which builds may use them.
    pub validity: Validity,
    /// Whether bytes are the payload of a record, or an intact file, under the hash of a key.
    pub is_content: fn(&[u8; 32], &[u8]) -> bool,
}

impl RecordKind {
    /// The kind of the records `R`.
    #[must_use]
    pub const fn of<R: Storable>(
        number: u8,
        name: &'static str,
        storage: Storage,
        validity: Validity,
    ) -> Self {
        Self { number, name, storage, validity, is_content: |_, payload| is_record::<R>(payload) }
    }

    /// The version of the format, as records have it; 0 where the key tells builds apart.
    pub(super) fn format(&self) -> u32 {
        match self.validity {
            Validity::Sources(_) => 0,
            Validity::Format(version) => version,
        }
    }

    pub(super) fn stays_in_memory(&self) -> bool {
        self.storage == Storage::MemoryAndDisk
    }

    pub(super) fn is_indexed(&self) -> bool {
        self.storage == Storage::IndexedDisk
    }

    /// The folder and the extension of its files, if it has files.
    pub(super) fn files(&self) -> Option<[&'static str; 2]> {
        match self.storage {
            Storage::Files { folder, extension } => Some([folder, extension]),
            _ => None,
        }
    }
}

impl PartialEq for RecordKind {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
    }
}

impl Eq for RecordKind {}

impl Hash for RecordKind {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.number.hash(state);
    }
}

impl fmt::Debug for RecordKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

/// A value for each kind that there can be, by number.
#[derive(Debug)]
pub(super) struct ByKind<T>([T; 256]);

impl<T: Default> Default for ByKind<T> {
    fn default() -> Self {
        Self(std::array::from_fn(|_| T::default()))
    }
}

impl<T> Index<&RecordKind> for ByKind<T> {
    type Output = T;

    fn index(&self, kind: &RecordKind) -> &T {
        &self.0[usize::from(kind.number)]
    }
}

impl<T> IndexMut<&RecordKind> for ByKind<T> {
    fn index_mut(&mut self, kind: &RecordKind) -> &mut T {
        &mut self.0[usize::from(kind.number)]
    }
}
