//! Where the daemon is: the runtime folder and its `daemon.json`.

use std::fs::{self, DirBuilder};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::{ICEORYX2_VERSION, PROTOCOL};

/// Name of the file that describes the daemon.
pub const DAEMON_FILE: &str = "daemon.json";
/// Environment variable that names the runtime folder.
pub const RUNTIME_DIR_VARIABLE: &str = "SBDP_RUNTIME_DIR";

/// The content of `daemon.json`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Endpoint {
    /// The daemon's process id.
    pub pid: u32,
    /// Version of the wire contract.
    pub protocol: u32,
    /// Version of iceoryx2: nodes and services carry it.
    pub iceoryx2: String,
    /// Prefix of all files in shared memory.
    pub prefix: String,
    /// Folder of iceoryx2's files.
    pub root: PathBuf,
}

/// Why there is no usable endpoint.
#[derive(Debug, thiserror::Error)]
pub enum EndpointError {
    /// No `daemon.json`.
    #[error("no sbdp daemon is running (no {0}): start one with `sbdpd`")]
    NoDaemon(PathBuf),
    /// `daemon.json` names a process that is gone.
    #[error("the sbdp daemon (pid {pid}) that wrote {file} is gone: start a new one with `sbdpd`")]
    Gone {
        /// Its process id.
        pid: u32,
        /// The file.
        file: PathBuf,
    },
    /// The daemon speaks another version.
    #[error(
        "the daemon speaks protocol {protocol} over iceoryx2 {iceoryx2}, this client {PROTOCOL} over \
         {ICEORYX2_VERSION}: use matching versions"
    )]
    VersionMismatch {
        /// Its protocol.
        protocol: u32,
        /// Its iceoryx2.
        iceoryx2: String,
    },
    /// The folder belongs to another user, or other users can access it.
    #[error("runtime folder {path} is not safe: {reason}")]
    Unsafe {
        /// The folder.
        path: PathBuf,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// `daemon.json` cannot be understood.
    #[error("{path} cannot be understood: {reason}; remove it and restart `sbdpd`")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl Endpoint {
    /// An endpoint of this process.
    #[must_use]
    pub fn of_this_process(prefix: &str, root: &Path) -> Self {
        Self {
            pid: std::process::id(),
            protocol: PROTOCOL,
            iceoryx2: ICEORYX2_VERSION.to_owned(),
            prefix: prefix.to_owned(),
            root: root.to_owned(),
        }
    }

    /// Reads `daemon.json` and checks that its daemon is alive and speaks this version.
    ///
    /// # Errors
    /// See [`EndpointError`].
    pub fn find(runtime_dir: &Path) -> Result<Self, EndpointError> {
        let file = runtime_dir.join(DAEMON_FILE);
        if !file.exists() {
            return Err(EndpointError::NoDaemon(file));
        }
        check_folder(runtime_dir)?;
        let this = Self::read(&file)?;
        if !this.is_alive() {
            return Err(EndpointError::Gone { pid: this.pid, file });
        }
        if this.protocol != PROTOCOL || this.iceoryx2 != ICEORYX2_VERSION {
            let Self { protocol, iceoryx2, .. } = this;
            return Err(EndpointError::VersionMismatch { protocol, iceoryx2 });
        }
        Ok(this)
    }

    /// Reads `daemon.json` as it is.
    ///
    /// # Errors
    /// It does not exist or cannot be understood.
    pub fn read(file: &Path) -> Result<Self, EndpointError> {
        let text = fs::read(file).map_err(|source| match source.kind() {
            io::ErrorKind::NotFound => EndpointError::NoDaemon(file.to_owned()),
            _ => EndpointError::Io { path: file.to_owned(), source },
        })?;
        serde_json::from_slice(&text)
            .map_err(|e| EndpointError::Damaged { path: file.to_owned(), reason: e.to_string() })
    }

    /// Publishes `daemon.json` atomically.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn publish(&self, runtime_dir: &Path) -> Result<(), EndpointError> {
        let path = runtime_dir.join(DAEMON_FILE);
        let draft = runtime_dir.join(format!("{DAEMON_FILE}.{}", self.pid));
        let write = || -> io::Result<()> {
            fs::write(&draft, serde_json::to_vec_pretty(self)?)?;
            fs::rename(&draft, &path)
        };
        write().map_err(|source| EndpointError::Io { path: path.clone(), source })
    }

    /// Whether its process is alive ([`is_process_alive`]).
    #[must_use]
    pub fn is_alive(&self) -> bool {
        is_process_alive(self.pid)
    }
}

