//! Assembly plans, from the command line and through the daemon.

mod common;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use common::{Boxes, Daemon};
use sbdp::document::PlanDocument;
use sbdp_client::{Client, Handle, PlanOptions, PlanStatus, Staging, Summary, Waypoint};

const IN_PLACE: Waypoint = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

#[test]
fn acts_as_a_client_process() {
    common::act_as_client();
}

fn sbdp(name: &str, options: &[&str], runtime_dir: &Path) -> Output {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.env("SBDP_RUNTIME_DIR", runtime_dir).stdin(Stdio::null());
    command.arg("plan").arg(path).args(["--assembly", "--json", "-"]).args(options).output().unwrap()
}

fn document(output: &Output) -> PlanDocument {
    let text = String::from_utf8_lossy(&output.stdout);
    PlanDocument::from_json(&text)
        .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&output.stderr)))
}

fn here(name: &str, options: &[&str]) -> PlanDocument {
    document(&sbdp(name, &[options, &["--embedded", "--no-cache"]].concat(), Path::new("/nonexistent/sbdp")))
}

/// Each part begins where it waits and ends where it belongs, in the order opposite to that in which they leave.
fn assert_reverses(plan: &PlanDocument, apart: &PlanDocument) {
    assert_eq!((plan.kind.as_str(), apart.kind.as_str()), ("assembly", "disassembly"));
    assert_eq!(plan.status, "complete");
    let order = |plan: &PlanDocument| plan.steps.iter().map(|s| s.parts.clone()).collect::<Vec<_>>();
    assert_eq!(order(plan), order(apart).into_iter().rev().collect::<Vec<_>>());
    for step in &plan.steps {
        assert_eq!((step.of, step.ends.as_str()), (None, "in"));
        assert_eq!(plan.initial.poses[&step.parts[0]], step.path[0]);
        assert_eq!(step.path.last(), Some(&IN_PLACE));
        let removal = apart.steps.iter().find(|s| s.parts == step.parts).unwrap();
        let end: Vec<_> = step.path.iter().rev().take(removal.path.len()).copied().collect();
        assert_eq!(end, removal.path, "the insertion is the removal");
        assert!(step.verified_depth >= removal.verified_depth);
    }
}

#[test]
fn the_command_line_puts_together_what_it_takes_apart() {
    for name in ["pin-bolt-cover", "threaded-bolt-and-nut"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name);
        let apart = Command::new(env!("CARGO_BIN_EXE_sbdp"))
            .arg("plan")
            .arg(path)
            .args(["--embedded", "--no-cache", "--json", "-"])
            .output()
            .unwrap();
        assert_reverses(&here(name, &[]), &document(&apart));
    }
}

#[test]
fn parts_wait_where_a_file_says_or_nowhere() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("staging.json");
    let turned = [0.0, -300.0, 40.0, 0.0, 0.0, 0.0, 1.0];
    std::fs::write(&file, serde_json::to_string(&BTreeMap::from([("pin", turned)])).unwrap()).unwrap();
    let given = here("pin-bolt-cover", &["--staging", file.to_str().unwrap()]);
    assert_eq!(given.status, "complete");
    assert_eq!(given.initial.poses["pin"], turned);
    let pin = given.steps.iter().find(|s| s.parts == ["pin"]).unwrap();
    assert_eq!((pin.path[0], pin.motion.as_str()), (turned, "rotation"));

    let nowhere = here("pin-bolt-cover", &["--staging", "none"]);
    let automatic = here("pin-bolt-cover", &[]);
    for (step, longer) in nowhere.steps.iter().zip(&automatic.steps) {
        assert!(longer.path.ends_with(&step.path) && longer.path.len() > step.path.len());
    }
}

#[test]
fn a_place_that_is_taken_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("staging.json");
    let refused = |text: &str, words: &[&str]| {
        std::fs::write(&file, text).unwrap();
        let output =
            sbdp("pin-bolt-cover", &["--staging", file.to_str().unwrap()], Path::new("/nonexistent"));
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
    };
    refused(r#"{"pinn": [0, 0, 0]}"#, &["--staging", "`pinn`", "`pin`"]);
    refused(r#"{"pin": [0, 0]}"#, &["`pin`", "[x, y, z]"]);
    refused("[]", &["staging.json", "poses by part"]);
    std::fs::write(&file, r#"{"pin": [0, 0, 0]}"#).unwrap();
    let plan = here("pin-bolt-cover", &["--staging", file.to_str().unwrap()]);
    assert_eq!(plan.status, "exhausted");
    let reason = plan.reason.unwrap();
    assert!(reason.contains("pin"), "{reason}");
    assert!(plan.blocked.iter().any(|b| b.action == "insertion"), "{:?}", plan.blocked);
}

fn asked(client: &Client, handle: Handle, options: &PlanOptions) -> (Vec<(u32, Vec<Waypoint>)>, Summary) {
    let plan = client.plan(handle, options).unwrap().plan_to_end().unwrap();
    let steps = plan.steps.iter().map(|step| (step.view().parts[0], step.view().path.to_vec()));
    (steps.collect(), plan.summary)
}

#[test]
fn the_daemon_puts_together_too() {
    let daemon = Daemon::start();
    let client = daemon.connect();
    let handle = client.upload(&Boxes::lattice(2).assembly()).unwrap();
    let options = |staging| PlanOptions { assembly: Some(staging), ..PlanOptions::default() };
    let (steps, summary) = asked(&client, handle, &options(Staging::Beside(Vec::new())));
    assert!(summary.assembly && summary.status == PlanStatus::Complete && steps.len() == 7);
    for (part, path) in &steps {
        assert!(summary.poses.contains(&(*part, path[0])));
        assert_eq!(path.last(), Some(&IN_PLACE));
    }
    let hits = client.status().unwrap().numbers.remembered;
    let (again, _) = asked(&client, handle, &options(Staging::Beside(Vec::new())));
    assert_eq!(again, steps);
    assert_eq!(client.status().unwrap().numbers.remembered, hits + 1);

    let (first, _) = &steps[0];
    let away = [50.0, 60.0, 70.0, 1.0, 0.0, 0.0, 0.0];
    let (steps, summary) = asked(&client, handle, &options(Staging::Beside(vec![(*first, away)])));
    assert_eq!((steps[0].1[0], summary.status), (away, PlanStatus::Complete));
    let (steps, summary) = asked(&client, handle, &PlanOptions::default());
    assert!(!summary.assembly && summary.poses.is_empty() && steps.len() == 7);
}

#[test]
fn the_daemon_plans_as_the_command_line_does_here() {
    let daemon = Daemon::start();
    let through = document(&sbdp("bolt-washer-plate", &["--daemon"], &daemon.runtime_dir()));
    let alone = here("bolt-washer-plate", &[]);
    assert_eq!((through.steps, through.initial), (alone.steps, alone.initial));
}
