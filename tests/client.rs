//! What programs do with a client: share it between threads, keep steps, poll, replan, give up waiting.

mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::Poll;
use std::time::{Duration, Instant};

use common::{Boxes, Daemon, HANG, next_event, options};
use rustix::process::Signal;
use sbdp_client::{
    Client, ClientError, ConnectOptions, Event, PlanOptions, PlanStatus, Staging, Step, StepEnd,
};

fn unremembered() -> PlanOptions {
    PlanOptions { no_cache: true, ..PlanOptions::default() }
}

fn numbers(steps: &[Step]) -> Vec<u32> {
    steps.iter().map(|step| step.view().number).collect()
}

#[test]
fn threads_ask_through_one_client_while_a_plan_comes_in() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let boxes = Arc::new(Boxes::lattice(4));
    let handle = client.upload(&boxes.assembly()).unwrap();
    let alone = client.plan(handle, &unremembered()).unwrap().plan_to_end().unwrap();
    let stream = client.plan(handle, &unremembered()).unwrap();
    let beside = std::thread::scope(|scope| {
        let planning = scope.spawn(|| stream.plan_to_end().unwrap());
        let asking = [(); 3].map(|()| {
            scope.spawn(|| {
                for _ in 0..200 {
                    assert!(client.knows(handle).unwrap());
                    assert_eq!(client.status().unwrap().numbers.pid, daemon.pid());
                }
            })
        });
        asking.into_iter().for_each(|thread| thread.join().unwrap());
        planning.join().unwrap()
    });
    assert_eq!(beside.steps, alone.steps);
    assert_eq!(client.restarts(), 0);
}

#[test]
fn a_plan_outlives_stream_client_and_daemon_and_has_names() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let boxes = Arc::new(Boxes::lattice(2));
    let mut stream = client.plan(Arc::clone(&boxes), &PlanOptions::default()).unwrap().in_place();
    let first = loop {
        if let Some(Event::Step(step)) = next_event(&mut stream).unwrap() {
            break step;
        }
    };
    assert!(first.is_in_place());
    drop(stream);
    let plan = client.plan(boxes, &PlanOptions::default()).unwrap().plan_to_end().unwrap();
    drop((client, daemon));
    assert!(!plan.steps[0].is_in_place());
    assert_eq!((plan.summary.status, plan.steps.len()), (PlanStatus::Complete, 7));
    assert_eq!(plan.steps[0], first);
    let view = first.view();
    assert_eq!(view.path[0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    let name = view.parts[0].to_string();
    assert_eq!(plan.names(&first).collect::<Vec<_>>(), [name.as_str()]);
    let of: Vec<&Step> = plan.steps_of(&name).unwrap().collect();
    assert_eq!(of, [&first]);
    let unknown = plan.steps_of("8").err().unwrap();
    assert!(unknown.to_string().contains("no part `8`"), "{unknown}");
}

#[test]
fn polling_says_that_nothing_is_there_yet_and_misses_nothing() {
    let mut daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(4).assembly()).unwrap();
    let whole = client.plan(handle, &unremembered()).unwrap().plan_to_end().unwrap();
    let mut stream = client.plan(handle, &unremembered()).unwrap();
    let (mut steps, mut waited) = (Vec::new(), 0);
    let start = Instant::now();
    loop {
        assert!(start.elapsed() < HANG);
        match stream.poll_event(Duration::ZERO).unwrap() {
            Poll::Pending => waited += 1,
            Poll::Ready(Some(Event::Step(step))) => steps.push(step),
            Poll::Ready(Some(Event::Done(_))) => break,
            Poll::Ready(event) => assert!(event.is_some()),
        }
    }
    assert!(waited > 0);
    assert_eq!(steps, whole.steps);
    assert!(matches!(stream.poll_event(Duration::ZERO), Ok(Poll::Ready(None))));
    // A daemon that is gone is found out by polls alone, too.
    let chain = client.upload(&Boxes::lattice(6).assembly()).unwrap();
    let mut stream = client.plan(chain, &unremembered()).unwrap();
    daemon.signal(Signal::KILL);
    daemon.wait();
    let error = loop {
        assert!(start.elapsed() < HANG);
        match stream.poll_event(Duration::ZERO) {
            Ok(Poll::Ready(Some(Event::Done(_)))) => return, // planned faster than killed
            Ok(_) => {}
            Err(error) => break error,
        }
    };
    assert!(error.is_no_daemon(), "{error}");
}

