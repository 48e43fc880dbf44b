//! A plan request from its reception to its end, as a state machine without any transport.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use sbdp_ipc::clock::monotonic_ns;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::{ResponseHeader, ResponseKind};
use sbdp_ipc::plan::Step;

use super::metrics::LatencyKind;
use super::outbox::Outbox;
use super::response_cache::CachedResponse;
use crate::termination::Termination;

/// Where a request stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SessionState {
    /// Its bytes are copied.
    Received,
    /// It can be read and names a known assembly.
    Admitted,
    /// It waits for a worker.
    Queued,
    /// A worker plans.
    Running,
    /// The plan is ready and leaves as fast as the client reads.
    Streaming,
    /// It is over.
    Ended(SessionEnd),
}

/// How a request ended. Every end is an answer, except when the client is gone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SessionEnd {
    /// The whole plan was sent.
    Done,
    /// The client left or cancelled.
    Cancelled,
    /// The deadline passed before planning began.
    Expired,
    /// It was not planned.
    Refused,
    /// Planning failed, or the client did not read.
    Failed,
}

/// What happens to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Input {
    Admit,
    Enqueue,
    Start,
    Finish,
    Drain,
    Refuse,
    Expire,
    Cancel,
    Fail,
}

impl SessionState {
    /// The state after an input; `None` where the input is not legal.
    pub(crate) fn after(self, input: Input) -> Option<Self> {
        use SessionState::{Admitted, Ended, Queued, Received, Running, Streaming};
        let next = match (self, input) {
            (Received, Input::Admit) => Admitted,
            (Admitted, Input::Enqueue) => Queued,
            (Queued, Input::Start) => Running,
            (Running, Input::Finish) => Streaming,
            (Streaming, Input::Drain) => Ended(SessionEnd::Done),
            (Received | Admitted | Queued | Running, Input::Refuse) => Ended(SessionEnd::Refused),
            (Received | Admitted | Queued, Input::Expire) => Ended(SessionEnd::Expired),
            (Received | Admitted | Queued | Running | Streaming, Input::Cancel) => {
                Ended(SessionEnd::Cancelled)
            }
            (Running | Streaming, Input::Fail) => Ended(SessionEnd::Failed),
            _ => return None,
        };
        Some(next)
    }

    pub(crate) fn is_over(self) -> bool {
        matches!(self, Self::Ended(_))
    }
}

/// Why a chunk was not delivered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Undelivered {
    /// The client's buffer is full now.
    Full,
    /// It will never be delivered.
    Broken,
}

/// The way back to the client that asked.
pub(crate) trait Link {
    /// Sends one chunk without waiting.
    fn send(&self, header: ResponseHeader, payload: &[u8]) -> Result<(), Undelivered>;
    /// Whether the client still holds its request. Asked on the port thread only.
    fn is_connected(&self) -> bool;
}

/// A plan request and its way back.
#[derive(Debug)]
pub(crate) struct Session<L> {
    link: L,
    request: u64,
    /// The listener to wake.
    pub(crate) listener: u128,
    state: SessionState,
    outbox: Outbox,
    /// The flag that its worker's termination condition polls, once there is one.
    cancel: Option<Arc<AtomicBool>>,
    /// When planning must end.
    pub(crate) deadline: Option<Instant>,
    admitted_ns: u64,
    started_ns: u64,
    /// Since when something waits that the client does not take.
    stuck_since: Option<Instant>,
    received: Instant,
    remembered: bool,
}

impl<L: Link> Session<L> {
    pub(crate) fn new(link: L, request: u64, listener: u128, outbox_limit: usize) -> Self {
        Self {
            link,
            request,
            listener,
            state: SessionState::Received,
            outbox: Outbox::new(outbox_limit),
            cancel: None,
            deadline: None,
            admitted_ns: 0,
            started_ns: 0,
            stuck_since: None,
            received: Instant::now(),
            remembered: false,
        }
    }

    pub(crate) fn state(&self) -> SessionState {
        self.state
    }

    pub(crate) fn is_connected(&self) -> bool {
        self.link.is_connected()
    }

    /// Moves on; an illegal input is a bug of ours, logged and without effect.
    pub(crate) fn input(&mut self, input: Input) -> bool {
        let Some(next) = self.state.after(input) else {
            tracing::debug!(state = ?self.state, ?input, "input ignored");
            return false;
        };
        match next {
            SessionState::Admitted => self.admitted_ns = monotonic_ns(),
            SessionState::Running => self.started_ns = monotonic_ns(),
            SessionState::Ended(SessionEnd::Cancelled | SessionEnd::Failed) => self.cancel_work(),
            _ => {}
        }
        self.state = next;
        true
    }

