//! The daemon's place: its lock, its `daemon.json`, and its own part of shared memory.

use std::fs;
use std::path::{Path, PathBuf};

use sbdp_ipc::endpoint::{self, DAEMON_FILE, Endpoint, EndpointError};
use sbdp_ipc::layout::{self, LayoutError};

use super::instance::{Instance, ignore_missing, sweep};
use super::lock::{LockError, LockFile};
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
        let root = config.root.clone().unwrap_or_else(|| runtime_dir.join("iox"));
        Ok(Self { runtime_dir, prefix, root })
    }

    fn prefix_lock(&self) -> PathBuf {
        Path::new("/dev/shm").join(format!("{}{LOCK_FILE}", self.prefix))
    }
}

/// Checks that a configured place can be used, without touching it.
///
/// # Errors
/// Prefix or root are not usable.
pub fn check_place(config: &EndpointConfig) -> Result<(), LifecycleError> {
    let Place { prefix, root, .. } = Place::of(config)?;
    layout::check_place(&prefix, &root)?;
    Ok(())
}

/// The held lock. Dropping it removes `daemon.json`, and all that is in shared memory.
#[derive(Debug)]
pub(crate) struct Lease {
    place: Place,
    /// This daemon's part of shared memory.
    pub(crate) instance: Instance,
    _locks: [LockFile; 2],
}

impl Lease {
    /// Takes the lock, or says who holds it; then clears what dead daemons left.
    pub(crate) fn take(place: Place) -> Result<Self, LifecycleError> {
        layout::check_place(&place.prefix, &place.root)?;
        endpoint::create_runtime_dir(&place.runtime_dir)?;
        let folder_lock = take_lock(&place.runtime_dir.join(LOCK_FILE), "--runtime-dir")?;
        // Shared memory knows no folders: without this, a daemon elsewhere with the same prefix
        // would be wiped from under its clients.
        let prefix_lock = take_lock(&place.prefix_lock(), "--prefix")?;
        remove_if_there(&place.runtime_dir.join(DAEMON_FILE))?;
        sweep(&place, None);
        let instance = Instance::create(&place)?;
        Ok(Self { place, instance, _locks: [folder_lock, prefix_lock] })
    }

    /// Tells clients where we are; to be called when the ports are open.
    pub(crate) fn publish(&self) -> Result<(), LifecycleError> {
        Endpoint::of_this_process(&self.instance.prefix, &self.instance.root)
            .publish(&self.place.runtime_dir)
            .map_err(LifecycleError::from)
    }

    /// Removes what clients of dead daemons still made when these were swept.
    pub(crate) fn sweep(&self) {
        sweep(&self.place, Some(&self.instance));
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        let unpublished = remove_if_there(&self.place.runtime_dir.join(DAEMON_FILE));
        sweep(&self.place, None);
        let removed = unpublished.and_then(|()| remove_if_there(&self.place.prefix_lock()));
        if let Err(error) = removed {
            tracing::warn!(%error, "something stays behind");
        }
    }
}

pub(super) fn io_error(path: &Path) -> impl FnOnce(std::io::Error) -> LifecycleError {
    let path = path.to_owned();
    move |source| LifecycleError::Io { path, source }
}

fn take_lock(path: &Path, option: &'static str) -> Result<LockFile, LifecycleError> {
    LockFile::take(path).map_err(|error| match error {
        LockError::Held(pid) => LifecycleError::Taken {
            pid: pid.map_or_else(|| "unknown".to_owned(), |pid| pid.to_string()),
            lock: path.to_owned(),
            option,
        },
        LockError::Io(source) => io_error(path)(source),
    })
}

fn remove_if_there(path: &Path) -> Result<(), LifecycleError> {
    ignore_missing(fs::remove_file(path)).map_err(io_error(path))
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
        let first = Lease::take(place.clone()).unwrap();
        let error = Lease::take(place.clone()).unwrap_err().to_string();
        assert!(error.contains(&std::process::id().to_string()), "{error}");
        drop(first);
        Lease::take(place).unwrap();
    }

    #[test]
    fn a_prefix_in_use_elsewhere_is_refused() {
        let (here, there) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let first = place(here.path());
        let _lease = Lease::take(first.clone()).unwrap();
        let second = Place { prefix: first.prefix, ..place(there.path()) };
        let error = Lease::take(second).unwrap_err().to_string();
        assert!(error.contains("--prefix"), "{error}");
    }

    #[test]
    fn a_lease_is_published_and_leaves_nothing_of_itself_or_of_the_dead() {
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        endpoint::create_runtime_dir(&place.runtime_dir).unwrap();
        let dead = Instance::create(&place).unwrap();
        let lease = Lease::take(place.clone()).unwrap();
        assert!(!dead.root.exists() && lease.instance.root.exists());
        lease.publish().unwrap();
        let found = Endpoint::find(&place.runtime_dir).unwrap();
        assert_eq!((&found.prefix, &found.root), (&lease.instance.prefix, &lease.instance.root));
        // A client of the dead one was just making a file.
        fs::create_dir_all(&dead.root).unwrap();
        lease.sweep();
        assert!(!dead.root.exists() && lease.instance.root.exists());
        drop(lease);
        assert!(matches!(Endpoint::find(&place.runtime_dir), Err(EndpointError::NoDaemon(_))));
        assert_eq!(fs::read_dir(&place.root).unwrap().count(), 0);
    }

    #[test]
    fn a_runtime_folder_open_to_others_is_refused() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let place = place(dir.path());
        fs::create_dir(&place.runtime_dir).unwrap();
        fs::set_permissions(&place.runtime_dir, fs::Permissions::from_mode(0o755)).unwrap();
        let error = Lease::take(place).unwrap_err().to_string();
        assert!(error.contains("chmod 700"), "{error}");
    }
}