/// Whether a process is alive. One that ended but was not waited for by its parent yet (a
/// zombie) can be signalled but never answers: it counts as dead.
#[must_use]
pub fn is_process_alive(pid: u32) -> bool {
    let Some(id) = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw) else {
        return false;
    };
    rustix::process::test_kill_process(id) != Err(rustix::io::Errno::SRCH) && !has_ended(pid)
}

/// Whether the process is a zombie; `false` where /proc does not tell.
fn has_ended(pid: u32) -> bool {
    // "PID (NAME) STATE …", where the name may hold anything, brackets included.
    let stat = fs::read(format!("/proc/{pid}/stat")).unwrap_or_default();
    let state = stat.iter().rposition(|&b| b == b')').and_then(|end| stat.get(end + 2));
    matches!(state, Some(b'Z' | b'X'))
}

/// The runtime folder: `$SBDP_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR/sbdp`, else `/tmp/sbdp-UID`.
#[must_use]
pub fn default_runtime_dir() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    set(RUNTIME_DIR_VARIABLE)
        .or_else(|| set("XDG_RUNTIME_DIR").map(|d| d.join("sbdp")))
        .unwrap_or_else(|| PathBuf::from(format!("/tmp/sbdp-{}", rustix::process::getuid().as_raw())))
}

/// The prefix that belongs to a runtime folder unless the configuration names another: shared
/// memory ignores folders, so daemons of different folders must differ in prefix.
#[must_use]
pub fn default_prefix(runtime_dir: &Path) -> String {
    let hash = blake3::hash(runtime_dir.as_os_str().as_encoded_bytes()).to_hex();
    format!("sbdp_{}_", &hash[..8])
}

/// Creates the runtime folder with mode 0700, or checks the one that is there.
///
/// # Errors
/// It cannot be created, belongs to another user, or other users can access it.
pub fn create_runtime_dir(path: &Path) -> Result<(), EndpointError> {
    match DirBuilder::new().mode(0o700).recursive(false).create(path) {
        Ok(()) => {}
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
        Err(source) => return Err(EndpointError::Io { path: path.to_owned(), source }),
    }
    check_folder(path)
}

fn check_folder(path: &Path) -> Result<(), EndpointError> {
    let refuse =
        |reason: &str| Err(EndpointError::Unsafe { path: path.to_owned(), reason: reason.to_owned() });
    let meta =
        fs::symlink_metadata(path).map_err(|source| EndpointError::Io { path: path.to_owned(), source })?;
    if !meta.is_dir() {
        return refuse("it is not a folder (a link will not do)");
    }
    if meta.uid() != rustix::process::getuid().as_raw() {
        return refuse("it belongs to another user; set SBDP_RUNTIME_DIR to a folder of your own");
    }
    if meta.mode() & 0o077 != 0 {
        return refuse("others may enter it; run `chmod 700` on it");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};

    fn endpoint(pid: u32) -> Endpoint {
        Endpoint { pid, ..Endpoint::of_this_process("x_", Path::new("/")) }
    }

    #[test]
    fn a_process_that_ended_is_dead_before_and_after_its_parent_waited() {
        assert!(endpoint(std::process::id()).is_alive());
        let mut child = std::process::Command::new("sleep").arg("1000").spawn().unwrap();
        let pid = child.id();
        assert!(endpoint(pid).is_alive());
        child.kill().unwrap();
        // Waits for the end and leaves the zombie.
        let ended = WaitIdOptions::EXITED | WaitIdOptions::NOWAIT;
        waitid(WaitId::Pid(Pid::from_child(&child)), ended).unwrap();
        assert!(!endpoint(pid).is_alive(), "a zombie");
        child.wait().unwrap();
        assert!(!endpoint(pid).is_alive());
    }

    #[test]
    fn no_process_has_number_zero() {
        assert!(!endpoint(0).is_alive());
        assert!(!endpoint(u32::MAX).is_alive());
    }
}
