//! The store from outside: it comes back after being closed, killed, or damaged, and keeps its budgets.

use std::collections::HashMap;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use super::*;

const SOURCES: Validity = Validity::Sources("these");
pub(super) static RECORDS: RecordKind =
    RecordKind::of::<Vec<bool>>(1, "records", Storage::MemoryAndDisk, SOURCES);
pub(super) static OTHER: RecordKind = RecordKind::of::<u8>(2, "other", Storage::MemoryAndDisk, SOURCES);
pub(super) static INDEXED: RecordKind = RecordKind::of::<u8>(3, "indexed", Storage::IndexedDisk, SOURCES);
static ON_DISK: RecordKind = RecordKind::of::<u8>(4, "on disk", Storage::Disk, SOURCES);
pub(super) static VERSIONED: RecordKind =
    RecordKind::of::<u8>(5, "versioned", Storage::MemoryAndDisk, Validity::Format(3));
pub(super) static FILES: RecordKind = RecordKind {
    number: 6,
    name: "files",
    storage: Storage::Files { folder: "blobs", extension: "blob" },
    validity: SOURCES,
    is_content: is_blob,
};
pub(super) static KINDS: [&RecordKind; 6] = [&RECORDS, &OTHER, &INDEXED, &ON_DISK, &VERSIONED, &FILES];

/// Bytes that are all as the first of the hash, after their number. It grows.
pub(super) struct Blob {
    length: AtomicUsize,
    written: AtomicUsize,
}

impl Blob {
    pub(super) fn of(length: usize) -> Arc<Self> {
        Arc::new(Self { length: AtomicUsize::new(length), written: AtomicUsize::new(0) })
    }
}

impl FileSource for Blob {
    fn memory(&self) -> usize {
        self.length.load(Ordering::Relaxed)
    }

    fn is_unwritten(&self) -> bool {
        self.written.load(Ordering::Relaxed) < self.memory()
    }

    fn write(&self, hash: &[u8; 32], out: &mut dyn Write) -> io::Result<usize> {
        let length = self.memory();
        out.write_all(&length.to_le_bytes())?;
        out.write_all(&vec![hash[0]; length])?;
        Ok(length)
    }

    fn is_written(&self, amount: usize) {
        self.written.fetch_max(amount, Ordering::Relaxed);
    }
}

fn is_blob(hash: &[u8; 32], bytes: &[u8]) -> bool {
    bytes.split_first_chunk().is_some_and(|(length, blob)| {
        usize::from_le_bytes(*length) == blob.len() && blob.iter().all(|byte| *byte == hash[0])
    })
}

/// Set for a process that a test starts to be killed: the folder that it writes to.
const VICTIM: &str = "SBDP_TEST_CACHE_VICTIM";
/// How often the kill test kills.
const KILLS: &str = "SBDP_TEST_KILLS";

fn settings(folder: &Path) -> CacheSettings {
    CacheSettings { folder: Some(folder.to_owned()), memory_bytes: 1 << 20, disk_bytes: 64 << 20 }
}

fn open_as(settings: &CacheSettings) -> Result<Cache, DiskError> {
    Cache::open(settings, &KINDS)
}

fn open(folder: &Path) -> Cache {
    open_as(&settings(folder)).unwrap()
}

/// A key of any kind but the last, which has files.
fn key(n: u64) -> RecordKey {
    Digest::new().integer(n).key(KINDS[n as usize % (KINDS.len() - 1)])
}

/// Some record that only `n` has.
fn record(n: u64, length: usize) -> Vec<bool> {
    (0..length as u64 + n % 7).map(|i| (n.wrapping_mul(i + 11) >> 3).is_multiple_of(2)).collect()
}

fn has(cache: &Cache, n: u64, length: usize) -> bool {
    let found = cache.get::<Vec<bool>>(&key(n));
    assert!(found.as_ref().is_none_or(|r| *r == record(n, length)), "another record than was written");
    found.is_some()
}

fn file(folder: &Path) -> std::path::PathBuf {
    folder.join("records.redb")
}

