//! The daemon's life, driven from outside: start, clients that come, go and die, and its end.

mod common;

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Command};

use common::{Boxes, Daemon, act_as_client, next_event, plan, wait};
use rustix::process::Signal;
use sbdp_client::{Client, ClientError, ConnectOptions, ErrorCode, Event, PlanOptions, PlanStatus};

/// Not a test of its own: other tests run this binary as a client process.
#[test]
fn acts_as_a_client_process() {
    act_as_client();
}

fn output(mut child: Child) -> String {
    let mut text = String::new();
    child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    assert!(wait(&mut child).success(), "{text}");
    text
}

/// Returns when a client process has uploaded its assembly and is about to ask for a plan.
fn wait_for_upload(child: &mut Child) -> BufReader<std::process::ChildStdout> {
    let mut reader = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.contains("uploaded") {
        line.clear();
        assert_ne!(reader.read_line(&mut line).unwrap(), 0, "the client process ended early");
    }
    reader
}

/// Returns when the daemon has begun to plan, or has planned already.
fn wait_for_request(client: &Client) {
    while client.status().unwrap().numbers.requests == 0 {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

#[test]
fn a_client_process_gets_its_plan() {
    let daemon = Daemon::start();
    assert!(output(daemon.client_process("two")).contains("complete"));
}

#[test]
fn two_clients_at_once_each_get_their_plan() {
    let daemon = Daemon::start();
    let clients = [daemon.client_process("two"), daemon.client_process("small-lattice")];
    let [two, lattice] = clients.map(output);
    assert!(two.contains("complete"), "{two}");
    assert!(lattice.contains("complete"), "{lattice}");
}

#[test]
fn a_client_killed_while_planning_leaves_the_daemon_serving() {
    let daemon = Daemon::start_with("[workers]\ncount = 1\n");
    let observer = daemon.connect();
    let mut client = daemon.client_process("lattice");
    let _reader = wait_for_upload(&mut client);
    wait_for_request(&observer);
    client.kill().unwrap();
    client.wait().unwrap();
    // With one worker this is planned only after the dead client's request was given up.
    let handle = observer.upload(&Boxes::two().assembly()).unwrap();
    let (_, summary) = plan(&observer, handle, &PlanOptions::default());
    assert_eq!(summary.status, PlanStatus::Complete);
}

#[test]
fn sigterm_while_planning_is_answered_and_the_daemon_leaves_with_success() {
    let mut daemon = Daemon::start_with("[times]\ngrace_s = 0.0\n");
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(5).assembly()).unwrap();
    let mut stream = client.plan(handle, &PlanOptions::default()).unwrap();
    let mut signalled = false;
    let summary = loop {
        match next_event(&mut stream).unwrap() {
            Some(Event::Done(summary)) => break summary,
            Some(_) if !signalled => {
                daemon.signal(Signal::TERM);
                signalled = true;
            }
            Some(_) => {}
            None => panic!("the stream ended without an answer"),
        }
    };
    assert!(signalled);
    // A planner fast enough may be done before the signal is seen.
    assert!(matches!(summary.status, PlanStatus::Cancelled | PlanStatus::Complete));
    assert_eq!(daemon.wait().code(), Some(0));
    assert!(!daemon.runtime_dir().join("daemon.json").exists());
    drop(stream);
    assert!(client.status().unwrap_err().is_no_daemon());
}

#[test]
fn an_idle_daemon_leaves_at_sigint() {
    let mut daemon = Daemon::start();
    daemon.signal(Signal::INT);
    assert_eq!(daemon.wait().code(), Some(0));
    let leftover =
        sbdp_ipc::layout::shared_memory_files(&sbdp_ipc::endpoint::default_prefix(&daemon.runtime_dir()))
            .unwrap();
    assert!(leftover.is_empty(), "{leftover:?}");
}

#[test]
fn a_second_daemon_is_refused_and_told_who_holds_the_place() {
    let daemon = Daemon::start();
    let rival = daemon.rival();
    assert!(!rival.status.success());
    let message = String::from_utf8_lossy(&rival.stderr).into_owned();
    assert!(message.contains(&format!("pid {}", daemon.pid())), "{message}");
    daemon.connect().status().unwrap();
}

#[test]
fn after_a_crash_and_a_restart_the_same_client_goes_on() {
    let mut daemon = Daemon::start();
    let client = daemon.connect();
    let boxes = Boxes::two();
    let handle = client.upload(&boxes.assembly()).unwrap();
    plan(&client, handle, &PlanOptions::default());
    daemon.kill_and_restart();
    assert_eq!(client.status().unwrap().numbers.pid, daemon.pid());
    // What the daemon remembers across a crash is its caches' business; uploading again is
    // always right, and free where it remembers.
    let handle = client.upload(&boxes.assembly()).unwrap();
    let (_, summary) = plan(&client, handle, &PlanOptions::default());
    assert_eq!(summary.status, PlanStatus::Complete);
}

#[test]
fn a_stopped_client_freezes_nobody() {
    let daemon = Daemon::start();
    let observer = daemon.connect();
    let mut stopped = daemon.client_process("lattice");
    let _reader = wait_for_upload(&mut stopped);
    wait_for_request(&observer);
    let pid = rustix::process::Pid::from_child(&stopped);
    rustix::process::kill_process(pid, Signal::STOP).unwrap();
    let handle = observer.upload(&Boxes::two().assembly()).unwrap();
    let (_, summary) = plan(&observer, handle, &PlanOptions::default());
    assert_eq!(summary.status, PlanStatus::Complete);
    stopped.kill().unwrap();
    stopped.wait().unwrap();
}

#[test]
fn a_daemon_starts_over_whatever_a_killed_one_left_damaged() {
    for damage in [&b""[..], b"garbage"] {
        let mut daemon = Daemon::start();
        daemon.kill_and_restart_after(|root| damage_files(root, damage));
        let client = daemon.connect();
        let handle = client.upload(&Boxes::two().assembly()).unwrap();
        let (_, summary) = plan(&client, handle, &PlanOptions::default());
        assert_eq!(summary.status, PlanStatus::Complete);
    }
}

/// Overwrites every file below a folder.
fn damage_files(folder: &std::path::Path, content: &[u8]) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let entry = entry.unwrap();
        if entry.file_type().unwrap().is_dir() {
            damage_files(&entry.path(), content);
        } else if entry.file_type().unwrap().is_file() {
            let _ = std::fs::remove_file(entry.path());
            std::fs::write(entry.path(), content).unwrap();
        }
    }
}

