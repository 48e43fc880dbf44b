//! `sbdp config`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::error::CliError;
use super::print;
use crate::config::Config;
use crate::{daemon, telemetry};

/// Arguments of `sbdp config`.
#[derive(Debug, Args)]
pub(super) struct ConfigArguments {
    #[command(subcommand)]
    command: ConfigCommand,
}

#[derive(Debug, Subcommand)]
enum ConfigCommand {
    /// Check whether a file is a valid configuration; names the line that is wrong
    Check {
        /// A configuration of `sbdpd`
        file: PathBuf,
    },
}

pub(super) fn run(arguments: &ConfigArguments) -> Result<ExitCode, CliError> {
    let ConfigCommand::Check { file } = &arguments.command;
    let config = Config::load(file).map_err(|e| CliError::Refused(e.to_string()))?;
    let in_file = |e: String| CliError::Refused(format!("{}: {e}", file.display()));
    daemon::check_place(&config.endpoint).map_err(|e| in_file(e.to_string()))?;
    telemetry::filter(&config.log).map_err(|e| in_file(e.to_string()))?;
    print("the configuration is fine\n")?;
    Ok(ExitCode::SUCCESS)
}
