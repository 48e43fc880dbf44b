//! Admission, cancellation and client death with a scripted planner and without any transport.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};

use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseHeader};

use super::*;
use crate::daemon::session::Undelivered;
use crate::daemon::workers::{Report, start};
use crate::fixtures::{plan_of, step_of};
use crate::geometry::{Revision, SourceAssembly};
use crate::plan::{Plan, PlanStatus};
use crate::search::{Interrupt, PlanSink};
use crate::service::{Admission, AnsweredQuestion, ServiceError};
use crate::termination::Termination;

/// No test waits longer than this for what must happen.
const HANG: Duration = Duration::from_secs(60);

/// What the scripted planner does is said by `max_simulations`.
const QUICK: u64 = 0;
const PANIC: u64 = 1;
/// Runs until it is cancelled or let go.
const HOLD: u64 = 2;

/// An upload of this name is taken in until that is cancelled.
const ENDLESS: &str = "endless";

#[derive(Default)]
struct Scripted {
    let_go: AtomicBool,
    /// Uploads that are being taken in.
    taking_in: AtomicUsize,
    /// What was answered before a restart.
    before: Vec<AnsweredQuestion>,
    /// The bytes of responses that were reported to it.
    answers: AtomicUsize,
}

impl Planning for Scripted {
    fn admit(&self, source: &SourceAssembly, termination: &Termination) -> Result<Admission, ServiceError> {
        assert!(!source.parts.is_empty(), "scripted to panic on an empty assembly");
        self.taking_in.fetch_add(1, Ordering::Relaxed);
        while source.name == ENDLESS && termination.check().is_ok() {
            std::thread::yield_now();
        }
        self.taking_in.fetch_sub(1, Ordering::Relaxed);
        Ok(Admission { id: AssemblyId([7; 32]), known: false, warnings: vec![] })
    }

    fn revise(&self, base: AssemblyId, _: &Revision, _: &Termination) -> Result<Admission, ServiceError> {
        Ok(Admission { id: base, known: true, warnings: vec![] })
    }

    fn knows(&self, id: AssemblyId) -> bool {
        id.0 == [7; 32]
    }

    fn set_response_bytes(&self, bytes: usize) {
        self.answers.store(bytes, Ordering::Relaxed);
    }

    fn recent_answers(&self, most: usize, bytes: u64) -> Vec<AnsweredQuestion> {
        assert!(most > 0 && bytes > 0);
        self.before.clone()
    }

    fn plan(
        &self,
        _: AssemblyId,
        request: &crate::search::PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError> {
        let step = step_of(0);
        match request.max_simulations {
            Some(PANIC) => panic!("scripted panic"),
            Some(HOLD) => loop {
                match termination.check() {
                    Err(Interrupt::Cancelled) => return Ok(plan_of(PlanStatus::Cancelled, vec![])),
                    Err(Interrupt::DeadlinePassed) => return Ok(plan_of(PlanStatus::Timeout, vec![])),
                    Ok(()) if self.let_go.load(Ordering::Relaxed) => break,
                    Ok(()) => std::thread::sleep(Duration::from_millis(1)),
                }
            },
            _ => {}
        }
        sink.step(&step);
        Ok(plan_of(PlanStatus::Complete, vec![step]))
    }
}

/// A client's side: what it got, and whether it is there.
#[derive(Clone, Debug, Default)]
struct Wire {
    gone: Rc<Cell<bool>>,
    got: Rc<RefCell<Vec<(ResponseHeader, AlignedBytes)>>>,
}

impl Link for Wire {
    fn send(&self, header: ResponseHeader, payload: &[u8]) -> Result<(), Undelivered> {
        self.got.borrow_mut().push((header, AlignedBytes::copy_of(payload)));
        Ok(())
    }

    fn is_connected(&self) -> bool {
        !self.gone.get()
    }
}

impl Wire {
    fn kinds(&self) -> Vec<u32> {
        self.got.borrow().iter().map(|(h, _)| h.kind).collect()
    }

    fn error(&self) -> Option<ErrorCode> {
        let got = self.got.borrow();
        let (header, bytes) = got.last()?;
        (header.kind == ResponseKind::Error as u32).then(|| WireError::decode(bytes.as_slice()).unwrap().code)
    }

    fn summary_status(&self) -> Option<&'static str> {
        let got = self.got.borrow();
        let (header, bytes) = got.last()?;
        (header.kind == ResponseKind::Summary as u32)
            .then(|| sbdp_ipc::summary::SummaryView::new(bytes.as_slice()).unwrap().status())
    }
}

