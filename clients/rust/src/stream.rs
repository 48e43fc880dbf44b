//! A plan as it comes in.

use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::Assembly;
use sbdp_ipc::headers::{CONTROL_CANCEL, RequestKind, ResponseHeader, ResponseKind, id_of_words};
use sbdp_ipc::layout::{CREDIT_STEP, PLAN_REQUEST};
use sbdp_ipc::plan::{StepView, StepsView};
use sbdp_ipc::progress::{STAGE_SDF, STAGE_TRANSFER};
use sbdp_ipc::services::{Answer, Pending};

use crate::client::Client;
use crate::connection::{Connection, SLICE};
use crate::error::ClientError;
use crate::options::{Handle, PlanOptions};
use crate::patience::{Again, Patience};
use crate::summary::Summary;

/// No message may announce more than this (it would be put together in memory).
const LONGEST_MESSAGE: u64 = 1 << 30;
/// So often one assembly is uploaded again for one plan: a daemon that forgets it again at once has no
/// room for it.
const UPLOADS_AGAIN: u32 = 3;

/// The stages of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Building distance fields.
    Sdf,
    /// Searching and verifying.
    Search,
    /// Finding the ways to where insertions begin.
    Transfer,
}

/// What the daemon is doing; some of these are lost on purpose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// The stage that runs.
    pub stage: Stage,
    /// Units of the stage done.
    pub done: u32,
    /// Units of the stage in all.
    pub total: u32,
    /// Simulations so far.
    pub simulations: u64,
}

/// What a stream yields.
#[allow(clippy::large_enum_variant, reason = "there is one summary in a stream")]
#[derive(Debug)]
pub enum Event<'s> {
    /// Something moved on.
    Progress(Progress),
    /// A verified step, in order; its slices lie in shared memory and live as long as the
    /// borrow of the stream, that is until the next event is asked for.
    Step(StepView<'s>),
    /// Events of the search, if the trace is wanted: whole lines, one JSON object each.
    Trace(String),
    /// The daemon went away, and another one has taken its place and was asked again: the steps and the trace so far
    /// are void, and all of them come again from the first.
    Restarted,
    /// The end: everything else about the plan.
    Done(Summary),
}

/// A plan as it comes in. Dropping it cancels the request.
#[derive(Debug)]
pub struct PlanStream<'c> {
    client: &'c Client,
    connection: Arc<Connection>,
    /// It is the client's one plan.
    is_open: bool,
    pending: Option<Pending>,
    /// The last control request: it must live until the daemon saw it or a newer one.
    control: Option<Pending>,
    request: u64,
    received: u64,
    granted: u64,
    cancel_wanted: bool,
    cancel_sent: bool,
    message: Message,
    next_step: usize,
    parts: Option<Parts>,
    question: Question<'c>,
    patience: Patience,
}

/// What was asked, to ask it again.
#[derive(Debug)]
struct Question<'c> {
    bytes: Vec<u8>,
    /// To be uploaded again if the daemon does not know it any more.
    assembly: Option<&'c Assembly<'c>>,
    /// How often that happened without a plan.
    uploads: u32,
}

/// The message that is being read.
#[derive(Debug)]
enum Message {
    None,
    /// In place.
    Shared(Answer),
    /// Put together from several chunks.
    Owned(AlignedBytes),
}

/// A message that comes in several chunks.
#[derive(Debug)]
struct Parts {
    kind: u32,
    bytes: AlignedBytes,
    filled: u64,
}

/// What `advance` found; the borrow of the step is made by the caller.
#[allow(clippy::large_enum_variant, reason = "there is one summary in a stream")]
enum Found {
    Restarted,
    Progress(Progress),
    Step(usize),
    Trace(String),
    Done(Summary),
}

impl Message {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::None => &[],
            Self::Shared(answer) => answer.payload(),
            Self::Owned(bytes) => bytes.as_slice(),
        }
    }
}

