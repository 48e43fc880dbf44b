//! `sbdp schedule`, from outside.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn sbdp(folder: &Path, arguments: &[&str]) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.current_dir(folder).env("SBDP_CACHE_DIR", folder.join("cache")).args(arguments).output().unwrap()
}

/// A folder with the plan of the bracket that is bolted on.
fn bracket(plan: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let bracket = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/bolted-bracket-20");
    let planned =
        sbdp(folder.path(), &[&["plan", bracket, "--embedded", "-q", "--json", "plan.json"], plan].concat());
    assert!(planned.status.success(), "{planned:?}");
    folder
}

fn scheduled(folder: &Path, options: &[&str]) -> Value {
    let found = sbdp(folder, &[&["schedule", "plan.json", "--json", "-"], options].concat());
    assert!(found.status.success(), "{found:?}");
    serde_json::from_slice(&found.stdout).unwrap()
}

#[test]
fn more_arms_are_faster_until_the_longest_chain_is_left() {
    let folder = bracket(&[]);
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let number = |value: &Value| value.as_u64().unwrap() as usize;
    let mut last = f64::INFINITY;
    for arms in ["1", "2", "4", "100"] {
        let found = scheduled(folder.path(), &["--arms", arms]);
        assert_eq!(found["schema"], "sbdp-schedule/1");
        let steps = found["steps"].as_array().unwrap();
        assert_eq!(steps.len(), plan["steps"].as_array().unwrap().len());
        let at = |step: usize| steps.iter().find(|s| number(&s["step"]) == step).unwrap();
        let time = |step: &Value, field: &str| step[field].as_f64().unwrap();
        for (place, step) in steps.iter().enumerate() {
            for before in plan["steps"][number(&step["step"])]["requires"].as_array().unwrap() {
                assert!(time(at(number(before)), "end") <= time(step, "begin"));
            }
            let is_going_on = |other: &&Value| time(step, "begin") < time(other, "end");
            let busy = steps[..=place].iter().filter(is_going_on).count();
            assert!(busy + number(&step["held"]) <= arms.parse().unwrap(), "{arms} arms: {step}");
        }
        let (seconds, work) = (found["seconds"].as_f64().unwrap(), found["work"].as_f64().unwrap());
        let chain: f64 = found["critical"]
            .as_array()
            .unwrap()
            .iter()
            .map(|s| time(at(number(s)), "end") - time(at(number(s)), "begin"))
            .sum();
        assert!(
            chain <= seconds + 1e-9
                && seconds <= last
                && work / arms.parse::<f64>().unwrap() <= seconds + 1e-9
        );
        assert!(arms != "1" || (seconds - work).abs() < 1e-9);
        last = seconds;
    }
    assert!(last < scheduled(folder.path(), &["--arms", "1"])["seconds"].as_f64().unwrap() / 2.0);
}

#[test]
fn times_come_from_a_file() {
    let folder = bracket(&["--target", "bolt-1"]);
    fs::write(folder.path().join("times.toml"), "grasp = 10\nput_down = 20.5\nspeed = 1e9\nturn = 0\n")
        .unwrap();
    let found = scheduled(folder.path(), &["--times", "times.toml", "--arms", "1", "--weightless"]);
    let steps = found["steps"].as_array().unwrap().len();
    assert!((found["seconds"].as_f64().unwrap() - 30.5 * steps as f64).abs() < 1e-3, "{found}");
    for (text, words) in [
        ("speed = 0", "`speed` must be a finite number above 0"),
        ("grasp = -1", "`grasp` must be a finite number from 0 up"),
        ("grip = 1", "unknown field `grip`"),
        ("grasp =", "times.toml"),
    ] {
        fs::write(folder.path().join("times.toml"), text).unwrap();
        let refused = sbdp(folder.path(), &["schedule", "plan.json", "--times", "times.toml"]);
        let error = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{text}: {error}");
        assert!(error.contains(words), "{text}: {error}");
    }
}

#[test]
fn too_few_arms_to_hold_and_plans_with_a_fixed_order_are_refused_with_what_to_do() {
    // Upside down, a bolt falls once its nut is off.
    let folder = bracket(&["--target", "bolt-1"]);
    let refused = sbdp(folder.path(), &["schedule", "plan.json", "--arms", "1", "--up=-z"]);
    let error = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2), "{error}");
    assert!(error.contains("1 to move and 1 to hold"), "{error}");
    scheduled(folder.path(), &["--arms", "2", "--up=-z"]);
    scheduled(folder.path(), &["--arms", "1", "--up=-z", "--weightless"]);
    let folder = bracket(&["--assembly"]);
    let refused = sbdp(folder.path(), &["schedule", "plan.json"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("plan the disassembly"), "{refused:?}");
}
