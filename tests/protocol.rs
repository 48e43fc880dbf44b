//! The wire contract between the real daemon and clients, well-behaved and not.

mod common;

use std::time::Duration;

use common::{Boxes, Daemon, HANG, next_event, plan};
use sbdp::blocking_graph::StaticAnalysis;
use sbdp::geometry::{SourceAssembly, SourceMesh, SourcePart};
use sbdp::plan::PlanStep;
use sbdp::search::{ActionSet, Engine, PlanRequest, PlanSink, Progress, Termination, TraceEvent};
use sbdp::service::Service;
use sbdp::simulation::PenaltyParameters;
use sbdp_client::{
    Assembly, Client, ErrorCode, Event, Handle, Part, PenaltyParameter, PlanOptions, PlanStatus, StepEnd,
    Summary, Vertices, content_hash,
};
use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::endpoint::Endpoint;
use sbdp_ipc::error::WireError;
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseKind};
use sbdp_ipc::layout::{self, PLAN_REQUEST};
use sbdp_ipc::services::{self, Answer, ClientPort};

const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn source(units: Option<&str>) -> SourceAssembly {
    let vertices = vec![[0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.25, 0.0], [0.0, 0.0, 0.1_f32.into()]];
    let part = |name: &str| SourcePart {
        name: name.to_owned(),
        origin: format!("{name}.obj"),
        mesh: SourceMesh { vertices: vertices.clone(), triangles: TETRAHEDRON.to_vec() },
    };
    SourceAssembly {
        name: "any".to_owned(),
        units: units.map(str::to_owned),
        parts: vec![part("0"), part("10")],
        fixed: vec!["10".to_owned()],
        ..SourceAssembly::default()
    }
}

/// The upload of a source assembly, in double or single precision.
fn with_upload<T>(source: &SourceAssembly, single: bool, use_it: impl FnOnce(&Assembly<'_>) -> T) -> T {
    let narrow: Vec<Vec<[f32; 3]>> =
        source.parts.iter().map(|p| p.mesh.vertices.iter().map(|v| v.map(|x| x as f32)).collect()).collect();
    let parts = source.parts.iter().zip(&narrow).map(|(p, narrow)| Part {
        name: &p.name,
        vertices: if single { Vertices::F32(narrow) } else { Vertices::F64(&p.mesh.vertices) },
        triangles: &p.mesh.triangles,
    });
    use_it(&Assembly {
        name: "another name",
        units: source.units.as_deref(),
        parts: parts.collect(),
        fixed: source.fixed.iter().map(String::as_str).collect(),
    })
}

#[test]
fn client_and_daemon_give_the_same_content_the_same_handle() {
    for units in [None, Some(""), Some("mm")] {
        let source = source(units);
        let handle = sbdp::geometry::content_hash(&source);
        assert_eq!(with_upload(&source, false, content_hash).0, handle);
        // All coordinates fit single precision: widened, they are the same content.
        assert_eq!(with_upload(&source, true, content_hash).0, handle);
    }
}

#[test]
fn the_handle_of_known_content_never_changes() {
    assert_eq!(content_hash(&Assembly::default()).to_string().len(), 64);
    let handle = with_upload(&source(Some("mm")), false, content_hash).to_string();
    assert_eq!(handle, PINNED);
}

/// Changes only together with the tag of the byte stream.
const PINNED: &str = "5174a65bbdbbe6027ca566ecab29bbde642f31381d9ba6117b46e48a58f55431";

#[test]
fn content_that_differs_anywhere_has_another_handle() {
    let base = source(Some("mm"));
    let mut variants = vec![base.clone(), source(None), source(Some(""))];
    let mut vary = |change: fn(&mut SourceAssembly)| {
        let mut variant = base.clone();
        change(&mut variant);
        variants.push(variant);
    };
    vary(|a| a.fixed.clear());
    vary(|a| a.parts[0].name = "1".to_owned());
    vary(|a| a.parts[0].mesh.vertices[0][2] = -0.0);
    vary(|a| a.parts[1].mesh.triangles.swap(0, 1));
    vary(|a| drop(a.parts.pop()));
    vary(|a| a.parts.swap(0, 1));
    let handles: std::collections::BTreeSet<_> = variants.iter().map(sbdp::geometry::content_hash).collect();
    assert_eq!(handles.len(), variants.len());
}

#[test]
fn uploading_twice_is_free_and_answers_the_same_handle() {
    let daemon = Daemon::start();
    let boxes = Boxes::two();
    let first = daemon.connect().upload(&boxes.assembly()).unwrap();
    let client = daemon.connect();
    assert_eq!(client.upload(&boxes.assembly()).unwrap(), first);
    assert_eq!(first, content_hash(&boxes.assembly()));
    assert_eq!(client.status().unwrap().numbers.uploads, 1);
    assert!(client.knows(first).unwrap());
}

#[test]
fn a_plan_names_its_parts_and_says_how_it_went() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let (parts, summary) = plan(&client, handle, &PlanOptions { fixed: vec![0], ..PlanOptions::default() });
    assert!(parts.contains(&1) && !parts.contains(&0), "{parts:?}");
    assert_eq!(summary.fixed, [0]);
    assert_eq!((summary.status, summary.parts.clone()), (PlanStatus::Complete, vec!["0".into(), "1".into()]));
    assert_eq!((summary.planner.as_str(), summary.engine.as_str()), ("sbdp-star", "sliding"));
    let status = client.status().unwrap();
    assert_eq!((status.numbers.requests, status.numbers.done), (1, 1));
}