#[test]
fn a_daemon_that_dies_while_planning_is_a_clear_error() {
    let mut daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(5).assembly()).unwrap();
    let mut stream = client.plan(handle, &PlanOptions::default()).unwrap();
    let first = next_event(&mut stream).unwrap();
    assert!(first.is_some());
    daemon.signal(Signal::KILL);
    daemon.wait();
    loop {
        match next_event(&mut stream) {
            Ok(Some(Event::Done(_))) => return, // planned faster than killed
            Ok(Some(_)) => {}
            Ok(None) => panic!("the stream ended without an answer"),
            Err(error) => {
                assert!(error.is_no_daemon(), "{error}");
                assert!(error.to_string().contains("restart `sbdpd`"), "{error}");
                return;
            }
        }
    }
}

#[test]
fn without_a_daemon_the_error_says_to_start_one() {
    let folder = tempfile::tempdir().unwrap();
    let runtime_dir = Some(folder.path().to_owned());
    let error =
        Client::connect_with(ConnectOptions { runtime_dir, ..ConnectOptions::default() }).unwrap_err();
    assert!(error.is_no_daemon() && error.to_string().contains("`sbdpd`"), "{error}");
}

#[test]
fn a_dropped_stream_frees_its_client_and_its_worker() {
    let daemon = Daemon::start_with("[workers]\ncount = 1\n");
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(5).assembly()).unwrap();
    let stream = client.plan(handle, &PlanOptions::default()).unwrap();
    assert!(matches!(client.plan(handle, &PlanOptions::default()), Err(ClientError::StreamOpen)));
    assert_eq!(client.status().unwrap().numbers.requests, 1, "status works beside a stream");
    drop(stream);
    let two = client.upload(&Boxes::two().assembly()).unwrap();
    assert_eq!(plan(&client, two, &PlanOptions::default()).1.status, PlanStatus::Complete);
}

#[test]
fn a_cancelled_stream_ends_with_what_there_is() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(5).assembly()).unwrap();
    let mut stream = client.plan(handle, &PlanOptions::default()).unwrap();
    stream.cancel();
    loop {
        match next_event(&mut stream) {
            Ok(Some(Event::Done(summary))) => {
                assert!(matches!(summary.status, PlanStatus::Cancelled | PlanStatus::Complete));
                break;
            }
            Ok(Some(_)) => {}
            Ok(None) => panic!("the stream ended without an answer"),
            Err(error) => {
                assert_eq!(error.code(), Some(ErrorCode::Cancelled), "{error}");
                break;
            }
        }
    }
}

#[test]
fn a_bad_configuration_is_refused_with_its_key() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("bad.toml");
    std::fs::write(&file, "[workers]\ncuont = 1\n").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_sbdpd")).arg("--config").arg(&file).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("cuont"));
    let explained = concat!(env!("CARGO_MANIFEST_DIR"), "/config/default.toml");
    let mut check = Command::new(env!("CARGO_BIN_EXE_sbdpd"));
    assert!(check.args(["--config", explained, "--check-config"]).status().unwrap().success());
}

/// A name or a text that jemalloc does not know would leave it as it is by default.
#[test]
fn the_allocator_gives_back_what_is_free() {
    let mut check = Command::new(env!("CARGO_BIN_EXE_sbdpd"));
    let output = check.arg("--check-config").env("_RJEM_MALLOC_CONF", "stats_print:true").output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    for option in ["opt.narenas: 4", "opt.dirty_decay_ms: 500 ", "opt.muzzy_decay_ms: 0 "] {
        assert!(told.contains(option), "{option}: {told}");
    }
    assert!(!told.contains("Invalid"), "{told}");
}
