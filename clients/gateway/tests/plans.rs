//! Plans through the gateway are those of the Rust client.

mod common;

use std::sync::Arc;

use common::{Daemon, Gateway, Lattice, assembly, end_of, request, status, to_end, upload, upload_source};
use sbdp_client::{Plan, PlanOptions, Staging};
use sbdp_gateway::proto::plan_event::Event;
use sbdp_gateway::proto::{self, HaveRequest, PlanRequest, VersionRequest};

const ASSEMBLIES: [&str; 9] = [
    "bolt-washer-plate",
    "bolted-bracket-20",
    "covered-pin",
    "l-slot",
    "linked-rings",
    "peg-stl",
    "pegs.glb",
    "pin-bolt-cover",
    "pinned-block",
];

#[test]
fn acts_as_the_daemon() {
    common::act_as_the_daemon();
}

fn document(plan: &Plan) -> String {
    plan.to_json().unwrap()
}

fn joined(events: &[Event]) -> String {
    let piece = |event: &Event| match event {
        Event::Document(piece) => Some(piece.clone()),
        _ => None,
    };
    events.iter().filter_map(piece).collect()
}

#[tokio::test]
async fn documents_are_those_of_the_rust_client_byte_for_byte() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let (mut caller, client) = (gateway.connect().await, daemon.connect());
    for name in ASSEMBLIES {
        let assembly = Arc::new(assembly(name));
        let handle = upload_source(&mut caller, &assembly).await;
        for staging in [None, Some(Staging::Beside(Vec::new()))] {
            let keep = if name == "pin-bolt-cover" { vec![1, 2] } else { Vec::new() };
            let options =
                PlanOptions { assembly: staging.clone(), keep: keep.clone(), ..PlanOptions::default() };
            let local = |options: &PlanOptions| {
                client.plan(Arc::clone(&assembly), options).unwrap().plan_to_end().unwrap()
            };
            // The first is planned, the others come from memory, with the same times.
            local(&options);
            let local = local(&options);
            let staging =
                if staging.is_some() { proto::Staging::Beside } else { proto::Staging::Disassembly };
            let wanted = PlanRequest {
                document: true,
                staging: staging.into(),
                keep: keep.clone(),
                ..request(&handle)
            };
            let events = to_end(caller.plan(wanted).await.unwrap().into_inner()).await.unwrap();
            assert_eq!(joined(&events), document(&local), "{name}");

            let steps: Vec<&proto::Step> = events
                .iter()
                .filter_map(|event| if let Event::Step(step) = event { Some(step) } else { None })
                .collect();
            assert_eq!(steps.len(), local.steps.len(), "{name}");
            for (step, local) in steps.into_iter().zip(&local.steps) {
                let view = local.view();
                assert_eq!(step.number, view.number);
                assert_eq!((&step.parts[..], &step.path[..]), (view.parts, view.path.as_flattened()));
                assert_eq!((&step.requires[..], step.wave, step.of), (view.requires, view.wave, view.of));
                assert_eq!((step.rotates, step.verified_depth), (view.rotates, view.verified_depth));
                assert_eq!(step.direction.map(|d| [d.x, d.y, d.z]), view.direction);
                assert_eq!(step.ends() as u32, view.ends as u32 + 1);
            }
            let end = end_of(&events);
            assert_eq!(end.status() as u32, local.summary.status as u32 + 1, "{name}");
            assert_eq!((&end.parts, &end.remaining), (&local.summary.parts, &local.summary.remaining));
            assert_eq!((end.assembly, end.base.clone()), (local.summary.assembly, local.summary.base.parts));
            assert_eq!(end.warnings.len(), local.summary.warnings.len());
            assert_eq!((&end.keep, &local.summary.keep), (&keep, &keep));
        }
    }
}

#[tokio::test]
async fn known_content_is_not_sent_again() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let boxes = Lattice::new(2);
    let handle = sbdp_client::content_hash(&boxes.assembly()).0.to_vec();
    let have = |handle: &[u8]| HaveRequest { handle: handle.to_vec().into() };
    assert!(!caller.have(have(&handle)).await.unwrap().into_inner().known);
    for _ in 0..3 {
        assert_eq!(upload(&mut caller, &boxes.assembly()).await, handle);
        assert!(caller.have(have(&handle)).await.unwrap().into_inner().known);
    }
    let status = status(&mut caller).await;
    assert_eq!((status.uploads, status.restarts, status.plans), (1, 0, 0));
    let version = caller.version(VersionRequest {}).await.unwrap().into_inner();
    assert_eq!((version.version, version.protocol), (status.version, sbdp_ipc::PROTOCOL));
}

#[tokio::test]
async fn progress_and_steps_come_before_the_end_and_options_arrive() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let boxes = Lattice::new(4);
    let handle = upload(&mut caller, &boxes.assembly()).await;
    let wanted = PlanRequest {
        no_cache: true,
        trace: true,
        fixed: vec![0],
        removed: vec![63],
        targets: Some(proto::PartList { parts: vec![62] }),
        up: Some(proto::Vector { x: 0.0, y: 0.0, z: 2.0 }),
        planner: proto::Planner::Sbdp.into(),
        actions: proto::Actions::Paper.into(),
        ..request(&handle)
    };
    let events = to_end(caller.plan(wanted).await.unwrap().into_inner()).await.unwrap();
    let first = |is: fn(&Event) -> bool| events.iter().position(is).expect("such an event");
    let end = first(|event| matches!(event, Event::End(_)));
    assert_eq!(end, events.len() - 1);
    assert!(first(|event| matches!(event, Event::Progress(_))) < end);
    assert!(first(|event| matches!(event, Event::Step(_))) < end);
    assert!(first(|event| matches!(event, Event::Trace(_))) < end);
    assert!(!events.iter().any(|event| matches!(event, Event::Document(_))), "it was not wanted");
    let end = end_of(&events);
    assert_eq!((end.status(), end.planner.as_str()), (proto::PlanStatus::Complete, "sbdp"));
    assert_eq!((&end.fixed, &end.removed), (&vec![0], &vec![63]));
    assert_eq!(end.targets.as_ref().unwrap().parts, [62]);
    assert_eq!(end.units.as_deref(), Some("mm"));
}
