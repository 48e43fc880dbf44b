//! `sbdp bench load`, `soak` and `cancel` in small: what they count, and that nothing is lost.

use std::path::Path;
use std::process::Command;

fn bench(arguments: &[&str]) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("figures.json");
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    let output = command.arg("bench").args(arguments).arg("--json").arg(&file).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap()
}

fn l_slot() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies/l-slot").display().to_string()
}

#[test]
fn every_request_is_answered_or_refused_with_a_reason_also_beside_disturbers() {
    let load =
        bench(&["load", &l_slot(), "--clients", "3", "--requests", "121", "--variety", "4", "--disturb"]);
    for phase in [&load, &load["disturbed"]] {
        let count = |name: &str| phase[name].as_u64().unwrap();
        assert_eq!(count("sent"), 121);
        assert_eq!(count("answered") + count("refused") + count("dropped"), 121, "{phase}");
        assert_eq!((count("lost"), count("differing")), (0, 0), "{phase}");
        assert!(phase["daemon"]["at_end"]["resident_kib"].as_u64().unwrap() > 0);
        assert!(phase["kinds"]["repeat"]["p99_us"].as_f64().unwrap() > 0.0);
    }
    let received = |phase: &serde_json::Value| phase["plans_received"].as_u64().unwrap();
    assert!(received(&load["disturbed"]) > received(&load), "one floods");
    assert!(load["p99_ratio"]["repeat"].as_f64().unwrap() > 0.0);
}

#[test]
fn clients_and_daemons_may_be_killed_and_all_answers_are_the_undisturbed_ones() {
    let kills = ["--client-kills", "4", "--daemon-kills", "3"];
    let slot = l_slot();
    let mut arguments = vec!["soak", &slot, "--clients", "2", "--requests", "30"];
    arguments.extend(kills);
    let soak = bench(&arguments);
    let count = |name: &str| soak[name].as_u64().unwrap();
    assert_eq!((count("client_kills"), count("daemon_kills"), count("clients_failed")), (4, 3, 0), "{soak}");
    assert_eq!((count("lost"), count("differing"), count("differing_from_undisturbed")), (0, 0, 0), "{soak}");
    assert!(count("compared") > 0 && count("sent") >= 60);
    for left in ["left_in_shared_memory", "left_in_root"] {
        assert_eq!(soak[left].as_array().map(Vec::len), Some(0), "{soak}");
    }
}

#[test]
fn plans_that_are_ended_are_measured() {
    let records = bench(&["cancel", &l_slot(), "--samples", "6"]);
    assert_eq!(records.as_array().map(Vec::len), Some(1));
    assert!(records[0]["ended"].as_u64().unwrap() <= 6 && records[0]["plan_ms"].as_f64().unwrap() > 0.0);
}
