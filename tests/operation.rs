//! What those who operate a daemon rely on: figures, checks of its configuration, reload, readiness.

mod common;

use std::io::{Read, Write};
use std::os::unix::net::{UnixDatagram, UnixStream};
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use common::{Boxes, Daemon, HANG, plan, wait};
use rustix::process::Signal;
use sbdp_client::{ErrorCode, PlanOptions};

fn sbdp(daemon: &Daemon, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.args(arguments).env("SBDP_RUNTIME_DIR", daemon.runtime_dir()).output().unwrap()
}

#[test]
fn figures_tell_what_was_asked_and_how_long_it_took() {
    let daemon = Daemon::start_with("[times]\ntick_s = 0.05\n[metrics]\nsocket = \"metrics.sock\"\n");
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    plan(&client, handle, &PlanOptions::default());
    plan(&client, handle, &PlanOptions::default());
    let output = sbdp(&daemon, &["status", "--json"]);
    assert!(output.status.success(), "{output:?}");
    let figures: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((figures["pid"].as_u64(), figures["done"].as_u64()), (Some(u64::from(daemon.pid())), Some(2)));
    assert_eq!(
        (figures["clients"].as_u64(), figures["connections"].as_u64()),
        (Some(2), Some(2)),
        "and `sbdp`"
    );
    assert!(figures["shared_memory_free_bytes"].as_u64() != Some(0));
    for kind in ["plan", "remembered_plan", "upload"] {
        let latency = &figures["latency"][kind];
        assert_eq!(latency["count"], 1, "{kind}");
        assert!(latency["p99_s"].as_f64().unwrap() > 0.0 && latency["sum_s"].as_f64().unwrap() < 60.0);
    }
    let start = Instant::now();
    while !metrics(&daemon).contains("sbdp_plan_requests_ended_total{end=\"done\"} 2\n") {
        assert!(start.elapsed() < HANG, "{}", metrics(&daemon));
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn the_state_is_told_in_plain_lines() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    plan(&client, handle, &PlanOptions::default());
    let output = sbdp(&daemon, &["status"]);
    assert!(output.status.success(), "{output:?}");
    let text = String::from_utf8(output.stdout).unwrap();
    let first = format!("sbdpd {}, protocol {}, pid {}, up ", sbdp::BUILD, sbdp_ipc::PROTOCOL, daemon.pid());
    assert!(text.starts_with(&first), "{text}");
    let line = |subject: &str| {
        let found = text.lines().find(|line| line.starts_with(subject));
        found.unwrap_or_else(|| panic!("no {subject} in\n{text}"))
    };
    assert!(line("workers ").contains("2, 0 busy; 0 requests wait, at most 64"), "{text}");
    assert!(line("clients ").contains("2, with 2 connections"), "{text}");
    assert!(line("requests ").ends_with("1: 1 answered (0 from memory)"), "{text}");
    for kind in ["plan time ", "upload time "] {
        assert!(line(kind).contains("median ") && line(kind).ends_with("(of 1)"), "{text}");
    }
    assert!(
        line("memory ").contains(" MB in all, ") && line("memory ").contains(" in 1 assemblies"),
        "{text}"
    );
    assert!(line("cache ").contains(&format!("{}: ", daemon.cache_dir().display())), "{text}");
    // Aligned, and few.
    let column = |line: &str| {
        let gap = line.find("  ").unwrap();
        gap + line[gap..].find(|c| c != ' ').unwrap()
    };
    let columns: std::collections::HashSet<_> = text.lines().skip(1).map(column).collect();
    assert!(columns.len() == 1 && text.lines().count() < 12, "{text}");
}

#[test]
fn the_cache_is_counted_while_the_daemon_holds_it() {
    let mut daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    plan(&client, handle, &PlanOptions::default());
    let folder = daemon.cache_dir();
    let stats = |daemon: &Daemon| {
        let arguments = ["cache", "stats", "--json", "-", "--cache-dir", folder.to_str().unwrap()];
        let output = sbdp(daemon, &arguments);
        assert!(output.status.success(), "{output:?}");
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()
    };
    let records = |stats: &serde_json::Value| -> Vec<u64> {
        let kinds = stats["kinds"].as_array().unwrap().iter();
        kinds.flat_map(|k| [k["disk_entries"].as_u64().unwrap(), k["disk_bytes"].as_u64().unwrap()]).collect()
    };
    // What was planned is written a moment later.
    let start = Instant::now();
    let mut held = stats(&daemon);
    while records(&held).iter().sum::<u64>() == 0 {
        assert!(start.elapsed() < HANG, "{held}");
        std::thread::sleep(Duration::from_millis(10));
        held = stats(&daemon);
    }
    assert_eq!(
        (held["from"].as_str(), held["pid"].as_u64()),
        (Some("daemon"), Some(u64::from(daemon.pid())))
    );
    assert_eq!(held["folder"].as_str(), folder.to_str());
    let plain = sbdp(&daemon, &["cache", "stats", "--cache-dir", folder.to_str().unwrap()]);
    let told = format!("as counted by the daemon that holds it (pid {})", daemon.pid());
    assert!(String::from_utf8_lossy(&plain.stdout).contains(&told), "{plain:?}");
    // The daemon is not asked about another folder that is in use.
    let other = tempfile::tempdir().unwrap();
    let settings = sbdp::cache::CacheSettings {
        folder: Some(other.path().to_owned()),
        ..sbdp::cache::CacheSettings::default()
    };
    let taken = sbdp::cache::Cache::open(&settings, &sbdp::service::RECORD_KINDS).unwrap();
    let refused = sbdp(&daemon, &["cache", "stats", "--cache-dir", other.path().to_str().unwrap()]);
    assert_eq!(refused.status.code(), Some(1));
    let why = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(why.contains("in use by another process") && why.contains(folder.to_str().unwrap()), "{why}");
    drop(taken);
    // Both ways of counting agree.
    daemon.signal(Signal::TERM);
    daemon.wait();
    let before = records(&held);
    let files = stats(&daemon);
    assert_eq!((files["from"].as_str(), files["pid"].as_u64()), (Some("files"), None));
    let after = records(&files);
    assert!(before.iter().zip(&after).all(|(held, read)| held <= read), "{before:?} {after:?}");
}

fn metrics(daemon: &Daemon) -> String {
    let mut stream = UnixStream::connect(daemon.runtime_dir().join("metrics.sock")).unwrap();
    stream.write_all(b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

#[test]
fn a_configuration_is_checked_to_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    let check = |text: &str| {
        std::fs::write(&file, text).unwrap();
        let output =
            Command::new(env!("CARGO_BIN_EXE_sbdp")).args(["config", "check"]).arg(&file).output().unwrap();
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert_eq!(check(include_str!("../config/default.toml")).0, Some(0));
    for (text, line, key) in [
        ("[workers]\ncuont = 1\n", "line 2", "cuont"),
        ("[workers]\n\ncount = 0\n", "line 3", "workers.count"),
        ("[log]\nformat = \"xml\"\n", "line 2", "xml"),
        ("[times\n", "line 1", ""),
    ] {
        let (code, message) = check(text);
        assert!(code == Some(2) && message.contains(line) && message.contains(key), "{text}: {message}");
    }
    let (code, message) = check("[endpoint]\nprefix = \"a/b\"\n");
    assert!(code == Some(2) && message.contains("prefix"), "{message}");
}

#[test]
fn at_sighup_limits_change_and_a_bad_file_changes_nothing() {
    let daemon = Daemon::start_with("");
    let client = daemon.connect();
    let limit = || client.status().unwrap().numbers.queue_limit;
    let vertices = vec![[0.5; 3]; 60_000];
    let too_large = || {
        let part = sbdp_client::Part {
            name: "big",
            vertices: sbdp_client::Vertices::F64(&vertices),
            triangles: &[[0, 1, 2]],
        };
        let assembly = sbdp_client::Assembly { parts: vec![part], ..sbdp_client::Assembly::default() };
        client.upload(&assembly).unwrap_err().code()
    };
    assert_eq!(limit(), 64);
    daemon.configure("[requests]\nqueue = 5\nmax_upload_mb = 1\n");
    daemon.signal(Signal::HUP);
    let start = Instant::now();
    while limit() != 5 {
        assert!(start.elapsed() < HANG, "the configuration is not read again");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(too_large(), Some(ErrorCode::TooLarge));
    daemon.configure("[requests]\nqueue = -5\n");
    daemon.signal(Signal::HUP);
    std::thread::sleep(Duration::from_millis(200));
    assert_eq!((limit(), too_large()), (5, Some(ErrorCode::TooLarge)));
}

#[test]
fn a_service_manager_is_told_when_the_daemon_is_ready_lives_and_leaves() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notify");
    let manager = UnixDatagram::bind(&path).unwrap();
    manager.set_read_timeout(Some(HANG)).unwrap();
    let heard = || {
        let mut text = [0; 200];
        let length = manager.recv(&mut text).unwrap();
        String::from_utf8_lossy(&text[..length]).into_owned()
    };
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdpd"));
    command.arg("--runtime-dir").arg(folder.path().join("run"));
    command.env("SBDP_CACHE_DIR", folder.path().join("cache"));
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "200000");
    let mut child = command.spawn().unwrap();
    assert_eq!(heard(), "READY=1");
    // Without anything to do it says that it lives, more often than once a tick.
    for _ in 0..5 {
        assert_eq!(heard(), "WATCHDOG=1");
    }
    rustix::process::kill_process(rustix::process::Pid::from_child(&child), Signal::TERM).unwrap();
    let last = std::iter::repeat_with(heard).find(|text| text != "WATCHDOG=1");
    assert_eq!(last.as_deref(), Some("STOPPING=1"));
    assert!(wait(&mut child).success());
}
