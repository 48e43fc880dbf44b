//! A plan as it arrives.

use std::sync::{Arc, Weak};
use std::task::Poll;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::{CONTROL_CANCEL, RequestKind, ResponseHeader, ResponseKind, id_of_words};
use sbdp_ipc::layout::{BORROWED_RESPONSES, CREDIT_STEP, PLAN_REQUEST};
use sbdp_ipc::progress::{STAGE_SDF, STAGE_TRANSFER, TRIED_TURNS};
use sbdp_ipc::services::{Answer, Pending};

use crate::client::Client;
use crate::connection::Connection;
use crate::error::ClientError;
use crate::message::Assembler;
use crate::options::PlanOptions;
use crate::patience::Patience;
use crate::process_bound::ProcessBound;
use crate::step::{Message, Step, Steps};
use crate::subject::{Meshes, Subject};
use crate::summary::Summary;

/// How often one assembly is uploaded again for one plan: a daemon that drops it again at once has no
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

/// What the daemon is doing. Some samples are dropped on purpose.
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
    /// What the search tries, if that is known.
    pub tried: Option<Tried>,
}

/// A motion that the search tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tried {
    /// Index of the part; of several side by side, the first.
    pub part: u32,
    /// Whether the part is turned, and not only pushed.
    pub turns: bool,
}

impl Tried {
    /// From [`ProgressSample::tried`](sbdp_ipc::progress::ProgressSample::tried).
    fn from_wire(tried: u32) -> Option<Self> {
        let part = (tried & !TRIED_TURNS).checked_sub(1)?;
        Some(Self { part, turns: tried & TRIED_TURNS != 0 })
    }
}

/// What a stream yields.
#[allow(clippy::large_enum_variant, reason = "there is one summary in a stream")]
#[derive(Debug)]
pub enum Event {
    /// Planning made progress.
    Progress(Progress),
    /// A verified step, in order.
    Step(Step),
    /// Events of the search, if the trace was requested: whole lines with one JSON object each.
    Trace(String),
    /// The daemon went away, and the request was sent to the one that replaced it: the steps and the trace so far
    /// are void, and come again from the first.
    Restarted,
    /// The end: everything else about the plan.
    Done(Summary),
}

/// A plan as it arrives. Dropping it cancels the request. It may move between threads, and outlive the client.
#[derive(Debug)]
pub struct PlanStream {
    client: Client,
    connection: Arc<ProcessBound<Connection>>,
    /// Whether it is the client's one plan.
    is_open: bool,
    pending: Option<ProcessBound<Pending>>,
    /// The last control request: it must live until the daemon saw it or a newer one.
    control: Option<ProcessBound<Pending>>,
    request: u64,
    received: u64,
    granted: u64,
    cancel_wanted: bool,
    cancel_sent: bool,
    steps: Option<Steps>,
    /// Steps are read in shared memory.
    in_place: bool,
    /// The messages in shared memory that may still be held.
    views: Vec<Weak<Message>>,
    long_message: Assembler,
    question: Question,
    patience: Patience,
    again: Option<Again>,
}

/// The request, to send it again.
#[derive(Debug)]
struct Question {
    bytes: Vec<u8>,
    subject: Subject,
    /// How often it was uploaded again without a plan.
    uploads: u32,
}

/// The request must be sent again.
#[derive(Debug, Clone, Copy)]
struct Again {
    at: Instant,
    /// The daemon that received the request is gone.
    restarted: bool,
}

impl Client {
    /// Requests a plan for a handle, or for meshes (in an `Arc`), which are uploaded whenever the daemon does
    /// not know them, as after a restart.
    ///
    /// # Errors
    /// The daemon is gone, this client is already receiving a plan, or the geometry is refused. Other refusals
    /// (`busy`, an unknown handle) are the stream's first result.
    pub fn plan(
        &self,
        subject: impl Into<Subject>,
        options: &PlanOptions,
    ) -> Result<PlanStream, ClientError> {
        self.check_process()?;
        let subject = subject.into();
        let handle = match &subject {
            Subject::Handle(handle) => *handle,
            Subject::Meshes(meshes) => {
                let handle = meshes.handle();
                if !self.has_uploaded(handle) {
                    self.upload(&meshes.assembly())?;
                }
                handle
            }
        };
        let bytes = options.to_wire(handle).encode();
        if bytes.len() > PLAN_REQUEST {
            return Err(ClientError::RequestTooLong { bytes: bytes.len() });
        }
        let connection = self.known_connection();
        if !self.begin_plan() {
            return Err(ClientError::StreamOpen);
        }
        // From here on the stream lets the client go, however this ends.
        let mut stream = PlanStream {
            client: self.clone(),
            connection,
            is_open: true,
            pending: None,
            control: None,
            request: 0,
            received: 0,
            granted: 0,
            cancel_wanted: false,
            cancel_sent: false,
            steps: None,
            in_place: false,
            views: Vec::new(),
            long_message: Assembler::default(),
            question: Question { bytes, subject, uploads: 0 },
            patience: Patience::default(),
            again: None,
        };
        let mut sent = stream.send();
        while let Err(error) = sent {
            let again = stream.recover(error)?;
            self.pause(again.at)?;
            sent = stream.send();
        }
        stream.again = None;
        Ok(stream)
    }
}

