//! The command line.

#[path = "../allocator.rs"]
mod allocator;

use std::process::ExitCode;

fn main() -> ExitCode {
    sbdp::cli::run()
}
