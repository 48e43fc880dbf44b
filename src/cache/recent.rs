//! What was used last before this process began, read in one look at the disk for each kind: one by one, as they
//! are asked for, records take several times as long.

use super::{Cache, Key, Kind, Listed, format};

/// Records of a kind that are read into memory.
const MOST: usize = 4096;
/// Of the budget in memory, what those of a kind may take.
const SHARE: usize = 32;

impl Cache {
    /// Reads into memory what is kept there and was used last. It does not count as used by this.
    pub fn recall_recent(&self) {
        let bytes = self.memory().budget() / SHARE;
        for kind in Kind::ALL.into_iter().filter(|kind| kind.stays_in_memory()) {
            for (key, payload) in self.recent(kind, MOST, bytes as u64) {
                // What somebody asked for meanwhile is used later than this was.
                if !self.memory().has(&key) {
                    self.keep(key, payload.into());
                }
            }
        }
    }

    /// The records of a kind on disk, those used last first.
    pub(super) fn last_used_first(&self, kind: Kind) -> Vec<Listed> {
        let listed = self.disk.as_ref().and_then(|disk| disk.list(Some(kind)));
        let mut listed = listed.unwrap_or_default();
        listed.sort_by_key(|l| std::cmp::Reverse(l.used));
        listed
    }

    /// The payloads of a kind on disk that were used last, no more than so many with so many bytes in all; the
    /// last one used comes last.
    pub(super) fn recent(&self, kind: Kind, most: usize, bytes: u64) -> Vec<(Key, Vec<u8>)> {
        let Some(disk) = &self.disk else { return Vec::new() };
        let listed = self.last_used_first(kind);
        let mut left = bytes;
        let fits = |bytes: u64| {
            left = left.saturating_sub(bytes);
            left > 0
        };
        let bytes_of = listed.iter().take(most).map(|l| l.bytes);
        let count = bytes_of.map(fits).take_while(|fits| *fits).count();
        let keys: Vec<Key> = listed[..count].iter().rev().map(|l| l.key).collect();
        let envelopes = disk.get_all(&keys).unwrap_or_default();
        let payload =
            |(key, envelope): (Key, Option<Vec<u8>>)| Some((key, format::opened(&key, &envelope?)?.to_vec()));
        keys.into_iter().zip(envelopes).filter_map(payload).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::records::{OverlapRecord, TouchingRecord};
    use super::super::{CacheSettings, Digest};
    use super::*;

    fn key(n: u64) -> Key {
        Digest::new().integer(n).key(Kind::Overlap)
    }

    #[test]
    fn what_was_used_last_is_in_memory_again_as_far_as_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let of = |memory_bytes: usize| CacheSettings {
            folder: Some(folder.path().to_owned()),
            memory_bytes,
            disk_bytes: 64 << 20,
        };
        let touching = Digest::new().integer(1).key(Kind::Touching);
        let cache = Cache::open(&of(1 << 20)).unwrap();
        cache.put(touching, &TouchingRecord { normals: None });
        for n in 0..9 {
            cache.put(key(n), &OverlapRecord { depth: n as f64 });
            cache.flush();
        }
        drop(cache);
        let room_for_four = SHARE * (4 * (format::ENVELOPE + size_of::<f64>()) + 1);
        for (memory_bytes, least) in [(1 << 20, 0), (room_for_four, 5)] {
            let cache = Cache::open(&of(memory_bytes)).unwrap();
            assert_eq!(cache.memory_bytes(), 0);
            cache.recall_recent();
            for n in 0..9 {
                assert_eq!(cache.memory().has(&key(n)), n >= least, "{n} of {memory_bytes} bytes");
            }
            assert!(cache.memory().has(&touching));
        }
        let cache = Cache::open(&of(1 << 20)).unwrap();
        cache.recall_recent();
        for n in 0..9 {
            assert_eq!(cache.get(&key(n)), Some(OverlapRecord { depth: n as f64 }));
        }
        let cache = Cache::in_memory(1 << 20);
        cache.recall_recent();
        assert_eq!(cache.memory_bytes(), 0, "without a disk there was nothing before");
    }
}
