//! What the dispatcher handles.

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::WireError;
use sbdp_ipc::headers::RequestHeader;

use super::request_queue::Owner;
use super::workers::WorkerEvent;

/// A request as it came in: header and payload are private copies.
#[derive(Debug)]
pub(crate) struct Incoming<L> {
    pub(crate) link: L,
    /// The client's port.
    pub(crate) client: u128,
    /// The client that the request counts for in quotas.
    pub(crate) owner: Owner,
    pub(crate) header: RequestHeader,
    pub(crate) payload: AlignedBytes,
}

/// Everything that can happen.
#[derive(Debug)]
pub(crate) enum Event<L> {
    /// A client asks for a plan.
    Plan(Incoming<L>),
    /// A client gives credit for a plan's stream, or cancels its plan.
    Control(Incoming<L>),
    /// A client asks for the status.
    Status(Incoming<L>),
    /// A client asks for the metrics.
    Metrics(Incoming<L>),
    /// A client asks whether a handle is known.
    Have(Incoming<L>),
    /// A client uploads meshes.
    Upload(Incoming<L>),
    /// A client uploads the difference from a known assembly.
    Revise(Incoming<L>),
    /// A request that cannot be handled, and why.
    Unusable(Incoming<L>, WireError),
    /// A worker reports.
    Worker(WorkerEvent),
    /// SIGTERM or SIGINT.
    Terminate,
}
