//! What waits for the workers: plans to make, and assemblies to take in.

use std::path::PathBuf;
use std::time::Instant;

use sbdp_ipc::bytes::AlignedBytes;

use super::request_queue::Owner;
use crate::geometry::Pose;
use crate::report::ReportQuery;
use crate::search::{PlanRequest, Termination};
use crate::service::AssemblyId;

/// The key of a plan request: the client port's id, and the request's number there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct SessionKey {
    pub(crate) client: u128,
    pub(crate) request: u64,
}

/// A plan to make.
#[derive(Debug)]
pub(crate) struct PlanJob {
    pub(crate) key: SessionKey,
    pub(crate) owner: Owner,
    pub(crate) received: Instant,
    pub(crate) assembly: AssemblyId,
    /// The key under which the response is cached, if the request allows that.
    pub(crate) question: Option<Vec<u8>>,
    /// Parts that the request moves.
    pub(crate) moved: Vec<(usize, Pose)>,
    pub(crate) request: PlanRequest,
    /// What to report about the plan.
    pub(crate) reports: ReportQuery,
    /// The client wants the events of the search.
    pub(crate) trace: bool,
    pub(crate) termination: Termination,
}

#[cfg(test)]
impl PlanJob {
    /// A request about an assembly, from no client.
    pub(super) fn about(assembly: AssemblyId, request: PlanRequest) -> Self {
        Self {
            key: SessionKey { client: 0, request: 0 },
            owner: Owner::default(),
            received: Instant::now(),
            assembly,
            question: None,
            moved: vec![],
            request,
            reports: ReportQuery::default(),
            trace: false,
            termination: Termination::default(),
        }
    }
}

/// An upload as it was received.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) number: u64,
    /// A private copy.
    pub(crate) bytes: AlignedBytes,
    /// Becomes true when the client left.
    pub(crate) termination: Termination,
}

/// An assembly to take in.
#[derive(Debug)]
pub(crate) enum AdmitJob {
    /// Received meshes.
    Upload(Received),
    /// The same of what differs from a known assembly.
    Revise(Received),
    /// A file or folder of the configuration.
    Preload(PathBuf),
}

impl AdmitJob {
    /// The upload's number, if it is one.
    pub(super) fn number(&self) -> Option<u64> {
        match self {
            Self::Upload(received) | Self::Revise(received) => Some(received.number),
            Self::Preload(_) => None,
        }
    }
}
