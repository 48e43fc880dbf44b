//! What a full daemon answers, and what clients make of it.

mod common;

use std::time::Duration;

use common::{Boxes, Daemon, HANG, next_event, options, plan};
use sbdp_client::{
    Client, ClientError, ConnectOptions, ErrorCode, Event, PlanOptions, PlanStatus, PlanStream,
};

/// One plan is made, one waits.
const NARROW: &str = "[workers]\ncount = 1\n[requests]\nqueue = 1\n";

fn unremembered() -> PlanOptions {
    PlanOptions { no_cache: true, ..PlanOptions::default() }
}

/// The first error of a stream, whatever progress comes before it.
fn refusal(stream: &mut PlanStream) -> ClientError {
    loop {
        match next_event(stream) {
            Ok(Some(Event::Progress(_))) => {}
            Ok(event) => panic!("not refused but {event:?}"),
            Err(error) => return error,
        }
    }
}

#[test]
fn a_busy_daemon_says_when_to_come_again_and_a_patient_client_gets_its_plan() {
    let daemon = Daemon::start_with(NARROW);
    let [working, waiting, hasty] = [(); 3].map(|()| daemon.connect());
    let lattice = working.upload(&Boxes::lattice(5).assembly()).unwrap();
    let two = working.upload(&Boxes::two().assembly()).unwrap();
    let long = working.plan(lattice, &unremembered()).unwrap();
    while working.status().unwrap().numbers.running == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let queued = waiting.plan(lattice, &unremembered()).unwrap();
    while working.status().unwrap().numbers.queued == 0 {
        std::thread::sleep(Duration::from_millis(1));
    }
    let error = refusal(&mut hasty.plan(two, &unremembered()).unwrap());
    assert_eq!(error.code(), Some(ErrorCode::Busy), "{error}");
    assert!(error.retry_after().is_some_and(|hint| !hint.is_zero()));
    let patient = ConnectOptions { busy_wait: HANG, ..options(&daemon.runtime_dir()) };
    let patient = Client::connect_with(patient).unwrap();
    let stream = patient.plan(two, &unremembered()).unwrap();
    drop((long, queued));
    let summary = stream.plan_to_end().unwrap().summary;
    assert_eq!(summary.status, PlanStatus::Complete);
}

#[test]
fn a_batch_request_is_planned_like_any_other_and_answers_the_same_question() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let batch = PlanOptions { batch: true, ..PlanOptions::default() };
    let (parts, summary) = plan(&client, handle, &batch);
    assert_eq!(summary.status, PlanStatus::Complete);
    let (again, summary) = plan(&client, handle, &PlanOptions::default());
    assert_eq!((again, summary.stats.plan_hit), (parts, 1));
}
