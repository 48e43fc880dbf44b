//! What waits for the workers: plans to make, and assemblies to take in.

use std::path::PathBuf;
use std::time::Instant;

use sbdp_ipc::bytes::AlignedBytes;

use super::request_queue::Owner;
use crate::geometry::Pose;
use crate::search::{PlanRequest, Termination};
use crate::service::AssemblyId;

/// Which plan request: the client port's id and its number there.
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
    /// What is remembered with its answer, if anything is to be.
    pub(crate) question: Option<Vec<u8>>,
    /// Parts that stand elsewhere than in it.
    pub(crate) moved: Vec<(usize, Pose)>,
    pub(crate) request: PlanRequest,
    pub(crate) termination: Termination,
}

#[cfg(test)]
impl PlanJob {
    /// A request about an assembly by nobody in particular.
    pub(super) fn about(assembly: AssemblyId, request: PlanRequest) -> Self {
        Self {
            key: SessionKey { client: 0, request: 0 },
            owner: Owner::default(),
            received: Instant::now(),
            assembly,
            question: None,
            moved: vec![],
            request,
            termination: Termination::default(),
        }
    }
}

/// What was received with an upload.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) number: u64,
    /// A private copy.
    pub(crate) bytes: AlignedBytes,
    /// True once nobody waits for it.
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
