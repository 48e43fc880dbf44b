//! Distance fields on disk: a file for each, in a folder beside the records, as `sdf/FORMAT.md` draws it.
//!
//! A field depends on its shape alone. Whoever first looks at one maps its file; the thread that writes
//! records also writes these files, of fields in which bricks were filled that are in no file yet.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::writer::Writer;
use super::{Cache, Digest, Key, Kind};
use crate::geometry::Surface;
use crate::sdf::{Field, FieldStore, Grid, Mapping, MappingTally};

const FOLDER: &str = "fields";
const EXTENSION: &str = "sdf";
/// Of a file that is being written.
const UNFINISHED: &str = "unfinished";
/// After a file could not be written, none is for so long.
const PAUSE: Duration = Duration::from_secs(30);
/// Bytes that are written at once.
const BUFFER: usize = 1 << 20;

impl FieldStore for Cache {
    fn field(&self, surface: &Arc<Surface>, content: &[u8; 32]) -> Option<Grid> {
        let key = key(content);
        let found = self.disk.as_ref().and_then(|disk| {
            let mapping = disk.fields.open(&key)?;
            let grid = Grid::stored(surface, key.hash(), mapping);
            if grid.is_some() {
                disk.touch(key);
            } else {
                disk.fields.forget(&key);
            }
            grid
        });
        let tally = self.tally.of(Kind::Field);
        if found.is_some() {
            tally.hits.one_more()
        } else {
            tally.misses.one_more()
        };
        found
    }
}

impl Cache {
    /// Keeps the field of a shape with some content on disk, if there is a store on disk, and if enough of it
    /// is not there yet. The field counts as used.
    pub fn keep_field(&self, content: &[u8; 32], field: &Arc<Field>) {
        if field.is_built() {
            let write = |writer: &Writer, key| {
                // What is new in it is handed over with what else becomes new.
                let _waits = writer.write_field(key, field);
            };
            self.keep_if(field.is_worth_writing(), content, write);
        }
    }

    /// The same at the end, when little is enough: waits until there is room for it.
    pub fn keep_rest_of_field(&self, content: &[u8; 32], field: &Arc<Field>) {
        let write = |writer: &Writer, key| writer.write_last_of_field(key, field);
        self.keep_if(field.unwritten() > 0, content, write);
    }

    fn keep_if(&self, wanted: bool, content: &[u8; 32], write: impl FnOnce(&Writer, Key)) {
        let (Some(disk), Some(writer)) = (&self.disk, &self.writer) else { return };
        let key = key(content);
        if wanted && disk.may_write() && disk.fields.may_write() {
            write(writer, key);
        } else if disk.fields.has(&key) {
            disk.touch(key);
        }
    }
}

fn key(content: &[u8; 32]) -> Key {
    Digest::new().hash(content).key(Kind::Field)
}

/// The folder of the files.
#[derive(Debug)]
pub(super) struct FieldFiles {
    folder: PathBuf,
    /// The files that are there, with their bytes.
    known: Mutex<HashMap<Key, u64>>,
    mapped: Arc<MappingTally>,
    failed_at: Mutex<Option<Instant>>,
}

impl FieldFiles {
    /// Those of a store's folder, none of which is known yet.
    pub(super) fn beside(store: &Path) -> Self {
        let folder = store.join(FOLDER);
        Self { folder, known: Mutex::default(), mapped: Arc::default(), failed_at: Mutex::default() }
    }

