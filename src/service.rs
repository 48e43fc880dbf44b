//! The planning service: assemblies that it knows by content, and plans about them.
//!
//! The daemon's workers and the command line without a daemon both call this, so what is
//! tested is what is used. It knows nothing of shared memory.
//!
//! Data flow of a request: assembly (`geometry`) → fields (`sdf`) and overlaps → `search` → plan in
//! the input's units (`plan`).

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::geometry::{Assembly, GeometryError, SourceAssembly};
use crate::plan::{Overlap, Plan, PlanContext, PreparedAssembly, Warning};
use crate::search::{PlanRequest, PlanSink, Termination};

/// The name of an assembly: the hash of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AssemblyId(pub [u8; 32]);

/// What admission found out about an assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct Admission {
    /// Its handle.
    pub id: AssemblyId,
    /// It was there before: nothing was done.
    pub known: bool,
    /// What healing found.
    pub warnings: Vec<Warning>,
}

/// Why a request was not planned at all.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// No assembly has this id (it was never uploaded, or it was evicted).
    #[error("unknown assembly: upload it (again) first")]
    UnknownAssembly,
    /// The request names a part that is not there.
    #[error("the request names part {index} in `{field}`, but the assembly has {count} parts")]
    NoSuchPart {
        /// Which list.
        field: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The worker threads for the request could not be started.
    #[error("cannot start worker threads: {0}")]
    Threads(String),
    /// The geometry was refused.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}
