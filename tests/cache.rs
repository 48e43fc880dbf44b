//! What is remembered on disk, driven from outside: the command line, a second process, a full disk, a
//! damaged file, and a daemon that is started again.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use common::{Boxes, Daemon};
use rustix::process::Signal;
use sbdp::cache::{Cache, CacheSettings};
use sbdp::document::{PlanDocument, StatsDocument};
use sbdp::service::RECORD_KINDS;
use sbdp_client::{Change, Handle, PlanOptions, PlanStatus};

fn assembly() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies/pin-bolt-cover")
}

/// The command, kept away from any daemon that runs for this user.
fn sbdp(cache: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command
        .env("SBDP_RUNTIME_DIR", "/nonexistent/sbdp-tests")
        .env("SBDP_CACHE_DIR", cache)
        .stdin(Stdio::null());
    command
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[track_caller]
fn document(output: &Output) -> PlanDocument {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    PlanDocument::from_json(&text(&output.stdout)).unwrap()
}

fn plan(cache: &Path, options: &[&str]) -> PlanDocument {
    let output =
        sbdp(cache).arg("plan").arg(assembly()).args(["--json", "-"]).args(options).output().unwrap();
    assert!(output.stderr.is_empty(), "{}", text(&output.stderr));
    document(&output)
}

fn without_stats(document: PlanDocument) -> PlanDocument {
    PlanDocument { stats: StatsDocument::default(), ..document }
}

fn look(cache: &Path, options: &[&str]) -> Output {
    sbdp(cache).arg("cache").args(options).output().unwrap()
}

fn records(cache: &Path) -> u64 {
    let output = look(cache, &["stats", "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let stats: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(stats["on_disk"].as_bool().unwrap() && stats["file_bytes"].as_u64().unwrap() > 0);
    stats["kinds"].as_array().unwrap().iter().map(|k| k["disk_entries"].as_u64().unwrap()).sum()
}

#[test]
fn a_plan_is_remembered_by_the_next_process() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("made/when/needed");
    let first = plan(&cache, &[]);
    assert!(!first.stats.cache.plan_hit && first.stats.simulations_run == first.stats.simulations);
    let again = plan(&cache, &["--threads", "1"]);
    assert!(again.stats.cache.plan_hit && again.stats.simulations_run == 0);
    assert_eq!(again.stats.simulations, first.stats.simulations);
    // Another question about the same parts.
    let changed = plan(&cache, &["--removed", &first.steps[0].parts[0]]);
    let cold = plan(&cache, &["--removed", &first.steps[0].parts[0], "--no-cache"]);
    assert!(changed.stats.cache.blocking_hits > 0 && !changed.stats.cache.plan_hit);
    assert_eq!(cold.stats.cache.blocking_hits, 0);
    assert_eq!(without_stats(changed), without_stats(cold));
    assert_eq!(without_stats(again), without_stats(first));
}

#[test]
fn nothing_is_remembered_without_a_cache() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("cache");
    plan(&cache, &["--no-cache"]);
    assert!(!cache.exists());
    let output = look(&cache, &["stats"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("there is no cache") && !cache.exists());
}

#[test]
fn the_store_is_listed_checked_and_emptied() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path();
    plan(cache, &[]);
    let count = records(cache);
    let listed = text(&look(cache, &["ls"]).stdout);
    assert_eq!(listed.lines().count() as u64, count + 1, "{listed}");
    assert!(["plan", "verdict", "overlap", "blocking"].iter().all(|kind| listed.contains(kind)), "{listed}");
    assert!(text(&look(cache, &["stats"]).stdout).contains("blocking"));
    let verified = look(cache, &["verify"]);
    assert_eq!(verified.status.code(), Some(0), "{}", text(&verified.stdout));
    assert!(text(&verified.stdout).starts_with(&format!("{count} records, 0 damaged")));
    assert_eq!(look(cache, &["evict", "--to-mb", "1"]).status.code(), Some(0));
    assert_eq!(records(cache), count, "there is less than a megabyte");
    assert!(text(&look(cache, &["clear"]).stdout).starts_with(&format!("{count} records")));
    assert_eq!(records(cache), 0);
    assert!(!plan(cache, &[]).stats.cache.plan_hit);
}

#[test]
fn a_second_process_plans_from_memory_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let alone = plan(folder.path(), &["--no-cache"]);
    let settings = CacheSettings { folder: Some(folder.path().to_owned()), ..CacheSettings::default() };
    let held = Cache::open(&settings, &RECORD_KINDS).unwrap();
    let output = sbdp(folder.path()).arg("plan").arg(assembly()).args(["--json", "-"]).output().unwrap();
    let second = document(&output);
    assert!(text(&output.stderr).contains("in use by another process"), "{}", text(&output.stderr));
    assert_eq!(without_stats(second), without_stats(alone));
    let refused = look(folder.path(), &["verify"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("in use by another process"));
    drop(held);
    assert_eq!(records(folder.path()), 0);
}

/// Whether the file cannot be begun or cannot grow: the plan is the same, and what is on disk is whole.
#[test]
fn a_full_disk_costs_what_would_be_remembered_and_no_more() {
    let folder = tempfile::tempdir().unwrap();
    let alone = without_stats(plan(folder.path(), &["--no-cache"]));
    for kilobytes in [8, 40, 60, 80, 120, 200, 400, 1000, 2000] {
        let cache = folder.path().join(kilobytes.to_string());
        // Without a handler, the signal would end the process before the error is returned.
        let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", 2 * kilobytes);
        let mut command = Command::new("sh");
        command.args(["-c", &script, "sh", env!("CARGO_BIN_EXE_sbdp"), "plan"]).arg(assembly());
        command.args(["--json", "-", "--embedded"]).env("SBDP_CACHE_DIR", &cache);
        assert_eq!(without_stats(document(&command.output().unwrap())), alone, "{kilobytes} kB");
        let verified = look(&cache, &["verify"]);
        assert_eq!(verified.status.code(), Some(0), "{kilobytes} kB: {verified:?}");
        assert_eq!(without_stats(plan(&cache, &[])), alone, "{kilobytes} kB");
        assert!(plan(&cache, &[]).stats.cache.plan_hit, "{kilobytes} kB");
    }
}

#[test]
fn a_damaged_file_is_set_aside_and_told_by_verify() {
    let folder = tempfile::tempdir().unwrap();
    let first = without_stats(plan(folder.path(), &[]));
    let file = folder.path().join("records.redb");
    let mut bytes = std::fs::read(&file).unwrap();
    let middle = bytes.len() / 3;
    bytes[64..middle].fill(0x5a);
    std::fs::write(&file, &bytes).unwrap();
    let output = sbdp(folder.path()).arg("plan").arg(assembly()).args(["--json", "-"]).output().unwrap();
    assert_eq!(without_stats(document(&output)), first);
    look(folder.path(), &["verify"]);
    assert_eq!(look(folder.path(), &["verify"]).status.code(), Some(0));
    plan(folder.path(), &[]);
    assert!(plan(folder.path(), &[]).stats.cache.plan_hit);
}

/// Stops the daemon and starts another in its place.
fn restart(daemon: &mut Daemon) {
    daemon.signal(Signal::TERM);
    assert!(daemon.wait().success());
    daemon.kill_and_restart();
}

#[test]
fn a_daemon_started_again_remembers() {
    let mut daemon = Daemon::start();
    let boxes = Boxes::lattice(2);
    let ask = |daemon: &Daemon| {
        let client = daemon.connect();
        let handle = client.upload(&boxes.assembly()).unwrap();
        common::plan(&client, handle, &PlanOptions::default())
    };
    let (parts, first) = ask(&daemon);
    assert_eq!(first.stats.plan_hit, 0);
    assert_eq!(ask(&daemon).1.stats.plan_hit, 1);
    restart(&mut daemon);
    let (again, second) = ask(&daemon);
    assert_eq!((again, second.stats.plan_hit, second.stats.simulations_run), (parts, 1, 0));
}

#[test]
fn handles_and_revisions_hold_across_restarts() {
    let mut daemon = Daemon::start_with("[cache]\nprefetch = false\n");
    let boxes = Boxes::lattice(2);
    let client = daemon.connect();
    let handle = client.upload(&boxes.assembly()).unwrap();
    let shift = |x: f64| [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    let change = Change { moved: vec![(7, shift(0.25))], ..Change::default() };
    let revised = client.revise(handle, &change).unwrap();
    let again =
        client.revise(revised, &Change { moved: vec![(6, shift(-0.25))], ..Change::default() }).unwrap();
    let known = common::plan(&client, again, &PlanOptions::default());
    drop(client);
    restart(&mut daemon);
    let client = daemon.connect();
    assert!([handle, revised, again].into_iter().all(|handle| client.knows(handle).unwrap()));
    assert!(!client.knows(Handle([7; 32])).unwrap());
    // What was asked before is answered without the assembly, another question with it.
    let (parts, summary) = common::plan(&client, again, &PlanOptions::default());
    assert_eq!((parts, summary.stats.plan_hit), (known.0, 1));
    assert_eq!(client.status().unwrap().numbers.remembered, 1);
    let other = PlanOptions { removed: vec![0], ..PlanOptions::default() };
    let (_, other) = common::plan(&client, again, &other);
    assert_eq!((other.stats.plan_hit, other.status), (0, PlanStatus::Complete));
}
