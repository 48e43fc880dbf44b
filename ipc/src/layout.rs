//! Names and limits of the services, and the explicit iceoryx2 configuration.
//!
//! Both sides take their configuration from here and from [`crate::endpoint`], never from the
//! iceoryx2 search path: that one begins in the working directory.

use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, Path as IoxPath, SemanticString};

/// Request-response: plans, credits, status.
pub const PLAN_SERVICE: &str = "sbdp/v1/plan";
/// Request-response: meshes in, handle out.
pub const GEOMETRY_SERVICE: &str = "sbdp/v1/geometry";
/// Publish-subscribe: progress.
pub const PROGRESS_SERVICE: &str = "sbdp/v1/progress";
/// Event: wakes the daemon.
pub const WAKE_SERVER_SERVICE: &str = "sbdp/v1/wake/server";
/// Event: wakes one client.
pub const WAKE_CLIENT_SERVICE: &str = "sbdp/v1/wake/client";

/// Clients at once.
pub const MAX_CLIENTS: usize = 40;
/// Client ports on `geometry`: one to ask, one while an upload lasts.
pub const MAX_GEOMETRY_CLIENTS: usize = 80;
/// Processes at once that have a service open.
pub const MAX_NODES: usize = 64;
/// Listeners and notifiers on the event services.
pub const MAX_EVENT_PORTS: usize = 64;
/// Active requests per client on `plan`: a plan, a control request, a status request.
pub const PLAN_ACTIVE_REQUESTS: usize = 3;
/// Responses that wait in a client's buffer for one request.
pub const RESPONSE_BUFFER: usize = 8;
/// Chunks that a stream may have in flight without credit. One place in the buffer is kept
/// free, so that the error that ends a stream always finds room.
pub const STREAM_WINDOW: u64 = RESPONSE_BUFFER as u64 - 1;
/// Received chunks after which a client grants credit.
pub const CREDIT_STEP: u64 = 3;
/// Responses that a client may hold at once for one request.
pub const BORROWED_RESPONSES: usize = 2;
/// Bytes of a chunk on `plan`.
pub const PLAN_CHUNK: usize = 256 * 1024;
/// Bytes of the longest request on `plan`.
pub const PLAN_REQUEST: usize = 256 * 1024;
/// Bytes of a response on `geometry` (a handle, or an error with its text).
pub const GEOMETRY_RESPONSE: usize = 32 * 1024;
/// Progress samples that wait for a subscriber before the oldest is dropped.
pub const PROGRESS_BUFFER: usize = 8;

/// Why a prefix or root cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LayoutError {
    /// The prefix is not a file name part.
    #[error("prefix `{0}` is not usable: take 1 to 64 letters, digits, `_` or `-`")]
    Prefix(String),
    /// The root is not usable as a path.
    #[error("root `{0}` is not usable: take an absolute path of at most 180 bytes")]
    Root(PathBuf),
}

/// The iceoryx2 configuration for a prefix and a root.
///
/// # Errors
/// Prefix or root are not usable.
pub fn iceoryx2_config(prefix: &str, root: &Path) -> Result<Config, LayoutError> {
    let sane = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if prefix.is_empty() || prefix.len() > 64 || !prefix.chars().all(sane) {
        return Err(LayoutError::Prefix(prefix.to_owned()));
    }
    let root_bytes = root.as_os_str().as_encoded_bytes();
    if !root.is_absolute() || root_bytes.len() > 180 {
        return Err(LayoutError::Root(root.to_owned()));
    }
    let mut config = Config::default();
    config.global.prefix =
        FileName::new(prefix.as_bytes()).map_err(|_| LayoutError::Prefix(prefix.to_owned()))?;
    let root_path = IoxPath::new(root_bytes).map_err(|_| LayoutError::Root(root.to_owned()))?;
    config.global.set_root_path(&root_path);
    Ok(config)
}

/// Files in shared memory that carry a prefix.
///
/// # Errors
/// `/dev/shm` cannot be listed.
pub fn shared_memory_files(prefix: &str) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/dev/shm")? {
        let entry = entry?;
        if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
            found.push(entry.path());
        }
    }
    Ok(found)
}
