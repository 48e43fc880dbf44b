//! `sbdp completions` and `sbdp man`: what shells and `man` know of the command line, for packages.

use std::process::ExitCode;

use clap::CommandFactory;

use super::args::{Arguments, CompletionsArguments, ManArguments};
use super::error::CliError;
use super::print;

pub(super) fn completions(arguments: &CompletionsArguments) -> Result<ExitCode, CliError> {
    let (mut command, mut text) = (Arguments::command(), Vec::new());
    clap_complete::generate(arguments.shell, &mut command, "sbdp", &mut text);
    print(&String::from_utf8_lossy(&text))?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn pages(arguments: &ManArguments) -> Result<ExitCode, CliError> {
    let failed = |error| CliError::Failed(format!("{}: {error}", arguments.folder.display()));
    std::fs::create_dir_all(&arguments.folder).map_err(failed)?;
    clap_mangen::generate_to(Arguments::command(), &arguments.folder).map_err(failed)?;
    Ok(ExitCode::SUCCESS)
}
