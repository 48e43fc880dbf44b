//! The daemon's place: its lock, its `daemon.json`, and what a killed predecessor left behind.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::{CallbackProgression, Config as IoxConfig};
use sbdp_ipc::Transport;
use sbdp_ipc::endpoint::{self, DAEMON_FILE, Endpoint, EndpointError};
use sbdp_ipc::layout::{self, LayoutError};

use crate::config::EndpointConfig;

const LOCK_FILE: &str = "lock";

/// Why the daemon cannot have its place.
#[derive(Debug, thiserror::Error)]
pub enum LifecycleError {
    /// Another daemon has it.
    #[error("another sbdpd (pid {pid}) holds {lock}: stop it, or give this one another {option}")]
    Taken {
        /// The holder's process id, as the lock file says.
        pid: String,
        /// The lock file.
        lock: PathBuf,
        /// What would have to differ.
        option: &'static str,
    },
    /// The runtime folder is not usable.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// Prefix or root are not usable.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// A file or folder cannot be used.
    #[error("{path}: {source}")]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
}

/// Where a configuration puts the daemon.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) runtime_dir: PathBuf,
    pub(crate) prefix: String,
    pub(crate) root: PathBuf,
}

impl Place {
    pub(crate) fn of(config: &EndpointConfig) -> Result<Self, LifecycleError> {
        let chosen = config.runtime_dir.clone().unwrap_or_else(endpoint::default_runtime_dir);
        // The default prefix and root derive from it: it must mean the same from everywhere.
        let runtime_dir = std::path::absolute(&chosen).map_err(io_error(&chosen))?;
        let prefix = config.prefix.clone().unwrap_or_else(|| endpoint::default_prefix(&runtime_dir));
        let root = config.root.clone().unwrap_or_else(|| runtime_dir.join("iceoryx2"));
        Ok(Self { runtime_dir, prefix, root })
    }

    fn prefix_lock(&self) -> PathBuf {
        Path::new("/dev/shm").join(format!("{}{LOCK_FILE}", self.prefix))
    }

    pub(crate) fn iceoryx2_config(&self) -> Result<IoxConfig, LifecycleError> {
        Ok(layout::iceoryx2_config(&self.prefix, &self.root)?)
    }
}

/// Checks that a configured place can be used, without touching it.
///
/// # Errors
/// Prefix or root are not usable.
pub fn check_place(config: &EndpointConfig) -> Result<(), LifecycleError> {
    Place::of(config)?.iceoryx2_config().map(|_| ())
}

/// The held lock. Dropping it removes `daemon.json`, and what iceoryx2 keeps beyond its ports.
#[derive(Debug)]
pub(crate) struct Lease {
    place: Place,
    config: IoxConfig,
    _locks: [File; 2],
}

impl Lease {
    /// Takes the lock, or says who holds it; then clears what a dead daemon left.
    pub(crate) fn take(place: Place, config: &IoxConfig) -> Result<Self, LifecycleError> {
        endpoint::create_runtime_dir(&place.runtime_dir)?;
        let folder_lock = take_lock(&place.runtime_dir.join(LOCK_FILE), "--runtime-dir")?;
        // Shared memory knows no folders: without this, a daemon elsewhere with the same prefix
        // would be wiped from under its clients.
        let prefix_lock = take_lock(&place.prefix_lock(), "--prefix")?;
        remove_if_there(&place.runtime_dir.join(DAEMON_FILE))?;
        wipe_if_unused(&place, config)?;
        Ok(Self { place, config: config.clone(), _locks: [folder_lock, prefix_lock] })
    }

    /// Tells clients where we are; to be called when the ports are open.
    pub(crate) fn publish(&self) -> Result<(), LifecycleError> {
        Endpoint::of_this_process(&self.place.prefix, &self.place.root)
            .publish(&self.place.runtime_dir)
            .map_err(LifecycleError::from)
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let removed = remove_if_there(&self.place.runtime_dir.join(DAEMON_FILE))
            .and_then(|()| wipe_if_unused(&self.place, &self.config))
            .and_then(|()| remove_if_there(&self.place.prefix_lock()));
        if let Err(error) = removed {
            tracing::warn!(%error, "something stays behind");
        }
    }
}

fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> LifecycleError {
    let path = path.to_owned();
    move |source| LifecycleError::Io { path, source }
}

fn take_lock(path: &Path, option: &'static str) -> Result<File, LifecycleError> {
    let mut file = OpenOptions::new()
        .read(true)
        .write(true)
        .create(true)
        .truncate(false)
        .mode(0o600)
        .open(path)
        .map_err(io_error(path))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut pid = String::new();
            let _ = file.read_to_string(&mut pid);
            let pid = if pid.trim().is_empty() { "unknown".to_owned() } else { pid.trim().to_owned() };
            return Err(LifecycleError::Taken { pid, lock: path.to_owned(), option });
        }
        Err(TryLockError::Error(source)) => return Err(io_error(path)(source)),
    }
    let mut write = || {
        file.set_len(0)?;
        file.seek(SeekFrom::Start(0))?;
        writeln!(file, "{}", std::process::id())
    };
    write().map_err(io_error(path))?;
    Ok(file)
}

fn remove_if_there(path: &Path) -> Result<(), LifecycleError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(io_error(path)(e)),
        _ => Ok(()),
    }
}

