//! Errors as callers of gRPC get them: a status code, a message, and the number of an [`ErrorCode`].

use sbdp_client::{ClientError, ErrorCode as DaemonCode};
use tonic::metadata::{MetadataMap, MetadataValue};
use tonic::{Code, Status};

use crate::proto::ErrorCode;

/// Trailing metadata: the number of an [`ErrorCode`].
const CODE: &str = "sbdp-code";
/// Trailing metadata: milliseconds after which to try again.
const RETRY: &str = "sbdp-retry-ms";

/// Milliseconds after which to try again where a limit of the gateway is reached: about as long as a short plan
/// takes. At half, callers ask more often in vain; at double, a free place stays empty longer.
const USUAL_RETRY_MS: u32 = 250;

/// The gRPC status code that goes with an error; the proto file has the same table.
fn grpc_code(code: ErrorCode) -> Code {
    match code {
        ErrorCode::Unspecified => Code::Unknown,
        ErrorCode::Malformed
        | ErrorCode::Geometry
        | ErrorCode::NoSuchPart
        | ErrorCode::Unsupported
        | ErrorCode::TooLarge
        | ErrorCode::Argument
        | ErrorCode::RequestTooLong => Code::InvalidArgument,
        ErrorCode::UnknownHandle => Code::NotFound,
        ErrorCode::Busy | ErrorCode::TooManyClients | ErrorCode::SharedMemory => Code::ResourceExhausted,
        ErrorCode::Expired => Code::DeadlineExceeded,
        ErrorCode::SlowReader => Code::Aborted,
        ErrorCode::Cancelled => Code::Cancelled,
        ErrorCode::ShuttingDown
        | ErrorCode::NoDaemon
        | ErrorCode::DaemonDied
        | ErrorCode::Setup
        | ErrorCode::Timeout => Code::Unavailable,
        ErrorCode::Unusable => Code::FailedPrecondition,
        ErrorCode::Failed | ErrorCode::Protocol | ErrorCode::Internal => Code::Internal,
    }
}

fn status(code: ErrorCode, message: impl Into<String>, retry_ms: Option<u32>) -> Status {
    let mut metadata = MetadataMap::new();
    metadata.insert(CODE, MetadataValue::from(code as i32));
    if let Some(retry_ms) = retry_ms {
        metadata.insert(RETRY, MetadataValue::from(retry_ms));
    }
    Status::with_metadata(grpc_code(code), message, metadata)
}

/// What the client of the daemon says.
pub(crate) fn refused(error: &ClientError) -> Status {
    let retry_ms = error.retry_after().map(|time| u32::try_from(time.as_millis()).unwrap_or(u32::MAX));
    status(code_of(error), error.to_string(), retry_ms)
}

fn code_of(error: &ClientError) -> ErrorCode {
    match error {
        ClientError::Refused(refused) => match refused.code {
            DaemonCode::Malformed => ErrorCode::Malformed,
            DaemonCode::UnknownHandle => ErrorCode::UnknownHandle,
            DaemonCode::Busy => ErrorCode::Busy,
            DaemonCode::Expired => ErrorCode::Expired,
            DaemonCode::Geometry => ErrorCode::Geometry,
            DaemonCode::NoSuchPart => ErrorCode::NoSuchPart,
            DaemonCode::Unsupported => ErrorCode::Unsupported,
            DaemonCode::Failed => ErrorCode::Failed,
            DaemonCode::SlowReader => ErrorCode::SlowReader,
            DaemonCode::ShuttingDown => ErrorCode::ShuttingDown,
            DaemonCode::TooLarge => ErrorCode::TooLarge,
            DaemonCode::Cancelled => ErrorCode::Cancelled,
        },
        ClientError::DaemonDied { .. } => ErrorCode::DaemonDied,
        ClientError::Endpoint(_) if error.is_no_daemon() => ErrorCode::NoDaemon,
        ClientError::Endpoint(_) | ClientError::Layout(_) => ErrorCode::Unusable,
        ClientError::TooManyClients => ErrorCode::TooManyClients,
        ClientError::Setup(_) => ErrorCode::Setup,
        ClientError::Timeout { .. } => ErrorCode::Timeout,
        ClientError::NoSuchPart { .. } => ErrorCode::NoSuchPart,
        ClientError::SharedMemory { .. } => ErrorCode::SharedMemory,
        ClientError::RequestTooLong { .. } => ErrorCode::RequestTooLong,
        ClientError::Malformed(_) | ClientError::Protocol(_) => ErrorCode::Protocol,
        // A wait of the gateway is interrupted only when it shuts down, or when nobody waits for the answer.
        ClientError::Interrupted => ErrorCode::ShuttingDown,
        // The gateway gives each plan a client of its own, holds no views, forks nothing, and has no sessions.
        ClientError::StreamOpen
        | ClientError::ViewsHeld
        | ClientError::Forked { .. }
        | ClientError::NoAssemblySession => ErrorCode::Internal,
    }
}

