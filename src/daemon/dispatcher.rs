//! Admission and bookkeeping: what happens to every request, without any transport.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::clock;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::HandleResponse;
use sbdp_ipc::headers::{CONTROL_CANCEL, RequestHeader, ResponseHeader, ResponseKind, id_of_words, id_words};
use sbdp_ipc::plan::PlanRequest;
use sbdp_ipc::progress::ProgressSample;
use sbdp_ipc::status::{Status, StatusHeader};

use super::closing::Closing;
use super::convert;
use super::intake::Upload;
use super::jobs::{AdmitJob, PlanJob, SessionKey};
use super::metrics::{CacheMetrics, HostStatus, Latencies, Metrics};
use super::planning::Planning;
use super::request_queue::{Class, Owner, Rejected, Ticket};
use super::resources;
use super::response_cache::{CachedResponse, ResponseCache, question};
use super::session::{End, Input, Link, Session, State};
use super::shared_queue::Queues;
use super::workers::WorkerEvent;
use crate::config::{Config, seconds};
use crate::service::AssemblyId;

/// A request as it came in: header and payload are private copies.
#[derive(Debug)]
pub(crate) struct Incoming<L> {
    pub(crate) link: L,
    /// The client's port.
    pub(crate) client: u128,
    /// Who counts for quotas.
    pub(crate) owner: Owner,
    pub(crate) header: RequestHeader,
    pub(crate) payload: AlignedBytes,
}

/// Everything that can happen.
#[derive(Debug)]
pub(crate) enum Event<L> {
    /// A plan is asked for.
    Plan(Incoming<L>),
    /// Credit for a plan's stream, or the wish to end it.
    Control(Incoming<L>),
    /// The status is asked for.
    Status(Incoming<L>),
    /// The figures are asked for.
    Figures(Incoming<L>),
    /// Is this handle known?
    Have(Incoming<L>),
    /// Meshes.
    Upload(Incoming<L>),
    /// What differs from a known assembly.
    Revise(Incoming<L>),
    /// Something that cannot be taken, and why.
    Unusable(Incoming<L>, WireError),
    /// A worker reports.
    Worker(WorkerEvent),
    /// SIGTERM or SIGINT.
    Terminate,
}

/// The limits that the dispatcher keeps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    outbox: usize,
    pub(super) patience: Duration,
    threads: usize,
    pub(super) grace: Duration,
    pub(super) drain: Duration,
    /// How much memory is left, in bytes, if the system says.
    pub(super) free_memory: fn() -> Option<u64>,
}

impl Limits {
    fn of(config: &Config) -> Self {
        Self {
            outbox: megabytes(config.requests.outbox_mb),
            patience: seconds(config.requests.slow_reader_s),
            threads: config.workers.threads_per_request,
            grace: seconds(config.times.grace_s),
            drain: seconds(config.times.drain_s),
            free_memory: resources::free_memory,
        }
    }
}

fn megabytes(mb: u64) -> usize {
    usize::try_from(mb.saturating_mul(1 << 20)).unwrap_or(usize::MAX)
}

/// The dispatcher.
#[derive(Debug)]
pub(crate) struct Dispatcher<L, P> {
    pub(super) service: Arc<P>,
    pub(super) queues: Queues,
    pub(super) limits: Limits,
    pub(super) sessions: HashMap<SessionKey, Session<L>>,
    pub(super) uploads: HashMap<u64, Upload<L>>,
    running: BTreeSet<(u128, u64)>,
    answers: ResponseCache,
    pub(super) next_upload: u64,
    pub(super) latencies: Latencies,
    pub(super) closing: Closing,
    pub(super) counters: StatusHeader,
    preloaded: Vec<(String, [u8; 32])>,
    started: Instant,
    /// What only the ports and the system know.
    pub(crate) host: HostStatus,
    /// Listeners to wake.
    pub(crate) wakes: Vec<u128>,
    /// Progress to publish.
    pub(crate) samples: Vec<ProgressSample>,
}

