//! What may befall a daemon and its clients, done to the real one: killed, started twice, damaged files,
//! no room left, too few descriptors, clients that die or cheat.

mod common;

use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

use common::{Boxes, Daemon, HANG, next_event, options, plan, wait};
use rustix::process::{Signal, kill_process};
use sbdp_client::{Client, ClientError, ConnectOptions, Event, PlanOptions, PlanStatus, Summary};
use sbdp_ipc::endpoint::{DAEMON_FILE, Endpoint};

/// Not a test of its own: other tests run this binary as a client process.
#[test]
fn acts_as_a_client_process() {
    common::act_as_client();
}

fn patient(daemon: &Daemon) -> Client {
    let options = ConnectOptions { reconnect: HANG, ..options(&daemon.runtime_dir()) };
    Client::connect_with(options).unwrap()
}

/// The parts of every step, and its path.
type Steps = Vec<(Vec<u32>, Vec<[f64; 7]>)>;

/// Plans an assembly whatever happens meanwhile: the steps, the summary, and how often the plan began anew.
fn plan_through(client: &Client, boxes: &Arc<Boxes>) -> (Steps, Summary, u32) {
    let options = PlanOptions { no_cache: true, ..PlanOptions::default() };
    let mut stream = client.plan(Arc::clone(boxes), &options).unwrap();
    let (mut steps, mut restarts) = (Vec::new(), 0);
    loop {
        match next_event(&mut stream).unwrap() {
            Some(Event::Step(step)) => steps.push((step.view().parts.to_vec(), step.view().path.to_vec())),
            Some(Event::Progress(_) | Event::Trace(_)) => {}
            Some(Event::Restarted) => {
                steps.clear();
                restarts += 1;
            }
            Some(Event::Done(summary)) => return (steps, summary, restarts),
            None => panic!("a stream ends with `Done`"),
        }
    }
}