#[test]
fn what_was_remembered_is_there_after_a_restart() {
    let folder = tempfile::tempdir().unwrap();
    let cache = open(folder.path());
    (0..100).for_each(|n| cache.put(key(n), &record(n, 20)));
    drop(cache);
    let cache = open(folder.path());
    assert!((0..100).all(|n| has(&cache, n, 20)) && !has(&cache, 100, 20));
    let s = cache.statistics();
    assert_eq!(
        s.kinds.iter().map(|k| (k.hits, k.disk_entries)).fold((0, 0), |(a, b), (c, d)| (a + c, b + d)),
        (100, 100)
    );
    assert_eq!(s.kinds.iter().map(|k| k.misses).sum::<u64>(), 1);
    assert!(cache.verify().clean);
}

/// A mesh of some millions of triangles.
#[test]
fn a_record_may_be_larger_than_all_that_may_wait() {
    let folder = tempfile::tempdir().unwrap();
    let settings = CacheSettings { disk_bytes: 1 << 30, ..settings(folder.path()) };
    let large = 80 << 20;
    let cache = open_as(&settings).unwrap();
    cache.put(key(0), &record(0, large));
    drop(cache);
    let cache = open_as(&settings).unwrap();
    assert!(has(&cache, 0, large), "nothing had waited before it");
}

#[test]
fn a_second_process_gets_the_error_that_the_store_is_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let first = open(folder.path());
    assert!(matches!(open_as(&settings(folder.path())), Err(DiskError::InUse(_))));
    drop(first);
    assert!(open(folder.path()).is_on_disk());
}

#[test]
fn a_folder_that_cannot_be_made_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    let below = settings(&folder.path().join("file/below"));
    assert!(matches!(open_as(&below), Err(DiskError::Unusable { .. })));
}

/// Bytes of a record change where the database does not look: it is a miss and replaced.
#[test]
fn a_damaged_record_is_a_counted_miss_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let n = 0;
    let cache = open(folder.path());
    cache.put(key(n), &record(n, 30));
    cache.flush();
    let disk = cache.disk.as_ref().unwrap();
    let mut bytes = disk.get(&key(n)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    disk.write(&[(key(n), bytes)], &HashMap::new());
    cache.memory().clear();
    assert!(!has(&cache, n, 30));
    assert_eq!(cache.statistics().kinds[0].damaged, 1);
    cache.put(key(n), &record(n, 30));
    cache.flush();
    cache.memory().clear();
    assert!(has(&cache, n, 30));
    let damaged = vec![0; 50];
    disk.write(&[(key(n), damaged)], &HashMap::new());
    assert_eq!(cache.verify(), Verified { records: 1, damaged: 1, clean: true });
    assert_eq!(cache.verify(), Verified { records: 0, damaged: 0, clean: true });
}

#[test]
fn a_file_that_is_no_store_is_set_aside() {
    let folder = tempfile::tempdir().unwrap();
    for content in [&b"something else"[..], &[0xa5; 100_000]] {
        std::fs::write(file(folder.path()), content).unwrap();
        let cache = open(folder.path());
        assert_eq!(cache.statistics().set_aside, 1);
        cache.put(key(0), &record(0, 5));
        cache.flush();
        assert!(cache.verify().clean && cache.is_on_disk());
        assert_eq!(std::fs::read(folder.path().join("records.redb.damaged")).unwrap(), content);
        drop(cache);
        assert!(has(&open(folder.path()), 0, 5));
    }
}

