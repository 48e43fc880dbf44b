//! Deadlines, cancelling, slow readers, and daemons and gateways that end.

mod common;

use std::time::{Duration, Instant};

use common::{
    Caller, Daemon, Gateway, HANG, Lattice, assembly, code, end_of, next_event, request, status, to_end,
    upload, upload_source, wait_until,
};
use rustix::process::Signal;
use sbdp_gateway::proto::plan_event::Event;
use sbdp_gateway::proto::{self, CancelRequest, PlanEvent, PlanRequest, PlanStatus, StatusReply};
use tonic::{Code, Request, Streaming};

#[test]
fn acts_as_the_daemon() {
    common::act_as_the_daemon();
}

/// A plan that takes far longer than any of these tests wait: trees that grow for ever.
async fn long(caller: &mut Caller) -> PlanRequest {
    let handle = upload_source(caller, &assembly("bolted-bracket-20")).await;
    let planner = proto::Planner::Rrt.into();
    PlanRequest { planner, max_simulations: Some(u64::MAX), no_cache: true, ..request(&handle) }
}

/// The number of the next step.
async fn next_step(events: &mut Streaming<PlanEvent>) -> u32 {
    loop {
        match next_event(events).await.unwrap() {
            Some(Event::Step(step)) => return step.number,
            Some(Event::End(_)) | None => panic!("there is no step"),
            Some(_) => {}
        }
    }
}

/// Waits for a state of daemon and gateway; another caller asks, as they do not say it by themselves.
async fn wait_for(caller: &mut Caller, is_so: impl Fn(&StatusReply) -> bool) {
    let start = Instant::now();
    while !is_so(&status(caller).await) {
        assert!(start.elapsed() < HANG, "{:?}", status(caller).await);
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

/// Waits until nothing is under way.
async fn idle(caller: &mut Caller) {
    wait_for(caller, |now| (now.running, now.queued, now.plans) == (0, 0, 0)).await;
}

#[tokio::test]
async fn the_plan_so_far_comes_before_the_deadline_of_the_call() {
    let daemon = Daemon::start();
    // A wide margin: this is not about how fast this machine is.
    let gateway = Gateway::start_with(&daemon, "[limits]\nanswer_margin_ms = 3000\n");
    let mut caller = gateway.connect().await;
    let mut wanted = Request::new(long(&mut caller).await);
    wanted.set_timeout(Duration::from_secs(5));
    let events = to_end(caller.plan(wanted).await.unwrap().into_inner()).await.unwrap();
    assert_eq!(end_of(&events).status(), PlanStatus::Timeout);
    assert!(events.iter().any(|event| matches!(event, Event::Step(_))));
    idle(&mut caller).await;
}

#[tokio::test]
async fn a_request_has_a_timeout_of_its_own() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let wanted = PlanRequest { timeout_s: Some(0.5), ..long(&mut caller).await };
    let events = to_end(caller.plan(wanted.clone()).await.unwrap().into_inner()).await.unwrap();
    assert_eq!(end_of(&events).status(), PlanStatus::Timeout);
    let late = PlanRequest { timeout_s: Some(0.0), ..wanted };
    let expired = to_end(caller.plan(late).await.unwrap().into_inner()).await.unwrap_err();
    assert_eq!((expired.code(), code(&expired)), (Code::DeadlineExceeded, 4), "{expired}");
}

#[tokio::test]
async fn a_cancelled_plan_comes_to_its_end_with_the_steps_so_far() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let wanted = PlanRequest { cancel_key: "robot 7".to_owned(), document: true, ..long(&mut caller).await };
    let mut events = caller.plan(wanted.clone()).await.unwrap().into_inner();
    next_step(&mut events).await;
    let twice = caller.plan(wanted).await.unwrap_err();
    assert_eq!(twice.code(), Code::InvalidArgument);
    assert!(twice.message().contains("cancel_key"), "{twice}");
    let cancel = |key: &str| CancelRequest { cancel_key: key.to_owned() };
    let mut other = gateway.connect().await;
    assert!(!other.cancel(cancel("robot 8")).await.unwrap().into_inner().found);
    assert!(other.cancel(cancel("robot 7")).await.unwrap().into_inner().found);
    let rest = to_end(events).await.unwrap();
    assert_eq!(end_of(&rest).status(), PlanStatus::Cancelled);
    assert!(rest.iter().any(|event| matches!(event, Event::Document(_))));
    assert!(!other.cancel(cancel("robot 7")).await.unwrap().into_inner().found);
    idle(&mut other).await;
}

#[tokio::test]
async fn a_call_that_is_dropped_ends_in_the_daemon() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let (mut caller, mut other) = (gateway.connect().await, gateway.connect().await);
    let wanted = long(&mut caller).await;
    // The stream alone, and the whole connection.
    let mut events = caller.plan(wanted.clone()).await.unwrap().into_inner();
    next_step(&mut events).await;
    assert_eq!(status(&mut other).await.running, 1);
    drop(events);
    idle(&mut other).await;
    let mut events = caller.plan(wanted).await.unwrap().into_inner();
    next_step(&mut events).await;
    drop((events, caller));
    idle(&mut other).await;
    assert_eq!(status(&mut other).await.cancelled, 2);
}

