//! The arguments that name an assembly.

use std::path::PathBuf;

use clap::Args;

use crate::cache::CacheSettings;
use crate::files::{IgnorePattern, LoadOptions, Split, StepSettings, load};
use crate::geometry::{GeometryError, SourceAssembly};

/// The heading of its options, as in `src/cli/README.md`.
const INPUT: &str = "Input";

/// An assembly, and how its files are read.
#[derive(Debug, Args)]
pub(in crate::cli) struct Input {
    /// A folder of OBJ, STL, PLY, OFF, GLB, 3MF or STEP files in assembled pose, or one such file with the whole assembly in it
    pub(in crate::cli) assembly: PathBuf,
    /// What counts as a part in a file that holds several: each object, group, solid or primitive; each separate body; or
    /// the whole file (of a scene each node) [default: what a file of the whole assembly names, if these are bodies]
    #[arg(long, value_name = "objects|bodies|none", help_heading = INPUT)]
    pub(in crate::cli) split: Option<Split>,
    /// Leave out parts whose names, or whose files' names, match a pattern, as '*bolt*' (repeatable)
    #[arg(long, value_name = "GLOB", help_heading = INPUT)]
    pub(in crate::cli) ignore: Vec<IgnorePattern>,
    /// The program that converts STEP files to GLB (see clients/step) [default: $SBDP_STEP, else `sbdp-step` beside this
    /// program or on PATH]
    #[arg(long, value_name = "PROGRAM", help_heading = INPUT)]
    pub(in crate::cli) converter: Option<PathBuf>,
    /// Largest distance of the triangles of a STEP file from its surfaces, in mm [default: 0.01]
    #[arg(long, value_name = "MM", value_parser = deflection, help_heading = INPUT)]
    pub(in crate::cli) deflection: Option<f64>,
}

fn deflection(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|mm: &f64| mm.is_finite() && *mm > 0.0);
    number.ok_or_else(|| format!("`{text}` is no positive number of millimetres"))
}

impl Input {
    /// Reads the assembly; converted STEP files are remembered in the default folder.
    ///
    /// # Errors
    /// As [`load`].
    pub(in crate::cli) fn read(&self) -> Result<SourceAssembly, GeometryError> {
        load(&self.assembly, &self.options(CacheSettings::default_folder()))
    }

    /// How the files are read. Converted STEP files are remembered in the folder, if there is one.
    pub(in crate::cli) fn options(&self, cache_folder: Option<PathBuf>) -> LoadOptions {
        let step =
            StepSettings { converter: self.converter.clone(), cache_folder, ..StepSettings::default() };
        let step = StepSettings { deflection: self.deflection.unwrap_or(step.deflection), ..step };
        LoadOptions { split: self.split, ignore: self.ignore.clone(), step: Some(step) }
    }
}
