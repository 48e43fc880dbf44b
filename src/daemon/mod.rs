//! The daemon: the planning service behind shared memory.
//!
//! One thread owns the ports (`event_loop`): it receives, copies and checks requests, admits or refuses them,
//! and sends responses. It never plans, heals or blocks. `workers` plan and heal, and report back as events.
//! Repeated questions are answered from `response_cache` at once. While the workers are idle, assemblies are
//! prepared (`prefetch`) and likely questions are planned (`speculation`).
//! `dispatcher` handles every event with the state machine of `session`, the bounded `outbox` and `uploads`; none
//! of these knows iceoryx2, so they are tested without it. Only `convert` sees both wire and working types.

mod convert;
mod dispatcher;

mod event_loop;
mod events;

mod instance;
mod jobs;
mod lease;
mod lock;
mod metrics;
mod metrics_socket;
mod outbox;
mod outgoing;
mod place;
mod planning;
mod ports;
mod prefetch;
mod request_queue;
mod resources;
mod response_cache;
mod session;
mod shared_queue;
mod shutdown;
mod speculation;
mod supervisor;
mod thread_events;
mod uploads;
mod watchdog;
mod workers;

pub(crate) use convert::source_assembly as uploaded_assembly;
pub use event_loop::{Reload, run, run_reloading};
pub use place::{PlaceError, check_place};
pub use planning::Planning;

/// The ports, for measuring them without a daemon behind.
pub(crate) mod transport {
    pub(crate) use super::ports::{ActiveLink, Ports};
    pub(crate) use super::session::Link;
}

use sbdp_ipc::services::SetupError;

/// Why the daemon could not run.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// The place is taken or unusable.
    #[error(transparent)]
    Place(#[from] PlaceError),
    /// iceoryx2 could not be set up.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The operating system refused something.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
}