impl PlanStream {
    /// Sends the request as if it were the first time.
    fn send(&mut self) -> Result<(), ClientError> {
        self.steps = None;
        self.long_message = Assembler::default();
        self.control = None;
        self.pending = None;
        (self.received, self.granted) = (0, 0);
        self.cancel_sent = false;
        self.request = self.client.new_request();
        self.connection = self.client.connection()?;
        let header = Client::header(RequestKind::Plan, self.request);
        let (connection, bytes) = (&self.connection, &self.question.bytes);
        let fill = |out: &mut [u8]| out.copy_from_slice(bytes);
        let sent = self.client.send(connection, "plan", &connection.plan, header, bytes.len(), fill)?;
        self.pending = Some(sent);
        self.patience.asked();
        Ok(())
    }

    /// Prepares to send the request again after an error that the client handles itself.
    fn recover(&mut self, error: ClientError) -> Result<Again, ClientError> {
        // Of a plan that is not wanted any more only the end is: where a daemon is, it has said it.
        if self.cancel_wanted && !error.is_no_daemon() {
            return Err(error);
        }
        let forgotten = error.code() == Some(ErrorCode::UnknownHandle);
        let restarted = error.is_no_daemon() || self.again.is_some_and(|again| again.restarted);
        if let Some(meshes) = self.question.meshes().filter(|_| forgotten)
            && self.question.uploads < UPLOADS_AGAIN
        {
            self.question.uploads += 1;
            self.client.upload(&meshes.assembly())?;
            return Ok(*self.again.insert(Again { at: Instant::now(), restarted }));
        }
        let at = self.patience.after(self.client.options(), error)?;
        Ok(*self.again.insert(Again { at, restarted }))
    }
}

impl Question {
    fn meshes(&self) -> Option<Arc<dyn Meshes>> {
        match &self.subject {
            Subject::Handle(_) => None,
            Subject::Meshes(meshes) => Some(Arc::clone(meshes)),
        }
    }
}

impl PlanStream {
    /// Reads steps in shared memory, without a copy. Two of their messages may be held: asking for an event that needs
    /// a third returns [`ClientError::ViewsHeld`], and nothing is lost.
    #[must_use]
    pub fn in_place(mut self) -> Self {
        self.in_place = true;
        self
    }

    /// Steps are copied, as they are unless they are read [in place](Self::in_place).
    pub(crate) fn copied(mut self) -> Self {
        self.in_place = false;
        self
    }

    /// Waits for the next event; `None` after [`Event::Done`]. Waits as long as the daemon
    /// lives: give [`PlanOptions::timeout`] to bound the planning itself.
    ///
    /// # Errors
    /// The daemon refused, failed or died. The stream is over then, except after [`ClientError::ViewsHeld`].
    pub fn next_event(&mut self) -> Result<Option<Event>, ClientError> {
        loop {
            if let Poll::Ready(event) = self.event_until(None)? {
                return Ok(event);
            }
        }
    }

    /// The next event if it arrives within a time, which may be zero; otherwise `Pending`, and the stream continues.
    ///
    /// # Errors
    /// As [`Self::next_event`].
    pub fn poll_event(&mut self, within: Duration) -> Result<Poll<Option<Event>>, ClientError> {
        self.event_until(Some(Instant::now() + within))
    }

    /// Asks the daemon to stop soon. The stream continues until `Done`, whose status is then
    /// `cancelled` unless the plan was ready before. To leave without an answer, drop the stream.
    pub fn cancel(&mut self) {
        self.cancel_wanted = true;
        self.send_control();
    }

    fn event_until(&mut self, deadline: Option<Instant>) -> Result<Poll<Option<Event>>, ClientError> {
        self.client.check_process()?;
        loop {
            let error = match self.advance(deadline) {
                Ok(found) => return Ok(found),
                Err(held @ ClientError::ViewsHeld) => return Err(held),
                Err(error) => error,
            };
            if let Err(error) = self.recover(error) {
                self.close();
                return Err(error);
            }
        }
    }