impl Client {
    /// Asks for a plan.
    ///
    /// # Errors
    /// The daemon is gone, or this client receives a plan already. What the daemon refuses
    /// (`busy`, an unknown handle) comes as the stream's first result.
    pub fn plan(&self, handle: Handle, options: &PlanOptions) -> Result<PlanStream<'_>, ClientError> {
        self.stream(Question { bytes: options.to_wire(handle).encode(), assembly: None, uploads: 0 })
    }

    /// Uploads an assembly and asks for a plan; uploads it again whenever the daemon does not know it any
    /// more, as after a restart.
    ///
    /// # Errors
    /// The geometry is refused, the daemon is gone, or this client receives a plan already.
    pub fn plan_assembly<'c>(
        &'c self,
        assembly: &'c Assembly<'c>,
        options: &PlanOptions,
    ) -> Result<PlanStream<'c>, ClientError> {
        let handle = self.upload(assembly)?;
        let bytes = options.to_wire(handle).encode();
        self.stream(Question { bytes, assembly: Some(assembly), uploads: 0 })
    }

    fn stream<'c>(&'c self, question: Question<'c>) -> Result<PlanStream<'c>, ClientError> {
        if question.bytes.len() > PLAN_REQUEST {
            return Err(ClientError::RequestTooLong { bytes: question.bytes.len() });
        }
        let connection = self.known_connection();
        if self.planning.replace(true) {
            return Err(ClientError::StreamOpen);
        }
        // From here on the stream lets the client go, however this ends.
        let mut stream = PlanStream {
            client: self,
            connection,
            is_open: true,
            pending: None,
            control: None,
            request: 0,
            received: 0,
            granted: 0,
            cancel_wanted: false,
            cancel_sent: false,
            message: Message::None,
            next_step: 0,
            parts: None,
            question,
            patience: Patience::default(),
        };
        if let Err(error) = stream.send() {
            stream.ask_again(error)?;
        }
        Ok(stream)
    }
}

impl PlanStream<'_> {
    /// Asks, as if nothing had been asked before.
    fn send(&mut self) -> Result<(), ClientError> {
        self.message = Message::None;
        self.parts = None;
        self.control = None;
        self.pending = None;
        (self.received, self.granted, self.next_step) = (0, 0, 0);
        self.cancel_sent = false;
        self.request = self.client.new_request();
        self.connection = self.client.connection()?;
        let header = Client::header(RequestKind::Plan, self.request);
        let (connection, bytes) = (&self.connection, &self.question.bytes);
        let fill = |out: &mut [u8]| out.copy_from_slice(bytes);
        let timeout = self.client.options.timeout;
        self.pending = Some(connection.send("plan", &connection.plan, header, bytes.len(), fill, timeout)?);
        Ok(())
    }

    /// Asks once more after an error that a client gets over by itself.
    fn recover(&mut self, error: ClientError) -> Result<Option<Found>, ClientError> {
        // Of a plan that is not wanted any more only the end is: where a daemon is, it has said it.
        if self.cancel_wanted && !error.is_no_daemon() {
            return Err(error);
        }
        let forgotten = error.code() == Some(ErrorCode::UnknownHandle);
        if let Some(assembly) = self.question.assembly.filter(|_| forgotten)
            && self.question.uploads < UPLOADS_AGAIN
        {
            self.question.uploads += 1;
            self.client.upload(assembly)?;
            self.send()?;
            return Ok(None);
        }
        Ok(self.ask_again(error)?.then_some(Found::Restarted))
    }

    /// Asks until it could be asked; whether that was another daemon.
    fn ask_again(&mut self, mut error: ClientError) -> Result<bool, ClientError> {
        let (until, mut restarted) = (Instant::now() + self.client.options.reconnect, false);
        loop {
            restarted |= self.patience.after(self.client, error)? == Again::Restarted;
            // That daemon may die, too, before it is asked.
            match self.send() {
                Ok(()) => return Ok(restarted),
                Err(e) if restarted && Instant::now() >= until => return Err(e),
                Err(e) => error = e,
            }
        }
    }
}

