//! What the port thread sends beside the streams of plans: responses of one message, progress, wake-ups.

use sbdp_ipc::clock::monotonic_ns;
use sbdp_ipc::error::WireError;
use sbdp_ipc::geometry::HandleResponse;
use sbdp_ipc::headers::{RequestHeader, ResponseHeader, ResponseKind, id_of_words};
use sbdp_ipc::progress::ProgressSample;

use super::session::Link;

/// Responses are sent at once; the rest is collected here.
#[derive(Debug, Default)]
pub(crate) struct Outgoing {
    /// Listeners to wake.
    pub(crate) wakes: Vec<u128>,
    /// Progress to publish.
    pub(crate) samples: Vec<ProgressSample>,
}

impl Outgoing {
    pub(super) fn handle(
        &mut self,
        link: &impl Link,
        request: &RequestHeader,
        handle: [u8; 32],
        known: bool,
    ) {
        let response = HandleResponse { handle, known: u32::from(known), reserved: 0 };
        self.respond(link, request, ResponseKind::Handle, bytemuck::bytes_of(&response));
    }

    pub(super) fn error(&mut self, link: &impl Link, request: &RequestHeader, error: &WireError) {
        self.send(link, request, ResponseKind::Error, &error.encode(), error.retry_ms);
    }

    pub(super) fn respond(
        &mut self,
        link: &impl Link,
        request: &RequestHeader,
        kind: ResponseKind,
        bytes: &[u8],
    ) {
        self.send(link, request, kind, bytes, 0);
    }

    /// Sends the one response to a request. Its buffer is empty, so the response fits.
    fn send(
        &mut self,
        link: &impl Link,
        request: &RequestHeader,
        kind: ResponseKind,
        bytes: &[u8],
        retry_ms: u32,
    ) {
        let header = ResponseHeader {
            kind: kind as u32,
            retry_ms,
            request: request.request,
            total: bytes.len() as u64,
            sent_ns: monotonic_ns(),
            ..ResponseHeader::default()
        };
        if let Err(error) = link.send(header, bytes) {
            tracing::debug!(?error, ?kind, "answer not delivered");
        }
        self.wakes.push(id_of_words(request.listener));
    }
}
