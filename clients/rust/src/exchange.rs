//! Sending requests and waiting for answers without burning a core.

use std::time::{Duration, Instant};

use iceoryx2::port::SendError;
use iceoryx2::port::client::RequestSendError;
use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::WireError;
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseKind, id_words};
use sbdp_ipc::services::{Answer, ClientPort, Pending, SetupError};

use crate::client::Client;
use crate::error::ClientError;
use crate::patience::Patience;

/// Longest sleep between two looks at the port: a lost wake-up costs at most this.
pub(crate) const SLICE: Duration = Duration::from_millis(200);
/// Pause before a request is tried again that the daemon had no room for.
const RETRY: Duration = Duration::from_millis(2);

impl Client {
    pub(crate) fn header(&self, kind: RequestKind, request: u64) -> RequestHeader {
        RequestHeader {
            kind: kind as u32,
            request,
            listener: id_words(self.listener.id().value()),
            ..RequestHeader::default()
        }
    }

    /// Sends a request; tries until the daemon took it or the client's timeout has passed.
    pub(crate) fn send(
        &self,
        what: &'static str,
        port: &ClientPort,
        header: RequestHeader,
        length: usize,
        fill: impl Fn(&mut [u8]),
    ) -> Result<Pending, ClientError> {
        let start = Instant::now();
        loop {
            self.refresh_endpoint()?;
            if let Some(pending) = try_send(port, header, length, &fill)? {
                self.wake_daemon();
                return Ok(pending);
            }
            if start.elapsed() > self.options.timeout {
                return Err(ClientError::Timeout { what, after: self.options.timeout });
            }
            std::thread::sleep(RETRY);
        }
    }

    pub(crate) fn wake_daemon(&self) {
        // A failed wake-up costs one tick of the daemon, no more.
        let _ = self.notifier.notify();
    }

    /// Sleeps until the daemon wakes this client, at most until `until`.
    pub(crate) fn sleep(&self, until: Instant) {
        let left = until.saturating_duration_since(Instant::now());
        if self.listener.timed_wait(|_| {}, left.min(SLICE)).is_err() {
            // Interrupted by a signal, or broken: either way the caller looks again.
            std::thread::sleep(RETRY);
        }
    }

    /// The next response, if one is there; an error if none will come.
    pub(crate) fn try_receive(&self, pending: &Pending) -> Result<Option<Answer>, ClientError> {
        // Asked before looking: what was sent before the request was let go is then seen.
        let connected = pending.is_connected();
        match pending.receive() {
            Ok(Some(answer)) => Ok(Some(answer)),
            Ok(None) if connected => self.check_alive().map(|()| None),
            Ok(None) => Err(ClientError::DaemonDied { pid: self.pid() }),
            Err(e) => Err(SetupError::at("receiving")(e).into()),
        }
    }

    /// Sends a request and waits for the one response to it; both once more where the options say so.
    pub(crate) fn ask(
        &self,
        what: &'static str,
        port: &ClientPort,
        header: RequestHeader,
        length: usize,
        fill: impl Fn(&mut [u8]),
        timeout: Duration,
    ) -> Result<AlignedBytes, ClientError> {
        let mut patience = Patience::default();
        loop {
            let sent = self.send(what, port, header, length, &fill);
            match sent.and_then(|pending| self.answer(what, &pending, timeout)) {
                Ok(answer) => return Ok(answer),
                Err(error) => patience.after(self, error)?,
            };
        }
    }

    /// Waits for the one response to a request.
    fn answer(
        &self,
        what: &'static str,
        pending: &Pending,
        timeout: Duration,
    ) -> Result<AlignedBytes, ClientError> {
        let deadline = Instant::now() + timeout;
        loop {
            if let Some(answer) = self.try_receive(pending)? {
                return open(&answer);
            }
            if Instant::now() >= deadline {
                return Err(ClientError::Timeout { what, after: timeout });
            }
            self.sleep(deadline);
        }
    }
}

impl Client {
    /// One attempt to send a control request.
    pub(crate) fn try_send_control(&self, header: RequestHeader) -> Option<Pending> {
        let length = sbdp_ipc::bytes::ALIGNMENT;
        let pending = try_send(&self.plan_port, header, length, &|_: &mut [u8]| {}).ok().flatten()?;
        self.wake_daemon();
        Some(pending)
    }
}

/// One attempt; `None` if the daemon has no room now, or is not there yet after a restart.
fn try_send(
    port: &ClientPort,
    header: RequestHeader,
    length: usize,
    fill: &impl Fn(&mut [u8]),
) -> Result<Option<Pending>, ClientError> {
    let mut request = port.loan_slice(length).map_err(SetupError::at("loaning shared memory"))?;
    *request.user_header_mut() = header;
    fill(request.payload_mut());
    match request.send() {
        Ok(pending) if pending.number_of_server_connections() > 0 => Ok(Some(pending)),
        Ok(_) | Err(RequestSendError::SendError(SendError::UnableToDeliver)) => Ok(None),
        Err(RequestSendError::ExceedsMaxActiveRequests) => Ok(None),
        Err(e) => Err(SetupError::at("sending")(e).into()),
    }
}

/// A copy of a response's payload; an error response becomes an error.
fn open(answer: &Answer) -> Result<AlignedBytes, ClientError> {
    let bytes = AlignedBytes::copy_of(answer.payload());
    let header = answer.user_header();
    if ResponseKind::from_wire(header.kind) == Some(ResponseKind::Error) {
        let error = WireError { retry_ms: header.retry_ms, ..WireError::decode(bytes.as_slice())? };
        return Err(ClientError::Refused(error));
    }
    Ok(bytes)
}
