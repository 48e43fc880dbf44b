//! The command line.

use std::process::ExitCode;

fn main() -> ExitCode {
    sbdp::cli::run()
}