struct Bench {
    dispatcher: Dispatcher<Wire, Scripted>,
    service: Arc<Scripted>,
    reports: Receiver<WorkerEvent>,
    next_request: u64,
}

impl Bench {
    fn new(queue: usize) -> Self {
        Self::of(queue, Scripted::default())
    }

    fn of(queue: usize, service: Scripted) -> Self {
        let mut config = Config::default();
        config.workers.count = 1;
        config.requests.queue = queue;
        config.times.grace_s = 0.0;
        let service = Arc::new(service);
        config.requests.waiting_per_client = queue;
        let queues = Queues::new(&config);
        let (sender, reports): (Sender<WorkerEvent>, _) = channel();
        let sender = Mutex::new(sender);
        let report: Report = Arc::new(move |event| {
            let _ = sender.lock().unwrap().send(event);
        });
        start(1, &queues, &service, &report).unwrap();
        Self {
            dispatcher: Dispatcher::new(Arc::clone(&service), queues, &config),
            service,
            reports,
            next_request: 0,
        }
    }

    fn incoming(&mut self, kind: RequestKind, payload: &[u8]) -> (Wire, Incoming<Wire>) {
        self.next_request += 1;
        let wire = Wire::default();
        let header =
            RequestHeader { kind: kind as u32, request: self.next_request, ..RequestHeader::default() };
        let payload = AlignedBytes::copy_of(payload);
        (wire.clone(), Incoming { link: wire, client: 5, owner: Owner(5), header, payload })
    }

    fn ask(&mut self, request: &PlanRequest) -> Wire {
        let (wire, incoming) = self.incoming(RequestKind::Plan, &request.encode());
        self.handle(Event::Plan(incoming));
        wire
    }

    fn script(&mut self, script: u64) -> Wire {
        self.ask(&request(script))
    }

    fn handle(&mut self, event: Event<Wire>) {
        self.dispatcher.handle(event, Instant::now());
        self.dispatcher.settle(Instant::now());
    }

    /// Lets workers report until something holds.
    fn until(&mut self, holds: impl Fn(&Dispatcher<Wire, Scripted>) -> bool) {
        let start = Instant::now();
        while !holds(&self.dispatcher) {
            assert!(start.elapsed() < HANG, "this never happens");
            match self.reports.recv_timeout(Duration::from_millis(5)) {
                Ok(event) => self.handle(Event::Worker(event)),
                Err(RecvTimeoutError::Timeout) => self.dispatcher.settle(Instant::now()),
                Err(RecvTimeoutError::Disconnected) => panic!("the workers are gone"),
            }
        }
    }

    fn until_running(&mut self) {
        self.until(|dispatcher| dispatcher.sessions.values().any(|s| s.state() == SessionState::Running));
    }
}

fn request(script: u64) -> PlanRequest {
    PlanRequest { handle: [7; 32], actions: 1, max_simulations: Some(script), ..PlanRequest::default() }
}

#[test]
fn a_plan_is_streamed_and_summed_up() {
    let mut bench = Bench::new(4);
    let wire = bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    assert_eq!(wire.kinds(), [ResponseKind::Steps as u32, ResponseKind::Summary as u32]);
    assert_eq!(wire.summary_status(), Some("complete"));
}

#[test]
fn what_was_answered_before_is_answered_at_once_while_no_worker_is_free() {
    let mut bench = Bench::new(1);
    let first = bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    bench.script(HOLD);
    bench.until_running();
    let again = bench.script(QUICK);
    assert_eq!((again.kinds(), again.summary_status()), (first.kinds(), Some("complete")));
    assert_eq!((bench.dispatcher.counters.remembered, bench.dispatcher.counters.done), (1, 2));
    let unremembered = PlanRequest { no_cache: true, ..request(QUICK) };
    assert!(bench.ask(&unremembered).kinds().is_empty(), "it waits for a worker");
    let error = bench.script(HOLD).error();
    assert_eq!(error, Some(ErrorCode::Busy), "what was not answered is not remembered");
}

#[test]
fn what_was_answered_before_a_restart_is_answered_at_once_after_it() {
    let mut bench = Bench::new(1);
    let first = bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    let asked = question(&request(QUICK)).unwrap();
    let before = vec![(asked.clone(), bench.dispatcher.answers.get(&asked).unwrap().messages())];
    let mut bench = Bench::of(1, Scripted { before, ..Scripted::default() });
    bench.script(HOLD);
    bench.until_running();
    let again = bench.script(QUICK);
    assert_eq!((again.kinds(), again.summary_status()), (first.kinds(), Some("complete")));
    assert_eq!(bench.dispatcher.counters.remembered, 1);
}

