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