    /// Looks which files there are. What a killed writer did not finish is removed.
    ///
    /// # Errors
    /// The folder cannot be made or read.
    pub(super) fn look(&self) -> io::Result<Vec<(Key, u64)>> {
        fs::create_dir_all(&self.folder)?;
        let mut found = HashMap::new();
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let (path, bytes) = (entry.path(), entry.metadata()?.len());
            if path.extension().is_some_and(|e| e == UNFINISHED) {
                fs::remove_file(&path)?;
            } else if let Some(key) = key_of(&path) {
                found.insert(key, bytes);
            }
        }
        let list = found.iter().map(|(key, bytes)| (*key, *bytes)).collect();
        *self.known() = found;
        Ok(list)
    }

    /// The file of a key, mapped.
    pub(super) fn open(&self, key: &Key) -> Option<Mapping> {
        if !self.has(key) {
            return None;
        }
        let opened = Mapping::of(&self.path(key), &self.mapped);
        if opened.is_err() {
            self.forget(key);
        }
        opened.ok()
    }

    pub(super) fn has(&self, key: &Key) -> bool {
        self.known().contains_key(key)
    }

    /// The file of a key is not to be used any more.
    pub(super) fn forget(&self, key: &Key) {
        self.known().remove(key);
    }

    /// Whether a file may be written: some time ago it may not have been possible.
    pub(super) fn may_write(&self) -> bool {
        self.failed_at().is_none_or(|at| at.elapsed() >= PAUSE)
    }

    /// Writes what is known of a field in place of its file; the bytes of that.
    ///
    /// # Errors
    /// The system refused, for a full disk for example: the file is what it was.
    pub(super) fn write(&self, key: &Key, field: &Field) -> io::Result<u64> {
        let path = self.path(key);
        let unfinished = path.with_extension(UNFINISHED);
        let written = publish(&unfinished, &path, |out| field.write(key.hash(), out));
        *self.failed_at() = written.is_err().then(Instant::now);
        let (bytes, filled) = written.inspect_err(|_| {
            // It takes room. What cannot even be removed is so at the next start.
            let _left = fs::remove_file(&unfinished);
        })?;
        field.is_written(filled);
        self.known().insert(*key, bytes);
        Ok(bytes)
    }

    /// Removes files. What is mapped of them stays until it is given back.
    pub(super) fn remove(&self, keys: &[Key]) {
        for key in keys.iter().filter(|key| key.kind() == Kind::Field) {
            self.forget(key);
            // One that is not there need not be removed.
            let _gone = fs::remove_file(self.path(key));
        }
    }

    /// Whether all of a file is as it was written.
    pub(super) fn is_intact(&self, key: &Key) -> bool {
        self.open(key).is_some_and(|mapping| crate::sdf::is_intact(key.hash(), &mapping))
    }

    /// Bytes of all files.
    pub(super) fn bytes(&self) -> u64 {
        self.known().values().sum()
    }

    /// What is mapped of them, and what was found damaged.
    pub(super) fn mapped(&self) -> &MappingTally {
        &self.mapped
    }

    pub(super) fn path(&self, key: &Key) -> PathBuf {
        let hash: String = key.hash().iter().map(|byte| format!("{byte:02x}")).collect();
        self.folder.join(hash).with_extension(EXTENSION)
    }

    /// A holder that panicked cannot have left it half-changed.
    fn known(&self) -> MutexGuard<'_, HashMap<Key, u64>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn failed_at(&self) -> MutexGuard<'_, Option<Instant>> {
        self.failed_at.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes a file under another name, and gives it its own when it is complete; its bytes, and what was
/// written. It is not waited for the disk: what a power failure leaves of it, its checksums tell.
fn publish<T>(
    unfinished: &Path,
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<T>,
) -> io::Result<(u64, T)> {
    let mut out = BufWriter::with_capacity(BUFFER, File::create(unfinished)?);
    let written = write(&mut out)?;
    out.flush()?;
    let bytes = out.get_ref().metadata()?.len();
    fs::rename(unfinished, path)?;
    Ok((bytes, written))
}

/// The key of a file by its name, if it is one of ours.
fn key_of(path: &Path) -> Option<Key> {
    let name = path.file_stem()?.to_str()?;
    let ours = path.extension()? == EXTENSION && name.len() == 64 && name.is_ascii();
    let byte = |i: usize| u8::from_str_radix(name.get(2 * i..2 * i + 2)?, 16).ok();
    let bytes: Vec<u8> = (0..32).map(byte).collect::<Option<_>>()?;
    Some(Key::new(Kind::Field, bytes.try_into().ok()?)).filter(|_| ours)
}

#[cfg(test)]
mod tests;
