//! Ctrl-C: the first asks the work to stop and answer with what it has, the second ends the
//! process.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::error::CliError;

/// The exit code of what was cancelled.
const CANCELLED: i32 = 5;

/// Lets interrupts end the process at once as long as the flag is set, which it is: while there is nothing yet to answer
/// with.
pub(super) fn end_on_interrupt() -> Result<Arc<AtomicBool>, CliError> {
    let at_once = Arc::new(AtomicBool::new(true));
    let listen = |signal| flag::register_conditional_shutdown(signal, CANCELLED, Arc::clone(&at_once));
    registered([SIGINT, SIGTERM].into_iter().map(listen))?;
    Ok(at_once)
}

/// Sets `cancel` at the first interrupt; another one finds it set and exits.
pub(super) fn cancel_on_interrupt(cancel: &Arc<AtomicBool>) -> Result<(), CliError> {
    // In this order: the shutdown must look at the flag before the second handler sets it.
    let listen = |signal| {
        flag::register_conditional_shutdown(signal, CANCELLED, Arc::clone(cancel))?;
        flag::register(signal, Arc::clone(cancel))
    };
    registered([SIGINT, SIGTERM].into_iter().map(listen))
}

fn registered<T>(all: impl Iterator<Item = std::io::Result<T>>) -> Result<(), CliError> {
    let all: std::io::Result<Vec<_>> = all.collect();
    all.map(drop).map_err(|e| CliError::Failed(format!("cannot listen for Ctrl-C: {e}")))
}
