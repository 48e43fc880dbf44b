//! Records that are files: of the kinds with [`Storage::Files`](super::Storage::Files), in folders beside the file of
//! records. Reading a file maps it. The thread that writes records also writes these files.

use std::collections::HashMap;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::key::RecordKey;
use super::kind::RecordKind;
use super::mapping::{Mapping, MappingTally};

/// The extension of a file that is being written.
const UNFINISHED: &str = "unfinished";
/// After a file could not be written, no other is tried for this long: the disk is full, mostly.
const PAUSE: Duration = Duration::from_secs(30);
/// Bytes that are written at once.
const BUFFER: usize = 1 << 20;

/// What the content of a file is written from. It may grow, and is then written again as a whole.
pub trait FileSource: Send + Sync {
    /// Bytes that it takes in memory, also while it waits to be written.
    fn memory(&self) -> usize;

    /// Whether some of it is in no file.
    fn is_unwritten(&self) -> bool;

    /// Writes a file under the hash of its key; how much of the source that is, for [`FileSource::is_written`].
    ///
    /// # Errors
    /// The system refused.
    fn write(&self, hash: &[u8; 32], out: &mut dyn Write) -> io::Result<usize>;

    /// As much as this is in a file now.
    fn is_written(&self, amount: usize);
}

/// The folders of the files.
#[derive(Debug)]
pub(super) struct RecordFiles {
    store: PathBuf,
    /// The kinds that have files.
    kinds: Vec<&'static RecordKind>,
    /// The files that are there, with their bytes.
    known: Mutex<HashMap<RecordKey, u64>>,
    mapped: Arc<MappingTally>,
    failed_at: Mutex<Option<Instant>>,
}

impl RecordFiles {
    /// Those of a store's folder, none of which is known yet.
    pub(super) fn of(store: &Path, kinds: &[&'static RecordKind]) -> Self {
        Self {
            store: store.to_owned(),
            kinds: kinds.iter().copied().filter(|kind| kind.files().is_some()).collect(),
            known: Mutex::default(),
            mapped: Arc::default(),
            failed_at: Mutex::default(),
        }
    }

    /// Looks which files there are. What a killed writer did not finish is removed.
    ///
    /// # Errors
    /// A folder cannot be made or read.
    pub(super) fn look(&self) -> io::Result<Vec<(RecordKey, u64)>> {
        let mut found = HashMap::new();
        for kind in &self.kinds {
            let Some([folder, extension]) = kind.files() else { continue };
            let folder = self.store.join(folder);
            fs::create_dir_all(&folder)?;
            for entry in fs::read_dir(&folder)? {
                let entry = entry?;
                let (path, bytes) = (entry.path(), entry.metadata()?.len());
                if path.extension().is_some_and(|e| e == UNFINISHED) {
                    fs::remove_file(&path)?;
                } else if let Some(hash) = hash_of(&path, extension) {
                    found.insert(RecordKey::new(kind, hash), bytes);
                }
            }
        }
        let list = found.iter().map(|(key, bytes)| (*key, *bytes)).collect();
        *self.known() = found;
        Ok(list)
    }

    /// The file of a key, mapped.
    pub(super) fn open(&self, key: &RecordKey) -> Option<Mapping> {
        if !self.has(key) {
            return None;
        }
        let opened = Mapping::of(&self.path(key)?, &self.mapped);
        if opened.is_err() {
            self.forget(key);
        }
        opened.ok()
    }

    pub(super) fn has(&self, key: &RecordKey) -> bool {
        self.known().contains_key(key)
    }

    /// The file of a key is not to be used any more.
    pub(super) fn forget(&self, key: &RecordKey) {
        self.known().remove(key);
    }

    /// Whether a file may be written: not for a while after one could not be.
    pub(super) fn may_write(&self) -> bool {
        self.failed_at().is_none_or(|at| at.elapsed() >= PAUSE)
    }

    /// Writes a source in place of its file; the bytes of that.
    ///
    /// # Errors
    /// The system refused, for a full disk for example: the file is what it was.
    pub(super) fn write(&self, key: &RecordKey, source: &dyn FileSource) -> io::Result<u64> {
        let path = self.path(key).ok_or_else(|| io::Error::other("records of this kind are no files"))?;
        let unfinished = path.with_extension(UNFINISHED);
        let written = publish(&unfinished, &path, |out| source.write(key.hash(), out));
        *self.failed_at() = written.is_err().then(Instant::now);
        let (bytes, amount) = written.inspect_err(|_| {
            // It takes room. If it cannot be removed, the next start does it.
            let _left = fs::remove_file(&unfinished);
        })?;
        source.is_written(amount);
        self.known().insert(*key, bytes);
        Ok(bytes)
    }

    /// Removes files. A mapping of one stays valid.
    pub(super) fn remove(&self, keys: &[RecordKey]) {
        for key in keys {
            self.forget(key);
            if let Some(path) = self.path(key) {
                // One that is not there need not be removed.
                let _gone = fs::remove_file(path);
            }
        }
    }

    /// Whether all of a file is as it was written.
    pub(super) fn is_intact(&self, key: &RecordKey) -> bool {
        self.open(key).is_some_and(|mapping| (key.kind().is_content)(key.hash(), &mapping))
    }

    /// Bytes of all files.
    pub(super) fn bytes(&self) -> u64 {
        self.known().values().sum()
    }

    /// What is mapped, and what was found damaged in it.
    pub(super) fn mapped(&self) -> &MappingTally {
        &self.mapped
    }

    /// The file of a key, if records of its kind are files.
    fn path(&self, key: &RecordKey) -> Option<PathBuf> {
        let [folder, extension] = key.kind().files()?;
        let hash = blake3::Hash::from_bytes(*key.hash()).to_hex();
        Some(self.store.join(folder).join(hash.as_str()).with_extension(extension))
    }

    /// A holder that panicked cannot have left it half-changed.
    fn known(&self) -> MutexGuard<'_, HashMap<RecordKey, u64>> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn failed_at(&self) -> MutexGuard<'_, Option<Instant>> {
        self.failed_at.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes a file under another name, and renames it when it is complete; its bytes, and what `write` returned. This
/// does not wait for the disk: checksums show what a power failure leaves of the file.
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

/// The hash in the name of a file, if it is one of ours.
fn hash_of(path: &Path, extension: &str) -> Option<[u8; 32]> {
    let hash = blake3::Hash::from_hex(path.file_stem()?.to_str()?).ok()?;
    (path.extension()? == extension).then_some(hash.into())
}