/// Whatever is damaged in the file, no wrong record comes out, nothing panics, and in the end there is a
/// store that works.
#[test]
fn a_file_damaged_anywhere_gives_no_wrong_record() {
    let folder = tempfile::tempdir().unwrap();
    let whole = {
        let cache = open(folder.path());
        (0..300).for_each(|n| cache.put(key(n), &record(n, 100)));
        drop(cache);
        std::fs::read(file(folder.path())).unwrap()
    };
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut below = |n: usize| {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (random >> 33) as usize % n
    };
    for round in 0..40 {
        std::fs::write(file(folder.path()), &whole).unwrap();
        let damaged = std::fs::OpenOptions::new().write(true).open(file(folder.path())).unwrap();
        if round % 8 == 7 {
            damaged.set_len(below(whole.len()) as u64).unwrap();
        } else {
            for _ in 0..20 {
                let garbage: Vec<u8> = (0..64).map(|_| below(256) as u8).collect();
                damaged.write_all_at(&garbage, below(whole.len()) as u64).unwrap();
            }
        }
        drop(damaged);
        let cache = open_as(&settings(folder.path())).unwrap_or_else(|e| panic!("round {round}: {e}"));
        for n in 0..300 {
            has(&cache, n, 100);
            cache.put(key(n), &record(n, 100));
        }
        cache.flush();
        cache.memory().clear();
        let _first = cache.verify();
        (0..300).for_each(|n| cache.put(key(n), &record(n, 100)));
        cache.flush();
        cache.memory().clear();
        assert!((0..300).all(|n| has(&cache, n, 100)), "round {round}");
        assert_eq!(cache.verify(), Verified { records: 300, damaged: 0, clean: true }, "round {round}");
    }
}

#[test]
fn memory_and_disk_keep_their_budgets() {
    let folder = tempfile::tempdir().unwrap();
    let budget = 32 << 20;
    let cache = open_as(&CacheSettings { disk_bytes: budget, ..settings(folder.path()) }).unwrap();
    let mut largest = 0;
    for n in 0..20_000u64 {
        let length = 100 + (n as usize * 37) % 8000;
        cache.put(key(n), &record(n, length));
        if n % 500 == 499 {
            cache.flush();
            let s = cache.statistics();
            assert!(s.memory_bytes <= 1 << 20, "{s:?}");
            largest = largest.max(s.file_bytes);
        }
    }
    assert!(largest <= budget, "the file had {largest} bytes");
    let s = cache.statistics();
    let left = |(kind, k): (&&RecordKind, &KindStatistics)| {
        k.disk_evictions > 0 && (k.evictions > 0 || !kind.stays_in_memory()) || kind.files().is_some()
    };
    assert!(KINDS.iter().zip(&s.kinds).all(left), "{s:?}");
    assert_eq!(s.overflows, 0);
    assert_counted(&cache);
    // The last one is there.
    assert!(has(&cache, 19_999, 100 + (19_999 * 37) % 8000));
    assert!(cache.verify().clean);
}

#[test]
fn what_is_used_stays_on_disk_while_others_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let cache = open_as(&CacheSettings { disk_bytes: 16 << 20, ..settings(folder.path()) }).unwrap();
    for n in 0..8000 {
        cache.put(key(n), &record(n, 2000));
        // From memory, but it counts as used on disk, too.
        assert!(has(&cache, 0, 2000));
        if n % 100 == 0 {
            cache.flush();
        }
    }
    cache.flush();
    cache.memory().clear();
    assert!(has(&cache, 0, 2000) && !has(&cache, 1, 2000));
}

/// What is counted without a look at the disk is what is there.
fn assert_counted(cache: &Cache) {
    cache.flush();
    let list = cache.list();
    for (kind, statistics) in KINDS.iter().zip(cache.statistics().kinds) {
        let bytes: Vec<u64> = list.iter().filter(|l| l.key.kind() == *kind).map(|l| l.bytes).collect();
        let counted = (statistics.disk_entries, statistics.disk_bytes);
        assert_eq!(counted, (bytes.len() as u64, bytes.iter().sum()), "{kind:?}");
    }
}

#[test]
fn records_on_disk_are_counted_as_they_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let cache = open(folder.path());
    assert_counted(&cache);
    (0..300).for_each(|n| cache.put(key(n), &record(n, 2000)));
    assert_counted(&cache);
    // Others with the same keys.
    (0..100).for_each(|n| cache.put(key(n), &record(n, 500)));
    assert_counted(&cache);
    assert!(cache.evict(200_000) > 0);
    assert_counted(&cache);
    cache.remove(&[key(299), key(1_000_000)]);
    assert_counted(&cache);
    drop(cache);
    let cache = open(folder.path());
    assert!(cache.statistics().disk_records() > 0);
    assert_counted(&cache);
}