    fn advance(&mut self, deadline: Option<Instant>) -> Result<Poll<Option<Event>>, ClientError> {
        if let Some(again) = self.again {
            self.client.pause(deadline.map_or(again.at, |d| d.min(again.at)))?;
            if Instant::now() < again.at {
                return Ok(Poll::Pending);
            }
            self.send()?;
            self.again = None;
            if again.restarted {
                return Ok(Poll::Ready(Some(Event::Restarted)));
            }
        }
        let mut slept = false;
        loop {
            if let Some(step) = self.step_at_hand() {
                return Ok(Poll::Ready(Some(Event::Step(step))));
            }
            if self.pending.is_some() {
                self.check_views()?;
            }
            let Some(pending) = self.pending.as_ref() else { return Ok(Poll::Ready(None)) };
            let seen = self.connection.wakes();
            if let Some(answer) = self.connection.try_receive(pending, slept)? {
                if let Some(found) = self.take(answer)? {
                    return Ok(Poll::Ready(Some(found)));
                }
                continue;
            }
            if !slept && self.connection.comes_at_once(pending) {
                continue;
            }
            self.send_control();
            if let Some(progress) = self.progress() {
                return Ok(Poll::Ready(Some(Event::Progress(progress))));
            }
            let now = Instant::now();
            if deadline.is_some_and(|d| now >= d) {
                // A caller that only polls finds out here that nothing will come.
                self.connection.check_alive()?;
                return Ok(Poll::Pending);
            }
            let slice = self.client.slice();
            self.connection.sleep(deadline.unwrap_or(now + slice), seen, slice);
            slept = true;
        }
    }

    /// The next step of the message that is being read.
    fn step_at_hand(&mut self) -> Option<Step> {
        let step = self.steps.as_mut()?.take_next();
        if step.is_none() {
            self.steps = None;
        }
        step
    }

    /// Whether another message may be borrowed.
    fn check_views(&mut self) -> Result<(), ClientError> {
        self.views.retain(|message| message.strong_count() > 0);
        if self.views.len() < BORROWED_RESPONSES { Ok(()) } else { Err(ClientError::ViewsHeld) }
    }

    /// Takes a chunk in.
    fn take(&mut self, answer: Answer) -> Result<Option<Event>, ClientError> {
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
            return self.open(&header, Message::shared(answer));
        }
        match self.long_message.add(&header, answer.payload())? {
            Some(bytes) => self.open(&header, Message::Owned(bytes)),
            None => Ok(None),
        }
    }

    /// Opens a whole message.
    fn open(&mut self, header: &ResponseHeader, message: Message) -> Result<Option<Event>, ClientError> {
        match ResponseKind::from_wire(header.kind) {
            Some(ResponseKind::Steps) if self.in_place => {
                let steps = Steps::new(message)?;
                if matches!(**steps.message(), Message::Shared(_)) {
                    self.views.push(Arc::downgrade(steps.message()));
                }
                self.steps = Some(steps);
                Ok(None)
            }
            Some(ResponseKind::Steps) => {
                self.steps = Some(Steps::new(message.owned())?);
                Ok(None)
            }
            Some(ResponseKind::Trace) => {
                let lines = String::from_utf8(message.bytes().to_vec());
                let lines = lines.map_err(|_| ClientError::Protocol("a trace is not UTF-8".to_owned()))?;
                Ok(Some(Event::Trace(lines)))
            }
            Some(ResponseKind::Summary) => {
                // A copy: it outlives the stream, and nothing decoded may change behind our back.
                let copy = AlignedBytes::copy_of(message.bytes());
                let summary = Summary::decode(copy.as_slice())?;
                drop(message);
                self.close();
                Ok(Some(Event::Done(summary)))
            }
            Some(ResponseKind::Error) => {
                let copy = AlignedBytes::copy_of(message.bytes());
                let error = WireError::decode(copy.as_slice())?;
                Err(ClientError::Refused(WireError { retry_ms: header.retry_ms, ..error }))
            }
            _ => Err(ClientError::Protocol(format!("a response of kind {} in a plan", header.kind))),
        }
    }

    /// Grants credit when enough was read, and passes on a cancellation. What the daemon has
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
                    tried: Tried::from_wire(sample.tried),
                });
            }
        }
        None
    }

    /// Releases the request.
    fn close(&mut self) {
        self.steps = None;
        self.again = None;
        self.control = None;
        if self.is_open {
            self.is_open = false;
            self.client.end_plan();
        }
        let Some(pending) = self.pending.take() else { return };
        if self.client.check_process().is_err() {
            // The request goes on: it is that of the parent process.
            return;
        }
        let daemon_holds_it = pending.is_connected();
        drop(pending);
        // The daemon asks whether we are still there when it is woken, not before. Of a request that it has
        // let go of, as it does with the last message, it asks no more.
        if daemon_holds_it {
            self.connection.wake_daemon();
        }
    }
}

impl Drop for PlanStream {
    fn drop(&mut self) {
        self.close();
    }
}
