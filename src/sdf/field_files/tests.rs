//! Fields come back after a restart as they were, and what is damaged, half-written or too much does not.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Point3;

use super::*;
use crate::cache::CacheSettings;
use crate::fixtures::{ball, cuboid, l_shape, open_box, spread, surface};
use crate::sdf::FieldEstimate;

const FOLDER: &str = "fields";

fn open_with(folder: &Path, disk_bytes: u64) -> Arc<Cache> {
    let settings = CacheSettings { folder: Some(folder.to_owned()), disk_bytes, ..CacheSettings::default() };
    Arc::new(Cache::open(&settings, &[&FIELD]).unwrap())
}

fn open(folder: &Path) -> Arc<Cache> {
    open_with(folder, 64 << 20)
}

/// A surface, and as what it is known.
struct Solid {
    surface: Arc<Surface>,
    content: [u8; 32],
}

fn solids() -> Vec<Solid> {
    let open = open_box([-1.0; 3], [1.0; 3]);
    let meshes = [cuboid([-1.0, -1.5, -1.2], [1.0, 1.5, 1.2]), ball(3), l_shape(), open];
    let solid = |(n, mesh)| Solid { surface: Arc::new(surface(mesh)), content: [n; 32] };
    (0..).zip(meshes).map(solid).collect()
}

impl Solid {
    /// Its field, as somebody finds it in a store who comes for the first time.
    fn field(&self, cache: &Arc<Cache>) -> Arc<Field> {
        let store = Arc::downgrade(cache) as std::sync::Weak<dyn FieldStore>;
        Arc::new(Field::stored(&self.surface, store, self.content))
    }

    fn key(&self) -> RecordKey {
        key(&self.content)
    }

    /// What a field says all over the lower part of its box.
    fn told(&self, field: &Field, part: f64) -> Vec<(FieldEstimate, Option<u32>)> {
        let b = self.surface.bounds().grown(0.2);
        let to: Point3<f64> = b.min + b.extents() * part;
        let points = spread(b.min.into(), to.into(), 2000);
        points.map(|p| (field.estimate(&p), field.likely_nearest(&p))).collect()
    }

    /// What it says that was never in a file.
    fn truth(&self) -> Vec<(FieldEstimate, Option<u32>)> {
        self.told(&Field::of(&self.surface), 1.0)
    }

    /// Looked at in a part of its box, and kept.
    fn kept(&self, cache: &Arc<Cache>, part: f64) -> Arc<Field> {
        let field = self.field(cache);
        drop(self.told(&field, part));
        keep_field(cache, &self.content, &field);
        cache.flush();
        field
    }
}

/// Hits, misses, damaged, evicted.
fn counts(cache: &Cache) -> [u64; 4] {
    let counts = cache.statistics();
    let field = &counts.kinds[0];
    [field.hits, field.misses, field.damaged, field.disk_evictions]
}

fn file_of(store: &Path, solid: &Solid) -> PathBuf {
    let hash = blake3::Hash::from_bytes(*solid.key().hash()).to_hex();
    store.join(FOLDER).join(hash.as_str()).with_extension("sdf")
}

/// In place of a file, as its writer would: what is mapped stays.
fn replace(path: &Path, bytes: &[u8]) {
    let other = path.with_extension("other");
    fs::write(&other, bytes).unwrap();
    fs::rename(other, path).unwrap();
}

#[test]
fn a_field_is_there_after_a_restart_and_says_the_same_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let cache = open(folder.path());
    let solids = solids();
    for solid in &solids {
        assert!(solid.kept(&cache, 1.0).unwritten() == 0);
    }
    assert_eq!(counts(&cache), [0, 4, 0, 0]);
    assert_eq!(cache.statistics().mapped_bytes, 0, "they were built here");
    drop(cache);
    let cache = open(folder.path());
    for solid in &solids {
        let field = solid.field(&cache);
        assert_eq!(solid.told(&field, 1.0), solid.truth());
        assert!(field.filled() == 0 && field.in_its_file().0 > 0, "nothing was measured again");
        assert!(cache.statistics().mapped_bytes > 0 && field.memory() < field.in_its_file().0 * 5832);
    }
    assert_eq!((counts(&cache), cache.statistics().mapped_bytes), ([4, 0, 0, 0], 0), "given back");
    assert!(cache.statistics().field_file_bytes > 100_000);
}