    pub(crate) fn admit(&mut self, deadline: Option<Instant>) {
        self.deadline = deadline;
        self.input(Input::Admit);
    }

    /// What ends the work of a worker on it.
    pub(crate) fn termination(&mut self) -> Termination {
        let termination = Termination::new(self.deadline);
        self.cancel = Some(termination.cancel_flag());
        termination
    }

    /// Lets the worker stop soon; the request is still answered.
    pub(crate) fn cancel_work(&self) {
        if let Some(cancel) = &self.cancel {
            cancel.store(true, Ordering::Relaxed);
        }
    }

    /// Ends with an error that the client gets.
    pub(crate) fn end_with(&mut self, input: Input, error: &WireError) {
        if self.input(input) {
            self.outbox.end_with(error);
        }
    }

    pub(crate) fn step(&mut self, step: Step) {
        if self.state == SessionState::Running && self.outbox.push_step(step).is_err() {
            self.lose("its outbox is full");
        }
    }

    /// Events of the search, as lines of JSON.
    pub(crate) fn trace(&mut self, lines: Vec<u8>) {
        let is_running = self.state == SessionState::Running;
        if is_running && self.outbox.push_whole(ResponseKind::Trace, Arc::new(lines)).is_err() {
            self.lose("its outbox is full");
        }
    }

    /// Answers at once with what was answered before.
    pub(crate) fn answer(&mut self, answer: &CachedResponse) {
        if [Input::Enqueue, Input::Start].into_iter().all(|input| self.input(input)) {
            self.answer_running(answer);
        }
    }

    /// Answers what runs with what was answered before.
    pub(crate) fn answer_running(&mut self, answer: &CachedResponse) {
        self.remembered = true;
        for message in &answer.steps {
            if self.outbox.push_whole(ResponseKind::Steps, Arc::clone(message)).is_err() {
                return self.lose("its outbox is full");
            }
        }
        self.finish(Arc::clone(&answer.summary));
    }

    pub(crate) fn finish(&mut self, summary: Arc<Vec<u8>>) {
        if self.input(Input::Finish) && self.outbox.push_whole(ResponseKind::Summary, summary).is_err() {
            self.lose("its outbox is full");
        }
    }

    pub(crate) fn grant(&mut self, consumed: u64) {
        self.outbox.grant(consumed);
    }

    fn lose(&mut self, why: &str) {
        let message = format!("slow reader: the client does not read its plan ({why})");
        self.end_with(Input::Fail, &WireError::new(ErrorCode::SlowReader, message));
    }

    /// Sends what the client has room for; true if anything was sent.
    pub(crate) fn pump(&mut self, now: Instant, patience: Duration) -> bool {
        let sent = self.send_waiting();
        if sent || self.outbox.is_empty() {
            self.stuck_since = None;
        } else if now.saturating_duration_since(*self.stuck_since.get_or_insert(now)) > patience
            && !self.state.is_over()
        {
            self.lose("nothing was read for too long");
            return self.send_waiting();
        }
        if self.state == SessionState::Streaming && self.outbox.is_empty() {
            self.input(Input::Drain);
        }
        sent
    }

    fn send_waiting(&mut self) -> bool {
        let mut sent = false;
        while let Some(chunk) = self.outbox.next_chunk() {
            let header = ResponseHeader {
                kind: chunk.kind as u32,
                retry_ms: chunk.retry_ms,
                request: self.request,
                sequence: chunk.sequence,
                offset: chunk.offset,
                total: chunk.total,
                admitted_ns: self.admitted_ns,
                started_ns: self.started_ns,
                sent_ns: monotonic_ns(),
            };
            match self.link.send(header, chunk.bytes) {
                Ok(()) => {
                    self.outbox.delivered();
                    sent = true;
                }
                Err(Undelivered::Full) => break,
                Err(Undelivered::Broken) => {
                    self.input(Input::Cancel);
                    break;
                }
            }
        }
        sent
    }

    /// How long a plan took that was sent to its end, and from where it came.
    pub(crate) fn timed(&self) -> Option<(LatencyKind, Duration)> {
        let kind = if self.remembered { LatencyKind::RememberedPlan } else { LatencyKind::Plan };
        (self.state == SessionState::Ended(SessionEnd::Done)).then(|| (kind, self.received.elapsed()))
    }

