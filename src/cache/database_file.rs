//! The file of records, opened or made.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek};
use std::path::Path;

use redb::Database;
use redb::backends::FileBackend;

use super::tables::DiskFailure;

/// Bytes of redb's own cache of pages.
const PAGE_CACHE: usize = 16 << 20;
/// Bytes at the beginning of redb's file that get their values last.
const MAGIC: usize = 9;
/// Bytes: when the beginning gets its values, the file has nothing but a header, which is shorter than this.
const FIRST_PAGE: usize = 4096;
const BUFFER: usize = 1 << 16;

/// Opens the file of records for this process alone, or makes it.
pub(super) fn database_at(path: &Path) -> Result<Database, DiskFailure> {
    let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
    match file.try_lock() {
        // redb locks the same way: nobody is making the file now.
        Ok(()) => {
            if was_never_made(&mut file)? {
                file.set_len(0)?;
            }
        }
        Err(TryLockError::WouldBlock) => return Err(DiskFailure::InUse),
        // redb decides whether it can do without a lock.
        Err(TryLockError::Error(_)) => {}
    }
    Ok(Database::builder().set_cache_size(PAGE_CACHE).create_with_backend(FileBackend::new(file)?)?)
}

/// Whether a process was killed while it made the file. redb sets the length first and the beginning last, and refuses
/// a file without the beginning. Nothing was ever written to such a file.
fn was_never_made(file: &mut File) -> io::Result<bool> {
    file.rewind()?;
    let mut page = Vec::with_capacity(FIRST_PAGE);
    file.by_ref().take(FIRST_PAGE as u64).read_to_end(&mut page)?;
    let is_blank = |bytes: &[u8]| bytes.iter().all(|&byte| byte == 0);
    if page.len() < FIRST_PAGE || !is_blank(&page[..MAGIC]) {
        return Ok(false);
    }
    let mut buffer = vec![0; BUFFER];
    loop {
        match file.read(&mut buffer)? {
            0 => return Ok(true),
            read if is_blank(&buffer[..read]) => {}
            _ => return Ok(false),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::KINDS;
    use super::super::{Cache, CacheSettings};

    /// Opens a store with a file of records; how many files were set aside for it.
    fn set_aside(content: &[u8]) -> u64 {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("records.redb"), content).unwrap();
        let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
        let cache = Cache::open(&settings, &KINDS).unwrap();
        assert!(cache.verify().clean && cache.is_on_disk());
        cache.statistics().set_aside
    }

    #[test]
    fn a_file_whose_maker_was_killed_is_made_anew() {
        let mut cut_short = vec![0; 1 << 20];
        assert_eq!(set_aside(&cut_short), 0, "it had its length");
        cut_short[12..320].fill(3);
        assert_eq!(set_aside(&cut_short), 0, "and its header");
    }

    #[test]
    fn a_file_in_which_something_was_written_is_set_aside() {
        let mut damaged = vec![0; 1 << 20];
        damaged[700_000] = 1;
        assert_eq!(set_aside(&damaged), 1);
        assert_eq!(set_aside(&[0; 100]), 1, "redb makes none so short");
    }
}