#[test]
fn what_is_filled_later_joins_what_is_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let solid = &solids()[1];
    let first = solid.kept(&open(folder.path()), 0.3).filled();
    let cache = open(folder.path());
    let field = solid.field(&cache);
    assert_eq!(solid.told(&field, 1.0), solid.truth());
    assert!(first > 0 && field.filled() > 0 && field.in_its_file().0 == first);
    keep_field(&cache, &solid.content, &field);
    cache.flush();
    assert_eq!(field.unwritten(), 0);
    drop((field, cache));
    let cache = open(folder.path());
    let field = solid.field(&cache);
    assert!(field.in_its_file().0 > first);
    assert_eq!((solid.told(&field, 1.0), field.filled()), (solid.truth(), 0));
}

#[test]
fn little_that_is_new_waits_for_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let (solid, cache) = (&solids()[1], open(folder.path()));
    let field = solid.kept(&cache, 0.95);
    let before = field.filled();
    drop(solid.told(&field, 1.0));
    let new = field.unwritten();
    assert!(new > 0 && new < before / 8, "{new} of {before}");
    keep_field(&cache, &solid.content, &field);
    cache.flush();
    assert_eq!(field.unwritten(), new);
    keep_rest_of_field(&cache, &solid.content, &field);
    cache.flush();
    assert_eq!(field.unwritten(), 0);
}

#[test]
fn a_damaged_file_is_a_counted_miss_and_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let solid = &solids()[2];
    let whole = {
        let cache = open(folder.path());
        drop(solid.kept(&cache, 1.0));
        fs::read(file_of(folder.path(), solid)).unwrap()
    };
    let changed = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 4;
        bytes
    };
    // The version, the tables, an end that is missing: no file. In a brick: no brick.
    let none = [changed(4), changed(200), whole[..whole.len() - 5832].to_vec(), Vec::new()];
    for (bytes, hit) in none.into_iter().map(|bytes| (bytes, 0)).chain([(changed(whole.len() - 9), 1)]) {
        let cache = open(folder.path());
        replace(&file_of(folder.path(), solid), &bytes);
        let field = solid.kept(&cache, 1.0);
        assert_eq!(solid.told(&field, 1.0), solid.truth());
        assert_eq!(counts(&cache), [hit, 1 - hit, 1, 0]);
        assert!(
            cache.verify().clean && fs::read(file_of(folder.path(), solid)).unwrap() == whole,
            "replaced"
        );
        drop((field, cache));
        let cache = open(folder.path());
        assert_eq!(solid.field(&cache).filled(), 0);
        assert_eq!(counts(&cache), [1, 0, 0, 0]);
    }
}

#[test]
fn verify_takes_damaged_files_out() {
    let folder = tempfile::tempdir().unwrap();
    let (solids, cache) = (solids(), open(folder.path()));
    for solid in &solids {
        drop(solid.kept(&cache, 1.0));
    }
    assert_eq!((cache.verify().records, cache.verify().damaged), (4, 0));
    for (solid, at) in solids.iter().zip([0, 300, usize::MAX]) {
        let path = file_of(folder.path(), solid);
        let mut bytes = fs::read(&path).unwrap();
        let at = at.min(bytes.len() - 1);
        bytes[at] ^= 1;
        replace(&path, &bytes);
    }
    let verified = cache.verify();
    assert_eq!((verified.records, verified.damaged, verified.clean), (4, 3, true));
    assert_eq!(cache.list().iter().map(|l| l.key).collect::<Vec<_>>(), [solids[3].key()]);
    assert_eq!((cache.verify().records, cache.verify().damaged), (1, 0));
    assert!(!file_of(folder.path(), &solids[0]).exists() && file_of(folder.path(), &solids[3]).exists());
}

