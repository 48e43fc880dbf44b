//! What is planned ahead while nothing is asked, by the real daemon: whoever finds a part stuck or gone in the
//! middle of a plan is answered from memory, and as if nothing had been speculated.

mod common;

use std::time::{Duration, Instant};

use common::{Boxes, Daemon, HANG, plan};
use sbdp_client::{Client, Handle, PlanOptions, PlanStatus};

/// Questions that wait, with the one at work, and those that were planned ahead.
fn ahead(client: &Client) -> (u64, u64) {
    let metrics: serde_json::Value = serde_json::from_str(&client.metrics().unwrap()).unwrap();
    let of = |what: &str| metrics["ahead"][what].as_u64().unwrap();
    (of("questions") + of("assemblies"), of("speculated"))
}

fn left_alone(client: &Client) -> u64 {
    let began = Instant::now();
    loop {
        let (waiting, speculated) = ahead(client);
        if waiting == 0 {
            return speculated;
        }
        assert!(began.elapsed() < HANG, "{waiting} questions wait");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// All that is speculated of a plan that takes out some parts.
fn contingencies(parts: &[u32]) -> Vec<PlanOptions> {
    let question = |fixed: &[u32], removed: &[u32]| PlanOptions {
        fixed: fixed.to_vec(),
        removed: removed.to_vec(),
        ..PlanOptions::default()
    };
    let of = |(k, part): (usize, &u32)| {
        let in_turn = (k > 0).then(|| question(&[*part], &parts[..k]));
        in_turn.into_iter().chain([question(&[*part], &[]), question(&[], &[*part])])
    };
    parts.iter().enumerate().flat_map(of).collect()
}

fn upload(daemon: &Daemon) -> (Client, Handle) {
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(2).assembly()).unwrap();
    (client, handle)
}

#[test]
fn what_may_be_asked_after_a_plan_is_answered_from_memory_and_no_otherwise() {
    let (speculating, other) = (Daemon::start(), Daemon::start_with("[cache]\nspeculation_s = 0\n"));
    let ((client, handle), (cold, same)) = (upload(&speculating), upload(&other));
    let (parts, _) = plan(&client, handle, &PlanOptions::default());
    assert_eq!(plan(&cold, same, &PlanOptions::default()).0, parts);
    assert_eq!(left_alone(&client), contingencies(&parts).len() as u64);
    assert_eq!(left_alone(&cold), 0);
    for options in contingencies(&parts) {
        let (speculated, found) = plan(&client, handle, &options);
        let (expected, made) = plan(&cold, same, &options);
        assert_eq!((speculated, found.status), (expected, made.status), "{options:?}");
        assert_eq!((found.stats.plan_hit, made.stats.plan_hit), (1, 0), "{options:?}");
    }
}

#[test]
fn what_was_speculated_outlives_the_daemon_and_leads_on() {
    let mut daemon = Daemon::start();
    let (client, handle) = upload(&daemon);
    let (parts, _) = plan(&client, handle, &PlanOptions::default());
    left_alone(&client);
    drop(client);
    daemon.signal(rustix::process::Signal::TERM);
    daemon.wait();
    daemon.kill_and_restart();
    let client = daemon.connect();
    let gone = PlanOptions { removed: vec![parts[0]], ..PlanOptions::default() };
    let (left, found) = plan(&client, handle, &gone);
    assert_eq!((found.status, found.stats.plan_hit), (PlanStatus::Complete, 1));
    // Then the next part may be gone, too.
    assert_eq!(left_alone(&client), contingencies(&left).len() as u64);
    let both = PlanOptions { removed: vec![parts[0], left[0]], ..PlanOptions::default() };
    assert_eq!(plan(&client, handle, &both).1.stats.plan_hit, 1);
}
