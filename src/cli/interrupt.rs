//! Ctrl-C: the first asks the work to stop and answer with what it has, the second ends the
//! process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::error::CliError;

/// Sets `cancel` at the first interrupt.
pub(super) fn cancel_on_interrupt(cancel: Arc<AtomicBool>) -> Result<(), CliError> {
    ctrlc::set_handler(move || {
        if cancel.swap(true, Ordering::Relaxed) {
            std::process::exit(5);
        }
        eprintln!("cancelling; once more ends at once");
    })
    .map_err(|e| CliError::Failed(format!("cannot listen for Ctrl-C: {e}")))
}