/// Keeps the trace, if it is wanted; the plan itself is compared.
#[derive(Default)]
struct Traced {
    wanted: bool,
    lines: String,
}

impl PlanSink for Traced {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &PlanStep) {}
    fn traces(&self) -> bool {
        self.wanted
    }
    fn traced(&mut self, event: TraceEvent) {
        self.lines += &(serde_json::to_string(&event).unwrap() + "\n");
    }
}

fn source_of(upload: &Assembly<'_>) -> SourceAssembly {
    SourceAssembly {
        units: upload.units.map(str::to_owned),
        parts: upload.parts.iter().map(source_part).collect(),
        ..SourceAssembly::default()
    }
}

#[test]
fn the_daemon_answers_to_the_bit_what_the_service_answers_in_process() {
    let boxes = Boxes::lattice(2);
    let upload = boxes.assembly();
    let service = Service::default();
    let id = service.admit(&source_of(&upload)).unwrap().id;
    let request = PlanRequest { fixed: vec![0], ..PlanRequest::default() };
    let here = service.plan(id, &request, &Termination::new(None), &mut Traced::default()).unwrap();

    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&upload).unwrap();
    assert_eq!(handle.0, id.0);
    let mut stream = client.plan(handle, &PlanOptions { fixed: vec![0], ..PlanOptions::default() }).unwrap();
    let mut steps = here.steps.iter();
    loop {
        match next_event(&mut stream).unwrap().unwrap() {
            Event::Step(there) => {
                let there = there.view();
                let here = steps.next().unwrap();
                assert_eq!((there.parts, there.path), (&numbers(&here.parts)[..], here.path.as_slice()));
                assert_eq!((there.of, there.ends), (None, StepEnd::Out));
                assert_eq!(there.verified_depth.to_bits(), here.verified_depth.to_bits());
                assert_eq!(there.requires, numbers(&here.requires));
                assert_eq!((there.wave as usize, there.direction), (here.wave, here.direction));
            }
            Event::Progress(_) | Event::Trace(_) => {}
            Event::Restarted => panic!("nothing was restarted"),
            Event::Done(there) => {
                assert!(steps.next().is_none());
                assert_eq!((there.parts, there.units), (here.parts, here.units));
                assert_eq!((there.reason, there.remaining), (here.reason, numbers(&here.remaining)));
                assert_eq!(there.stats.simulations, here.stats.simulations);
                return;
            }
        }
    }
}

