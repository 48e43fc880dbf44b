//! Logs: standard error, text or JSON, filtered.

use std::io::IsTerminal;

use tracing_subscriber::EnvFilter;

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
    /// Somebody set a subscriber before.
    #[error("logging was started twice")]
    Twice,
}

/// Checks the filter that `start` would use.
///
/// # Errors
/// It cannot be parsed.
pub fn filter(config: &LogConfig) -> Result<EnvFilter, TelemetryError> {
    let text = std::env::var(FILTER_VARIABLE).unwrap_or_else(|_| config.filter.clone());
    EnvFilter::try_new(&text).map_err(|e| TelemetryError::Filter { filter: text, reason: e.to_string() })
}

/// Starts logging for this process.
///
/// # Errors
/// The filter cannot be parsed, or logging was started before.
pub fn start(config: &LogConfig) -> Result<(), TelemetryError> {
    let builder = tracing_subscriber::fmt()
        .with_env_filter(filter(config)?)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr);
    let started = match config.format {
        LogFormat::Text => builder.try_init(),
        LogFormat::Json => builder.json().try_init(),
    };
    started.map_err(|_| TelemetryError::Twice)
}
