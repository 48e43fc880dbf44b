//! The subject of a plan.

use std::fmt;
use std::sync::Arc;

use sbdp_ipc::geometry::Assembly;

use crate::content_hash::content_hash;
use crate::options::Handle;

/// Meshes that the caller keeps, to be uploaded whenever the daemon does not know them.
pub trait Meshes: Send + Sync {
    /// The assembly; the same at every call.
    fn assembly(&self) -> Assembly<'_>;

    /// The handle of that assembly. It is called for every plan: cache it if the meshes are large.
    fn handle(&self) -> Handle {
        content_hash(&self.assembly())
    }
}

/// The subject of a plan: an assembly that the daemon knows, or meshes that it receives when it does not know them.
#[derive(Clone)]
pub enum Subject {
    /// An assembly that was uploaded.
    Handle(Handle),
    /// Meshes.
    Meshes(Arc<dyn Meshes>),
}

impl From<Handle> for Subject {
    fn from(handle: Handle) -> Self {
        Self::Handle(handle)
    }
}

impl<M: Meshes + 'static> From<Arc<M>> for Subject {
    fn from(meshes: Arc<M>) -> Self {
        Self::Meshes(meshes)
    }
}

impl From<Arc<dyn Meshes>> for Subject {
    fn from(meshes: Arc<dyn Meshes>) -> Self {
        Self::Meshes(meshes)
    }
}

impl fmt::Debug for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Handle(handle) => write!(f, "{handle}"),
            Self::Meshes(_) => f.write_str("meshes"),
        }
    }
}