fn numbers(list: &[usize]) -> Vec<u32> {
    list.iter().map(|i| *i as u32).collect()
}

fn source_part(part: &Part<'_>) -> SourcePart {
    let mesh = SourceMesh { vertices: part.vertices.iter().collect(), triangles: part.triangles.to_vec() };
    SourcePart { name: part.name.to_owned(), origin: "upload".to_owned(), mesh }
}

/// The trace of a plan, and its summary.
fn trace(client: &Client, handle: Handle, options: &PlanOptions) -> (String, Summary) {
    let mut stream = client.plan(handle, options).unwrap();
    let mut lines = String::new();
    loop {
        match next_event(&mut stream).unwrap().unwrap() {
            Event::Trace(more) => lines += &more,
            Event::Progress(_) | Event::Step(_) => {}
            Event::Restarted => panic!("nothing was restarted"),
            Event::Done(summary) => return (lines, summary),
        }
    }
}

#[test]
fn the_papers_planner_is_asked_for_over_the_wire_with_its_parameters_and_its_trace() {
    let boxes = Boxes::lattice(2);
    let upload = boxes.assembly();
    let service = Service::default();
    let id = service.admit(&source_of(&upload)).unwrap().id;
    let here = |force: f64, rule| {
        let request = PlanRequest {
            engine: Engine::Penalty,
            actions: ActionSet::Paper,
            static_analysis: rule,
            penalty: PenaltyParameters { force, ..PenaltyParameters::default() },
            ..PlanRequest::default()
        };
        let mut sink = Traced { wanted: true, ..Traced::default() };
        service.plan(id, &request, &Termination::default(), &mut sink).unwrap();
        sink.lines
    };
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&upload).unwrap();
    let options = |penalty, static_analysis| PlanOptions {
        engine: sbdp_client::Engine::Penalty,
        actions: sbdp_client::ActionSet::Paper,
        static_analysis,
        penalty,
        trace: true,
        ..PlanOptions::default()
    };
    let (literal, sliding) = (sbdp_client::StaticAnalysis::Paper, sbdp_client::StaticAnalysis::Sliding);
    let usual = trace(&client, handle, &options(vec![], literal)).0;
    assert_eq!(usual, here(100.0, StaticAnalysis::Paper));
    // A trace is not answered from memory.
    assert_eq!(trace(&client, handle, &options(vec![], literal)).0, usual);
    let weak = options(vec![(PenaltyParameter::Force, 50.0)], sliding);
    let (weak, _) = trace(&client, handle, &weak);
    assert_eq!(weak, here(50.0, StaticAnalysis::Sliding));
    assert_ne!(weak, usual);
    let (code, message) =
        refusal(&client, handle, &options(vec![(PenaltyParameter::TimeStep, 0.0)], literal));
    assert!(code == ErrorCode::Unsupported && message.contains("time-step"), "{message}");
    for options in [
        PlanOptions {
            path_timeout: Some(Duration::ZERO),
            actions: sbdp_client::ActionSet::Paper,
            ..PlanOptions::default()
        },
        PlanOptions { planning_timeout: Some(Duration::ZERO), ..PlanOptions::default() },
    ] {
        let (lines, summary) = trace(&client, handle, &options);
        assert_eq!((summary.status, summary.steps), (PlanStatus::Timeout, 0));
        assert!(lines.is_empty(), "no trace was asked for");
    }
}

#[test]
fn the_status_counts_states_whose_graphs_were_answered_from_memory() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(2).assembly()).unwrap();
    let mut hits = 0;
    for fixed in 0..3 {
        let (_, summary) =
            plan(&client, handle, &PlanOptions { fixed: vec![fixed], ..PlanOptions::default() });
        hits += summary.stats.graph_hits;
    }
    assert!(hits >= 7, "the second question has the graphs of the first: {hits}");
    assert_eq!(client.status().unwrap().numbers.graphs_remembered, hits);
}