/// A field of a request cannot be used.
pub(crate) fn argument(field: &str, problem: impl std::fmt::Display) -> Status {
    status(ErrorCode::Argument, format!("`{field}`: {problem}"), None)
}

/// Something about a part of an upload cannot be used.
pub(crate) fn part(name: &str, problem: impl std::fmt::Display) -> Status {
    status(ErrorCode::Argument, format!("part `{name}`: {problem}"), None)
}

/// An upload is longer than it may be.
pub(crate) fn too_large(message: impl Into<String>) -> Status {
    status(ErrorCode::TooLarge, message, None)
}

/// A limit of the gateway is reached for now.
pub(crate) fn busy(message: impl Into<String>) -> Status {
    status(ErrorCode::Busy, message, Some(USUAL_RETRY_MS))
}

/// The deadline of the call has passed.
pub(crate) fn expired() -> Status {
    status(ErrorCode::Expired, "the deadline of the call passed before the daemon had answered", None)
}

/// The caller does not read.
pub(crate) fn slow_reader() -> Status {
    let message =
        "the events of this plan were not read for a minute: read them as they come, or ask for less";
    status(ErrorCode::SlowReader, message, None)
}

/// The gateway ends.
pub(crate) fn shutting_down() -> Status {
    status(ErrorCode::ShuttingDown, "the gateway is shutting down: start `sbdp-gateway` again", None)
}

/// A fault of the gateway.
pub(crate) fn internal(message: &str) -> Status {
    status(ErrorCode::Internal, format!("{message}; please report this"), None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sbdp_ipc::error::WireError;

    #[test]
    fn codes_of_the_daemon_keep_their_numbers() {
        for number in 1..=12 {
            let code = DaemonCode::from_wire(number).unwrap();
            let error = ClientError::Refused(WireError::new(code, "message"));
            assert_eq!(code_of(&error) as u32, number);
        }
        assert_eq!(DaemonCode::from_wire(13), None, "a new code needs a place in the proto file");
    }

    #[test]
    fn the_table_of_the_proto_file_is_that_of_the_gateway() {
        let text = include_str!("../../../ipc/proto/sbdp/v1/planner.proto");
        let table = text.split_once("enum ErrorCode {").unwrap().1.split_once('}').unwrap().0;
        let mut documented = String::new();
        let mut codes = 0;
        for line in table.lines().map(str::trim) {
            if let Some((name, _)) = line.split_once(" = ") {
                let code = ErrorCode::from_str_name(name).unwrap();
                let named = format!("{:?}", grpc_code(code)).to_uppercase();
                let expected = documented
                    .rsplit_once('[')
                    .map_or("UNKNOWN".to_owned(), |(_, code)| code.trim_end_matches(']').replace('_', ""));
                assert_eq!(named, expected, "{name}");
                documented.clear();
                codes += 1;
            } else {
                documented += line;
            }
        }
        assert!(codes > 20, "{codes}");
    }

    #[test]
    fn busy_says_when_to_try_again() {
        let status = refused(&ClientError::Refused(WireError::busy("full", 40)));
        assert_eq!(status.code(), Code::ResourceExhausted);
        assert_eq!(status.metadata().get(CODE).unwrap(), "3");
        assert_eq!(status.metadata().get(RETRY).unwrap(), "40");
    }
}
