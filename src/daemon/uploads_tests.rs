//! Meshes that come in, with a scripted planner and without any transport.

use sbdp_ipc::geometry::{Assembly, Part, Vertices};

use super::*;

impl Bench {
    fn upload(&mut self, deadline_ns: u64) -> Wire {
        let (wire, mut incoming) = self.incoming(RequestKind::Upload, &[0xff; 200]);
        incoming.header.consumed = deadline_ns;
        self.handle(Event::Upload(incoming));
        wire
    }
}

#[test]
fn an_upload_that_makes_admission_panic_is_answered_failed() {
    let mut bench = Bench::new(4);
    let empty = Assembly::default();
    let mut bytes = vec![0; empty.encoded_len()];
    assert!(empty.encode_into(&mut bytes));
    let (wire, incoming) = bench.incoming(RequestKind::Upload, &bytes);
    bench.handle(Event::Upload(incoming));
    bench.until(|dispatcher| dispatcher.uploads.is_empty());
    assert_eq!(wire.error(), Some(ErrorCode::Failed));
    let (wire, incoming) = bench.incoming(RequestKind::Upload, &[0xff; 200]);
    bench.handle(Event::Upload(incoming));
    bench.until(|dispatcher| dispatcher.uploads.is_empty());
    assert_eq!(wire.error(), Some(ErrorCode::Malformed));
}

#[test]
fn an_upload_that_is_late_is_answered_expired() {
    let mut bench = Bench::new(4);
    assert_eq!(bench.upload(1).error(), Some(ErrorCode::Expired));
    // Nobody takes these up: they are late while they wait.
    bench.dispatcher.uploads.queue = Queues::new(&Config::default()).admissions;
    let waiting = bench.upload(clock::deadline_in(Duration::from_millis(20)));
    assert!(waiting.kinds().is_empty() && bench.dispatcher.next_deadline(Instant::now()).is_some());
    bench.until(|dispatcher| dispatcher.uploads.is_empty());
    assert_eq!(waiting.error(), Some(ErrorCode::Expired));
    assert_eq!(bench.dispatcher.uploads.queue.len(), 0);
}

#[test]
fn an_upload_whose_client_leaves_keeps_no_memory() {
    let mut bench = Bench::new(4);
    bench.dispatcher.uploads.queue = Queues::new(&Config::default()).admissions;
    let waiting = bench.upload(0);
    waiting.gone.set(true);
    bench.dispatcher.settle(Instant::now());
    assert!(bench.dispatcher.uploads.is_empty() && bench.dispatcher.uploads.queue.len() == 0);
    assert!(waiting.kinds().is_empty());
}

#[test]
fn an_upload_whose_client_leaves_while_it_is_taken_in_is_not_taken_in_to_the_end() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let part = Part { name: "part", vertices: Vertices::F64(&corners), triangles: &[[0, 1, 2]] };
    let endless = Assembly { name: ENDLESS, parts: vec![part], ..Assembly::default() };
    let mut bytes = vec![0; endless.encoded_len()];
    assert!(endless.encode_into(&mut bytes));
    let mut bench = Bench::new(4);
    let (wire, incoming) = bench.incoming(RequestKind::Upload, &bytes);
    bench.handle(Event::Upload(incoming));
    let service = Arc::clone(&bench.service);
    let busy = || service.taking_in.load(Ordering::Relaxed) > 0;
    bench.until(|_| busy());
    wire.gone.set(true);
    bench.until(|dispatcher| dispatcher.uploads.is_empty() && !busy());
    // When the daemon leaves, and its grace is over, it is the same.
    let (_wire, incoming) = bench.incoming(RequestKind::Upload, &bytes);
    bench.handle(Event::Upload(incoming));
    bench.until(|_| busy());
    bench.handle(Event::Terminate);
    bench.handle(Event::Terminate);
    bench.until(|_| !busy());
}

#[test]
fn an_upload_that_memory_is_not_enough_for_is_refused_before_it_is_copied() {
    let mut bench = Bench::new(4);
    bench.dispatcher.uploads.free_memory = || Some(1 << 30);
    assert!(bench.dispatcher.uploads.refusal(OTHER, 1 << 20).is_none());
    let error = bench.dispatcher.uploads.refusal(OTHER, 500 << 20).unwrap();
    assert_eq!(error.code, ErrorCode::TooLarge);
    assert!(error.message.contains("500 MB") && error.message.contains("1024 MB are free"), "{error:?}");
    bench.dispatcher.uploads.free_memory = || None;
    assert!(
        bench.dispatcher.uploads.refusal(OTHER, 500 << 20).is_none(),
        "where nothing is known, it is tried"
    );
}

#[test]
fn more_uploaded_bytes_than_may_wait_are_refused_before_they_are_copied() {
    let mut bench = Bench::new(4);
    let mut config = Config::default();
    config.requests.uploads_mb_per_client = 1;
    bench.dispatcher.uploads.queue = Queues::new(&config).admissions;
    assert!(bench.dispatcher.uploads.refusal(OTHER, 5 << 20).is_none(), "one that would wait alone is taken");
    bench.upload(0);
    let error = bench.dispatcher.uploads.refusal(Owner(5), 5 << 20).unwrap();
    assert_eq!(error.code, ErrorCode::Busy);
    assert!(error.retry_ms > 0 && bench.dispatcher.uploads.refusal(OTHER, 5 << 20).is_none());
}