#[test]
fn a_poll_does_not_wait_for_the_next_daemon() {
    let mut daemon = Daemon::start();
    let connect = ConnectOptions { reconnect: HANG, ..options(&daemon.runtime_dir()) };
    let client = Client::connect_with(connect).unwrap();
    let boxes = Arc::new(Boxes::lattice(5));
    let mut stream = client.plan(boxes, &unremembered()).unwrap();
    let mut pending_without_daemon = false;
    daemon.kill_and_restart_after(|_| {
        // What came before the end is still there; after it there is nothing yet, and no error.
        let start = Instant::now();
        while !pending_without_daemon {
            assert!(start.elapsed() < HANG);
            pending_without_daemon = stream.poll_event(Duration::ZERO).unwrap().is_pending();
        }
    });
    let (mut steps, mut restarts) = (Vec::new(), 0);
    loop {
        match next_event(&mut stream).unwrap() {
            Some(Event::Step(step)) => steps.push(step),
            Some(Event::Restarted) => {
                steps.clear();
                restarts += 1;
            }
            Some(Event::Done(summary)) => {
                assert_eq!(summary.status, PlanStatus::Complete);
                break;
            }
            event => assert!(event.is_some()),
        }
    }
    assert_eq!((restarts, client.restarts()), (1, 1));
    assert_eq!(numbers(&steps), (0..124).collect::<Vec<_>>());
}

#[test]
fn a_session_asks_for_the_plan_of_what_is_left() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let boxes = Arc::new(Boxes::lattice(2));
    let refused = client
        .session(Arc::clone(&boxes), PlanOptions { assembly: Some(Staging::None), ..PlanOptions::default() });
    assert!(matches!(refused, Err(ClientError::NoAssemblySession)));
    let mut session = client.session(Arc::clone(&boxes), PlanOptions::default()).unwrap();
    let asked = |options: PlanOptions| {
        client.plan(Arc::clone(&boxes), &options).unwrap().plan_to_end().unwrap().steps
    };
    let whole = session.replan().unwrap().plan_to_end().unwrap();
    assert_eq!(whole.steps, asked(PlanOptions::default()));

    // The first step is done; the part of the second one stays, and one of the others was pushed.
    let [first, second, third] = [0, 1, 2].map(|n| whole.steps[n].view());
    assert_eq!(first.ends, StepEnd::Out);
    let (out, stuck, pushed) = (first.parts[0], second.parts[0], third.parts[0]);
    assert_eq!(session.part(&out.to_string()).unwrap(), out);
    assert!(matches!(session.part("none"), Err(ClientError::NoSuchPart { .. })));
    let way = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    session.performed(&whole.steps[0]);
    session.stuck(stuck);
    session.moved(pushed, way);
    let rest = session.replan().unwrap().plan_to_end().unwrap();
    let (removed, fixed, moved) = (vec![out], vec![stuck], vec![(pushed, way)]);
    assert_eq!(
        rest.steps,
        asked(PlanOptions {
            removed: removed.clone(),
            fixed,
            moved: moved.clone(),
            ..PlanOptions::default()
        })
    );
    assert_eq!(rest.summary.removed, [out]);
    assert!(rest.steps.iter().all(|step| !step.view().parts.contains(&stuck)));

    session.freed(stuck);
    let rest = session.replan().unwrap().plan_to_end().unwrap();
    assert_eq!(rest.steps, asked(PlanOptions { removed, moved, ..PlanOptions::default() }));
    session.executed(&(0..8).collect::<Vec<_>>());
    let nothing = session.replan().unwrap().plan_to_end().unwrap();
    assert_eq!((nothing.summary.status, nothing.steps.len()), (PlanStatus::Complete, 0));
}

