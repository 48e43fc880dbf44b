//! The lease of a place: its locks, `daemon.json`, and the instance in shared memory.

use std::fs;
use std::path::Path;

use sbdp_ipc::endpoint::{self, DAEMON_FILE, Endpoint};
use sbdp_ipc::layout;

use super::instance::{Instance, sweep};
use super::lock::{LockError, LockFile};
use super::place::{DaemonPlace, LOCK_FILE, PlaceError, ignore_missing, io_error};

/// The held locks. Dropping it removes `daemon.json` and the instance's files in shared memory.
#[derive(Debug)]
pub(crate) struct Lease {
    place: DaemonPlace,
    /// This daemon's part of shared memory.
    pub(crate) instance: Instance,
    _locks: [LockFile; 2],
}

impl Lease {
    /// Takes the locks, or reports their holder; then removes the files of dead daemons.
    pub(crate) fn take(place: DaemonPlace) -> Result<Self, PlaceError> {
        layout::check_place(&place.prefix, &place.root)?;
        endpoint::create_runtime_dir(&place.runtime_dir)?;
        let folder_lock = take_lock(&place.runtime_dir.join(LOCK_FILE), "--runtime-dir")?;
        // Shared memory has no folders: without this lock, the files of a daemon with another folder but the same
        // prefix would be removed while it runs.
        let prefix_lock = take_lock(&place.prefix_lock(), "--prefix")?;
        remove_if_there(&place.runtime_dir.join(DAEMON_FILE))?;
        sweep(&place, None);
        let instance = Instance::create(&place)?;
        Ok(Self { place, instance, _locks: [folder_lock, prefix_lock] })
    }

    /// Writes `daemon.json`, by which clients find the daemon. To be called when the ports are open.
    pub(crate) fn publish(&self) -> Result<(), PlaceError> {
        Endpoint::of_this_process(&self.instance.prefix, &self.instance.root)
            .publish(&self.place.runtime_dir)
            .map_err(PlaceError::from)
    }

    /// Removes files that clients of dead daemons created after `take`.
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

fn take_lock(path: &Path, option: &'static str) -> Result<LockFile, PlaceError> {
    LockFile::take(path).map_err(|error| match error {
        LockError::Held(pid) => PlaceError::Taken {
            pid: pid.map_or_else(|| "unknown".to_owned(), |pid| pid.to_string()),
            lock: path.to_owned(),
            option,
        },
        LockError::Io(source) => io_error(path)(source),
    })
}

fn remove_if_there(path: &Path) -> Result<(), PlaceError> {
    ignore_missing(fs::remove_file(path)).map_err(io_error(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::EndpointConfig;
    use sbdp_ipc::endpoint::EndpointError;

    fn place(dir: &Path) -> DaemonPlace {
        let config = EndpointConfig { runtime_dir: Some(dir.join("run")), ..EndpointConfig::default() };
        DaemonPlace::of(&config).unwrap()
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
        let second = DaemonPlace { prefix: first.prefix, ..place(there.path()) };
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
