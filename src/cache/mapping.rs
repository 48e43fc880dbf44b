//! A file that is mapped to be read: the one unsafe operation of the planning modules.

#![allow(unsafe_code, reason = "the compiler cannot know that nobody writes to a mapped file")]

use std::fs::File;
use std::io;
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use memmap2::{Mmap, MmapMut};

/// What a process has mapped, and how much of it was damaged.
#[derive(Debug, Default)]
pub struct MappingTally {
    bytes: AtomicU64,
    damaged: AtomicU64,
}

impl MappingTally {
    /// Bytes of all files that are mapped now. They are no memory of this process: the system can take them back.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Pieces of files that were found damaged, since the start.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.damaged.load(Ordering::Relaxed)
    }
}

/// The bytes of a file, for as long as this lives, whatever becomes of its name.
#[derive(Debug)]
pub struct Mapping {
    bytes: Mmap,
    tally: Arc<MappingTally>,
}

impl Mapping {
    /// Maps a file that is complete: one that got its name when the last byte was written.
    ///
    /// # Errors
    /// The file is not there, or cannot be mapped.
    pub fn of(path: &Path, tally: &Arc<MappingTally>) -> io::Result<Self> {
        let file = File::open(path)?;
        // SAFETY: nobody writes to a mapped file. The one writer (`files.rs`) makes each file under another name and
        // renames it when it is complete; a file with its final name is only replaced or removed as a whole, which
        // does not change what is mapped. Only the owner can open the folder.
        let bytes = unsafe { Mmap::map(&file) }?;
        tally.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(Self { bytes, tally: Arc::clone(tally) })
    }

    /// A copy of bytes, aligned as a file would be.
    ///
    /// # Errors
    /// There is no memory for it, or there are no bytes.
    pub(crate) fn of_copy(bytes: &[u8]) -> io::Result<Self> {
        let mut copy = MmapMut::map_anon(bytes.len())?;
        copy.copy_from_slice(bytes);
        let tally = Arc::<MappingTally>::default();
        tally.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        Ok(Self { bytes: copy.make_read_only()?, tally })
    }

    /// Counts a piece of the file that is not as it was written.
    pub(crate) fn is_damaged(&self) {
        self.tally.damaged.fetch_add(1, Ordering::Relaxed);
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        self.tally.bytes.fetch_sub(self.bytes.len() as u64, Ordering::Relaxed);
    }
}

impl Deref for Mapping {
    type Target = [u8];

    #[inline]
    fn deref(&self) -> &[u8] {
        &self.bytes
    }
}
