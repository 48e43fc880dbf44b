//! Names and limits of the services, and the explicit iceoryx2 configuration.
//!
//! Both sides take their configuration from here and from [`crate::endpoint`], never from the
//! iceoryx2 search path, which begins in the working directory.

use std::path::{Path, PathBuf};

use iceoryx2::prelude::{Config, FileName, Path as IoxPath, SemanticString};

/// Request-response: plans, credits, status.
pub const PLAN_SERVICE: &str = "sbdp/v11/plan";
/// Request-response: meshes in, handle out.
pub const GEOMETRY_SERVICE: &str = "sbdp/v11/geometry";
/// Publish-subscribe: progress.
pub const PROGRESS_SERVICE: &str = "sbdp/v11/progress";
/// Event: wakes the daemon.
pub const WAKE_SERVER_SERVICE: &str = "sbdp/v11/wake/server";
/// Event: wakes one client.
pub const WAKE_CLIENT_SERVICE: &str = "sbdp/v11/wake/client";

/// The most clients at a time.
pub const MAX_CLIENTS: usize = 40;
/// Client ports on `geometry`: one for questions, one during an upload.
pub const MAX_GEOMETRY_CLIENTS: usize = 80;
/// The most processes that have a service open at a time.
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
    #[error("prefix `{0}` is not usable: take a few letters, digits, `_` or `-`, at most {LONGEST_PREFIX}")]
    Prefix(String),
    /// The root is not usable as a path.
    #[error(
        "root `{0}` is not usable: take an absolute path that has, together with the prefix, at most \
         {LONGEST_PLACE} bytes (sockets lie there, and their paths are short)"
    )]
    Root(PathBuf),
}

/// Bytes that the prefix and the root may have together, as they are configured. The path of a socket has at
/// most 107: root, tag and prefix with tag and their separators, an id of iceoryx2 (35 digits are more than a
/// daemon comes to in years) and `.event`.
pub const LONGEST_PLACE: usize = 107 - 2 * TAG - 3 - 35 - 6;
/// Characters that a configured prefix may have.
const LONGEST_PREFIX: usize = 30;
/// Characters of the tag that a daemon adds to its prefix and its root, so that no two share files.
pub const TAG: usize = 5;

/// Checks the prefix and the root that a daemon is given.
///
/// # Errors
/// Prefix or root are not usable.
pub fn check_place(prefix: &str, root: &Path) -> Result<(), LayoutError> {
    check(prefix, root, LONGEST_PLACE)
}

fn check(prefix: &str, root: &Path, longest: usize) -> Result<(), LayoutError> {
    let sane = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if prefix.is_empty()
        || prefix.len() > LONGEST_PREFIX + longest - LONGEST_PLACE
        || !prefix.chars().all(sane)
    {
        return Err(LayoutError::Prefix(prefix.to_owned()));
    }
    if !root.is_absolute() || prefix.len() + root.as_os_str().len() > longest {
        return Err(LayoutError::Root(root.to_owned()));
    }
    Ok(())
}

/// The iceoryx2 configuration for the prefix and root that `daemon.json` names.
///
/// # Errors
/// Prefix or root are not usable.
pub fn iceoryx2_config(prefix: &str, root: &Path) -> Result<Config, LayoutError> {
    check(prefix, root, LONGEST_PLACE + 2 * TAG + 2)?;
    let mut config = Config::default();
    config.global.prefix =
        FileName::new(prefix.as_bytes()).map_err(|_| LayoutError::Prefix(prefix.to_owned()))?;
    let root_path =
        IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|_| LayoutError::Root(root.to_owned()))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_that_is_taken_leaves_sockets_room_for_their_paths() {
        let (prefix, root) = ("sbdp_main_", Path::new("/run/user/1000/sbdp/iox/that/is/no/longer"));
        assert_eq!(prefix.len() + root.as_os_str().len(), 51);
        check_place(prefix, root).unwrap();
        let socket = format!("{}/i1234/{prefix}i1234_{}.event", root.display(), "9".repeat(35));
        assert!(socket.len() + LONGEST_PLACE - 51 <= 107);
        let longer = root.join("abc");
        let error = check_place(prefix, &longer).unwrap_err().to_string();
        assert!(error.contains("at most 53 bytes"), "{error}");
        for bad in ["", "a/b", "a.b", &"x".repeat(31)] {
            assert!(matches!(check_place(bad, Path::new("/tmp")), Err(LayoutError::Prefix(_))), "{bad}");
        }
        assert!(matches!(check_place("a_", Path::new("tmp")), Err(LayoutError::Root(_))));
        iceoryx2_config("sbdp_main_i1234_", &root.join("i1234")).unwrap();
    }
}
