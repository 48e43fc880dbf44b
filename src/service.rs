//! The planning service: assemblies that it knows by content, and plans about them.
//!
//! The daemon's workers and the command line without a daemon both call this, so what is
//! tested is what is used. It knows nothing of shared memory.

use crate::geometry::{GeometryError, SourceAssembly};
use crate::plan::{Overlap, Plan, Warning};
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
    /// The geometry was refused.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// The service. Shared by all threads.
#[derive(Debug, Default)]
pub struct Service {}

impl Service {
    /// Validates, heals and registers an assembly. The same content gives the same id, at once.
    ///
    /// # Errors
    /// The geometry was refused; the error names the part and the reason.
    pub fn admit(&self, source: &SourceAssembly) -> Result<Admission, ServiceError> {
        let _ = source;
        Err(ServiceError::UnknownAssembly)
    }

    /// Whether an assembly is known.
    #[must_use]
    pub fn knows(&self, id: AssemblyId) -> bool {
        let _ = id;
        false
    }

    /// The overlaps at the assembled pose, in the input's units.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn overlaps(&self, id: AssemblyId) -> Result<Vec<Overlap>, ServiceError> {
        let _ = id;
        Err(ServiceError::UnknownAssembly)
    }

    /// Plans. Blocks until done; `termination` ends it early with a plan that says so.
    ///
    /// # Errors
    /// Nothing could be planned: unknown id, part numbers out of range.
    pub fn plan(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError> {
        let _ = (id, request, termination, sink);
        Err(ServiceError::UnknownAssembly)
    }
}
