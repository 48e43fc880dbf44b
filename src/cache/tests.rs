//! The store from outside: it comes back after being closed, killed, or damaged, and keeps its budgets.

use std::collections::HashMap;
use std::os::unix::fs::FileExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use nalgebra::Point3;

use super::records::BlockingRecord;
use super::*;
use crate::fixtures::{ball, surface};
use crate::geometry::Surface;
use crate::sdf::{Estimate, Field, FieldStore};

/// Set for a process that a test starts to be killed: the folder that it writes to.
const VICTIM: &str = "SBDP_TEST_CACHE_VICTIM";
/// How often the kill test kills.
const KILLS: &str = "SBDP_TEST_KILLS";

/// Of what is a record: the last of all kinds is a file.
const KINDS: &[Kind] = Kind::ALL.split_last().unwrap().1;

fn settings(folder: &Path) -> CacheSettings {
    CacheSettings { folder: Some(folder.to_owned()), memory_bytes: 1 << 20, disk_bytes: 64 << 20 }
}

fn open(folder: &Path) -> Cache {
    Cache::open(&settings(folder)).unwrap()
}

fn key(n: u64) -> Key {
    Digest::new().integer(n).key(KINDS[n as usize % KINDS.len()])
}

/// Some record that only `n` has.
fn record(n: u64, length: usize) -> BlockingRecord {
    BlockingRecord {
        blocked: (0..length as u64 + n % 7)
            .map(|i| (n.wrapping_mul(i + 11) >> 3).is_multiple_of(2))
            .collect(),
    }
}

fn has(cache: &Cache, n: u64, length: usize) -> bool {
    let found = cache.get::<BlockingRecord>(&key(n));
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
        s.kinds
            .iter()
            .map(|k| (k.hits, k.disk_entries.unwrap()))
            .fold((0, 0), |(a, b), (c, d)| (a + c, b + d)),
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
    let cache = Cache::open(&settings).unwrap();
    cache.put(key(0), &record(0, large));
    drop(cache);
    let cache = Cache::open(&settings).unwrap();
    assert!(has(&cache, 0, large), "nothing had waited before it");
}

#[test]
fn a_second_process_is_told_that_the_store_is_in_use() {
    let folder = tempfile::tempdir().unwrap();
    let first = open(folder.path());
    assert!(matches!(Cache::open(&settings(folder.path())), Err(DiskError::InUse(_))));
    drop(first);
    assert!(open(folder.path()).is_on_disk());
}

#[test]
fn a_folder_that_cannot_be_made_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("file"), "").unwrap();
    let below = settings(&folder.path().join("file/below"));
    assert!(matches!(Cache::open(&below), Err(DiskError::Unusable { .. })));
}

/// Bytes of a record change where the database does not look: it is a miss and replaced.
#[test]
fn a_damaged_record_is_a_counted_miss_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let n = Kind::Blocking as u64 - 1;
    let cache = open(folder.path());
    cache.put(key(n), &record(n, 30));
    cache.flush();
    let disk = cache.disk.as_ref().unwrap();
    let mut bytes = disk.get(&key(n)).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    disk.write(&[(key(n), bytes)], &HashMap::new());
    cache.memory().clear();
    assert!(!has(&cache, n, 30));
    assert_eq!(cache.statistics().kinds[Kind::Blocking.index()].damaged, 1);
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
        let cache = Cache::open(&settings(folder.path())).unwrap_or_else(|e| panic!("round {round}: {e}"));
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
    let cache = Cache::open(&CacheSettings { disk_bytes: budget, ..settings(folder.path()) }).unwrap();
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
    let left = |(kind, k): (&Kind, &KindStatistics)| {
        k.disk_evictions > 0 && (k.evictions > 0 || !kind.stays_in_memory())
    };
    assert!(KINDS.iter().zip(&s.kinds).all(left), "{s:?}");
    assert_eq!(s.overflows, 0);
    // What came last is there.
    assert!(has(&cache, 19_999, 100 + (19_999 * 37) % 8000));
    assert!(cache.verify().clean);
}

#[test]
fn what_is_used_stays_on_disk_while_others_come_and_go() {
    let folder = tempfile::tempdir().unwrap();
    let cache = Cache::open(&CacheSettings { disk_bytes: 16 << 20, ..settings(folder.path()) }).unwrap();
    for n in 0..8000 {
        cache.put(key(n), &record(n, 2000));
        // From memory: the disk is to hear of it all the same.
        assert!(has(&cache, 0, 2000));
        if n % 100 == 0 {
            cache.flush();
        }
    }
    cache.flush();
    cache.memory().clear();
    assert!(has(&cache, 0, 2000) && !has(&cache, 1, 2000));
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
    let (mut most, mut most_files) = (0, 0);
    let surface = Arc::new(surface(ball(3)));
    let truth = said(&Field::of(&surface), 1.0);
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
        let cache = Arc::new(open(folder.path()));
        let verified = cache.verify();
        assert!(verified.clean && verified.damaged == 0, "kill {kill}: {verified:?}");
        assert_eq!(cache.statistics().set_aside, 0, "kill {kill}");
        assert!(verified.records >= most, "kill {kill}: committed records are gone");
        most = verified.records;
        let found = (0..WRITTEN).filter(|&n| has(&cache, n, 50)).count();
        let files = cache.list().iter().filter(|l| l.key.kind() == Kind::Field).count();
        assert_eq!(found + files, verified.records, "kill {kill}");
        assert!(files >= most_files, "kill {kill}: files are gone");
        most_files = files;
        for n in 0..FIELDS {
            let field = field(&cache, n, &surface);
            assert_eq!(said(&field, 1.0), truth, "kill {kill}: field {n}");
        }
        assert_eq!(cache.counters().kinds[Kind::Field.index()].hits, files as u64, "kill {kill}");
    }
    assert!(most > 0 && most_files > 0, "none lived long enough to write");
}

/// Of so many different records.
const WRITTEN: u64 = 2000;

/// Of so many shapes.
const FIELDS: u8 = 20;

fn field(cache: &Arc<Cache>, n: u8, surface: &Arc<Surface>) -> Arc<Field> {
    let store = Arc::downgrade(cache) as std::sync::Weak<dyn FieldStore>;
    Arc::new(Field::stored(surface, store, [n; 32]))
}

/// What a field says along a diagonal of its box, up to a share of it.
fn said(field: &Field, share: f64) -> Vec<Estimate> {
    let at = |i: u32| Point3::from([-1.1 + 2.2 * share * f64::from(i) / 500.0; 3]);
    (0..500).map(|i| field.estimate(&at(i))).collect()
}

/// Files are made, and grow, beside the records.
fn write_for_ever(folder: &Path) -> ! {
    let cache = Arc::new(open(folder));
    let surface = Arc::new(surface(ball(3)));
    let fields: Vec<_> = (0..FIELDS).map(|n| field(&cache, n, &surface)).collect();
    loop {
        for n in 0..WRITTEN {
            cache.put(key(n), &record(n, 50));
            if n % 20 == 0 {
                let which = n / 20 % u64::from(FIELDS);
                drop(said(&fields[which as usize], 0.2 + n as f64 / WRITTEN as f64));
                cache.keep_rest_of_field(&[which as u8; 32], &fields[which as usize]);
                cache.flush();
            }
        }
    }
}
