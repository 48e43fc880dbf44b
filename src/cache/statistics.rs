//! What the store holds and counts, and maintenance from outside (`sbdp cache`).

use std::borrow::Cow;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Cache, Listed, RecordKind, envelope};

/// What the store holds and counts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheStatistics {
    /// Whether there is a store on disk that works.
    pub on_disk: bool,
    /// The folder of the store on disk.
    pub folder: Option<PathBuf>,
    /// Bytes of the file of records.
    pub file_bytes: u64,
    /// Bytes of the records that are files: distance fields, hence the name.
    pub field_file_bytes: u64,
    /// Bytes of such files that are mapped. They are no memory of this process.
    pub mapped_bytes: u64,
    /// Bytes in memory: payloads, keys and overhead.
    pub memory_bytes: u64,
    /// Records that were not written because too many waited, since the start.
    pub overflows: u64,
    /// Failures to write a file, since the start.
    pub write_failures: u64,
    /// Files that were set aside as damaged, since the start.
    pub set_aside: u64,
    /// By kind.
    pub kinds: Vec<KindStatistics>,
}

impl CacheStatistics {
    /// Records on disk, of all kinds.
    #[must_use]
    pub fn disk_records(&self) -> u64 {
        self.kinds.iter().map(|kind| kind.disk_entries).sum()
    }
}

/// What the store holds and counts of one kind, since the start.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct KindStatistics {
    /// The name of the kind.
    pub kind: Cow<'static, str>,
    /// Records found.
    pub hits: u64,
    /// Records asked for and not found.
    pub misses: u64,
    /// Records in memory.
    pub entries: u64,
    /// Bytes of their payloads.
    pub bytes: u64,
    /// Records that were evicted from memory.
    pub evictions: u64,
    /// Records on disk.
    pub disk_entries: u64,
    /// Bytes of the records on disk.
    pub disk_bytes: u64,
    /// Records that were evicted from disk.
    pub disk_evictions: u64,
    /// Records found damaged, or of another version.
    pub damaged: u64,
}

/// What a check of the store found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verified {
    /// Records that were checked.
    pub records: usize,
    /// Those that were damaged or of another version, and were taken out.
    pub damaged: usize,
    /// Whether the file of records was as its transactions left it.
    pub clean: bool,
}

impl Cache {
    /// What there is, and what was counted since the start. Does not wait for the disk.
    #[must_use]
    pub fn statistics(&self) -> CacheStatistics {
        let memory = self.memory();
        let kind = |kind: &&'static RecordKind| {
            let (tally, usage) = (&self.tally.kinds[*kind], memory.usage(kind));
            let (disk_entries, disk_bytes) = self.disk.as_ref().map_or((0, 0), |disk| disk.count_of(kind));
            KindStatistics {
                kind: kind.name.into(),
                hits: tally.hits.count(),
                misses: tally.misses.count(),
                entries: usage.entries,
                bytes: usage.bytes,
                evictions: tally.evictions.count(),
                disk_entries,
                disk_bytes,
                disk_evictions: tally.disk_evictions.count(),
                damaged: tally.damaged.count() + self.damaged_files(kind),
            }
        };
        CacheStatistics {
            on_disk: self.is_on_disk(),
            folder: self.disk.as_ref().map(|disk| disk.folder().to_owned()),
            file_bytes: self.disk.as_ref().map_or(0, |d| d.file_bytes()),
            field_file_bytes: self.disk.as_ref().map_or(0, |d| d.files.bytes()),
            mapped_bytes: self.disk.as_ref().map_or(0, |d| d.files.mapped().bytes()),
            memory_bytes: memory.bytes() as u64,
            overflows: self.tally.overflows.count(),
            write_failures: self.tally.write_failures.count(),
            set_aside: self.tally.set_aside.count(),
            kinds: self.kinds.iter().map(kind).collect(),
        }
    }

    /// If records of a kind are files: those that were found damaged when they were used.
    fn damaged_files(&self, kind: &RecordKind) -> u64 {
        let disk = self.disk.as_ref().filter(|_| kind.files().is_some());
        disk.map_or(0, |disk| disk.files.mapped().damaged())
    }

    /// All records on disk.
    #[must_use]
    pub fn list(&self) -> Vec<Listed> {
        self.disk.as_ref().and_then(|d| d.list(None)).unwrap_or_default()
    }

    /// Checks the file of records, each record in it and each record that is a file, and takes damaged ones out.
    #[must_use]
    pub fn verify(&self) -> Verified {
        self.flush();
        let Some(disk) = &self.disk else { return Verified { records: 0, damaged: 0, clean: true } };
        let checked = disk.check(false).unwrap_or(false);
        let clean = disk.holds_together() && checked;
        let list = self.list();
        let intact = |l: &&Listed| match l.key.kind().files() {
            Some(_) => disk.files.is_intact(&l.key),
            None => disk.get(&l.key).is_some_and(|bytes| envelope::opened(&l.key, &bytes).is_some()),
        };
        let damaged: Vec<_> = list.iter().filter(|l| !intact(l)).map(|l| l.key).collect();
        for key in &damaged {
            self.tally.kinds[key.kind()].damaged.one_more();
        }
        if !damaged.is_empty() {
            disk.remove(&damaged);
        }
        Verified { records: list.len(), damaged: damaged.len(), clean }
    }

    /// Evicts the least recently used records until no more than `bytes` are left, and gives unused space back; how many
    /// were evicted.
    #[must_use]
    pub fn evict(&self, bytes: u64) -> usize {
        self.flush();
        self.memory().clear();
        let Some(disk) = &self.disk else { return 0 };
        let evicted = disk.evict_all_above(bytes).unwrap_or(0);
        disk.check(true);
        evicted
    }
}
