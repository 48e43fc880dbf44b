//! How far the daemon's shutdown is.

use std::time::{Duration, Instant};

use sbdp_ipc::error::{ErrorCode, WireError};

/// The phase of a shutdown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shutdown {
    /// Nobody requested it.
    NotRequested,
    /// Running requests may finish until then.
    Grace(Instant),
    /// Running requests are cancelled, and must be answered by then.
    Drain(Instant),
}

impl Shutdown {
    pub(super) fn is_requested(self) -> bool {
        self != Self::NotRequested
    }

    /// When the next phase begins without an event.
    pub(super) fn end(self) -> Option<Instant> {
        match self {
            Self::NotRequested => None,
            Self::Grace(end) | Self::Drain(end) => Some(end),
        }
    }

    /// The phase after a signal: the first one begins the grace, the second one ends it.
    pub(super) fn requested(self, now: Instant, grace: Duration) -> Self {
        match self {
            Self::NotRequested => Self::Grace(now + grace),
            Self::Grace(_) => Self::Grace(now),
            Self::Drain(_) => self,
        }
    }

    /// The answer to requests that come during a shutdown.
    pub(super) fn error() -> WireError {
        WireError::new(ErrorCode::ShuttingDown, "the daemon is shutting down")
    }
}
