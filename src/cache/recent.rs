//! Reads the records that were used last, in one look at the disk for each kind. One by one, when they are asked for,
//! records take several times as long.

use super::{Cache, Listed, RecordKey, RecordKind, Storable, envelope, record};

/// Records of a kind that are read into memory.
const MOST: usize = 4096;
/// The records of a kind that are read take at most one part in this many of the budget in memory.
const SHARE: usize = 32;

impl Cache {
    /// Reads into memory what is kept there and was used last. That is no use of it.
    pub fn recall_recent(&self) {
        let bytes = self.memory().budget() / SHARE;
        for kind in self.kinds.iter().copied().filter(|kind| kind.stays_in_memory()) {
            for (key, payload) in self.recent_payloads(kind, MOST, bytes as u64) {
                // A record that a request used meanwhile was used later.
                if !self.memory().has(&key) {
                    self.keep(key, payload.into());
                }
            }
        }
    }

    /// The records of a kind on disk, those used last first.
    #[must_use]
    pub fn last_used_first(&self, kind: &RecordKind) -> Vec<Listed> {
        let listed = self.disk.as_ref().and_then(|disk| disk.list(Some(kind)));
        let mut listed = listed.unwrap_or_default();
        listed.sort_by_key(|l| std::cmp::Reverse(l.used));
        listed
    }

    /// The records of a kind on disk that were used last, at most `most` and of at most `bytes`; the last one used comes
    /// last.
    #[must_use]
    pub fn recent<R: Storable>(&self, kind: &RecordKind, most: usize, bytes: u64) -> Vec<(RecordKey, R)> {
        let payloads = self.recent_payloads(kind, most, bytes).into_iter();
        payloads.filter_map(|(key, payload)| Some((key, record::decode(&payload)?))).collect()
    }

    fn recent_payloads(&self, kind: &RecordKind, most: usize, bytes: u64) -> Vec<(RecordKey, Vec<u8>)> {
        let Some(disk) = &self.disk else { return Vec::new() };
        let listed = self.last_used_first(kind);
        let mut left = bytes;
        let fits = |bytes: u64| {
            left = left.saturating_sub(bytes);
            left > 0
        };
        let bytes_of = listed.iter().take(most).map(|l| l.bytes);
        let count = bytes_of.map(fits).take_while(|fits| *fits).count();
        let keys: Vec<RecordKey> = listed[..count].iter().rev().map(|l| l.key).collect();
        let envelopes = disk.get_all(&keys).unwrap_or_default();
        let payload = |(key, bytes): (RecordKey, Option<Vec<u8>>)| {
            Some((key, envelope::opened(&key, &bytes?)?.to_vec()))
        };
        keys.into_iter().zip(envelopes).filter_map(payload).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{KINDS, OTHER, RECORDS};
    use super::super::{CacheSettings, Digest};
    use super::*;

    fn key(n: u64) -> RecordKey {
        Digest::new().integer(n).key(&RECORDS)
    }

    #[test]
    fn what_was_used_last_is_in_memory_again_as_far_as_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let of = |memory_bytes: usize| CacheSettings {
            folder: Some(folder.path().to_owned()),
            memory_bytes,
            disk_bytes: 64 << 20,
        };
        let open = |memory_bytes: usize| Cache::open(&of(memory_bytes), &KINDS).unwrap();
        let other = Digest::new().integer(1).key(&OTHER);
        let cache = open(1 << 20);
        cache.put(other, &0_u8);
        for n in 0..9 {
            cache.put(key(n), &n);
            cache.flush();
        }
        drop(cache);
        let room_for_four = SHARE * (4 * (envelope::ENVELOPE + size_of::<u64>()) + 1);
        for (memory_bytes, least) in [(1 << 20, 0), (room_for_four, 5)] {
            let cache = open(memory_bytes);
            assert_eq!(cache.memory_bytes(), 0);
            cache.recall_recent();
            for n in 0..9 {
                assert_eq!(cache.memory().has(&key(n)), n >= least, "{n} of {memory_bytes} bytes");
            }
            assert!(cache.memory().has(&other));
        }
        let cache = open(1 << 20);
        cache.recall_recent();
        for n in 0..9 {
            assert_eq!(cache.get(&key(n)), Some(n));
        }
        let cache = Cache::in_memory(1 << 20, &KINDS);
        cache.recall_recent();
        assert_eq!(cache.memory_bytes(), 0, "without a disk there was nothing before");
    }
}
