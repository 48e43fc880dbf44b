//! Signals that come while a call waits for the daemon.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use sbdp_client::{ClientError, Interrupt};

use crate::error::raised;

/// What signal handlers of Python raised while a call waited for the daemon.
#[derive(Clone, Default)]
pub(crate) struct Signals(Arc<Mutex<Option<PyErr>>>);

impl Signals {
    /// Asks Python regularly whether a signal, such as Ctrl-C, has arrived.
    pub(crate) fn interrupt(&self) -> Interrupt {
        let raised = Arc::clone(&self.0);
        Interrupt::new(move || {
            let Err(error) = Python::attach(|py| py.check_signals()) else { return false };
            *raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            true
        })
    }

    /// A client error as an exception, or the exception of the signal handler that ended the call.
    pub(crate) fn raised(&self, py: Python<'_>, error: &ClientError) -> PyErr {
        let by_handler = match error {
            ClientError::Interrupted => self.0.lock().unwrap_or_else(PoisonError::into_inner).take(),
            _ => None,
        };
        by_handler.unwrap_or_else(|| raised(py, error))
    }
}
