//! Long plans through shared memory: the real daemon with a scripted planner, in this process.

mod common;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{Boxes, HANG, connect, next_event};
use sbdp::config::Config;
use sbdp::daemon::Planning;
use sbdp::geometry::{Revision, SourceAssembly};
use sbdp::plan::{Base, FreeGroup, MotionKind, Plan, PlanStats, PlanStatus, PlanStep, StepEnd};
use sbdp::search::{PlanRequest, PlanSink, Progress, Stage, Termination, Tried};
use sbdp::service::{Admission, AssemblyId, ServiceError};
use sbdp_client as client;
use sbdp_client::{Client, ErrorCode, Event, PlanOptions};
use sbdp_ipc::endpoint::{Endpoint, default_prefix};
use sbdp_ipc::layout::shared_memory_files;

/// Yields as many steps as `max_simulations` says, each with as many waypoints as `threads`.
struct Scripted;

fn waypoint(step: usize, number: usize) -> [f64; 7] {
    [step as f64, number as f64, 0.0, 1.0, 0.0, 0.0, 0.0]
}

/// One, two or three parts.
fn moved(step: usize) -> Vec<usize> {
    (step..=step + step % 3).collect()
}

impl Planning for Scripted {
    fn admit(&self, source: &SourceAssembly, _: &Termination) -> Result<Admission, ServiceError> {
        let id = AssemblyId(sbdp::geometry::content_hash(source));
        Ok(Admission { id, known: false, warnings: vec![] })
    }

    fn revise(&self, base: AssemblyId, _: &Revision, _: &Termination) -> Result<Admission, ServiceError> {
        Ok(Admission { id: base, known: true, warnings: vec![] })
    }

    fn knows(&self, _: AssemblyId) -> bool {
        true
    }

    fn plan(
        &self,
        _: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError> {
        let count = request.max_simulations.unwrap_or(0) as usize;
        assert_ne!(count, 666, "scripted panic");
        let mut steps = Vec::new();
        let mut status = PlanStatus::Complete;
        for part in 0..count {
            if termination.check().is_err() {
                status = PlanStatus::Cancelled;
                break;
            }
            let tried = Some(Tried { part: part + 7, turns: part % 2 == 1 });
            let progress =
                Progress { stage: Stage::Search, done: part as u32, total: 0, simulations: 0, tried };
            sink.progress(progress);
            let step = PlanStep {
                parts: moved(part),
                of: part.checked_sub(1),
                ends: if part % 2 == 1 { StepEnd::Aside } else { StepEnd::Out },
                motion: MotionKind::Rotation,
                path: (0..request.threads).map(|i| waypoint(part, i)).collect(),
                verified_depth: 0.5,
                requires: vec![part],
                wave: part,
                direction: Some([0.0, 0.6, -0.8]),
            };
            sink.step(&step);
            steps.push(step);
        }
        Ok(Plan {
            kind: sbdp::plan::PlanKind::default(),
            status,
            reason: Some("scripted".into()),
            planner: "sbdp-star".into(),
            engine: "sliding".into(),
            units: None,
            parts: (0..count + 2).map(|i| format!("part {i}")).collect(),
            removed: vec![],
            poses: vec![],
            targets: None,
            fixed: vec![],
            keep: vec![],
            base: Base::default(),
            steps,
            remaining: vec![],
            kept_together: vec![moved(1), moved(0)],
            free_together: vec![FreeGroup { parts: moved(1), direction: [0.0, 0.0, 1.0] }],
            blocked: vec![],
            overlaps: vec![],
            warnings: vec![],
            stats: PlanStats::default(),
        })
    }
}

/// A daemon in this process; it lives until the process ends, its files until the drop.
struct InProcess {
    folder: tempfile::TempDir,
}

impl InProcess {
    fn start(config: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut config: Config = toml::from_str(config).unwrap();
        let runtime_dir = folder.path().join("run");
        config.endpoint.runtime_dir = Some(runtime_dir.clone());
        std::thread::spawn(move || sbdp::daemon::run(&config, Arc::new(Scripted)).unwrap());
        let start = Instant::now();
        while Endpoint::find(&runtime_dir).is_err() {
            assert!(start.elapsed() < HANG, "the daemon does not become ready");
            std::thread::sleep(Duration::from_millis(5));
        }
        Self { folder }
    }

