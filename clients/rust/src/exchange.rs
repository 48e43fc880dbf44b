//! Sending requests and waiting for answers, without busy waiting.

use std::time::{Duration, Instant};

use iceoryx2::port::SendError;
use iceoryx2::port::client::RequestSendError;
use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::WireError;
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseKind, id_words};
use sbdp_ipc::services::{Answer, ClientPort, Pending, SetupError};

use crate::client::Client;
use crate::connection::{ASKED, Connection, INTERRUPTIBLE, RETRY, SLICE, Through};
use crate::error::ClientError;
use crate::patience::Patience;
use crate::process_bound::ProcessBound;

impl Client {
    /// A header that lacks only the listener: that one belongs to the connection.
    pub(crate) fn header(kind: RequestKind, request: u64) -> RequestHeader {
        RequestHeader { kind: kind as u32, request, ..RequestHeader::default() }
    }

    /// Sends a request and waits for the one response to it; both once more where the options say so.
    pub(crate) fn ask(
        &self,
        what: &'static str,
        through: Through,
        header: RequestHeader,
        length: usize,
        fill: impl Fn(&mut [u8]),
        timeout: Duration,
    ) -> Result<AlignedBytes, ClientError> {
        let mut patience = Patience::default();
        let attempt = || {
            let connection = self.connection()?;
            let port = connection.port(through)?;
            let pending = self.send(&connection, what, &port, header, length, &fill)?;
            Ok(self.answer(&connection, what, &pending, timeout))
        };
        loop {
            let error = match attempt() {
                Ok(Ok(answer)) => return Ok(answer),
                Ok(Err(error)) => {
                    patience.asked();
                    error
                }
                Err(error) => error,
            };
            self.pause(patience.after(self.options(), error)?)?;
        }
    }

    /// Sends a request; tries until the daemon took it or the timeout of short questions has passed. The caller has
    /// just seen the daemon alive.
    pub(crate) fn send(
        &self,
        connection: &Connection,
        what: &'static str,
        port: &ClientPort,
        header: RequestHeader,
        length: usize,
        fill: impl Fn(&mut [u8]),
    ) -> Result<ProcessBound<Pending>, ClientError> {
        let (start, timeout) = (Instant::now(), self.options().timeout);
        loop {
            if let Some(pending) = connection.try_send(port, header, length, &fill)? {
                connection.wake_daemon();
                return Ok(pending);
            }
            connection.check_alive()?;
            self.check_interrupt()?;
            if start.elapsed() > timeout {
                return Err(ClientError::Timeout { what, after: timeout });
            }
            std::thread::sleep(RETRY);
        }
    }

    /// Waits for the one response to a request.
    fn answer(
        &self,
        connection: &Connection,
        what: &'static str,
        pending: &Pending,
        timeout: Duration,
    ) -> Result<AlignedBytes, ClientError> {
        let deadline = Instant::now() + timeout;
        let mut slept = false;
        loop {
            let seen = connection.wakes();
            if let Some(answer) = connection.try_receive(pending, slept)? {
                return open(&answer);
            }
            if !slept && connection.comes_at_once(pending) {
                continue;
            }
            self.check_interrupt()?;
            if Instant::now() >= deadline {
                return Err(ClientError::Timeout { what, after: timeout });
            }
            connection.sleep(deadline, seen, self.slice());
            slept = true;
        }
    }

    /// Longest sleep between two looks.
    pub(crate) fn slice(&self) -> Duration {
        if self.options().interrupt.is_some() { INTERRUPTIBLE } else { SLICE }
    }
}

impl Connection {
    /// One attempt to send a control request.
    pub(crate) fn try_send_control(&self, header: RequestHeader) -> Option<ProcessBound<Pending>> {
        let length = sbdp_ipc::bytes::ALIGNMENT;
        let pending = self.try_send(&self.plan, header, length, &|_: &mut [u8]| {}).ok().flatten()?;
        self.wake_daemon();
        Some(pending)
    }

    /// One attempt; `None` if the daemon has no room now.
    fn try_send(
        &self,
        port: &ClientPort,
        header: RequestHeader,
        length: usize,
        fill: &impl Fn(&mut [u8]),
    ) -> Result<Option<ProcessBound<Pending>>, ClientError> {
        // A long one has a port of its own.
        let _writing = (length <= ASKED).then(|| self.begin_writing());
        let mut request = port.loan_slice(length).map_err(SetupError::at("loaning shared memory"))?;
        *request.user_header_mut() = RequestHeader { listener: id_words(self.listener_id()), ..header };
        fill(request.payload_mut());
        match request.send() {
            Ok(pending) if pending.number_of_server_connections() > 0 => Ok(Some(ProcessBound::new(pending))),
            Ok(_) | Err(RequestSendError::SendError(SendError::UnableToDeliver)) => Ok(None),
            Err(RequestSendError::ExceedsMaxActiveRequests) => Ok(None),
            Err(e) => Err(SetupError::at("sending")(e).into()),
        }
    }

    /// The next response, if one is there; an error if none will come. Whether the daemon is still alive is
    /// asked if this was waited for already (`slept`): it is a call to the system, which answers that come
    /// soon do without.
    pub(crate) fn try_receive(&self, pending: &Pending, slept: bool) -> Result<Option<Answer>, ClientError> {
        // Asked before looking: what was sent before the request was let go is then seen.
        let connected = pending.is_connected();
        match pending.receive() {
            Ok(Some(answer)) => Ok(Some(answer)),
            Ok(None) if connected && slept => self.check_alive().map(|()| None),
            Ok(None) if connected => Ok(None),
            Ok(None) => Err(self.died()),
            Err(e) => Err(SetupError::at("receiving")(e).into()),
        }
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
