//! Where the configuration puts the daemon: its folders and its prefix in shared memory.

use std::io;
use std::path::{Path, PathBuf};

use sbdp_ipc::endpoint::{self, EndpointError};
use sbdp_ipc::layout::{self, LayoutError};

use crate::config::EndpointConfig;

/// The name of a lock file.
pub(super) const LOCK_FILE: &str = "lock";

/// Why the daemon cannot have its place.
#[derive(Debug, thiserror::Error)]
pub enum PlaceError {
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
pub(crate) struct DaemonPlace {
    pub(crate) runtime_dir: PathBuf,
    pub(crate) prefix: String,
    pub(crate) root: PathBuf,
}

impl DaemonPlace {
    pub(crate) fn of(config: &EndpointConfig) -> Result<Self, PlaceError> {
        let chosen = config.runtime_dir.clone().unwrap_or_else(endpoint::default_runtime_dir);
        // The default prefix and root derive from it: it must mean the same from everywhere.
        let runtime_dir = std::path::absolute(&chosen).map_err(io_error(&chosen))?;
        let prefix = config.prefix.clone().unwrap_or_else(|| endpoint::default_prefix(&runtime_dir));
        let root = config.root.clone().unwrap_or_else(|| runtime_dir.join("iox"));
        Ok(Self { runtime_dir, prefix, root })
    }

    pub(super) fn prefix_lock(&self) -> PathBuf {
        Path::new("/dev/shm").join(format!("{}{LOCK_FILE}", self.prefix))
    }
}

/// Checks that a configured place can be used, without touching it.
///
/// # Errors
/// Prefix or root are not usable.
pub fn check_place(config: &EndpointConfig) -> Result<(), PlaceError> {
    let DaemonPlace { prefix, root, .. } = DaemonPlace::of(config)?;
    layout::check_place(&prefix, &root)?;
    Ok(())
}

pub(super) fn io_error(path: &Path) -> impl FnOnce(io::Error) -> PlaceError {
    let path = path.to_owned();
    move |source| PlaceError::Io { path, source }
}

/// The result of a removal, where somebody else may have removed the same before.
pub(super) fn ignore_missing(removed: io::Result<()>) -> io::Result<()> {
    match removed {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}
