//! The arguments that name an assembly.

use std::path::PathBuf;

use clap::Args;

use crate::files::{IgnorePattern, LoadOptions, Split, load};
use crate::geometry::{GeometryError, SourceAssembly};

/// An assembly, and how its files are read.
#[derive(Debug, Args)]
pub(in crate::cli) struct Input {
    /// A folder of OBJ, STL or GLB files in assembled pose, or one such file with the whole assembly in it
    pub(in crate::cli) assembly: PathBuf,
    /// What is a part in a file that holds several: each object, group, solid or primitive; each separate body; or all of
    /// it (of a scene each node) [default: what a file of the whole assembly names, if these are bodies]
    #[arg(long, value_name = "objects|bodies|none")]
    pub(in crate::cli) split: Option<Split>,
    /// Leave out the parts whose names, or whose files' names, fit a pattern, as '*bolt*' (repeatable)
    #[arg(long, value_name = "GLOB")]
    pub(in crate::cli) ignore: Vec<IgnorePattern>,
}

impl Input {
    /// Reads the assembly.
    ///
    /// # Errors
    /// As [`load`].
    pub(in crate::cli) fn read(&self) -> Result<SourceAssembly, GeometryError> {
        load(&self.assembly, &LoadOptions { split: self.split, ignore: self.ignore.clone() })
    }
}
