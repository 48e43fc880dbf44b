//! The arguments of `sbdp tools`.

use std::path::PathBuf;

use clap::Args;

/// Arguments of `sbdp tools`.
#[derive(Debug, Args)]
pub(in crate::cli) struct ToolsArguments {
    /// A plan that `sbdp plan --json` wrote
    pub(in crate::cli) plan: PathBuf,
    /// Its assembly [default: the one that the plan names]
    #[arg(long, value_name = "ASSEMBLY")]
    pub(in crate::cli) meshes: Option<PathBuf>,
    /// Exit with 3 if a fastener has no tool that can turn it
    #[arg(long)]
    pub(in crate::cli) required: bool,
    /// Write the tools as JSON to this file (`-`: to stdout, instead of the table)
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}
