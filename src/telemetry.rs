//! Logs: standard error, text or JSON, filtered.

use std::io::IsTerminal;

use tracing_subscriber::filter::{ParseError, Targets};
use tracing_subscriber::prelude::*;

use crate::config::{LogConfig, LogFormat};

/// Environment variable that takes precedence over the configured filter.
pub const FILTER_VARIABLE: &str = "SBDP_LOG";

/// Why logging could not start.
#[derive(Debug, thiserror::Error)]
pub enum TelemetryError {
    /// The filter cannot be parsed.
    #[error("log filter `{filter}`: {reason}")]
    Filter {
        /// The filter.
        filter: String,
        /// What is wrong.
        reason: String,
    },
    /// Logging was already started.
    #[error("logging was started twice")]
    Twice,
}

/// Checks the filter that `start` would use.
///
/// # Errors
/// It cannot be parsed.
pub fn filter(config: &LogConfig) -> Result<Targets, TelemetryError> {
    let text = std::env::var(FILTER_VARIABLE).unwrap_or_else(|_| config.filter.clone());
    text.parse().map_err(|e: ParseError| TelemetryError::Filter { filter: text, reason: e.to_string() })
}

/// Starts logging for this process.
///
/// # Errors
/// The filter cannot be parsed, or logging was started before.
pub fn start(config: &LogConfig) -> Result<(), TelemetryError> {
    let lines = tracing_subscriber::fmt::layer()
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr);
    let lines = match config.format {
        LogFormat::Text => lines.boxed(),
        LogFormat::Json => lines.json().boxed(),
    };
    let started = tracing_subscriber::registry().with(filter(config)?).with(lines).try_init();
    started.map_err(|_| TelemetryError::Twice)
}