fn refusal(client: &Client, handle: Handle, options: &PlanOptions) -> (ErrorCode, String) {
    let mut stream = client.plan(handle, options).unwrap();
    loop {
        match next_event(&mut stream) {
            Ok(Some(Event::Progress(_))) => {}
            Ok(event) => panic!("not refused but {event:?}"),
            Err(error) => return (error.code().unwrap(), error.to_string()),
        }
    }
}

#[test]
fn an_unknown_handle_is_refused_and_the_error_says_to_upload() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    assert!(!client.knows(Handle([9; 32])).unwrap());
    let (code, message) = refusal(&client, Handle([9; 32]), &PlanOptions::default());
    assert_eq!(code, ErrorCode::UnknownHandle);
    assert!(message.contains("upload"), "{message}");
}

#[test]
fn a_part_out_of_range_is_refused_by_number() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let options = PlanOptions { removed: vec![7], ..PlanOptions::default() };
    let (code, message) = refusal(&client, handle, &options);
    assert_eq!(code, ErrorCode::NoSuchPart);
    assert!(message.contains('7'), "{message}");
}

#[test]
fn a_deadline_in_the_past_is_answered_expired() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let options = PlanOptions { timeout: Some(Duration::ZERO), ..PlanOptions::default() };
    assert_eq!(refusal(&client, handle, &options).0, ErrorCode::Expired);
}

#[test]
fn refused_geometry_names_the_part() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [f64::NAN, 1.0, 0.0]];
    let part =
        Part { name: "broken-part", vertices: Vertices::F64(&vertices), triangles: &[[0, 1, 2], [0, 2, 1]] };
    let assembly = Assembly { parts: vec![part], ..Assembly::default() };
    let error = client.upload(&assembly).unwrap_err();
    assert_eq!(error.code(), Some(ErrorCode::Geometry));
    assert!(error.to_string().contains("broken-part"), "{error}");
}

#[test]
fn an_upload_beyond_the_limit_is_refused() {
    let daemon = Daemon::start_with("[requests]\nmax_upload_mb = 1\n");
    let vertices = vec![[0.0; 3]; 60_000];
    let part = Part { name: "big", vertices: Vertices::F64(&vertices), triangles: &[] };
    let assembly = Assembly { parts: vec![part], ..Assembly::default() };
    let error = daemon.connect().upload(&assembly).unwrap_err();
    assert_eq!(error.code(), Some(ErrorCode::TooLarge), "{error}");
}

/// A client that sends what it likes.
struct Rude {
    plan: ClientPort,
    geometry: ClientPort,
    wake: iceoryx2::port::notifier::Notifier<sbdp_ipc::Transport>,
    _node: iceoryx2::node::Node<sbdp_ipc::Transport>,
}

impl Rude {
    fn connect(daemon: &Daemon) -> Self {
        let endpoint = Endpoint::find(&daemon.runtime_dir()).unwrap();
        let config = layout::iceoryx2_config(&endpoint.prefix, &endpoint.root).unwrap();
        let node = services::node(&config).unwrap();
        let plan = services::plan(&node).unwrap().open().unwrap();
        let geometry = services::geometry(&node).unwrap().open().unwrap();
        let wake = services::wake(&node, layout::WAKE_SERVER_SERVICE).unwrap().open().unwrap();
        Self {
            plan: plan.client_builder().initial_max_slice_len(2 * PLAN_REQUEST).create().unwrap(),
            geometry: geometry.client_builder().initial_max_slice_len(PLAN_REQUEST).create().unwrap(),
            wake: wake.notifier_builder().create().unwrap(),
            _node: node,
        }
    }

