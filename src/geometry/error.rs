//! Why geometry is refused. Every refusal names the file (or upload), the part and the reason.

use crate::termination::Interrupt;

/// A refusal of input geometry.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GeometryError {
    /// A file or folder could not be read.
    #[error("{path}: {reason}")]
    Unreadable {
        /// The path.
        path: String,
        /// The reader's error.
        reason: String,
    },
    /// A part's mesh cannot be used.
    #[error("{origin}: part `{part}`: {reason}")]
    Part {
        /// The file it came from, or `upload`.
        origin: String,
        /// Its name.
        part: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// The termination condition became true before the geometry was ready.
    #[error("{0} while meshes were taken in")]
    Interrupted(#[from] Interrupt),
    /// The assembly as a whole cannot be used.
    #[error("{origin}: {reason}")]
    Assembly {
        /// The folder or file.
        origin: String,
        /// What is wrong and what to do.
        reason: String,
    },
}