    /// Over, and the client has what it can get.
    pub(crate) fn is_finished(&self) -> bool {
        self.state.is_over() && (self.outbox.is_empty() || !self.link.is_connected())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::{Cell, RefCell};
    use std::rc::Rc;

    const INPUTS: [Input; 9] = [
        Input::Admit,
        Input::Enqueue,
        Input::Start,
        Input::Finish,
        Input::Drain,
        Input::Refuse,
        Input::Expire,
        Input::Cancel,
        Input::Fail,
    ];

    #[derive(Clone, Default)]
    struct Scripted {
        room: Rc<Cell<usize>>,
        gone: Rc<Cell<bool>>,
        got: Rc<RefCell<Vec<ResponseHeader>>>,
    }

    impl Link for Scripted {
        fn send(&self, header: ResponseHeader, _: &[u8]) -> Result<(), Undelivered> {
            if self.room.get() == 0 {
                return Err(Undelivered::Full);
            }
            self.room.set(self.room.get() - 1);
            self.got.borrow_mut().push(header);
            Ok(())
        }

        fn is_connected(&self) -> bool {
            !self.gone.get()
        }
    }

    fn running(link: &Scripted) -> Session<Scripted> {
        let mut session = Session::new(link.clone(), 1, 0, 10_000);
        session.admit(None);
        session.termination();
        assert!(session.input(Input::Enqueue) && session.input(Input::Start));
        session
    }

    /// Whether its worker is told to stop.
    fn is_cancelled(session: &Session<Scripted>) -> bool {
        session.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed))
    }

    #[test]
    fn nothing_leads_out_of_an_end() {
        for end in [
            SessionEnd::Done,
            SessionEnd::Cancelled,
            SessionEnd::Expired,
            SessionEnd::Refused,
            SessionEnd::Failed,
        ] {
            for input in INPUTS {
                assert_eq!(SessionState::Ended(end).after(input), None);
            }
        }
    }

    #[test]
    fn every_live_state_can_be_left_by_a_client_that_goes() {
        for state in [
            SessionState::Received,
            SessionState::Admitted,
            SessionState::Queued,
            SessionState::Running,
            SessionState::Streaming,
        ] {
            assert_eq!(state.after(Input::Cancel), Some(SessionState::Ended(SessionEnd::Cancelled)));
        }
    }

    #[test]
    fn a_running_request_does_not_expire_it_times_out_with_a_plan() {
        assert_eq!(SessionState::Running.after(Input::Expire), None);
    }

    #[test]
    fn a_plan_is_done_when_its_last_chunk_is_delivered() {
        let link = Scripted::default();
        let mut session = running(&link);
        session.finish(Arc::new(vec![0; 8]));
        assert!(!session.pump(Instant::now(), Duration::from_secs(9)));
        assert_eq!(session.state(), SessionState::Streaming);
        link.room.set(1);
        assert!(session.pump(Instant::now(), Duration::from_secs(9)));
        assert_eq!(session.state(), SessionState::Ended(SessionEnd::Done));
        assert!(session.is_finished());
    }

    #[test]
    fn a_client_that_does_not_read_loses_its_stream_and_is_told() {
        let link = Scripted::default();
        let mut session = running(&link);
        let now = Instant::now();
        session.step(Step::default());
        session.pump(now, Duration::from_secs(1));
        assert!(session.stuck_since.is_some());
        session.pump(now + Duration::from_secs(2), Duration::from_secs(1));
        assert_eq!(session.state(), SessionState::Ended(SessionEnd::Failed));
        assert!(is_cancelled(&session), "its worker stops");
        link.room.set(1);
        session.pump(now, Duration::from_secs(1));
        assert_eq!(link.got.borrow()[0].kind, ResponseKind::Error as u32);
    }

    #[test]
    fn a_client_that_leaves_stops_its_worker() {
        let link = Scripted::default();
        let mut session = running(&link);
        link.gone.set(true);
        session.input(Input::Cancel);
        assert!(is_cancelled(&session));
        assert!(session.is_finished());
    }

    #[test]
    fn an_outbox_that_overflows_ends_the_stream() {
        let link = Scripted::default();
        let mut session = running(&link);
        for _ in 0..50 {
            session.step(Step { path: vec![[0.0; 7]; 20], ..Step::default() });
        }
        assert_eq!(session.state(), SessionState::Ended(SessionEnd::Failed));
    }
}