#[tokio::test]
async fn a_caller_that_does_not_read_keeps_nobody_waiting() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let (mut slow, mut other) = (gateway.connect_narrowly().await, gateway.connect().await);
    let boxes = Lattice::new(5);
    let handle = upload(&mut slow, &boxes.assembly()).await;
    let wanted = PlanRequest { trace: true, ..request(&handle) };
    let unread = slow.plan(wanted.clone()).await.unwrap().into_inner();
    let alone = to_end(other.plan(wanted.clone()).await.unwrap().into_inner()).await.unwrap();
    assert_eq!(end_of(&alone).status(), PlanStatus::Complete);
    wait_for(&mut other, |now| (now.running, now.plans) == (0, 1)).await;
    // Nothing was lost meanwhile but progress.
    let late = to_end(unread).await.unwrap();
    let count = |events: &[Event], is: fn(&Event) -> bool| events.iter().filter(|event| is(event)).count();
    let is_step: fn(&Event) -> bool = |event| matches!(event, Event::Step(_));
    assert_eq!(count(&late, is_step), count(&alone, is_step));
    assert_eq!(end_of(&late).status(), PlanStatus::Complete);
}

#[tokio::test]
async fn more_plans_than_allowed_are_refused_for_now() {
    let daemon = Daemon::start();
    let gateway = Gateway::start_with(&daemon, "[limits]\nplans = 1\n");
    let mut caller = gateway.connect().await;
    let wanted = long(&mut caller).await;
    let events = caller.plan(wanted.clone()).await.unwrap().into_inner();
    let refused = caller.plan(wanted).await.unwrap_err();
    assert_eq!((refused.code(), code(&refused)), (Code::ResourceExhausted, 3), "{refused}");
    assert!(refused.metadata().get("sbdp-retry-ms").is_some());
    assert!(refused.message().contains("limits.plans"), "{refused}");
    drop(events);
    idle(&mut caller).await;
    let small = upload(&mut caller, &Lattice::new(2).assembly()).await;
    to_end(caller.plan(request(&small)).await.unwrap().into_inner()).await.unwrap();
}

#[tokio::test]
async fn a_daemon_that_was_killed_is_followed() {
    let mut daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let wanted = long(&mut caller).await;
    // So that the daemon has the assembly on disk: its next one knows the handle then.
    let short = PlanRequest { timeout_s: Some(0.5), no_cache: false, ..wanted.clone() };
    to_end(caller.plan(short).await.unwrap().into_inner()).await.unwrap();
    let wanted = PlanRequest { cancel_key: "k".to_owned(), document: true, ..wanted };
    let mut events = caller.plan(wanted).await.unwrap().into_inner();
    next_step(&mut events).await;
    daemon.kill();
    daemon.start_again();
    loop {
        match next_event(&mut events).await.unwrap() {
            Some(Event::Restarted(_)) => break,
            Some(Event::End(_)) | None => panic!("the end of a plan whose daemon is gone"),
            Some(_) => {}
        }
    }
    assert_eq!(next_step(&mut events).await, 0, "all steps come again");
    assert_eq!(status(&mut caller).await.restarts, 1);
    caller.cancel(CancelRequest { cancel_key: "k".to_owned() }).await.unwrap();
    let rest = to_end(events).await.unwrap();
    assert_eq!(end_of(&rest).status(), PlanStatus::Cancelled);
}

#[tokio::test]
async fn without_a_daemon_callers_learn_what_to_do() {
    let mut daemon = Daemon::none();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let health = gateway.health().await;
    assert!(!health.serves("sbdp.v1.PlannerService", false).await);
    assert!(health.serves("", true).await);
    let refused = to_end(caller.plan(request(&[7; 32])).await.unwrap().into_inner()).await.unwrap_err();
    assert_eq!((refused.code(), code(&refused)), (Code::Unavailable, 100), "{refused}");
    assert!(refused.message().contains("start one with `sbdpd`"), "{refused}");
    daemon.start_again();
    assert!(health.serves("sbdp.v1.PlannerService", true).await);
    upload(&mut caller, &Lattice::new(2).assembly()).await;
}

#[tokio::test]
async fn plans_under_way_get_their_end_when_the_gateway_ends() {
    let daemon = Daemon::start();
    let mut gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let wanted = long(&mut caller).await;
    for signal in [Signal::TERM, Signal::INT] {
        let mut caller = gateway.connect().await;
        let mut events = caller.plan(wanted.clone()).await.unwrap().into_inner();
        next_step(&mut events).await;
        gateway.process.signal(signal);
        let rest = to_end(events).await.unwrap();
        assert_eq!(end_of(&rest).status(), PlanStatus::Cancelled);
        assert!(gateway.process.wait().success());
        gateway = Gateway::start(&daemon);
    }
    let client = daemon.connect();
    wait_until("the end of all requests", || client.status().unwrap().numbers.running == 0);
}