impl<L: Link, P: Planning> Dispatcher<L, P> {
    pub(crate) fn new(service: Arc<P>, queues: Queues, config: &Config) -> Self {
        let counters = StatusHeader {
            pid: std::process::id(),
            protocol: sbdp_ipc::PROTOCOL,
            workers: config.workers.count as u32,
            queue_limit: config.requests.queue as u32,
            ..StatusHeader::default()
        };
        let answers = ResponseCache::recent(&*service, config.cache.memory().answers);
        service.answers_take(answers.metrics().bytes);
        Self {
            service,
            queues,
            limits: Limits::of(config),
            latencies: Latencies::default(),
            sessions: HashMap::new(),
            uploads: HashMap::new(),
            running: BTreeSet::new(),
            answers,
            next_upload: 0,
            closing: Closing::Open,
            counters,
            preloaded: Vec::new(),
            started: Instant::now(),
            host: HostStatus::default(),
            wakes: Vec::new(),
            samples: Vec::new(),
        }
    }

    /// Keeps other limits from now on; what was taken under the old ones stays.
    pub(crate) fn reload(&mut self, config: &Config) {
        self.limits = Limits { threads: self.limits.threads, ..Limits::of(config) };
        self.counters.queue_limit = config.requests.queue as u32;
        self.queues.reload(config);
    }

    pub(crate) fn handle(&mut self, event: Event<L>, now: Instant) {
        match event {
            Event::Plan(incoming) => self.plan(incoming),
            Event::Control(incoming) => self.control(&incoming),
            Event::Status(incoming) => {
                let status = self.status().encode();
                self.answer(&incoming.link, &incoming.header, ResponseKind::Status, &status);
            }
            Event::Figures(incoming) => {
                let text = self.metrics().json();
                self.answer(&incoming.link, &incoming.header, ResponseKind::Figures, text.as_bytes());
            }
            Event::Have(incoming) => self.have(&incoming),
            Event::Upload(incoming) => {
                self.take_in(incoming, AdmitJob::Upload);
            }
            Event::Revise(incoming) => {
                self.take_in(incoming, AdmitJob::Revise);
            }
            Event::Unusable(incoming, error) => {
                self.counters.refused += 1;
                self.answer_error(&incoming.link, &incoming.header, &error);
            }
            Event::Worker(event) => self.worker(event),
            Event::Terminate => self.terminate(now),
        }
    }

    fn plan(&mut self, incoming: Incoming<L>) {
        self.counters.requests += 1;
        let Incoming { link, client, owner, header, payload } = incoming;
        let key = SessionKey { client, request: header.request };
        if self.sessions.contains_key(&key) {
            let error = WireError::new(ErrorCode::Malformed, "this request number is in use");
            self.counters.refused += 1;
            return self.answer_error(&link, &header, &error);
        }
        let mut session =
            Session::new(link, header.request, id_of_words(header.listener), self.limits.outbox);
        if let Some(answer) = self.answered_to_the_byte(&payload) {
            session.admit(None);
            self.answer_again(&mut session, &answer);
        } else if let Err((input, error)) = self.admit(&mut session, key, owner, &payload) {
            session.end_with(input, &error);
        }
        // What is there goes out at once, not behind other requests.
        if session.pump(Instant::now(), self.limits.patience) {
            self.wakes.push(session.listener);
        }
        if session.is_finished() {
            self.over(key, session);
        } else {
            self.sessions.insert(key, session);
        }
    }

    fn keep(&mut self, question: &[u8], answer: CachedResponse) {
        self.answers.insert(question, answer);
        self.service.answers_take(self.answers.metrics().bytes);
    }

    /// The answer to a request whose bytes are those of a question that was answered before: then all that
    /// would be found by reading them was found then.
    fn answered_to_the_byte(&mut self, payload: &AlignedBytes) -> Option<Arc<CachedResponse>> {
        if self.closing != Closing::Open {
            return None;
        }
        self.answers.get(payload.as_slice())
    }

    fn answer_again(&mut self, session: &mut Session<L>, answer: &CachedResponse) {
        self.queues.prefetch.answered();
        session.answer(answer);
        self.counters.remembered += 1;
    }

