//! Codes of errors.

use sbdp_client::ClientError;

/// The result of a call. A number keeps its meaning for ever. Codes below 100 are the daemon's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum SbdpCode {
    /// Success.
    Ok = 0,
    /// The daemon cannot read the request.
    Malformed = 1,
    /// The daemon has no assembly of this handle: upload it (again).
    UnknownHandle = 2,
    /// The daemon's queue is full: try again after `retry_ms`.
    Busy = 3,
    /// The deadline passed before planning began.
    Expired = 4,
    /// The geometry was refused; the message names part and reason.
    Geometry = 5,
    /// There is no such part.
    NoSuchPart = 6,
    /// The request needs something that this daemon does not offer.
    Unsupported = 7,
    /// The daemon failed; its log says more.
    Failed = 8,
    /// The client did not read the plan, and the daemon ended it.
    SlowReader = 9,
    /// The daemon is shutting down.
    ShuttingDown = 10,
    /// The message exceeds a limit of the daemon, or the memory that is left.
    TooLarge = 11,
    /// The request was cancelled before planning began.
    Cancelled = 12,
    /// No daemon is running at this place.
    NoDaemon = 100,
    /// The daemon went away before it answered.
    DaemonDied = 101,
    /// The daemon speaks another version, or its folder or files cannot be used.
    Unusable = 102,
    /// The daemon has as many clients as it can serve.
    TooManyClients = 103,
    /// Shared memory could not be set up.
    Setup = 104,
    /// No answer in time to a request that needs no planning.
    Timeout = 105,
    /// This client is already receiving a plan.
    StreamOpen = 106,
    /// Steps of two messages are kept in place: free them, then continue.
    ViewsHeld = 107,
    /// The interrupt function ended the call.
    Interrupted = 108,
    /// The client belongs to the process that this one was forked from.
    Forked = 109,
    /// An argument cannot be used; the message names it.
    Argument = 110,
    /// `/dev/shm` has too little space.
    SharedMemory = 111,
    /// The request names too many parts for one message.
    RequestTooLong = 112,
    /// The daemon's answer is wrong or cannot be read.
    Protocol = 113,
    /// A fault of this library: free the handles of this call, and report it.
    Internal = 114,
}

impl SbdpCode {
    const DAEMON: [Self; 12] = [
        Self::Malformed,
        Self::UnknownHandle,
        Self::Busy,
        Self::Expired,
        Self::Geometry,
        Self::NoSuchPart,
        Self::Unsupported,
        Self::Failed,
        Self::SlowReader,
        Self::ShuttingDown,
        Self::TooLarge,
        Self::Cancelled,
    ];

    pub(crate) fn of(error: &ClientError) -> Self {
        if let Some(code) = error.code() {
            let number = code as u32;
            return Self::DAEMON.into_iter().find(|c| *c as u32 == number).unwrap_or(Self::Failed);
        }
        match error {
            ClientError::DaemonDied { .. } => Self::DaemonDied,
            ClientError::Endpoint(_) if error.is_no_daemon() => Self::NoDaemon,
            ClientError::Endpoint(_) | ClientError::Layout(_) => Self::Unusable,
            ClientError::TooManyClients => Self::TooManyClients,
            ClientError::Setup(_) => Self::Setup,
            ClientError::Timeout { .. } => Self::Timeout,
            ClientError::StreamOpen => Self::StreamOpen,
            ClientError::ViewsHeld => Self::ViewsHeld,
            ClientError::Interrupted => Self::Interrupted,
            ClientError::Forked { .. } => Self::Forked,
            ClientError::NoSuchPart { .. } => Self::NoSuchPart,
            ClientError::NoAssemblySession => Self::Argument,
            ClientError::SharedMemory { .. } => Self::SharedMemory,
            ClientError::RequestTooLong { .. } => Self::RequestTooLong,
            ClientError::Malformed(_) | ClientError::Protocol(_) => Self::Protocol,
            ClientError::Refused(_) => Self::Failed,
        }
    }
}
