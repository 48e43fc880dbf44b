//! Loading the assemblies that the configuration lists.

use std::path::Path;

use crate::geometry::{GeometryError, SourceAssembly};

/// Loads a file or folder.
pub(crate) fn load(path: &Path) -> Result<SourceAssembly, GeometryError> {
    Err(GeometryError::Unreadable {
        path: path.display().to_string(),
        reason: "loading files is not part of this build".to_owned(),
    })
}