    fn runtime_dir(&self) -> PathBuf {
        self.folder.path().join("run")
    }
}

impl Drop for InProcess {
    fn drop(&mut self) {
        for path in shared_memory_files(&default_prefix(&self.runtime_dir())).unwrap_or_default() {
            let _ = std::fs::remove_file(path);
        }
    }
}

fn options(steps: u64, waypoints: u32) -> PlanOptions {
    PlanOptions { max_simulations: Some(steps), threads: waypoints, ..PlanOptions::default() }
}

/// Reads a whole plan, pausing once before anything is read; the number of steps.
fn read(client: &Client, options: &PlanOptions, pause: Duration) -> usize {
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let mut stream = client.plan(handle, options).unwrap();
    std::thread::sleep(pause);
    let mut steps = 0_usize;
    loop {
        match next_event(&mut stream).unwrap() {
            Some(Event::Step(step)) => {
                let step = step.view();
                assert_eq!(
                    (step.number as usize, step.of),
                    (steps, steps.checked_sub(1).map(|of| of as u32))
                );
                assert!(step.parts.iter().map(|p| *p as usize).eq(moved(steps)));
                let aside = steps % 2 == 1;
                assert_eq!(step.ends, if aside { client::StepEnd::Aside } else { client::StepEnd::Out });
                assert_eq!(step.path.len(), options.threads as usize);
                assert!(step.path.iter().enumerate().all(|(i, w)| *w == waypoint(steps, i)));
                assert_eq!(
                    (step.rotates, step.verified_depth, step.requires),
                    (true, 0.5, &[steps as u32][..])
                );
                assert_eq!((step.wave, step.direction), (steps as u32, Some([0.0, 0.6, -0.8])));
                steps += 1;
            }
            Some(Event::Progress(progress)) => {
                let tried = client::Tried { part: progress.done + 7, turns: progress.done % 2 == 1 };
                assert_eq!(progress.tried, Some(tried));
            }
            Some(Event::Trace(_)) => {}
            Some(Event::Restarted) => panic!("nothing was restarted"),
            Some(Event::Done(summary)) => {
                assert_eq!((summary.steps as usize, summary.parts.len()), (steps, steps + 2));
                assert_eq!(summary.kept_together, [vec![1, 2], vec![0]]);
                let free = client::FreeGroup { parts: vec![1, 2], direction: [0.0, 0.0, 1.0] };
                assert_eq!(summary.free_together, [free]);
                assert_eq!(summary.reason.as_deref(), Some("scripted"));
                return steps;
            }
            None => panic!("a stream ends with `Done`"),
        }
    }
}

#[test]
fn thousands_of_steps_arrive_whole_and_in_order_however_late_they_are_read() {
    let daemon = InProcess::start("[requests]\noutbox_mb = 512\n");
    let client = connect(&daemon.runtime_dir());
    for pause in [Duration::ZERO, Duration::from_millis(300)] {
        assert_eq!(read(&client, &options(3000, 100), pause), 3000);
    }
}

#[test]
fn a_path_longer_than_a_chunk_arrives_whole() {
    let daemon = InProcess::start("");
    let client = connect(&daemon.runtime_dir());
    assert_eq!(read(&client, &options(3, 50_000), Duration::ZERO), 3);
}

#[test]
fn a_summary_longer_than_a_chunk_arrives_whole() {
    let daemon = InProcess::start("");
    let client = connect(&daemon.runtime_dir());
    assert_eq!(read(&client, &options(60_000, 1), Duration::ZERO), 60_000);
}

#[test]
fn steps_in_place_hold_their_chunk_and_two_chunks_are_the_most() {
    let daemon = InProcess::start("[requests]\noutbox_mb = 512\n");
    let client = connect(&daemon.runtime_dir());
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let mut stream = client.plan(handle, &options(600, 1000)).unwrap().in_place();
    let (mut held, mut seen, mut refusals) = (Vec::new(), 0, 0);
    loop {
        match next_event(&mut stream) {
            Ok(Some(Event::Step(step))) => {
                assert!(step.is_in_place());
                assert_eq!(step.view().path.len(), 1000);
                assert_eq!(step.view().path[999], waypoint(seen, 999));
                seen += 1;
                held.push(step);
            }
            Err(client::ClientError::ViewsHeld) => {
                // Four of these paths are in a chunk; what was there at first came alone.
                assert!(held.len() >= 2 && held.len() <= 8, "{}", held.len());
                let first = held[0].view().number as usize;
                assert!(held.iter().enumerate().all(|(i, s)| s.view().path[7] == waypoint(first + i, 7)));
                held.clear();
                refusals += 1;
            }
            Ok(Some(Event::Done(summary))) => {
                assert_eq!(summary.steps, 600);
                break;
            }
            Ok(event) => assert!(event.is_some()),
            Err(error) => panic!("{error}"),
        }
    }
    assert_eq!(seen, 600);
    assert!(refusals >= 600 / 8, "{refusals}");
}

#[test]
fn a_client_that_does_not_read_loses_its_stream_and_the_next_one_is_served() {
    let daemon = InProcess::start("[requests]\noutbox_mb = 1\n");
    let client = connect(&daemon.runtime_dir());
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let mut stream = client.plan(handle, &options(100_000, 1000)).unwrap();
    let observer = connect(&daemon.runtime_dir());
    while observer.status().unwrap().numbers.failed == 0 {
        std::thread::sleep(Duration::from_millis(2));
    }
    let error = loop {
        match next_event(&mut stream) {
            Ok(Some(Event::Done(_)) | None) => panic!("the whole plan cannot have fitted"),
            Ok(Some(_)) => {}
            Err(error) => break error,
        }
    };
    assert_eq!(error.code(), Some(ErrorCode::SlowReader), "{error}");
    drop(stream);
    assert_eq!(read(&client, &options(2, 2), Duration::ZERO), 2);
}

#[test]
fn a_planner_that_panics_fails_its_request_only() {
    let daemon = InProcess::start("");
    let client = connect(&daemon.runtime_dir());
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let mut stream = client.plan(handle, &options(666, 1)).unwrap();
    let error = next_event(&mut stream).unwrap_err();
    assert_eq!(error.code(), Some(ErrorCode::Failed), "{error}");
    drop(stream);
    assert_eq!(read(&client, &options(2, 2), Duration::ZERO), 2);
}

#[test]
fn more_clients_than_there_is_room_for_are_told_so() {
    let daemon = InProcess::start("");
    let mut clients = Vec::new();
    let refused = loop {
        let options = sbdp_client::ConnectOptions {
            runtime_dir: Some(daemon.runtime_dir()),
            ..sbdp_client::ConnectOptions::default()
        };
        match Client::connect_with(options) {
            Ok(client) => clients.push(client),
            Err(error) => break error,
        }
    };
    assert_eq!(clients.len(), sbdp_ipc::layout::MAX_CLIENTS);
    assert!(matches!(refused, sbdp_client::ClientError::TooManyClients), "{refused}");
    clients.pop();
    assert_eq!(read(&connect(&daemon.runtime_dir()), &options(2, 2), Duration::ZERO), 2);
}