    /// Reads a plan request and puts it into the queue.
    fn admit(
        &mut self,
        session: &mut Session<L>,
        key: SessionKey,
        owner: Owner,
        payload: &AlignedBytes,
    ) -> Result<(), (Input, WireError)> {
        let refuse = |code, message: String| (Input::Refuse, WireError::new(code, message));
        if self.closing != Closing::Open {
            return Err((Input::Refuse, self.shutting_down()));
        }
        let wire = PlanRequest::decode(payload.as_slice())
            .map_err(|e| refuse(ErrorCode::Malformed, format!("plan request: {e}")))?;
        let request =
            convert::plan_request(&wire, self.limits.threads).map_err(|error| (Input::Refuse, error))?;
        let assembly = AssemblyId(wire.handle);
        let question = question(&wire);
        let answer = question.as_deref().and_then(|question| self.answers.get(question));
        if answer.is_none() && !self.service.knows(assembly) {
            return Err(refuse(ErrorCode::UnknownHandle, "no assembly has this handle".to_owned()));
        }
        let deadline = wire.deadline_ns.and_then(clock::instant_of);
        if wire.deadline_ns.is_some_and(|d| d <= clock::monotonic_ns()) {
            return Err(expired());
        }
        session.admit(deadline);
        if let Some(answer) = answer {
            self.answer_again(session, &answer);
            return Ok(());
        }
        let termination = session.termination();
        let class = if wire.batch { Class::Batch } else { Class::Interactive };
        let moved = convert::moved(&wire.moved);
        let received = Instant::now();
        let job = PlanJob { key, owner, received, assembly, question, moved, request, termination };
        let rejected = match self.queues.plans.push(Ticket { owner, class, bytes: 0 }, job) {
            Ok(()) => {
                session.input(Input::Enqueue);
                return Ok(());
            }
            Err(rejected) => rejected,
        };
        let busy = |message: String| WireError::busy(message, self.queues.plans.hint_ms(owner));
        let error = match rejected {
            Rejected::Full => busy(format!("busy: {} requests wait already", self.queues.plans.len())),
            Rejected::OwnerFull => busy("busy: as many requests of this client wait as may wait".to_owned()),
            Rejected::OwnerSpent => {
                busy("busy: this client has had its share of the workers' time".to_owned())
            }
            Rejected::Closed => self.shutting_down(),
        };
        Err((Input::Refuse, error))
    }

    fn control(&mut self, incoming: &Incoming<L>) {
        let key = SessionKey { client: incoming.client, request: incoming.header.request };
        let Some(session) = self.sessions.get_mut(&key) else { return };
        session.grant(incoming.header.consumed);
        if incoming.header.flags & CONTROL_CANCEL == 0 {
            return;
        }
        session.cancel_work();
        if session.state() == State::Queued && self.queues.plans.withdraw(|job| job.key == key) {
            let error = WireError::new(ErrorCode::Cancelled, "cancelled before planning began");
            session.end_with(Input::Cancel, &error);
        }
    }

    fn worker(&mut self, event: WorkerEvent) {
        match event {
            WorkerEvent::Started(key) => {
                self.running.insert((key.client, key.request));
                self.with_session(key, |s| {
                    s.input(Input::Start);
                });
            }
            WorkerEvent::Step(key, step) => self.with_session(key, |s| s.step(step)),
            WorkerEvent::Progress(key, progress) => {
                if let Some(session) = self.sessions.get(&key) {
                    self.samples.push(convert::progress(id_words(key.client), key.request, progress));
                    self.wakes.push(session.listener);
                }
            }
            WorkerEvent::Planned(key, summary, again) => {
                self.running.remove(&(key.client, key.request));
                if let Some((question, answer)) = again {
                    self.keep(&question, answer);
                }
                self.with_session(key, |s| s.finish(summary));
            }
            WorkerEvent::Answered(key, question, answer) => {
                self.running.remove(&(key.client, key.request));
                self.counters.remembered += 1;
                self.with_session(key, |s| s.answer_running(&answer));
                self.keep(&question, answer);
            }
            WorkerEvent::Unplanned(key, error) => {
                self.running.remove(&(key.client, key.request));
                let input = if error.code == ErrorCode::Failed { Input::Fail } else { Input::Refuse };
                self.with_session(key, |s| s.end_with(input, &error));
            }
            WorkerEvent::Admitted { number, result } => self.admitted(number, result),
            WorkerEvent::Preloaded { name, id } => {
                tracing::info!(name, "preloaded");
                self.preloaded.push((name, id.0));
            }
        }
    }

    /// A session that is gone was left by its client: its worker's reports come to nothing.
    fn with_session(&mut self, key: SessionKey, act: impl FnOnce(&mut Session<L>)) {
        if let Some(session) = self.sessions.get_mut(&key) {
            act(session);
        }
    }

