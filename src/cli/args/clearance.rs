//! The arguments of `sbdp clearance`.

use std::path::PathBuf;

use clap::Args;

use super::poses::not_negative;

/// Arguments of `sbdp clearance`.
#[derive(Debug, Args)]
pub(in crate::cli) struct ClearanceArguments {
    /// A plan that `sbdp plan --json` wrote
    pub(in crate::cli) plan: PathBuf,
    /// Its assembly [default: the one that the plan names]
    #[arg(long, value_name = "ASSEMBLY")]
    pub(in crate::cli) meshes: Option<PathBuf>,
    /// Report what comes nearer than this (input's units), or is not certain not to, and exit with 3 if anything does. Parts that are nearer to
    /// each other as they stand only have to keep what they have
    #[arg(long, value_name = "LENGTH", value_parser = not_negative, allow_negative_numbers = true)]
    pub(in crate::cli) at_least: Option<f64>,
    /// Write the clearances as JSON to this file (`-`: to stdout, instead of the table)
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}