    /// The error that the daemon answers with, or `None` if it gives no error.
    fn ask(&self, port: &ClientPort, kind: u32, payload: &[u8]) -> Option<ErrorCode> {
        let mut request = port.loan_slice(payload.len()).unwrap();
        *request.user_header_mut() = RequestHeader { kind, request: 1, ..RequestHeader::default() };
        request.payload_mut().copy_from_slice(payload);
        let pending = request.send().unwrap();
        self.wake.notify().unwrap();
        let start = std::time::Instant::now();
        loop {
            if let Some(answer) = pending.receive().unwrap() {
                return error_of(&answer);
            }
            if !pending.is_connected() && !pending.has_response() {
                return None;
            }
            assert!(start.elapsed() < HANG, "no answer to kind {kind}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

fn error_of(answer: &Answer) -> Option<ErrorCode> {
    (answer.user_header().kind == ResponseKind::Error as u32).then(|| {
        let bytes = AlignedBytes::copy_of(answer.payload());
        WireError::decode(bytes.as_slice()).unwrap().code
    })
}

#[test]
fn garbage_is_answered_with_errors_and_the_daemon_lives_on() {
    let daemon = Daemon::start();
    let rude = Rude::connect(&daemon);
    let malformed = Some(ErrorCode::Malformed);
    let noise: Vec<u8> = (0..997_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for payload in [&noise[..1], &noise[..79], &noise[..], &[0xff; 400], &[0; 1]] {
        for kind in [0, 99, u32::MAX, RequestKind::Have as u32, RequestKind::Upload as u32] {
            assert_eq!(rude.ask(&rude.plan, kind, payload), malformed, "plan, kind {kind}");
        }
        assert!(rude.ask(&rude.plan, RequestKind::Plan as u32, payload).is_some());
        assert_eq!(rude.ask(&rude.plan, RequestKind::Control as u32, payload), None);
        assert_eq!(rude.ask(&rude.plan, RequestKind::Status as u32, payload), None);
        for kind in [0, RequestKind::Plan as u32, RequestKind::Have as u32, RequestKind::Upload as u32] {
            assert_eq!(rude.ask(&rude.geometry, kind, payload), malformed, "geometry, kind {kind}");
        }
    }
    let long = vec![0; PLAN_REQUEST + 8];
    assert_eq!(rude.ask(&rude.plan, RequestKind::Plan as u32, &long), Some(ErrorCode::TooLarge));

    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    assert_eq!(plan(&client, handle, &PlanOptions::default()).1.status, PlanStatus::Complete);
}

#[test]
#[allow(unsafe_code, reason = "a sender that cheats has to write where it may not")]
fn contents_that_change_after_they_were_sent_are_answered_and_harm_nobody() {
    let daemon = Daemon::start();
    let rude = Rude::connect(&daemon);
    let boxes = Boxes::two();
    let upload = boxes.assembly();
    let mut bytes = vec![0; upload.encoded_len()];
    assert!(upload.encode_into(&mut bytes));
    let mut answers = [0; 2];
    for round in 0..300_usize {
        let mut request = rude.geometry.loan_slice(bytes.len()).unwrap();
        *request.user_header_mut() =
            RequestHeader { kind: RequestKind::Upload as u32, ..RequestHeader::default() };
        request.payload_mut().copy_from_slice(&bytes);
        let sent = request.payload_mut().as_mut_ptr();
        let pending = request.send().unwrap();
        rude.wake.notify().unwrap();
        let (start, mut step) = (std::time::Instant::now(), round);
        let answer = loop {
            if let Some(answer) = pending.receive().unwrap() {
                break answer;
            }
            assert!(start.elapsed() < HANG, "no answer");
            step = step.wrapping_mul(1_103_515_245).wrapping_add(12_345);
            // Counts and offsets stand in front.
            let place = (step >> 8) % if round.is_multiple_of(2) { 96 } else { bytes.len() };
            // SAFETY: `place` lies within the payload, whose memory `pending` keeps for this process alone
            // to write; the daemon reads it meanwhile, which is what is tested.
            unsafe { sent.add(place).write_volatile((step >> 16) as u8) };
        };
        answers[usize::from(error_of(&answer).is_some())] += 1;
    }
    assert_eq!(answers.iter().sum::<usize>(), 300);
    let client = daemon.connect();
    let handle = client.upload(&boxes.assembly()).unwrap();
    assert_eq!(plan(&client, handle, &PlanOptions::default()).1.status, PlanStatus::Complete);
}
