//! Handles every event: admits requests, follows them to their end, and counts them. It knows no transport.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::clock;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::{CONTROL_CANCEL, ResponseKind, id_of_words, id_words};
use sbdp_ipc::plan::PlanRequest;
use sbdp_ipc::status::{Status, StatusHeader};

use super::convert;
use super::events::{Event, Incoming};
use super::jobs::{AdmitJob, PlanJob, Received, SessionKey};
use super::metrics::{CacheMetrics, HostStatus, Latencies, Metrics};
use super::outgoing::Outgoing;
use super::planning::Planning;
use super::request_queue::{Class, Owner, Rejected, Ticket};
use super::response_cache::{CachedResponse, ResponseCache, question};
use super::session::{Input, Link, Session, SessionEnd, SessionState};
use super::shared_queue::Queues;
use super::shutdown::Shutdown;
use super::uploads::Uploads;
use super::workers::WorkerEvent;
use crate::config::{Config, seconds};
use crate::report::ReportQuery;
use crate::service::AssemblyId;

/// The limits that the dispatcher enforces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    outbox: usize,
    pub(super) patience: Duration,
    threads: usize,
    pub(super) grace: Duration,
    pub(super) drain: Duration,
}

impl Limits {
    fn of(config: &Config) -> Self {
        Self {
            outbox: megabytes(config.requests.outbox_mb),
            patience: seconds(config.requests.slow_reader_s),
            threads: config.workers.threads_per_request,
            grace: seconds(config.times.grace_s),
            drain: seconds(config.times.drain_s),
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
    pub(super) uploads: Uploads<L>,
    running: BTreeSet<(u128, u64)>,
    answers: ResponseCache,
    pub(super) latencies: Latencies,
    shutdown: Shutdown,
    pub(super) counters: StatusHeader,
    preloaded: Vec<(String, [u8; 32])>,
    started: Instant,
    /// Figures that only the ports and the system have.
    pub(crate) host: HostStatus,
    pub(crate) outgoing: Outgoing,
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
        service.set_response_bytes(answers.metrics().bytes);
        Self {
            service,
            limits: Limits::of(config),
            latencies: Latencies::default(),
            sessions: HashMap::new(),
            uploads: Uploads::new(Arc::clone(&queues.admissions)),
            running: BTreeSet::new(),
            answers,
            shutdown: Shutdown::NotRequested,
            counters,
            preloaded: Vec::new(),
            started: Instant::now(),
            host: HostStatus::default(),
            outgoing: Outgoing::default(),
            queues,
        }
    }

    /// Enforces other limits from now on. Requests that were admitted under the old ones stay.
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
                self.outgoing.respond(&incoming.link, &incoming.header, ResponseKind::Status, &status);
            }
            Event::Metrics(incoming) => {
                let text = self.metrics().json();
                self.outgoing.respond(
                    &incoming.link,
                    &incoming.header,
                    ResponseKind::Metrics,
                    text.as_bytes(),
                );
            }
            Event::Have(incoming) => self.have(&incoming),
            Event::Upload(incoming) => self.upload(incoming, AdmitJob::Upload),
            Event::Revise(incoming) => self.upload(incoming, AdmitJob::Revise),
            Event::Unusable(incoming, error) => {
                self.counters.refused += 1;
                self.outgoing.error(&incoming.link, &incoming.header, &error);
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
            return self.outgoing.error(&link, &header, &error);
        }
        let mut session =
            Session::new(link, header.request, id_of_words(header.listener), self.limits.outbox);
        if let Some(answer) = self.response_to_same_bytes(&payload) {
            session.admit(None);
            self.answer_from_cache(&mut session, &answer);
        } else if let Err((input, error)) = self.admit(&mut session, key, owner, &payload) {
            session.end_with(input, &error);
        }
        // Messages that are ready are sent at once, before other requests are read.
        if session.pump(Instant::now(), self.limits.patience) {
            self.outgoing.wakes.push(session.listener);
        }
        if session.is_finished() {
            self.finish(key, session);
        } else {
            self.sessions.insert(key, session);
        }
    }

    fn remember(&mut self, question: &[u8], answer: CachedResponse) {
        self.answers.insert(question, answer);
        self.service.set_response_bytes(self.answers.metrics().bytes);
    }

    /// The response to a request whose bytes equal those of a question that was answered before. The request need
    /// not be decoded and checked again.
    fn response_to_same_bytes(&mut self, payload: &AlignedBytes) -> Option<Arc<CachedResponse>> {
        if self.shutdown.is_requested() {
            return None;
        }
        self.answers.get(payload.as_slice())
    }

    fn answer_from_cache(&mut self, session: &mut Session<L>, answer: &CachedResponse) {
        self.queues.prefetch.answered();
        session.answer(answer);
        self.counters.remembered += 1;
    }

    /// Decodes a plan request and queues it.
    fn admit(
        &mut self,
        session: &mut Session<L>,
        key: SessionKey,
        owner: Owner,
        payload: &AlignedBytes,
    ) -> Result<(), (Input, WireError)> {
        let refuse = |code, message: String| (Input::Refuse, WireError::new(code, message));
        if self.shutdown.is_requested() {
            return Err((Input::Refuse, Shutdown::error()));
        }
        let wire = PlanRequest::decode(payload.as_slice())
            .map_err(|e| refuse(ErrorCode::Malformed, format!("plan request: {e}")))?;
        let request =
            convert::plan_request(&wire, self.limits.threads).map_err(|error| (Input::Refuse, error))?;
        let reports = ReportQuery::new(&wire.reports, &wire.gravity)
            .map_err(|error| (Input::Refuse, convert::service_error(&error)))?;
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
            self.answer_from_cache(session, &answer);
            return Ok(());
        }
        let termination = session.termination();
        let class = if wire.batch { Class::Batch } else { Class::Interactive };
        let moved = convert::moved(&wire.moved);
        let received = Instant::now();
        let trace = wire.trace;
        let job =
            PlanJob { key, owner, received, assembly, question, moved, request, reports, trace, termination };
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
            Rejected::Closed => Shutdown::error(),
        };
        Err((Input::Refuse, error))
    }

    fn have(&mut self, incoming: &Incoming<L>) {
        let Incoming { link, header, payload, .. } = incoming;
        match <[u8; 32]>::try_from(payload.as_slice()) {
            Ok(handle) => {
                let known = self.service.knows(AssemblyId(handle));
                self.outgoing.handle(link, header, handle, known);
            }
            Err(_) => {
                let error = WireError::new(ErrorCode::Malformed, "a handle has 32 bytes");
                self.outgoing.error(link, header, &error);
            }
        }
    }

    fn upload(&mut self, incoming: Incoming<L>, job: impl FnOnce(Received) -> AdmitJob) {
        self.counters.uploads += 1;
        self.uploads.take_in(incoming, job, &mut self.outgoing);
    }

    fn control(&mut self, incoming: &Incoming<L>) {
        let key = SessionKey { client: incoming.client, request: incoming.header.request };
        let Some(session) = self.sessions.get_mut(&key) else { return };
        session.grant(incoming.header.consumed);
        if incoming.header.flags & CONTROL_CANCEL == 0 {
            return;
        }
        session.cancel_work();
        if session.state() == SessionState::Queued && self.queues.plans.withdraw(|job| job.key == key) {
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
                    self.outgoing.samples.push(convert::progress(
                        id_words(key.client),
                        key.request,
                        progress,
                    ));
                    self.outgoing.wakes.push(session.listener);
                }
            }
            WorkerEvent::Trace(key, lines) => self.with_session(key, |s| s.trace(lines)),
            WorkerEvent::Planned { key, summary, again, graphs_remembered } => {
                self.running.remove(&(key.client, key.request));
                self.counters.graphs_remembered += graphs_remembered;
                if let Some((question, answer)) = again {
                    self.remember(&question, answer);
                }
                self.with_session(key, |s| s.finish(summary));
            }
            WorkerEvent::Answered(key, question, answer) => {
                self.running.remove(&(key.client, key.request));
                self.counters.remembered += 1;
                self.with_session(key, |s| s.answer_running(&answer));
                self.remember(&question, answer);
            }
            WorkerEvent::Unplanned(key, error) => {
                self.running.remove(&(key.client, key.request));
                let input = if error.code == ErrorCode::Failed { Input::Fail } else { Input::Refuse };
                self.with_session(key, |s| s.end_with(input, &error));
            }
            WorkerEvent::Admitted { number, result } => {
                self.uploads.answer(number, result, &mut self.outgoing, &mut self.latencies);
            }
            WorkerEvent::Preloaded { name, id } => {
                tracing::info!(name, "preloaded");
                self.preloaded.push((name, id.0));
            }
        }
    }

    /// Reports about a session whose client left are dropped.
    fn with_session(&mut self, key: SessionKey, act: impl FnOnce(&mut Session<L>)) {
        if let Some(session) = self.sessions.get_mut(&key) {
            act(session);
        }
    }

    /// Updates every session: cancels those whose clients left, ends those that expired, sends what can be sent.
    /// Called after every event.
    pub(crate) fn settle(&mut self, now: Instant) {
        let mut over = Vec::new();
        for (key, session) in &mut self.sessions {
            if !session.state().is_over() && !session.is_connected() {
                self.queues.plans.withdraw(|job| job.key == *key);
                session.input(Input::Cancel);
            }
            let late = session.deadline.is_some_and(|d| d <= now);
            if late
                && session.state() == SessionState::Queued
                && self.queues.plans.withdraw(|job| job.key == *key)
            {
                let (input, error) = expired();
                session.end_with(input, &error);
            }
            if session.pump(now, self.limits.patience) {
                self.outgoing.wakes.push(session.listener);
            }
            if session.is_finished() {
                over.push(*key);
            }
        }
        for key in over {
            self.remove(key);
        }
        self.uploads.settle(now, &mut self.outgoing, &mut self.latencies);
        self.shut_down(now);
    }

    /// Takes no new requests any more, and gives those that run a grace period, which another signal ends.
    fn terminate(&mut self, now: Instant) {
        self.shutdown = self.shutdown.requested(now, self.limits.grace);
        self.queues.close();
        let error = Shutdown::error();
        for (key, session) in &mut self.sessions {
            if session.state() == SessionState::Queued && self.queues.plans.withdraw(|job| job.key == *key) {
                session.end_with(Input::Refuse, &error);
            }
        }
    }

    fn shut_down(&mut self, now: Instant) {
        match self.shutdown {
            Shutdown::Grace(end) if end <= now => {
                self.sessions.values().for_each(Session::cancel_work);
                self.uploads.cancel_work();
                self.shutdown = Shutdown::Drain(now + self.limits.drain);
            }
            Shutdown::Drain(end) if end <= now => {
                let error = Shutdown::error();
                for session in self.sessions.values_mut() {
                    // Legal from every live state: a worker that does not stop is left behind.
                    let input = if matches!(session.state(), SessionState::Streaming) {
                        Input::Fail
                    } else {
                        Input::Refuse
                    };
                    session.end_with(input, &error);
                    session.pump(now, self.limits.patience);
                    self.outgoing.wakes.push(session.listener);
                }
                self.sessions.clear();
                self.uploads.clear();
            }
            _ => {}
        }
    }

    /// Whether the shutdown is over: everybody is answered.
    pub(crate) fn is_closed(&self) -> bool {
        self.shutdown.is_requested() && self.sessions.is_empty() && self.uploads.is_empty()
    }

    fn remove(&mut self, key: SessionKey) {
        if let Some(session) = self.sessions.remove(&key) {
            self.finish(key, session);
        }
    }

    /// Counts a finished session and releases its request.
    fn finish(&mut self, key: SessionKey, session: Session<L>) {
        let counter = match session.state() {
            SessionState::Ended(SessionEnd::Done) => &mut self.counters.done,
            SessionState::Ended(SessionEnd::Cancelled) => &mut self.counters.cancelled,
            SessionState::Ended(SessionEnd::Expired) => &mut self.counters.expired,
            SessionState::Ended(SessionEnd::Refused) => &mut self.counters.refused,
            _ => &mut self.counters.failed,
        };
        *counter += 1;
        let timed = session.timed();
        if let Some((kind, time)) = timed {
            self.latencies.add(kind, time);
        }
        let total_ms = timed.map(|(_, time)| time.as_secs_f64() * 1e3);
        tracing::debug!(request = key.request, state = ?session.state(), total_ms, "request over");
        // The request is released before its client is woken, so that the client sees the end.
        let listener = session.listener;
        drop(session);
        self.outgoing.wakes.push(listener);
    }

    /// When `settle` must be called next, if no event comes before.
    pub(crate) fn next_deadline(&self, now: Instant) -> Option<Instant> {
        let queued =
            self.sessions.values().filter(|s| s.state() == SessionState::Queued).filter_map(|s| s.deadline);
        let shutdown = self.shutdown.end();
        queued.chain(shutdown).chain(self.uploads.next_deadline(now)).min()
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
}

fn expired() -> (Input, WireError) {
    let error = WireError::new(ErrorCode::Expired, "the deadline passed before planning began");
    (Input::Expire, error)
}

#[cfg(test)]
#[path = "dispatcher_tests.rs"]
mod tests;
