//! The part of shared memory that belongs to one daemon process alone.
//!
//! A killed process may leave files of iceoryx2 in a state in which a process that opens them waits for ever. So no
//! daemon opens the files of another: each has its own prefix and folder, which clients read in `daemon.json`, and
//! removes the files of dead daemons.

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::prelude::Config as IoxConfig;
use sbdp_ipc::layout::{self, TAG};

use super::place::{DaemonPlace, PlaceError, ignore_missing, io_error};

/// Names of this process's part of a place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Instance {
    /// Prefix of its files in shared memory.
    pub(crate) prefix: String,
    /// Folder of its other files.
    pub(crate) root: PathBuf,
}

/// Hexadecimal digits of a tag, behind its first letter.
const DIGITS: usize = TAG - 1;
/// The number of tags that are tried. That all are taken cannot happen by chance.
const TRIES: u32 = 64;

impl Instance {
    /// A new instance, with its folder.
    pub(super) fn create(place: &DaemonPlace) -> Result<Self, PlaceError> {
        fs::create_dir_all(&place.root).map_err(io_error(&place.root))?;
        let mut refused = None;
        for attempt in 0..TRIES {
            let this = Self::of(place, &tag(attempt));
            match DirBuilder::new().mode(0o700).create(&this.root) {
                // A client of a dead daemon may still make files under an old tag.
                Ok(()) if this.is_unused() => return Ok(this),
                Ok(()) => {}
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => refused = Some(error),
                Err(error) => return Err(io_error(&this.root)(error)),
            }
        }
        Err(io_error(&place.root)(refused.unwrap_or_else(|| io::ErrorKind::AlreadyExists.into())))
    }

    fn of(place: &DaemonPlace, tag: &str) -> Self {
        Self { prefix: format!("{}{tag}_", place.prefix), root: place.root.join(tag) }
    }

    fn is_unused(&self) -> bool {
        layout::shared_memory_files(&self.prefix).is_ok_and(|files| files.is_empty())
    }

    /// Removes other users' rights to the files in shared memory: iceoryx2 creates one that everybody may write. To
    /// be called when the ports are open.
    pub(crate) fn close_to_others(&self) -> Result<(), PlaceError> {
        let shm = Path::new("/dev/shm");
        for path in layout::shared_memory_files(&self.prefix).map_err(io_error(shm))? {
            let mode = fs::metadata(&path).map_err(io_error(&path))?.mode();
            if mode & 0o077 != 0 {
                fs::set_permissions(&path, fs::Permissions::from_mode(mode & 0o700))
                    .map_err(io_error(&path))?;
            }
        }
        Ok(())
    }

    /// The configuration of iceoryx2 for this instance.
    pub(crate) fn iceoryx2_config(&self) -> Result<IoxConfig, PlaceError> {
        Ok(layout::iceoryx2_config(&self.prefix, &self.root)?)
    }
}

/// A letter and digits that no other attempt or process is likely to come to.
fn tag(attempt: u32) -> String {
    let seed = (std::process::id(), sbdp_ipc::clock::monotonic_ns(), attempt);
    let hash = blake3::hash(format!("{seed:?}").as_bytes()).to_hex();
    format!("i{}", &hash[..DIGITS])
}

fn is_tag(text: &[u8]) -> bool {
    matches!(text, [b'i', digits @ ..] if digits.len() == DIGITS && digits.iter().all(u8::is_ascii_hexdigit))
}

/// Removes the files of all instances of a place but the one that is kept. The holder of the place's lock may do so:
/// the other daemons are dead, and memory that their clients mapped stays valid. Such clients may create new files
/// meanwhile: files that could not be removed are left to the next call.
pub(super) fn sweep(place: &DaemonPlace, kept: Option<&Instance>) {
    for entry in fs::read_dir(&place.root).into_iter().flatten().flatten() {
        let path = entry.path();
        if is_tag(entry.file_name().as_encoded_bytes()) && kept.is_none_or(|k| k.root != path) {
            log_failure(&path, fs::remove_dir_all(&path));
        }
    }
    for path in layout::shared_memory_files(&place.prefix).unwrap_or_default() {
        let name = path.file_name().unwrap_or_default().as_encoded_bytes();
        let is_ours = name.get(place.prefix.len()..).is_some_and(|rest| {
            rest.get(..=DIGITS).is_some_and(is_tag) && rest.get(DIGITS + 1) == Some(&b'_')
        });
        if is_ours && kept.is_none_or(|k| !name.starts_with(k.prefix.as_bytes())) {
            log_failure(&path, fs::remove_file(&path));
        }
    }
}

fn log_failure(path: &Path, removed: io::Result<()>) {
    if let Err(error) = ignore_missing(removed) {
        tracing::info!(%error, path = %path.display(), "of a dead daemon this stays for now");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::EndpointConfig;

    fn place(dir: &Path) -> DaemonPlace {
        let config = EndpointConfig { runtime_dir: Some(dir.join("run")), ..EndpointConfig::default() };
        DaemonPlace::of(&config).unwrap()
    }

    /// A file in shared memory that goes with the test.
    struct Segment(PathBuf);

    impl Segment {
        fn new(name: &str) -> Self {
            let path = Path::new("/dev/shm").join(name);
            fs::write(&path, b"stale").unwrap();
            Self(path)
        }
    }

    impl Drop for Segment {
        fn drop(&mut self) {
            let _ = fs::remove_file(&self.0);
        }
    }

    #[test]
    fn no_two_daemons_share_anything() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        let (one, other) = (Instance::create(&place).unwrap(), Instance::create(&place).unwrap());
        assert!(one.prefix != other.prefix && one.root != other.root);
        assert!(one.root.is_dir() && one.iceoryx2_config().is_ok());
    }

    #[test]
    fn what_anybody_may_write_is_closed_to_others() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        let instance = Instance::create(&place).unwrap();
        let [own, others] = [&instance.prefix, &place.prefix].map(|p| Segment::new(&format!("{p}1.data")));
        let mode = |s: &Segment| fs::metadata(&s.0).unwrap().mode() & 0o777;
        for segment in [&own, &others] {
            fs::set_permissions(&segment.0, fs::Permissions::from_mode(0o666)).unwrap();
        }
        instance.close_to_others().unwrap();
        assert_eq!([mode(&own), mode(&others)], [0o600, 0o666]);
    }

    #[test]
    fn what_other_instances_left_is_swept_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        let [dead, alive] = [(); 2].map(|()| Instance::create(&place).unwrap());
        fs::write(dead.root.join("half.service"), b"").unwrap();
        fs::write(place.root.join("notes.txt"), b"").unwrap();
        fs::create_dir(place.root.join("images")).unwrap();
        let gone =
            [Segment::new(&format!("{}1.data", dead.prefix)), Segment::new(&format!("{}ix", dead.prefix))];
        let stay = [
            Segment::new(&format!("{}1.data", alive.prefix)),
            // Another daemon whose prefix begins like ours.
            Segment::new(&format!("{}main_1.data", place.prefix)),
            Segment::new(&format!("{}lock", place.prefix)),
        ];
        sweep(&place, Some(&alive));
        assert!(!dead.root.exists() && gone.iter().all(|s| !s.0.exists()));
        assert!(alive.root.exists() && stay.iter().all(|s| s.0.exists()));
        sweep(&place, None);
        assert!(!alive.root.exists() && !stay[0].0.exists() && stay[1].0.exists());
        assert!(place.root.join("notes.txt").exists() && place.root.join("images").exists());
    }
}