#[test]
fn clients_of_a_daemon_that_is_killed_and_restarted_get_the_same_plans_and_are_told() {
    let mut daemon = Daemon::start();
    let boxes = Arc::new(Boxes::lattice(5));
    let (undisturbed, _, restarts) = plan_through(&patient(&daemon), &boxes);
    assert_eq!(restarts, 0);
    let clients: Vec<Client> = (0..4).map(|_| patient(&daemon)).collect();
    let observer = daemon.connect();
    let planned: Vec<_> = std::thread::scope(|scope| {
        let boxes = &boxes;
        let threads: Vec<_> = clients
            .into_iter()
            .map(|client| {
                scope.spawn(move || {
                    let (steps, summary, restarts) = plan_through(&client, boxes);
                    (steps, summary.status, restarts, client.restarts())
                })
            })
            .collect();
        while observer.status().unwrap().numbers.running == 0 {
            std::thread::sleep(Duration::from_millis(1));
        }
        daemon.kill_and_restart();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    for (steps, status, streams, daemons) in &planned {
        assert_eq!(*status, PlanStatus::Complete);
        assert!(*steps == undisturbed, "the same plan to the bit");
        assert!(*daemons == 1 && *streams <= 1);
    }
    assert!(planned.iter().any(|(_, _, streams, _)| *streams == 1), "some plan was under way");
}

#[test]
fn of_two_daemons_started_at_once_one_serves_and_the_other_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let runtime_dir = folder.path().join("run");
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdpd"));
    command.arg("--runtime-dir").arg(&runtime_dir).env("SBDP_CACHE_DIR", folder.path().join("cache"));
    command.stderr(Stdio::piped());
    let mut both = [command.spawn().unwrap(), command.spawn().unwrap()];
    let start = Instant::now();
    let loser = loop {
        assert!(start.elapsed() < HANG, "none of them leaves");
        match both.iter_mut().position(|d| d.try_wait().unwrap().is_some()) {
            Some(loser) => break loser,
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let winner = &mut both[1 - loser];
    while Endpoint::find(&runtime_dir).map(|e| e.pid).ok() != Some(winner.id()) {
        assert!(start.elapsed() < HANG, "the winner does not become ready");
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(common::connect(&runtime_dir).pid(), winner.id());
    let pid = winner.id();
    terminate(winner);
    let [first, second] = both;
    let loser = if loser == 0 { first } else { second };
    let output = loser.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && message.contains(&format!("pid {pid}")), "{message}");
}

fn terminate(child: &mut Child) {
    kill_process(rustix::process::Pid::from_child(child), Signal::TERM).unwrap();
    assert!(wait(child).success());
}

#[test]
fn a_daemon_file_that_is_damaged_or_of_another_version_is_a_clear_error() {
    let daemon = Daemon::start();
    let file = daemon.runtime_dir().join(DAEMON_FILE);
    let good = std::fs::read_to_string(&file).unwrap();
    let refused = |text: &str| {
        std::fs::write(&file, text).unwrap();
        Client::connect_with(options(&daemon.runtime_dir())).unwrap_err()
    };
    for bad in ["", "{", "null", "[1]", "{\"pid\": -1}", &good[..good.len() / 2]] {
        let error = refused(bad).to_string();
        assert!(error.contains("daemon.json") && error.contains("cannot be understood"), "{bad}: {error}");
    }
    let mut endpoint: Endpoint = serde_json::from_str(&good).unwrap();
    endpoint.protocol += 1;
    let error = refused(&serde_json::to_string(&endpoint).unwrap());
    assert!(
        !error.is_no_daemon()
            && error.to_string().contains(&format!("speaks protocol {}", endpoint.protocol)),
        "{error}"
    );
    endpoint.protocol -= 1;
    endpoint.iceoryx2 = "0.99.0".to_owned();
    let error = refused(&serde_json::to_string(&endpoint).unwrap()).to_string();
    assert!(error.contains("iceoryx2 0.99.0") && error.contains("matching versions"), "{error}");
    endpoint.iceoryx2 = sbdp_ipc::ICEORYX2_VERSION.to_owned();
    endpoint.prefix = "../../etc/".to_owned();
    assert!(matches!(refused(&serde_json::to_string(&endpoint).unwrap()), ClientError::Layout(_)));
    std::fs::write(&file, good).unwrap();
    common::connect(&daemon.runtime_dir()).status().unwrap();
}

/// A daemon in a place where files can be had but nothing else is as usual: `before` is a line of shell
/// that runs first, in namespaces of its own where these may be had. None where they may not.
struct Confined {
    child: Child,
    folder: tempfile::TempDir,
}

impl Confined {
    fn start(before: &str, config: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("config.toml"), config).unwrap();
        let mut command = Command::new("sh");
        command.arg("-c").arg(format!("{before}; exec \"$SBDPD\" --config config.toml --runtime-dir run"));
        command.current_dir(folder.path()).env("SBDPD", env!("CARGO_BIN_EXE_sbdpd"));
        command.env("SBDP_CACHE_DIR", folder.path().join("cache"));
        let child = command.spawn().unwrap();
        let mut confined = Self { child, folder };
        let start = Instant::now();
        while Endpoint::find(&confined.runtime_dir()).is_err() {
            assert!(start.elapsed() < HANG, "the daemon does not become ready");
            assert!(confined.child.try_wait().unwrap().is_none(), "the daemon ended at once");
            std::thread::sleep(Duration::from_millis(5));
        }
        confined
    }

    fn runtime_dir(&self) -> std::path::PathBuf {
        self.folder.path().join("run")
    }

    fn descriptors(&self) -> usize {
        std::fs::read_dir(format!("/proc/{}/fd", self.child.id())).unwrap().count()
    }
}

impl Drop for Confined {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let prefix = sbdp_ipc::endpoint::default_prefix(&self.runtime_dir());
        for path in sbdp_ipc::layout::shared_memory_files(&prefix).unwrap_or_default() {
            let _ = std::fs::remove_file(path);
        }
    }
}

fn plans(client: &Client) {
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    let (_, summary) = plan(client, handle, &PlanOptions { no_cache: true, ..PlanOptions::default() });
    assert_eq!(summary.status, PlanStatus::Complete);
}

#[test]
fn a_daemon_without_descriptors_serves_those_it_has_and_recovers() {
    let daemon = Confined::start("ulimit -n 90", "");
    let first = common::connect(&daemon.runtime_dir());
    plans(&first);
    let mut others = Vec::new();
    for _ in 0..30 {
        let quick = ConnectOptions { timeout: Duration::from_millis(500), ..options(&daemon.runtime_dir()) };
        if let Ok(client) = Client::connect_with(quick)
            && client.status().is_ok()
        {
            others.push(client);
        }
    }
    let served = others.len();
    assert!(served < 30, "the limit was not reached");
    // Those who were there first are served as before.
    plans(&first);
    drop(others);
    let start = Instant::now();
    while daemon.descriptors() > 75 {
        assert!(start.elapsed() < HANG, "descriptors of clients that left are kept");
        std::thread::sleep(Duration::from_millis(20));
    }
    plans(&common::connect(&daemon.runtime_dir()));
}

#[test]
fn a_cache_that_cannot_be_written_costs_nobody_an_answer() {
    // A file where the folder should be, whoever runs the test: permissions do not stop root.
    let daemon = Confined::start("echo > cache", "");
    plans(&common::connect(&daemon.runtime_dir()));
}

#[test]
fn a_client_that_dies_while_uploading_or_holding_responses_costs_the_daemon_nothing() {
    let daemon = Daemon::start_with("[times]\ntick_s = 0.1\n");
    let observer = daemon.connect();
    plans(&observer);
    let descriptors = || std::fs::read_dir(format!("/proc/{}/fd", daemon.pid())).unwrap().count();
    let die = |round: u64| {
        let mut client = daemon.client_process(if round.is_multiple_of(2) { "uploading" } else { "holding" });
        std::thread::sleep(Duration::from_millis(40 + 35 * round));
        client.kill().unwrap();
        client.wait().unwrap();
    };
    (0..2).for_each(die);
    plans(&observer);
    std::thread::sleep(Duration::from_millis(500));
    let before = descriptors();
    (0..10).for_each(die);
    plans(&observer);
    let start = Instant::now();
    // A few are opened when something is used for the first time; a leak would be of ten at least. What the
    // last one had asked is ended at the tick after its death.
    let settled = || {
        let status = observer.status().unwrap().numbers;
        descriptors() <= before + 3 && (status.running, status.queued) == (0, 0)
    };
    while !settled() {
        assert!(start.elapsed() < HANG, "{} descriptors, {before} before", descriptors());
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn an_upload_whose_daemon_dies_is_noticed_and_done_again_at_the_next() {
    let mut daemon = Daemon::start();
    let (two, lattice) = (Boxes::two(), Boxes::lattice(6));
    let [impatient, patient] = [Duration::ZERO, HANG].map(|reconnect| {
        let options = ConnectOptions { reconnect, timeout: HANG, ..options(&daemon.runtime_dir()) };
        Client::connect_with(options).unwrap()
    });
    let base = impatient.upload(&two.assembly()).unwrap();
    // The daemon takes nothing while it is stopped: both are under way when it dies.
    daemon.signal(Signal::STOP);
    std::thread::scope(|scope| {
        let (added, lattice) = (vec![two.assembly().parts[0]], &lattice);
        let lost = scope.spawn(move || {
            let change = sbdp_client::Change { added, ..sbdp_client::Change::default() };
            impatient.revise(base, &change).unwrap_err()
        });
        let done = scope.spawn(move || {
            let handle = patient.upload(&lattice.assembly()).unwrap();
            (handle, patient.restarts())
        });
        std::thread::sleep(Duration::from_millis(300));
        daemon.kill_and_restart();
        let lost = lost.join().unwrap();
        assert!(matches!(lost, ClientError::DaemonDied { .. }), "{lost}");
        let (handle, restarts) = done.join().unwrap();
        assert_eq!(restarts, 1);
        assert!(daemon.connect().knows(handle).unwrap());
    });
}

#[test]
fn a_daemon_never_meets_what_a_killed_one_left() {
    let mut daemon = Daemon::start();
    let place = |daemon: &Daemon| {
        let endpoint = Endpoint::find(&daemon.runtime_dir()).unwrap();
        (endpoint.prefix, endpoint.root)
    };
    let client = patient(&daemon);
    plans(&client);
    let (prefix, root) = place(&daemon);
    daemon.kill_and_restart();
    let (next_prefix, next_root) = place(&daemon);
    assert!(next_prefix != prefix && next_root != root);
    plans(&client);
    assert_eq!(client.restarts(), 1);
    drop(client);
    let left = sbdp_ipc::layout::shared_memory_files(&prefix).unwrap();
    assert!(left.is_empty() && !root.exists(), "{left:?}");
}

/// Runs a daemon and a client in that role where `mount` has been done, in namespaces of their own; none
/// where these may not be had.
fn mounted(mount: &str, role: &str) -> Option<std::process::Output> {
    let alone = ["--user", "--map-root-user", "--mount"];
    if !Command::new("unshare").args(alone).arg("true").status().is_ok_and(|s| s.success()) {
        eprintln!("skipped: no namespaces here");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = format!(
        "mkdir cache; {mount} || exit 8; \"$SBDPD\" --runtime-dir run & pid=$!; \
         while ! [ -e run/daemon.json ]; do sleep 0.05; done; \
         SBDP_RUNTIME_DIR=run SBDP_TEST_ROLE={role} \"$CLIENT\" --exact acts_as_a_client_process --nocapture; \
         code=$?; kill -TERM $pid; wait $pid || exit 9; exit $code"
    );
    let mut command = Command::new("unshare");
    command.args(alone).args(["sh", "-c", &script]).current_dir(folder.path());
    command.env("SBDPD", env!("CARGO_BIN_EXE_sbdpd")).env("CLIENT", std::env::current_exe().unwrap());
    command.env("SBDP_CACHE_DIR", folder.path().join("cache"));
    Some(command.output().unwrap())
}

#[test]
fn shared_memory_that_is_too_small_is_refused_before_it_is_touched() {
    let Some(output) = mounted("mount -t tmpfs -o size=24m tmpfs /dev/shm", "too-large") else { return };
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success() && text.contains("then planned"), "{output:?}");
    assert!(text.contains("refused: ") && text.contains("/dev/shm has only"), "{text}");
}

#[test]
fn a_cache_disk_that_is_full_or_cannot_be_written_costs_nobody_an_answer() {
    for mount in ["mount -t tmpfs -o size=64k tmpfs cache", "mount -t tmpfs -o ro tmpfs cache"] {
        let Some(output) = mounted(mount, "small-lattice") else { return };
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success() && text.contains("complete after"), "{mount}: {output:?}");
    }
}

#[test]
fn a_clean_stop_after_faults_leaves_nothing_behind() {
    let mut daemon = Daemon::start_with("[times]\ntick_s = 0.1\n");
    let mut dying = daemon.client_process("holding");
    std::thread::sleep(Duration::from_millis(300));
    dying.kill().unwrap();
    dying.wait().unwrap();
    daemon.kill_and_restart();
    let client = patient(&daemon);
    plans(&client);
    drop(client);
    daemon.signal(Signal::TERM);
    assert!(daemon.wait().success());
    let prefix = sbdp_ipc::endpoint::default_prefix(&daemon.runtime_dir());
    let left = sbdp_ipc::layout::shared_memory_files(&prefix).unwrap();
    assert!(left.is_empty(), "{left:?}");
    let root = daemon.runtime_dir().with_file_name("iox");
    assert_eq!(files_below(&root), 0, "{}", root.display());
}

fn files_below(folder: &Path) -> usize {
    let Ok(entries) = std::fs::read_dir(folder) else { return 0 };
    entries.flatten().map(|e| if e.path().is_dir() { files_below(&e.path()) } else { 1 }).sum()
}
