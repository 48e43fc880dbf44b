//! The measure of latency: a peer that only copies bytes into the daemon's chunks, and a client that
//! only waits for them. The services, their limits and the way of waking are the daemon's, so that what
//! remains is what iceoryx2 itself takes.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use sbdp_ipc::Transport;
use sbdp_ipc::endpoint::{Endpoint, create_runtime_dir, default_prefix};
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseHeader, id_of_words, id_words};
use sbdp_ipc::layout::{self, PLAN_REQUEST, WAKE_CLIENT_SERVICE, WAKE_SERVER_SERVICE};
use sbdp_ipc::services::{self, ClientPort, Pending, SetupError};

use super::BenchError;
use crate::daemon::transport::{ActiveLink, Link, Ports};

/// An idle peer looks for its end so often.
const TICK: Duration = Duration::from_millis(200);

impl From<SetupError> for BenchError {
    fn from(error: SetupError) -> Self {
        Self::Failed(error.to_string())
    }
}

/// Answers every request with chunks of these sizes, until `end` becomes true.
///
/// # Errors
/// The place cannot be used.
pub fn serve(runtime_dir: &Path, root: &Path, chunks: &[usize], end: &AtomicBool) -> Result<(), BenchError> {
    create_runtime_dir(runtime_dir).map_err(BenchError::failed)?;
    let prefix = default_prefix(runtime_dir);
    let ports = Ports::open(&layout::iceoryx2_config(&prefix, root).map_err(BenchError::failed)?)?;
    Endpoint::of_this_process(&prefix, root).publish(runtime_dir).map_err(BenchError::failed)?;
    let chunks: Vec<Vec<u8>> = chunks.iter().map(|&bytes| vec![7; bytes]).collect();
    let mut wakes = Vec::new();
    while !end.load(Ordering::Relaxed) {
        while let Ok(Some(active)) = ports.plan.receive() {
            let header = *active.user_header();
            let link = ActiveLink(active);
            for chunk in &chunks {
                let sent = link.send(ResponseHeader::default(), chunk);
                sent.map_err(|e| BenchError::Failed(format!("a chunk was not delivered: {e:?}")))?;
            }
            wakes.push(id_of_words(header.listener));
        }
        ports.wake(&wakes);
        wakes.clear();
        let _ = ports.listener.timed_wait(|_| {}, TICK);
    }
    Ok(())
}

/// The other end.
pub(super) struct RawClient {
    port: ClientPort,
    listener: Listener<Transport>,
    notifier: Notifier<Transport>,
    _node: Node<Transport>,
}

impl RawClient {
    pub(super) fn connect(runtime_dir: &Path) -> Result<Self, BenchError> {
        let endpoint = Endpoint::find(runtime_dir).map_err(BenchError::failed)?;
        let node = services::node(
            &layout::iceoryx2_config(&endpoint.prefix, &endpoint.root).map_err(BenchError::failed)?,
        )?;
        let plan = services::plan(&node)?.open().map_err(BenchError::failed)?;
        let wake_client = services::wake(&node, WAKE_CLIENT_SERVICE)?.open().map_err(BenchError::failed)?;
        let wake_server = services::wake(&node, WAKE_SERVER_SERVICE)?.open().map_err(BenchError::failed)?;
        Ok(Self {
            port: plan
                .client_builder()
                .initial_max_slice_len(PLAN_REQUEST)
                .create()
                .map_err(BenchError::failed)?,
            listener: wake_client.listener_builder().create().map_err(BenchError::failed)?,
            notifier: wake_server.notifier_builder().create().map_err(BenchError::failed)?,
            _node: node,
        })
    }

    fn send(&self, payload: &[u8]) -> Result<Pending, BenchError> {
        let mut request = self.port.loan_slice(payload.len()).map_err(BenchError::failed)?;
        *request.user_header_mut() = RequestHeader {
            kind: RequestKind::Plan as u32,
            listener: id_words(self.listener.id().value()),
            ..RequestHeader::default()
        };
        request.payload_mut().copy_from_slice(payload);
        let pending = request.send().map_err(BenchError::failed)?;
        self.notifier.notify().map_err(BenchError::failed)?;
        Ok(pending)
    }

    /// The sizes of the chunks that answer a request, up to its end.
    pub(super) fn chunks(&self, payload: &[u8]) -> Result<Vec<usize>, BenchError> {
        let pending = self.send(payload)?;
        let mut sizes = Vec::new();
        loop {
            // Asked before looking: what was sent before the request was let go is then seen.
            let connected = pending.is_connected();
            match pending.receive().map_err(BenchError::failed)? {
                Some(answer) => sizes.push(answer.payload().len()),
                None if connected => {
                    let _ = self.listener.timed_wait(|_| {}, TICK);
                }
                None => return Ok(sizes),
            }
        }
    }

    /// Sends a request and waits for so many chunks: how long it took, and how many bytes came.
    pub(super) fn round(&self, payload: &[u8], chunks: usize) -> Result<(Duration, usize), BenchError> {
        let started = Instant::now();
        let pending = self.send(payload)?;
        let (mut received, mut length) = (0, 0);
        while received < chunks {
            match pending.receive().map_err(BenchError::failed)? {
                Some(answer) => {
                    received += 1;
                    length += answer.payload().len();
                }
                None => {
                    let _ = self.listener.timed_wait(|_| {}, TICK);
                }
            }
        }
        Ok((started.elapsed(), length))
    }
}
