//! `sbdp statics`, from outside.

mod common;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

/// An upright cuboid as OBJ.
fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> String {
    let mut text = String::new();
    for i in 0..8 {
        let at = |axis: usize| if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] };
        text.push_str(&format!("v {} {} {}\n", at(0), at(1), at(2)));
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text.push_str(&format!("f {a} {b} {c}\nf {a} {c} {d}\n"));
    }
    text
}

fn sbdp(folder: &Path, arguments: &[&str]) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.current_dir(folder).env("SBDP_CACHE_DIR", folder.join("cache")).args(arguments).output().unwrap()
}

/// The states of the plan of some boxes.
fn states(folder: &Path, parts: &[(&str, String)], plan: &[&str], statics: &[&str]) -> Vec<Value> {
    let assembly = folder.join("assembly");
    fs::create_dir_all(&assembly).unwrap();
    for (name, mesh) in parts {
        fs::write(assembly.join(format!("{name}.obj")), mesh).unwrap();
    }
    let planned =
        sbdp(folder, &[&["plan", "assembly", "--embedded", "-q", "--json", "plan.json"], plan].concat());
    assert!(planned.status.success(), "{planned:?}");
    let found = sbdp(folder, &[&["statics", "plan.json", "--json", "-"], statics].concat());
    assert!(found.status.success(), "{found:?}");
    let document: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(document["schema"], "sbdp-statics/1");
    document["states"].as_array().unwrap().clone()
}

/// A table, a beam that reaches over its edge, and a block that keeps the beam from tipping.
fn counterweight() -> [(&'static str, String); 3] {
    [
        ("table", cuboid([0.0, 0.0, 0.0], [100.0, 60.0, 20.0])),
        ("beam", cuboid([50.0, 20.0, 20.0], [190.0, 40.0, 30.0])),
        ("weight", cuboid([50.0, 15.0, 30.0], [75.0, 45.0, 70.0])),
    ]
}

#[test]
fn a_beam_falls_once_its_counterweight_is_gone() {
    let folder = tempfile::tempdir().unwrap();
    let plan = ["--base", "table", "--target", "weight"];
    let states = states(folder.path(), &counterweight(), &plan, &["--stays", "table", "--margin"]);
    let [before, after] = &states[..] else { panic!("{states:?}") };
    assert_eq!(before["standing"].as_array().unwrap().len(), 3);
    assert_eq!((&before["unstable"], &before["needs_friction"]), (&Value::Array(vec![]), &Value::from(0.0)));
    assert!(before["margin"].as_f64().unwrap() > 0.1, "{before}");
    let [unstable] = &after["unstable"].as_array().unwrap()[..] else { panic!("{after}") };
    assert_eq!(unstable["falls"][0]["part"], "beam");
    assert_eq!(unstable["hold"], serde_json::json!([["beam"]]));
    assert_eq!((&unstable["needs_clamping"], &after["margin"]), (&Value::Bool(false), &Value::Null));
}

#[test]
fn nuts_are_joined_to_their_bolts_unless_they_are_named_as_apart() {
    let folder = tempfile::tempdir().unwrap();
    let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/bolted-bracket-20");
    let planned = sbdp(folder.path(), &["plan", bracket, "--embedded", "-q", "--json", "plan.json"]);
    assert!(planned.status.success(), "{planned:?}");
    let statics = |options: &[&str]| {
        let found = sbdp(folder.path(), &[&["statics", "plan.json", "--json", "-"], options].concat());
        assert!(found.status.success(), "{found:?}");
        serde_json::from_slice::<Value>(&found.stdout).unwrap()
    };
    let joined = |document: &Value| document["joined"].as_array().unwrap().clone();
    let found = statics(&[]);
    assert_eq!(
        joined(&found)[0],
        serde_json::json!({"parts": ["back-bolt-1", "back-nut-1"], "by": "fastener"})
    );
    assert!(
        found["states"].as_array().unwrap().iter().all(|state| state["unstable"] == serde_json::json!([]))
    );
    let apart = statics(&["--apart", "nut-1", "bolt-1", "--join", "nut-1", "nut-2"]);
    assert_eq!(joined(&apart).len(), joined(&found).len());
    assert!(joined(&apart).contains(&serde_json::json!({"parts": ["nut-1", "nut-2"], "by": "named"})));
    assert!(joined(&apart).iter().all(|joint| joint["parts"] != serde_json::json!(["bolt-1", "nut-1"])));
}

/// By state, the number of parts that have to be held.
fn hands(states: &Value) -> Vec<usize> {
    let held = |unstable: &Value| unstable["hold"][0].as_array().unwrap().len();
    let of = |state: &Value| state["unstable"].as_array().unwrap().iter().map(held).sum();
    states.as_array().unwrap().iter().map(of).collect()
}

#[test]
fn a_bolt_follows_its_nut_where_it_would_have_to_be_held() {
    let folder = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let found = sbdp(folder.path(), arguments);
        assert!(found.status.success(), "{found:?}");
        found.stdout
    };
    let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/bolted-bracket-20");
    // Upside down, so that bolts hang by their nuts.
    let plan = ["plan", bracket, "--embedded", "-q", "--up=-z", "--json"];
    run(&[&plan[..], &["plan.json"]].concat());
    run(&[&plan[..], &["steady.json", "--steady"]].concat());
    let read = |text: &[u8]| serde_json::from_slice::<Value>(text).unwrap();
    let [before, after] = ["plan.json", "steady.json"]
        .map(|plan| read(&run(&["statics", plan, "--up=-z", "--json", "-"])))
        .map(|document| hands(&document["states"]).into_iter().max().unwrap());
    assert!(after < before, "{before} before, {after} after");
    // It has the same steps, each after those that it requires.
    let [plan, steady] =
        ["plan.json", "steady.json"].map(|file| read(&fs::read(folder.path().join(file)).unwrap()));
    let paths = |plan: &Value| {
        let mut steps: Vec<String> =
            plan["steps"].as_array().unwrap().iter().map(|step| step["path"].to_string()).collect();
        steps.sort();
        steps
    };
    assert_eq!(paths(&plan), paths(&steady));
    let names = |plan: &Value, step: usize| plan["steps"][step]["parts"].to_string();
    let required = |plan: &Value| {
        let mut all: Vec<(String, Vec<String>)> = Vec::new();
        for (i, step) in plan["steps"].as_array().unwrap().iter().enumerate() {
            let before: Vec<usize> =
                step["requires"].as_array().unwrap().iter().map(|r| r.as_u64().unwrap() as usize).collect();
            assert!(before.iter().all(|&r| r < i), "step {i} requires {before:?}");
            let mut before: Vec<String> = before.iter().map(|&r| names(plan, r)).collect();
            before.sort();
            all.push((names(plan, i), before));
        }
        all.sort();
        all
    };
    assert_eq!(required(&plan), required(&steady));
}