impl PlanStream<'_> {
    /// Waits for the next event; `None` after [`Event::Done`]. Waits as long as the daemon
    /// lives: give [`PlanOptions::timeout`] to bound the planning itself.
    ///
    /// # Errors
    /// The daemon refused, failed or died. The stream is over then.
    pub fn next_event(&mut self) -> Result<Option<Event<'_>>, ClientError> {
        self.next_event_until(None, Duration::ZERO)
    }

    /// Like [`Self::next_event`], but gives up after a while with [`ClientError::Timeout`]; the
    /// stream can be used further then.
    ///
    /// # Errors
    /// As above, and when nothing came in time.
    pub fn next_event_within(&mut self, timeout: Duration) -> Result<Option<Event<'_>>, ClientError> {
        self.next_event_until(Some(Instant::now() + timeout), timeout)
    }

    /// Asks the daemon to stop soon. The stream goes on until `Done`, which then says
    /// `cancelled` unless the plan was ready before. To leave without an answer, drop the stream.
    pub fn cancel(&mut self) {
        self.cancel_wanted = true;
        self.send_control();
    }

    fn next_event_until(
        &mut self,
        deadline: Option<Instant>,
        timeout: Duration,
    ) -> Result<Option<Event<'_>>, ClientError> {
        let found = loop {
            let error = match self.advance(deadline, timeout) {
                Ok(found) => break found,
                Err(timeout @ ClientError::Timeout { .. }) => return Err(timeout),
                Err(error) => error,
            };
            match self.recover(error) {
                Ok(None) => {}
                Ok(found) => break found,
                Err(error) => {
                    self.close();
                    return Err(error);
                }
            }
        };
        Ok(match found {
            None => None,
            Some(Found::Restarted) => Some(Event::Restarted),
            Some(Found::Progress(progress)) => Some(Event::Progress(progress)),
            Some(Found::Done(summary)) => Some(Event::Done(summary)),
            Some(Found::Trace(lines)) => Some(Event::Trace(lines)),
            Some(Found::Step(index)) => {
                let step = StepsView::new(self.message.bytes())?.get(index);
                step.map(Event::Step)
            }
        })
    }

    fn advance(
        &mut self,
        deadline: Option<Instant>,
        timeout: Duration,
    ) -> Result<Option<Found>, ClientError> {
        let mut slept = false;
        loop {
            if let Some(index) = self.step_at_hand()? {
                return Ok(Some(Found::Step(index)));
            }
            let Some(pending) = self.pending.as_ref() else { return Ok(None) };
            if let Some(answer) = self.connection.try_receive(pending, slept)? {
                if let Some(found) = self.take(answer)? {
                    return Ok(Some(found));
                }
                continue;
            }
            if !slept && self.connection.comes_at_once(pending) {
                continue;
            }
            self.send_control();
            if let Some(progress) = self.progress() {
                return Ok(Some(Found::Progress(progress)));
            }
            let now = Instant::now();
            if deadline.is_some_and(|d| now >= d) {
                return Err(ClientError::Timeout { what: "plan", after: timeout });
            }
            self.connection.sleep(deadline.unwrap_or(now + SLICE));
            slept = true;
        }
    }

    /// The next step of the message that is being read.
    fn step_at_hand(&mut self) -> Result<Option<usize>, ClientError> {
        if matches!(self.message, Message::None) {
            return Ok(None);
        }
        let count = StepsView::new(self.message.bytes())?.len();
        if self.next_step < count {
            self.next_step += 1;
            return Ok(Some(self.next_step - 1));
        }
        self.message = Message::None;
        Ok(None)
    }

    /// Takes a chunk in.
    fn take(&mut self, answer: Answer) -> Result<Option<Found>, ClientError> {
        let header = *answer.user_header();
        if header.sequence != self.received {
            return Err(ClientError::Protocol(format!(
                "chunk {} came where {} was due",
                header.sequence, self.received
            )));
        }
        self.received += 1;
        self.send_control();
        if header.offset == 0 && header.total == answer.payload().len() as u64 {
            return self.open(&header, Message::Shared(answer));
        }
        match self.put_together(&header, &answer)? {
            Some(bytes) => self.open(&header, Message::Owned(bytes)),
            None => Ok(None),
        }
    }

    fn put_together(
        &mut self,
        header: &ResponseHeader,
        answer: &Answer,
    ) -> Result<Option<AlignedBytes>, ClientError> {
        if header.offset == 0 && header.total <= LONGEST_MESSAGE {
            let bytes = AlignedBytes::zeroed(header.total as usize);
            self.parts = Some(Parts { kind: header.kind, bytes, filled: 0 });
        }
        let wrong = || ClientError::Protocol("the chunks of a message do not fit together".to_owned());
        let mut parts = self.parts.take().ok_or_else(wrong)?;
        let (start, end) = (parts.filled, parts.filled + answer.payload().len() as u64);
        if header.offset != start || header.kind != parts.kind {
            return Err(wrong());
        }
        let target = parts.bytes.as_mut_slice().get_mut(start as usize..end as usize).ok_or_else(wrong)?;
        target.copy_from_slice(answer.payload());
        parts.filled = end;
        if end == header.total {
            return Ok(Some(parts.bytes));
        }
        self.parts = Some(parts);
        Ok(None)
    }

    /// Opens a whole message.
    fn open(&mut self, header: &ResponseHeader, message: Message) -> Result<Option<Found>, ClientError> {
        match ResponseKind::from_wire(header.kind) {
            Some(ResponseKind::Steps) => {
                self.message = message;
                self.next_step = 0;
                Ok(None)
            }
            Some(ResponseKind::Trace) => {
                let lines = String::from_utf8(message.bytes().to_vec());
                let lines = lines.map_err(|_| ClientError::Protocol("a trace is not UTF-8".to_owned()))?;
                Ok(Some(Found::Trace(lines)))
            }
            Some(ResponseKind::Summary) => {
                // A copy: it outlives the stream, and nothing decoded may change behind our back.
                let copy = AlignedBytes::copy_of(message.bytes());
                let summary = Summary::decode(copy.as_slice())?;
                self.close();
                Ok(Some(Found::Done(summary)))
            }
            Some(ResponseKind::Error) => {
                let copy = AlignedBytes::copy_of(message.bytes());
                let error = WireError::decode(copy.as_slice())?;
                Err(ClientError::Refused(WireError { retry_ms: header.retry_ms, ..error }))
            }
            _ => Err(ClientError::Protocol(format!("a response of kind {} in a plan", header.kind))),
        }
    }

    /// Grants credit when enough was read, and passes a wish to cancel on. What the daemon has
    /// no room for now is tried again at the next occasion; both numbers are cumulative.
    fn send_control(&mut self) {
        let due = self.received - self.granted >= CREDIT_STEP;
        if self.pending.is_none() || !(due || self.cancel_wanted && !self.cancel_sent) {
            return;
        }
        self.control = None;
        let mut header = Client::header(RequestKind::Control, self.request);
        header.consumed = self.received;
        header.flags = if self.cancel_wanted { CONTROL_CANCEL } else { 0 };
        if let Some(pending) = self.connection.try_send_control(header) {
            self.control = Some(pending);
            self.granted = self.received;
            self.cancel_sent = self.cancel_wanted;
        }
    }

    fn progress(&self) -> Option<Progress> {
        let me = self.connection.plan.id().value();
        while let Ok(Some(sample)) = self.connection.progress.receive() {
            if id_of_words(sample.client) == me && sample.request == self.request {
                return Some(Progress {
                    stage: match sample.stage {
                        STAGE_SDF => Stage::Sdf,
                        STAGE_TRANSFER => Stage::Transfer,
                        _ => Stage::Search,
                    },
                    done: sample.done,
                    total: sample.total,
                    simulations: sample.simulations,
                });
            }
        }
        None
    }

    /// Lets go of the request.
    fn close(&mut self) {
        self.message = Message::None;
        self.control = None;
        if self.is_open {
            self.is_open = false;
            self.client.planning.set(false);
        }
        let Some(pending) = self.pending.take() else { return };
        let daemon_holds_it = pending.is_connected();
        drop(pending);
        // The daemon asks whether we are still there when it is woken, not before. Of a request that it has
        // let go of, as it does with the last message, it asks no more.
        if daemon_holds_it {
            self.connection.wake_daemon();
        }
    }
}

impl Drop for PlanStream<'_> {
    fn drop(&mut self) {
        self.close();
    }
}
