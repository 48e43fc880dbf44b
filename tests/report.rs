//! `sbdp plan --report`, from outside: in this process and through the daemon.

mod common;

use std::path::Path;
use std::process::{Command, Output};

use common::Daemon;
use serde_json::Value;

const ALL: &str = "stability,clearance,tools";

fn sbdp(folder: &Path, runtime_dir: &Path, arguments: &[&str]) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.env("SBDP_CACHE_DIR", folder.join("commands")).env("SBDP_RUNTIME_DIR", runtime_dir);
    command.current_dir(folder).args(arguments).output().unwrap()
}

fn document(output: &Output) -> Value {
    assert!(output.status.success(), "{output:?}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What `command` says about a plan, step by step.
fn said(folder: &Path, command: &str, list: &str) -> Vec<Value> {
    let found = document(&sbdp(folder, folder, &[command, "plan.json", "--json", "-"]));
    found[list].as_array().unwrap().clone()
}

/// Each report is what the command of its own says, here and from the daemon, anew and from its memory.
#[test]
fn reports_are_the_same_wherever_the_plan_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let assembly = format!("{}/tests/assemblies/bolted-bracket-20", env!("CARGO_MANIFEST_DIR"));
    let here = sbdp(
        folder,
        folder,
        &["plan", &assembly, "--embedded", "--report", ALL, "--json", "plan.json", "-q"],
    );
    assert!(here.status.success(), "{here:?}");
    let plan: Value = serde_json::from_slice(&std::fs::read(folder.join("plan.json")).unwrap()).unwrap();
    let steps = plan["steps"].as_array().unwrap();

    let states = said(folder, "statics", "states");
    let before = std::iter::once(&plan["initial"]["stability"]);
    let reported: Vec<&Value> = before.chain(steps.iter().map(|step| &step["stability"])).collect();
    assert_eq!(states.len(), reported.len());
    for (state, stability) in states.iter().zip(reported) {
        assert!(stability["unstable"].is_array());
        for field in ["needs_friction", "unstable", "unknown"] {
            assert_eq!(state[field], stability[field], "{state}");
        }
    }
    for found in said(folder, "clearance", "steps") {
        let clearance = &steps[found["step"].as_u64().unwrap() as usize]["clearance"];
        assert!(clearance["touching"].is_array());
        for field in ["touching", "closest"] {
            assert_eq!(found[field], clearance[field], "{found}");
        }
    }
    let tools = said(folder, "tools", "steps");
    let has_tools = |step: &&Value| !step["tools"].as_array().unwrap().is_empty();
    assert_eq!(steps.iter().filter(has_tools).count(), tools.len());
    for found in tools {
        assert_eq!(found["tools"], steps[found["step"].as_u64().unwrap() as usize]["tools"]);
    }

    let daemon = Daemon::start();
    for _ in 0..2 {
        let asked = ["plan", &assembly, "--daemon", "--report", ALL, "--json", "-", "-q"];
        let found = document(&sbdp(folder, &daemon.runtime_dir(), &asked));
        assert_eq!(found["steps"], plan["steps"]);
        assert_eq!(found["initial"], plan["initial"]);
    }
}

/// A report is for those who ask for it, and each by itself.
#[test]
fn what_is_not_asked_for_is_not_reported() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let assembly = format!("{}/tests/assemblies/bolt-washer-plate", env!("CARGO_MANIFEST_DIR"));
    let daemon = Daemon::start();
    for backend in ["--embedded", "--daemon"] {
        for report in ["", "stability", "clearance", "tools"] {
            let mut asked = vec!["plan", &assembly, backend, "--json", "-", "-q"];
            if !report.is_empty() {
                asked.extend(["--report", report]);
            }
            let plan = document(&sbdp(folder, &daemon.runtime_dir(), &asked));
            for step in plan["steps"].as_array().unwrap() {
                for field in ["stability", "clearance", "tools"] {
                    assert_eq!(step.get(field).is_some(), field == report, "{backend} {report}: {step}");
                }
            }
            assert_eq!(plan["initial"].get("stability").is_some(), report == "stability");
        }
    }
    let refused = sbdp(folder, folder, &["plan", &assembly, "--report", "weather"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    let refused = sbdp(folder, folder, &["plan", &assembly, "--report", "stability", "--friction", "-1"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

/// Seen from another side, other parts fall. Nothing falls towards what stays.
#[test]
fn gravity_acts_against_up() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let assembly = format!("{}/tests/assemblies/bolted-bracket-20", env!("CARGO_MANIFEST_DIR"));
    let daemon = Daemon::start();
    let held = |up: &str| {
        let plans = ["--embedded", "--daemon"].map(|backend| {
            let asked =
                ["plan", &assembly, backend, "--report", "stability", "--up", up, "--json", "-", "-q"];
            document(&sbdp(folder, &daemon.runtime_dir(), &asked))
        });
        assert_eq!(plans[0]["steps"], plans[1]["steps"]);
        let unstable = |step: &Value| !step["stability"]["unstable"].as_array().unwrap().is_empty();
        plans[0]["steps"].as_array().unwrap().iter().filter(|step| unstable(step)).count()
    };
    let sides = ["+x", "-x", "+y", "-y", "+z", "-z"].map(held);
    assert!(sides.iter().any(|count| *count > 0), "{sides:?}");
    assert!(sides.iter().any(|count| count != &sides[0]), "{sides:?}");
}

/// The table and the instructions say it in words.
#[test]
fn reports_are_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let assembly = format!("{}/tests/assemblies/bolted-bracket-20", env!("CARGO_MANIFEST_DIR"));
    let asked = ["plan", &assembly, "--embedded", "--report", ALL, "--up", "-z", "--json", "plan.json"];
    let found = sbdp(folder, folder, &asked);
    let text = String::from_utf8_lossy(&found.stdout);
    for section in
        ["\nstands:\n", "\npasses nearest:\n  step ", "\ntools:\n  12 nuts and screws: each has a tool"]
    {
        assert!(text.contains(section), "{section}: {text}");
    }
    let words = sbdp(folder, folder, &["steps", "plan.json"]);
    let words = String::from_utf8_lossy(&words.stdout);
    assert!(words.contains(", with a 9.53 mm socket"), "{words}");
    let plan: Value = serde_json::from_slice(&std::fs::read(folder.join("plan.json")).unwrap()).unwrap();
    let holds = plan["steps"].as_array().unwrap().iter().any(|step| {
        step["stability"]["unstable"].as_array().unwrap().iter().any(|u| u["hold"][0].is_array())
    });
    assert_eq!(holds, words.contains("; hold "), "{words}");
}
