//! What a plan is about.

use std::fmt;
use std::sync::Arc;

use sbdp_ipc::geometry::Assembly;

use crate::content_hash::content_hash;
use crate::options::Handle;

/// Meshes that are kept, to be uploaded whenever the daemon does not know them.
pub trait Meshes: Send + Sync {
    /// The assembly that they are; the same whenever it is asked.
    fn assembly(&self) -> Assembly<'_>;

    /// The handle of that assembly. It is asked for every plan: remember it where meshes are large.
    fn handle(&self) -> Handle {
        content_hash(&self.assembly())
    }
}

/// What a plan is about: an assembly that the daemon knows, or meshes that it gets when it does not know them (any more).
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