/// A truncated service file looks as if still being created and hangs everybody, across
/// restarts. With no live node nothing of it is needed: start from nothing. Clients that wait
/// for a restarted daemon are live nodes, and keep their services.
fn wipe_if_unused(place: &Place, config: &IoxConfig) -> Result<(), LifecycleError> {
    if has_live_node(config) {
        return Ok(());
    }
    for folder in ["services", "nodes"] {
        let path = place.root.join(folder);
        match fs::remove_dir_all(&path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(io_error(&path)(e)),
            _ => {}
        }
    }
    // Sockets by which killed processes were woken.
    for entry in fs::read_dir(&place.root).into_iter().flatten().flatten() {
        if entry.file_name().as_encoded_bytes().starts_with(place.prefix.as_bytes()) {
            remove_if_there(&entry.path())?;
        }
    }
    let shm = Path::new("/dev/shm");
    let kept = place.prefix_lock();
    for path in layout::shared_memory_files(&place.prefix).map_err(io_error(shm))? {
        if path != kept {
            remove_if_there(&path)?;
        }
    }
    Ok(())
}

/// We hold the lock and `daemon.json` is gone, so that nobody connects now: a node that cannot
/// be made out is a damaged leftover, not one that is just being created.
fn has_live_node(config: &IoxConfig) -> bool {
    let mut live = false;
    let listed = Node::<Transport>::list(config, |node| {
        live |= matches!(node, NodeState::Alive(_));
        CallbackProgression::Continue
    });
    if let Err(error) = listed {
        tracing::debug!(%error, "listing nodes");
    }
    live
}

/// Each client costs a few file descriptors: take as many as the system allows.
pub(crate) fn raise_file_limit() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
    if let Err(error) = setrlimit(Resource::Nofile, raised) {
        tracing::debug!(%error, "the limit of open files stays as it is");
    }
}

/// Less free shared memory than this is worth a warning.
const SMALL_SHARED_MEMORY: u64 = 256 << 20;

/// Shared memory that runs full is a SIGBUS, not an error: say so before it happens.
pub(crate) fn warn_of_small_shared_memory() {
    let Ok(stat) = rustix::fs::statvfs("/dev/shm") else { return };
    let free = stat.f_bavail.saturating_mul(stat.f_frsize);
    if stat.f_blocks > 0 && free < SMALL_SHARED_MEMORY {
        tracing::warn!(
            free_mb = free >> 20,
            "/dev/shm is small: many clients or large uploads may end the daemon; enlarge it \
             (`mount -o remount,size=…`, `docker run --shm-size`)"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(dir: &Path) -> Place {
        let config = EndpointConfig { runtime_dir: Some(dir.join("run")), ..EndpointConfig::default() };
        Place::of(&config).unwrap()
    }

    #[test]
    fn a_second_lease_is_refused_and_names_the_holder() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        let config = place.iceoryx2_config().unwrap();
        let first = Lease::take(place.clone(), &config).unwrap();
        let error = Lease::take(place.clone(), &config).unwrap_err().to_string();
        assert!(error.contains(&std::process::id().to_string()), "{error}");
        drop(first);
        Lease::take(place, &config).unwrap();
    }

    #[test]
    fn a_prefix_in_use_elsewhere_is_refused() {
        let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let first = place(here.path());
        let config = first.iceoryx2_config().unwrap();
        let _lease = Lease::take(first.clone(), &config).unwrap();
        let second = Place { prefix: first.prefix, ..place(there.path()) };
        let config = second.iceoryx2_config().unwrap();
        let error = Lease::take(second, &config).unwrap_err().to_string();
        assert!(error.contains("--prefix"), "{error}");
    }

    #[test]
    fn what_a_dead_daemon_left_is_wiped() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        let config = place.iceoryx2_config().unwrap();
        endpoint::create_runtime_dir(&place.runtime_dir).unwrap();
        let services = place.root.join("services");
        fs::create_dir_all(&services).unwrap();
        fs::write(services.join("half.service"), b"").unwrap();
        let event = place.root.join(format!("{}1.event", place.prefix));
        fs::write(&event, b"").unwrap();
        let other = place.root.join("notes.txt");
        fs::write(&other, b"").unwrap();
        let segment = Path::new("/dev/shm").join(format!("{}stale", place.prefix));
        fs::write(&segment, b"stale").unwrap();
        let lease = Lease::take(place.clone(), &config).unwrap();
        assert!(!services.join("half.service").exists() && !segment.exists() && !event.exists());
        assert!(other.exists(), "what is not ours stays");
        lease.publish().unwrap();
        assert!(Endpoint::find(&place.runtime_dir).is_ok());
        drop(lease);
        assert!(matches!(Endpoint::find(&place.runtime_dir), Err(EndpointError::NoDaemon(_))));
    }

    #[test]
    fn a_runtime_folder_open_to_others_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        fs::create_dir(&place.runtime_dir).unwrap();
        fs::set_permissions(&place.runtime_dir, fs::Permissions::from_mode(0o755)).unwrap();
        let config = place.iceoryx2_config().unwrap();
        let error = Lease::take(place, &config).unwrap_err().to_string();
        assert!(error.contains("chmod 700"), "{error}");
    }
}
