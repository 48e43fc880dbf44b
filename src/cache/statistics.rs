//! What the store holds and how it did; looking after it from outside (`sbdp cache`).

use serde::Serialize;

use super::disk::by_kind;
use super::{Cache, Kind, Listed, format};

/// How the store does.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct CacheStatistics {
    /// Whether there is a file that works.
    pub on_disk: bool,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of the files of distance fields.
    pub field_file_bytes: u64,
    /// Bytes of such files that are mapped: the system's, no memory of this process.
    pub mapped_bytes: u64,
    /// Bytes in memory: payloads and what is kept beside them.
    pub memory_bytes: u64,
    /// Records that were not written because too many waited, since the start.
    pub overflows: u64,
    /// Times that the file could not be written, since the start.
    pub write_failures: u64,
    /// Files that were set aside as damaged, since the start.
    pub set_aside: u64,
    /// By kind.
    pub kinds: Vec<KindStatistics>,
}

/// How one kind does; counts since the start.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KindStatistics {
    /// Its name.
    pub kind: &'static str,
    /// Records found.
    pub hits: u64,
    /// Records asked for and not found.
    pub misses: u64,
    /// Records in memory.
    pub entries: u64,
    /// Bytes of their payloads.
    pub bytes: u64,
    /// Records that left memory for others.
    pub evictions: u64,
    /// Records on disk, where they were counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disk_entries: Option<u64>,
    /// Their bytes, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disk_bytes: Option<u64>,
    /// Records that left the disk for others.
    pub disk_evictions: u64,
    /// Records found damaged, or of another version.
    pub damaged: u64,
}

/// What a check of the file found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verified {
    /// Records and files of fields that were looked at.
    pub records: usize,
    /// Of them, damaged or of another version, and taken out.
    pub damaged: usize,
    /// Whether the file itself was as its transactions left it.
    pub clean: bool,
}

impl Cache {
    /// Counts what there is; looks at every record's entry on disk.
    #[must_use]
    pub fn statistics(&self) -> CacheStatistics {
        let on_disk = by_kind(&self.list());
        let mut counters = self.counters();
        for (kind, (entries, bytes)) in counters.kinds.iter_mut().zip(on_disk) {
            (kind.disk_entries, kind.disk_bytes) = (Some(entries), Some(bytes));
        }
        counters
    }

    /// The same without counting what is on disk: at any time, at once.
    #[must_use]
    pub fn counters(&self) -> CacheStatistics {
        let memory = self.memory();
        let kind = |kind: Kind| {
            let (tally, held) = (self.tally.of(kind), memory.held(kind));
            KindStatistics {
                kind: kind.name(),
                hits: tally.hits.count(),
                misses: tally.misses.count(),
                entries: held.entries,
                bytes: held.bytes,
                evictions: tally.evictions.count(),
                disk_entries: None,
                disk_bytes: None,
                disk_evictions: tally.disk_evictions.count(),
                damaged: tally.damaged.count() + self.damaged_files(kind),
            }
        };
        CacheStatistics {
            on_disk: self.is_on_disk(),
            file_bytes: self.disk.as_ref().map_or(0, |d| d.file_bytes()),
            field_file_bytes: self.disk.as_ref().map_or(0, |d| d.fields.bytes()),
            mapped_bytes: self.disk.as_ref().map_or(0, |d| d.fields.mapped().bytes()),
            memory_bytes: memory.bytes() as u64,
            overflows: self.tally.overflows.count(),
            write_failures: self.tally.write_failures.count(),
            set_aside: self.tally.set_aside.count(),
            kinds: Kind::ALL.into_iter().map(kind).collect(),
        }
    }

    /// Files of a kind that were found damaged when they were used.
    fn damaged_files(&self, kind: Kind) -> u64 {
        let disk = self.disk.as_ref().filter(|_| kind.is_file());
        disk.map_or(0, |disk| disk.fields.mapped().damaged())
    }

    /// All records and files of fields on disk.
    #[must_use]
    pub fn list(&self) -> Vec<Listed> {
        self.disk.as_ref().and_then(|d| d.list(None)).unwrap_or_default()
    }

    /// Checks the file, every record in it and every file of a field, and takes damaged ones out.
    #[must_use]
    pub fn verify(&self) -> Verified {
        self.flush();
        let Some(disk) = &self.disk else { return Verified { records: 0, damaged: 0, clean: true } };
        let checked = disk.check(false).unwrap_or(false);
        let clean = disk.holds_together() && checked;
        let list = self.list();
        let intact = |l: &&Listed| match l.key.kind().is_file() {
            true => disk.fields.is_intact(&l.key),
            false => disk.get(&l.key).is_some_and(|bytes| format::opened(&l.key, &bytes).is_some()),
        };
        let damaged: Vec<_> = list.iter().filter(|l| !intact(l)).map(|l| l.key).collect();
        for key in &damaged {
            self.tally.of(key.kind()).damaged.one_more();
        }
        if !damaged.is_empty() {
            disk.remove(&damaged);
        }
        Verified { records: list.len(), damaged: damaged.len(), clean }
    }

    /// Takes out the records and files of fields used least recently until so many bytes are left, and gives
    /// unused space back; how many left.
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