    /// Looks after every session: who left, what expired, what can be sent. Called whenever
    /// anything happened.
    pub(crate) fn settle(&mut self, now: Instant) {
        let mut over = Vec::new();
        for (key, session) in &mut self.sessions {
            if !session.state().is_over() && !session.is_connected() {
                self.queues.plans.withdraw(|job| job.key == *key);
                session.input(Input::Cancel);
            }
            let late = session.deadline.is_some_and(|d| d <= now);
            if late && session.state() == State::Queued && self.queues.plans.withdraw(|job| job.key == *key) {
                let (input, error) = expired();
                session.end_with(input, &error);
            }
            if session.pump(now, self.limits.patience) {
                self.wakes.push(session.listener);
            }
            if session.is_finished() {
                over.push(*key);
            }
        }
        for key in over {
            self.remove(key);
        }
        self.settle_uploads(now);
        self.close_down(now);
    }

    fn remove(&mut self, key: SessionKey) {
        if let Some(session) = self.sessions.remove(&key) {
            self.over(key, session);
        }
    }

    /// Counts a session that is finished, and lets its request go.
    fn over(&mut self, key: SessionKey, session: Session<L>) {
        let counter = match session.state() {
            State::Ended(End::Done) => &mut self.counters.done,
            State::Ended(End::Cancelled) => &mut self.counters.cancelled,
            State::Ended(End::Expired) => &mut self.counters.expired,
            State::Ended(End::Refused) => &mut self.counters.refused,
            _ => &mut self.counters.failed,
        };
        *counter += 1;
        let timed = session.timed();
        if let Some((kind, time)) = timed {
            self.latencies.add(kind, time);
        }
        let total_ms = timed.map(|(_, time)| time.as_secs_f64() * 1e3);
        tracing::debug!(request = key.request, state = ?session.state(), total_ms, "request over");
        // The request is let go before its client is woken, so that it sees the end.
        let listener = session.listener;
        drop(session);
        self.wakes.push(listener);
    }

    /// When `settle` must be called next without anything happening.
    pub(crate) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        let queued = self.sessions.values().filter(|s| s.state() == State::Queued).filter_map(|s| s.deadline);
        let closing = self.closing.end();
        queued.chain(closing).chain(self.next_upload_deadline(now)).min()
    }

    fn numbers(&self) -> StatusHeader {
        StatusHeader {
            uptime_ns: u64::try_from(self.started.elapsed().as_nanos()).unwrap_or(u64::MAX),
            running: self.running.len() as u32,
            queued: self.queues.plans.len() as u32,
            ..self.counters
        }
    }

    pub(crate) fn metrics(&self) -> Metrics {
        let open = self.sessions.len() + self.uploads.len();
        Metrics::of(
            &self.numbers(),
            open,
            self.host,
            &self.latencies,
            &self.preloaded,
            CacheMetrics {
                answers: self.answers.metrics(),
                remembered: self.service.remembered(),
                ahead: self.queues.prefetch.metrics(),
            },
        )
    }

    fn status(&self) -> Status {
        Status {
            numbers: self.numbers(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            preloaded: self.preloaded.clone(),
        }
    }

    pub(super) fn answer_handle(&mut self, link: &L, header: &RequestHeader, handle: [u8; 32], known: bool) {
        let response = HandleResponse { handle, known: u32::from(known), reserved: 0 };
        self.answer(link, header, ResponseKind::Handle, bytemuck::bytes_of(&response));
    }

    pub(super) fn answer_error(&mut self, link: &L, header: &RequestHeader, error: &WireError) {
        self.respond(link, header, ResponseKind::Error, &error.encode(), error.retry_ms);
    }

    fn answer(&mut self, link: &L, request: &RequestHeader, kind: ResponseKind, bytes: &[u8]) {
        self.respond(link, request, kind, bytes, 0);
    }

    /// The one response to a request that is not a plan; its buffer is empty, so it fits.
    fn respond(
        &mut self,
        link: &L,
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
            sent_ns: clock::monotonic_ns(),
            ..ResponseHeader::default()
        };
        if let Err(error) = link.send(header, bytes) {
            tracing::debug!(?error, ?kind, "answer not delivered");
        }
        self.wakes.push(id_of_words(request.listener));
    }
}

fn expired() -> (Input, WireError) {
    let error = WireError::new(ErrorCode::Expired, "the deadline passed before planning began");
    (Input::Expire, error)
}

#[cfg(test)]
#[path = "dispatcher_tests.rs"]
mod tests;