/// With as many hands as the order needs, the plan is complete. With one fewer it ends early, and the reason names what has
/// to be held. The daemon answers the same. An assembly plan has the same order backwards.
#[test]
fn a_plan_ends_where_it_needs_more_hands() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = common::Daemon::start();
    let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/bolted-bracket-20");
    let planned = |backend: &str, options: &[&str]| {
        let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
        command.env("SBDP_CACHE_DIR", folder.path().join("cache")).current_dir(folder.path());
        command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir());
        let plan = ["plan", bracket, backend, "-q", "--up=-z", "--report", "stability", "--json", "-"];
        let found = command.args(plan).args(options).output().unwrap();
        (found.status.code(), serde_json::from_slice::<Value>(&found.stdout).unwrap())
    };
    let most = |plan: &Value| {
        let states: Vec<Value> =
            plan["steps"].as_array().unwrap().iter().map(|s| s["stability"].clone()).collect();
        hands(&Value::Array(states)).into_iter().max().unwrap_or(0)
    };
    let (_, steady) = planned("--embedded", &["--steady"]);
    let needed = most(&steady) + 1;
    for backend in ["--embedded", "--daemon"] {
        let (code, plan) = planned(backend, &["--hands", &needed.to_string()]);
        assert_eq!((code, plan["status"].as_str()), (Some(0), Some("complete")));
        assert_eq!(plan["steps"], steady["steps"], "{backend}");
        let (code, plan) = planned(backend, &["--hands", &(needed - 1).to_string()]);
        assert_eq!((code, plan["status"].as_str()), (Some(3), Some("exhausted")));
        let reason = plan["reason"].as_str().unwrap();
        assert!(reason.contains("hand") && reason.contains("to hold"), "{reason}");
        assert!(most(&plan) + 1 < needed, "{plan}");
        let count = |list: &str| plan[list].as_array().unwrap().len();
        assert_eq!(count("steps") + count("remaining"), count("parts"));
    }
    let (_, together) = planned("--embedded", &["--steady", "--assembly"]);
    let order = |plan: &Value| -> Vec<Value> {
        plan["steps"].as_array().unwrap().iter().map(|step| step["parts"].clone()).collect()
    };
    let backwards: Vec<Value> = order(&together).into_iter().rev().collect();
    assert_eq!(backwards, order(&steady));
}

