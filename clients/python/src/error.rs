//! Errors as Python raises them: a class per code, in `sbdp.errors`.

use pyo3::exceptions::{PyBufferError, PyKeyboardInterrupt};
use pyo3::prelude::*;
use sbdp::geometry::GeometryError;
use sbdp_client::{ClientError, ErrorCode};

/// An error of the class of this name.
fn of_class(py: Python<'_>, class: &str, message: &str, retry_after: Option<f64>) -> PyErr {
    let made = || {
        let error = py.import("sbdp.errors")?.getattr(class)?.call1((message,))?;
        if let Some(seconds) = retry_after {
            error.setattr("retry_after", seconds)?;
        }
        PyResult::Ok(PyErr::from_value(error))
    };
    made().unwrap_or_else(|broken| broken)
}

/// A client error as an exception.
pub(crate) fn raised(py: Python<'_>, error: &ClientError) -> PyErr {
    let message = error.to_string();
    let class = match error {
        ClientError::ViewsHeld => return PyBufferError::new_err(message),
        ClientError::Interrupted => return PyKeyboardInterrupt::new_err(message),
        ClientError::Refused(refused) => match refused.code {
            ErrorCode::Malformed => "MalformedError",
            ErrorCode::UnknownHandle => "UnknownHandleError",
            ErrorCode::Busy => "BusyError",
            ErrorCode::Expired => "ExpiredError",
            ErrorCode::Geometry => "GeometryError",
            ErrorCode::NoSuchPart => "NoSuchPartError",
            ErrorCode::Unsupported => "UnsupportedError",
            ErrorCode::Failed => "FailedError",
            ErrorCode::SlowReader => "SlowReaderError",
            ErrorCode::ShuttingDown => "ShuttingDownError",
            ErrorCode::TooLarge => "TooLargeError",
            ErrorCode::Cancelled => "CancelledError",
        },
        ClientError::NoSuchPart { .. } => "NoSuchPartError",
        error if error.is_no_daemon() => "NoDaemonError",
        ClientError::Timeout { .. } => "TimeoutError",
        ClientError::StreamOpen => "StreamOpenError",
        ClientError::Forked { .. } => "ForkedError",
        ClientError::TooManyClients => "TooManyClientsError",
        ClientError::SharedMemory { .. } => "SharedMemoryError",
        ClientError::RequestTooLong { .. } => "TooLargeError",
        ClientError::NoAssemblySession => "UnsupportedError",
        _ => "ConnectionError",
    };
    of_class(py, class, &message, error.retry_after().map(|time| time.as_secs_f64()))
}

/// An error in files or meshes, as an exception.
pub(crate) fn refused(py: Python<'_>, error: &GeometryError) -> PyErr {
    of_class(py, "GeometryError", &error.to_string(), None)
}

/// There is no part of this name.
pub(crate) fn no_such_part(py: Python<'_>, name: &str) -> PyErr {
    raised(py, &ClientError::NoSuchPart { name: name.to_owned() })
}
