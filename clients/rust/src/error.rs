//! Errors, with what to do about them.

use std::fmt;
use std::time::Duration;

use sbdp_ipc::bytes::Malformed;
use sbdp_ipc::endpoint::EndpointError;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::layout::{LayoutError, MAX_CLIENTS};
use sbdp_ipc::services::SetupError;

/// Why a call failed.
#[derive(thiserror::Error)]
pub enum ClientError {
    /// There is no usable daemon: none is running, it has another version, or its folder is not safe.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// `daemon.json` names a prefix or root that cannot be used.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The daemon has as many clients as it can serve.
    #[error("the daemon serves {MAX_CLIENTS} clients already: try again when one has left")]
    TooManyClients,
    /// Shared memory could not be set up.
    #[error("cannot reach the daemon: {0}; if this persists, restart `sbdpd`")]
    Setup(#[from] SetupError),
    /// No answer in time.
    #[error("the daemon gave no answer to `{what}` within {after:?}: it is overloaded or stopped")]
    Timeout {
        /// The request.
        what: &'static str,
        /// How long the client waited.
        after: Duration,
    },
    /// The daemon's process ended before it answered.
    #[error(
        "the daemon (pid {pid}) went away before it had answered: restart `sbdpd`, upload again, ask again"
    )]
    DaemonDied {
        /// Its process id.
        pid: u32,
    },
    /// This client is already receiving a plan.
    #[error("this client receives a plan already: finish or drop that stream, or connect another client")]
    StreamOpen,
    /// Two chunks of the plan are still held, and the next one needs the space.
    #[error("two chunks of this plan are still held: drop their steps before asking for the next one")]
    ViewsHeld,
    /// The caller interrupted the call.
    #[error("interrupted while waiting for the daemon")]
    Interrupted,
    /// The client belongs to the process that this one was forked from.
    #[error("this client belongs to process {pid}, which this one was forked from: connect another one here")]
    Forked {
        /// The process that connected.
        pid: u32,
    },
    /// There is no part of this name.
    #[error("the assembly has no part `{name}`")]
    NoSuchPart {
        /// The name.
        name: String,
    },
    /// A session does not support these options.
    #[error("a session replans how an assembly comes apart: leave out `assembly` in its options")]
    NoAssemblySession,
    /// The daemon answered with an error.
    #[error("{}{}", .0.message, hint(.0.code))]
    Refused(WireError),
    /// `/dev/shm` has too little space for the upload.
    #[error(
        "{needed} bytes are to be handed over, but /dev/shm has only {free} free: enlarge it \
         (`mount -o remount,size=…`, `docker run --shm-size`)"
    )]
    SharedMemory {
        /// Bytes needed.
        needed: u64,
        /// Bytes free.
        free: u64,
    },
    /// The request is too long for the wire.
    #[error("the request names too many parts for one message ({bytes} bytes)")]
    RequestTooLong {
        /// Its length.
        bytes: usize,
    },
    /// The daemon's answer cannot be read.
    #[error("the daemon's answer cannot be read ({0}): use matching versions")]
    Malformed(#[from] Malformed),
    /// The daemon's answer does not fit the request, or a chunk is missing.
    #[error("the daemon's answer is wrong: {0}; please report this")]
    Protocol(String),
}

/// Like `Display`, so that `fn main() -> Result<(), ClientError>` says what to do as well.
impl fmt::Debug for ClientError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

impl ClientError {
    /// The daemon's error code, if it answered with an error.
    #[must_use]
    pub fn code(&self) -> Option<ErrorCode> {
        match self {
            Self::Refused(error) => Some(error.code),
            _ => None,
        }
    }

    /// If the daemon is busy, the time to wait before the next try.
    #[must_use]
    pub fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Refused(error) if error.code == ErrorCode::Busy => {
                Some(Duration::from_millis(u64::from(error.retry_ms.max(1))))
            }
            _ => None,
        }
    }

    /// Whether no daemon is running, or it is gone.
    #[must_use]
    pub fn is_no_daemon(&self) -> bool {
        matches!(
            self,
            Self::Endpoint(EndpointError::NoDaemon(_) | EndpointError::Gone { .. }) | Self::DaemonDied { .. }
        )
    }
}

fn hint(code: ErrorCode) -> &'static str {
    match code {
        ErrorCode::UnknownHandle => " (call `upload` again, then ask again)",
        ErrorCode::Busy => " (try again later, or raise `queue` in the daemon's configuration)",
        ErrorCode::Failed => " (the daemon's log says more)",
        ErrorCode::ShuttingDown => " (start `sbdpd` again)",
        _ => "",
    }
}
