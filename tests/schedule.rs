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

#[test]
fn a_line_has_all_steps_in_order_and_more_stations_are_faster() {
    let folder = bracket(&["--steady", "--up=-z"]);
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let steps = plan["steps"].as_array().unwrap().len();
    let mut last = f64::INFINITY;
    for count in [1, 2, 3, steps, steps + 2] {
        let found = scheduled(folder.path(), &["--stations", &count.to_string(), "--up=-z"]);
        assert_eq!(found["schema"], "sbdp-line/1");
        let stations = found["stations"].as_array().unwrap();
        assert_eq!(stations.len(), count);
        let in_order: Vec<u64> = stations
            .iter()
            .flat_map(|station| station["steps"].as_array().unwrap())
            .map(|step| step.as_u64().unwrap())
            .collect();
        assert_eq!(in_order, (0..steps as u64).collect::<Vec<_>>());
        let seconds: Vec<f64> = stations.iter().map(|station| station["seconds"].as_f64().unwrap()).collect();
        let (cycle, work) = (found["cycle"].as_f64().unwrap(), found["work"].as_f64().unwrap());
        assert_eq!(cycle, seconds.iter().copied().fold(0.0, f64::max));
        assert!((seconds.iter().sum::<f64>() - work).abs() < 1e-9 && cycle >= work / count as f64 - 1e-9);
        assert!(cycle <= last, "{count} stations: {cycle}, fewer: {last}");
        last = cycle;
        // Upside down something hangs by its nut, and is held while that comes off.
        let hands = stations.iter().map(|station| station["hands"].as_u64().unwrap()).max();
        assert_eq!(hands, Some(2), "{found}");
    }
    let refused = sbdp(folder.path(), &["schedule", "plan.json", "--stations", "2", "--arms", "2"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}

/// The actions of a domain in STRIPS: the name of each, and the names in its precondition and its effect.
fn actions(domain: &str) -> Vec<(String, Vec<String>, Vec<String>)> {
    let without_comments: Vec<&str> =
        domain.lines().map(|line| line.split(';').next().unwrap_or_default()).collect();
    let text = without_comments.join(" ");
    let depth = |c: char| i32::from(c == '(') - i32::from(c == ')');
    assert_eq!(text.chars().map(depth).sum::<i32>(), 0, "{text}");
    let facts = |text: &str| -> Vec<String> {
        let names = text.split(['(', ')', ' ']).filter(|word| word.starts_with("done-"));
        names.map(str::to_owned).collect()
    };
    let action = |text: &str| {
        let (name, rest) = text.trim().split_once(' ').unwrap();
        let (before, effect) = rest.split_once(":effect").unwrap();
        (name.to_owned(), facts(before), facts(effect))
    };
    text.split("(:action").skip(1).map(action).collect()
}

#[test]
fn the_same_precedence_is_written_as_dot_json_and_pddl() {
    let folder = bracket(&[]);
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let steps = plan["steps"].as_array().unwrap();
    let read = |file: &str| {
        let found = sbdp(folder.path(), &["precedence", "plan.json", "-o", file]);
        assert!(found.status.success(), "{found:?}");
        fs::read_to_string(folder.path().join(file)).unwrap()
    };
    let json: Value = serde_json::from_str(&read("order.json")).unwrap();
    let numbers = |list: &Value| -> Vec<usize> {
        list.as_array().unwrap().iter().map(|step| step.as_u64().unwrap() as usize).collect()
    };
    let after: Vec<Vec<usize>> =
        json["steps"].as_array().unwrap().iter().map(|step| numbers(&step["after"])).collect();
    // What comes before a step, in turn, is what it requires, in turn; and no entry is among those of another.
    let all = |direct: &dyn Fn(usize) -> Vec<usize>, step: usize| {
        let (mut found, mut open) = (std::collections::BTreeSet::new(), direct(step));
        while let Some(before) = open.pop() {
            if found.insert(before) {
                open.extend(direct(before));
            }
        }
        found
    };
    let requires = |step: usize| numbers(&steps[step]["requires"]);
    let directly = |step: usize| after[step].clone();
    for (step, before_it) in after.iter().enumerate() {
        assert_eq!(all(&requires, step), all(&directly, step));
        for before in before_it {
            assert!(before_it.iter().all(|&other| !all(&directly, other).contains(before)), "step {step}");
        }
    }
    let dot = read("order.dot");
    assert_eq!(dot.matches(" -> ").count(), after.iter().map(Vec::len).sum::<usize>());
    assert_eq!(dot.matches("[label=").count(), steps.len());

    let problem = read("order.pddl");
    let actions = actions(&fs::read_to_string(folder.path().join("order-domain.pddl")).unwrap());
    assert_eq!(actions.len(), steps.len());
    for (step, (name, before, effect)) in actions.iter().enumerate() {
        assert_eq!(name, &format!("step-{}", step + 1));
        let done = |step: usize| format!("done-{}", step + 1);
        assert_eq!(before, &after[step].iter().map(|&step| done(step)).collect::<Vec<_>>());
        assert_eq!(effect, &[done(step)]);
        assert!(problem.contains(&format!("({})", done(step))), "{problem}");
    }
    let refused = sbdp(folder.path(), &["precedence", "plan.json", "-o", "order.txt"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
}
