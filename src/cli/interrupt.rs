//! Ctrl-C: the first asks the work to stop and answer with what it has, the second ends the
//! process.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::error::CliError;

/// Sets `cancel` at the first interrupt; another one finds it set and exits.
pub(super) fn cancel_on_interrupt(cancel: &Arc<AtomicBool>) -> Result<(), CliError> {
    // In this order: the shutdown must look at the flag before the second handler sets it.
    let listen = |signal| {
        flag::register_conditional_shutdown(signal, 5, Arc::clone(cancel))?;
        flag::register(signal, Arc::clone(cancel))
    };
    let registered: std::io::Result<Vec<_>> = [SIGINT, SIGTERM].into_iter().map(listen).collect();
    registered.map(drop).map_err(|e| CliError::Failed(format!("cannot listen for Ctrl-C: {e}")))
}