#[test]
fn evicting_leaves_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let cache = open(folder.path());
    (0..1000).for_each(|n| cache.put(key(n), &record(n, 2000)));
    cache.flush();
    let before = cache.statistics().file_bytes;
    assert!(cache.evict(500_000) > 500);
    let listed: u64 = cache.list().iter().map(|l| l.bytes).sum();
    assert!(listed > 300_000 && listed <= 500_000, "{listed}");
    assert!(cache.statistics().file_bytes < before);
    let left = cache.list().len();
    assert_eq!((cache.evict(0), cache.list().len()), (left, 0));
}

/// A process that writes is killed at any moment: the store opens, and holds nothing that is half.
#[test]
fn a_store_survives_being_killed() {
    if let Some(folder) = std::env::var_os(VICTIM) {
        write_for_ever(Path::new(&folder));
    }
    let folder = tempfile::tempdir().unwrap();
    let kills: u64 = std::env::var(KILLS).ok().and_then(|n| n.parse().ok()).unwrap_or(10);
    let (mut most, mut most_files, mut most_blobs) = (0, 0, [false; BLOBS as usize]);
    for kill in 0..kills {
        let mut victim = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "cache::tests::a_store_survives_being_killed", "--nocapture"])
            .env(VICTIM, folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        // From before it has opened the file until many transactions later.
        std::thread::sleep(Duration::from_millis(20 + kill.wrapping_mul(7919) % 400));
        victim.kill().unwrap();
        victim.wait().unwrap();
        let cache = open(folder.path());
        let verified = cache.verify();
        assert!(verified.clean && verified.damaged == 0, "kill {kill}: {verified:?}");
        assert_eq!(cache.statistics().set_aside, 0, "kill {kill}");
        assert!(verified.records >= most, "kill {kill}: committed records are gone");
        most = verified.records;
        let found = (0..WRITTEN).filter(|&n| has(&cache, n, 50)).count();
        let files = cache.list().iter().filter(|l| *l.key.kind() == FILES).count();
        assert_eq!(found + files, verified.records, "kill {kill}");
        assert!(files >= most_files, "kill {kill}: files are gone");
        most_files = files;
        for n in 0..BLOBS {
            let whole = cache.mapped(&blob_key(n), |mapping| is_blob(&[n; 32], &mapping).then_some(()));
            most_blobs[usize::from(n)] |= whole.is_some();
            assert_eq!(
                whole.is_some(),
                most_blobs[usize::from(n)],
                "kill {kill}: file {n} is gone or damaged"
            );
        }
        assert_eq!(cache.statistics().kinds[KINDS.len() - 1].hits, files as u64, "kill {kill}");
    }
    assert!(most > 0 && most_files > 0, "none lived long enough to write");
}

/// Different records that the killed process writes.
const WRITTEN: u64 = 2000;

/// Different files that it writes.
const BLOBS: u8 = 20;

fn blob_key(n: u8) -> RecordKey {
    RecordKey::new(&FILES, [n; 32])
}

/// Files are made, and grow, beside the records.
fn write_for_ever(folder: &Path) -> ! {
    let cache = open(folder);
    let blobs: Vec<_> = (0..BLOBS).map(|_| Blob::of(100_000)).collect();
    loop {
        for n in 0..WRITTEN {
            cache.put(key(n), &record(n, 50));
            if n % 20 == 0 {
                let which = (n / 20 % u64::from(BLOBS)) as u8;
                let blob = &blobs[usize::from(which)];
                blob.length.fetch_add(1000, Ordering::Relaxed);
                cache.keep_file_at_end(blob_key(which), blob.clone(), true);
                cache.flush();
            }
        }
    }
}