/// A writer may be killed while it writes, and between a file and its note.
#[test]
fn what_a_killed_writer_left_is_removed_or_taken_up() {
    let folder = tempfile::tempdir().unwrap();
    let (solids, fields) = (solids(), folder.path().join(FOLDER));
    let (whole, half) = {
        let cache = open(folder.path());
        solids.iter().for_each(|solid| drop(solid.kept(&cache, 1.0)));
        let path = file_of(folder.path(), &solids[0]);
        (fs::read(&path).unwrap(), path.with_extension("unfinished"))
    };
    fs::write(&half, &whole[..whole.len() / 2]).unwrap();
    fs::write(fields.join("README"), "of somebody").unwrap();
    fs::remove_file(half.with_extension("sdf")).unwrap();
    let note = folder.path().join("records.redb");
    for without_notes in [false, true] {
        if without_notes {
            fs::remove_file(&note).unwrap();
        }
        let cache = open(folder.path());
        assert!(!half.exists() && fields.join("README").exists());
        let listed: u64 = cache.list().iter().map(|file| file.bytes).sum();
        assert_eq!((cache.list().len(), listed), (3, cache.statistics().field_file_bytes));
        assert!(cache.verify().clean && cache.verify().damaged == 0);
        solids.iter().for_each(|solid| drop(solid.told(&solid.field(&cache), 0.1)));
        assert_eq!(counts(&cache), [3, 1, 0, 0]);
    }
}

#[test]
fn files_keep_their_share_of_the_budget_and_the_least_recently_used_leave() {
    let folder = tempfile::tempdir().unwrap();
    let budget = 64 << 20;
    let cache = open_with(folder.path(), budget);
    let of = |n: u8| Solid { content: [n; 32], surface: Arc::clone(&solids()[1].surface) };
    let used = of(0).kept(&cache, 1.0);
    let bytes = fs::metadata(file_of(folder.path(), &of(0))).unwrap().len();
    let count = (budget / 4 / bytes + 8) as u8;
    assert!(count > 10, "{bytes} bytes each");
    let reader = of(1);
    drop(reader.kept(&cache, 1.0));
    let mapped = reader.field(&cache);
    drop(reader.told(&mapped, 0.1));
    for n in 2..count {
        drop(of(n).kept(&cache, 1.0));
        // Nothing of it is new: it counts as used, and is not written.
        keep_field(&cache, &[0; 32], &used);
        let files: u64 = fs::read_dir(folder.path().join(FOLDER))
            .unwrap()
            .map(|file| file.unwrap().metadata().unwrap().len())
            .sum();
        assert!(files <= budget / 4 && files == cache.statistics().field_file_bytes, "{files}");
    }
    let there = |n: u8| file_of(folder.path(), &of(n)).exists();
    assert!(there(0) && !there(1) && !there(2) && there(count - 1));
    assert!(counts(&cache)[3] >= 8);
    assert_eq!(reader.told(&mapped, 1.0), reader.truth(), "what left is still mapped");
    assert_eq!(mapped.filled(), 0);
}

#[test]
fn evicting_and_clearing_take_files_with_them() {
    let folder = tempfile::tempdir().unwrap();
    let (solids, cache) = (solids(), open(folder.path()));
    for solid in &solids {
        drop(solid.kept(&cache, 1.0));
    }
    let statistics = cache.statistics();
    let field = &statistics.kinds[0];
    assert_eq!((field.disk_entries, field.disk_bytes), (4, statistics.field_file_bytes));
    let last = fs::metadata(file_of(folder.path(), &solids[3])).unwrap().len();
    assert_eq!(cache.evict(last + 1000), 3);
    assert_eq!(cache.list().iter().map(|l| (l.key, l.bytes)).collect::<Vec<_>>(), [(solids[3].key(), last)]);
    assert_eq!((cache.evict(0), cache.list().len(), cache.statistics().field_file_bytes), (1, 0, 0));
    assert_eq!(fs::read_dir(folder.path().join(FOLDER)).unwrap().count(), 0);
}

#[test]
fn a_folder_that_takes_no_file_costs_no_more_than_the_files() {
    let folder = tempfile::tempdir().unwrap();
    let (solid, cache) = (&solids()[0], open(folder.path()));
    let fields = folder.path().join(FOLDER);
    fs::remove_dir(&fields).unwrap();
    fs::write(&fields, "no folder").unwrap();
    let field = solid.kept(&cache, 1.0);
    assert!(field.unwritten() > 0 && cache.statistics().write_failures == 1);
    assert_eq!(solid.told(&field, 1.0), solid.truth());
    keep_field(&cache, &solid.content, &field);
    cache.flush();
    assert_eq!(cache.statistics().write_failures, 1, "it is left alone for a while");
    assert!(cache.is_on_disk());
}