#[test]
fn what_is_to_be_kept_stays_in_plans_of_the_daemon() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(2).assembly()).unwrap();
    let asked = |options: &PlanOptions| client.plan(handle, options).and_then(|stream| stream.plan_to_end());
    // Remembered plans are those of the same list alone.
    for keep in [vec![], vec![7], vec![0, 7], vec![], vec![7]] {
        let plan = asked(&PlanOptions { keep: keep.clone(), ..PlanOptions::default() }).unwrap();
        assert_eq!((plan.summary.status, &plan.summary.keep), (PlanStatus::Complete, &keep));
        assert!(
            keep.iter().all(|part| plan.summary.remaining.contains(part)),
            "{:?}",
            plan.summary.remaining
        );
        let stay = keep.iter().chain(&plan.summary.base.parts).collect::<std::collections::BTreeSet<_>>();
        assert_eq!(plan.steps.len(), 8 - stay.len());
    }
    let refused = |options: PlanOptions, words: &str| {
        let error = asked(&options).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    let keep = vec![3];
    refused(
        PlanOptions { keep: keep.clone(), fixed: vec![3], ..PlanOptions::default() },
        "in `fixed` and in `keep`",
    );
    refused(
        PlanOptions { keep, targets: Some(vec![3]), ..PlanOptions::default() },
        "is a target and in `keep`",
    );
    refused(PlanOptions { keep: vec![8], ..PlanOptions::default() }, "part 8 in `keep`");
    // A session forgets what is out.
    let mut session =
        client.session(handle, PlanOptions { keep: vec![0, 7], ..PlanOptions::default() }).unwrap();
    session.executed(&[7]);
    let rest = session.replan().unwrap().plan_to_end().unwrap();
    assert_eq!((rest.summary.status, rest.summary.keep), (PlanStatus::Complete, vec![0]));
}

#[test]
fn whoever_waits_for_a_daemon_that_hangs_can_give_up() {
    let mut daemon = Daemon::start();
    let wanted = Arc::new(AtomicBool::new(false));
    let options = ConnectOptions {
        interrupt: Some(Arc::clone(&wanted).into()),
        reconnect: HANG,
        timeout: HANG,
        upload_timeout: HANG,
        ..options(&daemon.runtime_dir())
    };
    let client = Client::connect_with(options).unwrap();
    let boxes = Boxes::lattice(3);
    let handle = client.upload(&boxes.assembly()).unwrap();
    let given_up = |what: &(dyn Fn() -> Result<(), ClientError> + Sync)| {
        wanted.store(false, Ordering::Relaxed);
        let error = std::thread::scope(|scope| {
            let waiting = scope.spawn(what);
            std::thread::sleep(Duration::from_millis(100));
            wanted.store(true, Ordering::Relaxed);
            waiting.join().unwrap().unwrap_err()
        });
        assert!(matches!(error, ClientError::Interrupted), "{error}");
    };
    daemon.signal(Signal::STOP);
    given_up(&|| client.knows(handle).map(drop));
    given_up(&|| client.upload(&Boxes::two().assembly()).map(drop));
    given_up(&|| client.status().map(drop));
    // Also while there is none, and another one is waited for.
    daemon.signal(Signal::KILL);
    // Until its last thread has ended, it takes requests, and a plan that was requested is no error.
    daemon.wait();
    given_up(&|| client.knows(handle).map(drop));
    given_up(&|| client.plan(handle, &PlanOptions::default()).map(drop));
}