#[test]
fn the_service_is_told_what_answers_take_also_after_a_restart() {
    let told = |bench: &Bench| {
        (bench.service.answers.load(Ordering::Relaxed), bench.dispatcher.answers.metrics().bytes)
    };
    let mut bench = Bench::new(4);
    assert_eq!(told(&bench), (0, 0));
    bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    let (bytes, held) = told(&bench);
    assert!(bytes > 0 && bytes == held, "{bytes} told, {held} held");
    let asked = question(&request(QUICK)).unwrap();
    let before = vec![(asked.clone(), bench.dispatcher.answers.get(&asked).unwrap().messages())];
    let bench = Bench::of(1, Scripted { before, ..Scripted::default() });
    assert_eq!(told(&bench), (bytes, bytes));
}

#[test]
fn of_a_question_asked_again_only_what_makes_it_another_counts() {
    let mut bench = Bench::new(1);
    bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    let soon = Some(clock::monotonic_ns() + 1_000_000_000_000);
    for same in [
        request(QUICK),
        PlanRequest { threads: 3, ..request(QUICK) },
        PlanRequest { batch: true, ..request(QUICK) },
        PlanRequest { deadline_ns: soon, ..request(QUICK) },
    ] {
        assert_eq!(bench.ask(&same).summary_status(), Some("complete"), "{same:?}");
    }
    assert_eq!(bench.dispatcher.counters.remembered, 4);
    let late = PlanRequest { deadline_ns: Some(1), ..request(QUICK) };
    assert_eq!(bench.ask(&late).error(), Some(ErrorCode::Expired), "nobody waits for it any more");
    let in_use = bench.next_request;
    bench.script(HOLD);
    bench.next_request = in_use;
    assert_eq!(bench.script(QUICK).error(), Some(ErrorCode::Malformed), "its number is that of another");
    bench.handle(Event::Terminate);
    assert_eq!(bench.script(QUICK).error(), Some(ErrorCode::ShuttingDown));
    assert_eq!(bench.dispatcher.counters.remembered, 4);
}

#[test]
fn more_than_the_queue_holds_is_answered_busy() {
    let mut bench = Bench::new(1);
    bench.script(HOLD);
    bench.until_running();
    let waiting = bench.script(QUICK);
    let refused = bench.script(QUICK);
    assert_eq!(refused.error(), Some(ErrorCode::Busy));
    bench.service.let_go.store(true, Ordering::Relaxed);
    bench.until(|dispatcher| dispatcher.counters.done == 2);
    assert_eq!(waiting.summary_status(), Some("complete"));
}

#[test]
fn a_panic_is_an_answer_and_the_next_request_is_served() {
    let mut bench = Bench::new(4);
    let wire = bench.script(PANIC);
    bench.until(|dispatcher| dispatcher.counters.failed == 1);
    assert_eq!(wire.error(), Some(ErrorCode::Failed));
    let wire = bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    assert_eq!(wire.summary_status(), Some("complete"));
}

#[test]
fn a_client_that_leaves_frees_its_worker() {
    let mut bench = Bench::new(4);
    let held = bench.script(HOLD);
    bench.until_running();
    held.gone.set(true);
    let next = bench.script(QUICK);
    bench.until(|dispatcher| dispatcher.counters.done == 1);
    assert_eq!(next.summary_status(), Some("complete"));
    assert!(held.kinds().is_empty());
    assert_eq!(bench.dispatcher.counters.cancelled, 1);
}

#[test]
fn cancelling_a_running_request_is_answered_with_what_there_is() {
    let mut bench = Bench::new(4);
    let wire = bench.script(HOLD);
    bench.until_running();
    let (_, mut control) = bench.incoming(RequestKind::Control, &[]);
    control.header.request = 1;
    control.header.flags = CONTROL_CANCEL;
    bench.handle(Event::Control(control));
    bench.until(|dispatcher| dispatcher.sessions.is_empty());
    assert_eq!(wire.summary_status(), Some("cancelled"));
}

#[test]
fn cancelling_a_waiting_request_takes_it_out_of_the_queue() {
    let mut bench = Bench::new(4);
    bench.script(HOLD);
    bench.until_running();
    let waiting = bench.script(QUICK);
    let (_, mut control) = bench.incoming(RequestKind::Control, &[]);
    control.header.request = 2;
    control.header.flags = CONTROL_CANCEL;
    bench.handle(Event::Control(control));
    assert_eq!(waiting.error(), Some(ErrorCode::Cancelled));
    bench.service.let_go.store(true, Ordering::Relaxed);
}