/// Upside down, a slider lies on the roof of its channel, and a pin on the slider. While one hand moves the slider aside,
/// another one has to hold the pin.
#[test]
fn hands_are_counted_while_parts_are_moved_aside() {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    let housing = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/covered-pin/housing.obj");
    fs::copy(housing, parts.join("housing.obj")).unwrap();
    fs::write(parts.join("slider.obj"), cuboid([10.5, 10.5, 10.5], [30.0, 29.5, 20.0])).unwrap();
    fs::write(parts.join("pin.obj"), cuboid([15.0, 16.0, 5.5], [23.0, 24.0, 10.5])).unwrap();
    let planned = |hands: &str| {
        let plan = [
            "plan",
            "parts",
            "--embedded",
            "-q",
            "--up=-z",
            "--fixed",
            "housing",
            "--target",
            "pin",
            "--json",
            "-",
        ];
        let found = sbdp(folder.path(), &[&plan[..], &["--hands", hands]].concat());
        (found.status.code(), serde_json::from_slice::<Value>(&found.stdout).unwrap())
    };
    let (code, plan) = planned("2");
    assert_eq!((code, &plan["steps"][0]["ends"]), (Some(0), &"aside".into()), "{plan}");
    let (code, plan) = planned("1");
    assert_eq!(
        (code, &plan["status"], &plan["steps"]),
        (Some(3), &"exhausted".into(), &serde_json::json!([]))
    );
    let reason = plan["reason"].as_str().unwrap();
    assert!(reason.contains("moves slider: 1 for that, and 1 to hold pin"), "{reason}");
    assert_eq!(plan["remaining"], serde_json::json!(["housing", "pin", "slider"]));
}

#[test]
fn an_assembly_plan_has_the_states_of_the_disassembly_backwards() {
    let folder = tempfile::tempdir().unwrap();
    let parts = [
        ("plate", cuboid([0.0, 0.0, 0.0], [100.0, 60.0, 10.0])),
        ("block", cuboid([40.0, 20.0, 10.0], [60.0, 40.0, 30.0])),
    ];
    let apart = states(folder.path(), &parts, &["--base", "plate"], &[]);
    let together = states(folder.path(), &parts, &["--base", "plate", "--assembly"], &[]);
    assert_eq!(apart.len(), 2);
    for (one, other) in apart.iter().zip(together.iter().rev()) {
        for field in ["standing", "needs_friction", "margin", "unstable"] {
            assert_eq!(one[field], other[field], "{field}");
        }
    }
}

#[test]
fn questions_that_have_no_answer_are_refused_with_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    states(folder.path(), &counterweight(), &["--base", "table"], &[]);
    for (arguments, words) in [
        (&["statics", "plan.json", "--stays", "nobody"][..], "no part `nobody`"),
        (&["statics", "plan.json", "--join", "beam", "nobody"], "--join: the plan has no part `nobody`"),
        (&["statics", "plan.json", "--apart", "nobody", "beam"], "--apart: the plan has no part `nobody`"),
        (&["statics", "plan.json", "--join", "beam"], "2 values required"),
        (&["statics", "plan.json", "--friction", "-1"], "from 0 up"),
        (&["statics", "plan.json", "--friction", "nan"], "from 0 up"),
        (&["statics", "plan.json", "--up", "0,0,0"], "one is not 0"),
        (&["statics", "nowhere.json"], "nowhere.json"),
    ] {
        let output = sbdp(folder.path(), arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(words), "{arguments:?}: {error}");
    }
}
