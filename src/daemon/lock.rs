//! A file that one daemon at a time holds, and that says who does.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::Path;
use std::time::{Duration, Instant};

use sbdp_ipc::endpoint::is_process_alive;

/// How long a daemon that just took the lock, or just dies, is given to say so.
const SETTLE: Duration = Duration::from_secs(1);
const LOOK_AGAIN: Duration = Duration::from_millis(2);

/// A held lock (flock); it is given back when this is dropped, or when the process ends in whatever way.
#[derive(Debug)]
pub(super) struct LockFile {
    file: File,
}

/// Why it cannot be had.
#[derive(Debug)]
pub(super) enum LockError {
    /// Another process has it: its id as far as it is known.
    Held(Option<u32>),
    /// The file cannot be used.
    Io(io::Error),
}

impl LockFile {
    /// Takes the lock and writes this process's id into the file, or says who holds it.
    ///
    /// Who takes it says so a moment later; until then the file may still name the holder before. So a
    /// name that is missing, or is of a process that is no more, is looked at again for a while.
    pub(super) fn take(path: &Path) -> Result<Self, LockError> {
        let start = Instant::now();
        loop {
            let mut lock = Self { file: open(path).map_err(LockError::Io)? };
            match lock.file.try_lock() {
                // A holder that left may have removed the file that was opened here: then this lock
                // keeps nobody out.
                Ok(()) if is_at(&lock.file, path).map_err(LockError::Io)? => {
                    lock.sign().map_err(LockError::Io)?;
                    return Ok(lock);
                }
                Ok(()) => continue,
                Err(TryLockError::WouldBlock) => {}
                Err(TryLockError::Error(error)) => return Err(LockError::Io(error)),
            }
            let holder = lock.holder();
            if holder.is_some_and(is_process_alive) || start.elapsed() > SETTLE {
                return Err(LockError::Held(holder));
            }
            std::thread::sleep(LOOK_AGAIN);
        }
    }

    fn sign(&mut self) -> io::Result<()> {
        self.file.set_len(0)?;
        self.file.rewind()?;
        self.file.write_all(format!("{}\n", std::process::id()).as_bytes())
    }

    /// Whom the file names: a whole line, or nobody.
    fn holder(&mut self) -> Option<u32> {
        let mut text = String::new();
        self.file.read_to_string(&mut text).ok()?;
        text.strip_suffix('\n')?.parse().ok()
    }
}

fn open(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Whether an open file is the one that its path leads to.
fn is_at(file: &File, path: &Path) -> io::Result<bool> {
    let here = file.metadata()?;
    match path.metadata() {
        Ok(there) => Ok((here.dev(), here.ino()) == (there.dev(), there.ino())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holder(path: &Path) -> Option<u32> {
        match LockFile::take(path) {
            Err(LockError::Held(holder)) => holder,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn who_holds_it_is_told_although_it_says_so_late() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lock");
        // What a holder that is no more left: the id is of no process, for ids end at 2^22.
        std::fs::write(&path, "2147483647\n").unwrap();
        let mut late = LockFile { file: open(&path).unwrap() };
        late.file.try_lock().unwrap();
        std::thread::scope(|scope| {
            let asked = scope.spawn(|| holder(&path));
            std::thread::sleep(10 * LOOK_AGAIN);
            late.sign().unwrap();
            assert_eq!(asked.join().unwrap(), Some(std::process::id()));
        });
    }

    #[test]
    fn a_holder_that_never_says_so_is_unknown() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lock");
        let silent = open(&path).unwrap();
        silent.try_lock().unwrap();
        assert_eq!(holder(&path), None);
        drop(silent);
        LockFile::take(&path).unwrap();
    }

    #[test]
    fn a_lock_on_a_file_that_was_removed_keeps_nobody_out_and_is_not_taken_for_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lock");
        let opened = open(&path).unwrap();
        assert!(is_at(&opened, &path).unwrap());
        std::fs::remove_file(&path).unwrap();
        assert!(!is_at(&opened, &path).unwrap());
        let lock = LockFile::take(&path).unwrap();
        assert!(is_at(&lock.file, &path).unwrap() && !is_at(&opened, &path).unwrap());
        assert_eq!(holder(&path), Some(std::process::id()));
    }
}