#[test]
fn a_deadline_that_passes_in_the_queue_is_answered_expired() {
    let mut bench = Bench::new(4);
    bench.script(HOLD);
    bench.until_running();
    let request = PlanRequest {
        handle: [7; 32],
        deadline_ns: Some(clock::deadline_in(Duration::from_millis(20))),
        ..PlanRequest::default()
    };
    let wire = bench.ask(&request);
    assert!(bench.dispatcher.next_deadline(Instant::now()).is_some());
    bench.until(|dispatcher| dispatcher.counters.expired == 1);
    assert_eq!(wire.error(), Some(ErrorCode::Expired));
    bench.service.let_go.store(true, Ordering::Relaxed);
}

#[test]
fn requests_that_cannot_be_planned_are_refused_with_their_code() {
    let mut bench = Bench::new(4);
    let known = PlanRequest { handle: [7; 32], ..PlanRequest::default() };
    let unknown = bench.ask(&PlanRequest::default());
    assert_eq!(unknown.error(), Some(ErrorCode::UnknownHandle));
    let unsupported = bench.ask(&PlanRequest { planner: 99, ..known.clone() });
    assert_eq!(unsupported.error(), Some(ErrorCode::Unsupported));
    let late = bench.ask(&PlanRequest { deadline_ns: Some(1), ..known });
    assert_eq!(late.error(), Some(ErrorCode::Expired));
    let (garbage, incoming) = bench.incoming(RequestKind::Plan, &[1, 2, 3]);
    bench.handle(Event::Plan(incoming));
    assert_eq!(garbage.error(), Some(ErrorCode::Malformed));
    assert_eq!((bench.dispatcher.counters.refused, bench.dispatcher.counters.expired), (3, 1));
}

#[test]
fn terminating_cancels_what_runs_refuses_what_waits_and_then_is_closed() {
    let mut bench = Bench::new(4);
    let running = bench.script(HOLD);
    bench.until_running();
    let waiting = bench.script(QUICK);
    bench.handle(Event::Terminate);
    assert_eq!(waiting.error(), Some(ErrorCode::ShuttingDown));
    let late = bench.script(QUICK);
    assert_eq!(late.error(), Some(ErrorCode::ShuttingDown));
    bench.until(|dispatcher| dispatcher.is_closed());
    assert_eq!(running.summary_status(), Some("cancelled"));
}

/// Another process than the one that all other requests come from.
const OTHER: Owner = Owner(6);

impl Bench {
    fn ask_as(&mut self, owner: Owner, request: &PlanRequest) -> Wire {
        let (wire, incoming) = self.incoming(RequestKind::Plan, &request.encode());
        self.handle(Event::Plan(Incoming { owner, ..incoming }));
        wire
    }
}

#[test]
fn a_client_that_fills_its_share_is_told_when_to_come_again_and_others_are_taken() {
    let mut bench = Bench::new(4);
    bench.dispatcher.queues = {
        let mut config = Config::default();
        config.requests.waiting_per_client = 1;
        Queues::new(&config)
    };
    let unremembered = PlanRequest { no_cache: true, ..request(QUICK) };
    assert!(bench.ask(&unremembered).kinds().is_empty());
    let refused = bench.ask(&unremembered);
    assert_eq!(refused.error(), Some(ErrorCode::Busy));
    assert!(refused.got.borrow()[0].0.retry_ms > 0);
    assert!(bench.ask_as(OTHER, &unremembered).kinds().is_empty(), "it waits");
    assert_eq!(bench.dispatcher.queues.plans.len(), 2);
}

#[test]
fn a_batch_request_waits_for_interactive_ones() {
    let mut bench = Bench::new(4);
    bench.script(HOLD);
    bench.until_running();
    let unremembered = PlanRequest { no_cache: true, ..request(QUICK) };
    let batch = bench.ask(&PlanRequest { batch: true, ..unremembered.clone() });
    let urgent = bench.ask_as(OTHER, &unremembered);
    bench.service.let_go.store(true, Ordering::Relaxed);
    bench.until(|dispatcher| dispatcher.counters.done >= 2);
    assert_eq!(urgent.summary_status(), Some("complete"));
    bench.until(|dispatcher| dispatcher.counters.done == 3);
    assert_eq!(batch.summary_status(), Some("complete"));
}

#[path = "uploads_tests.rs"]
mod uploads;
