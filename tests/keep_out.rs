//! What is only in the way: `--keep-out`, `--floor`, and the same through the daemon.

mod common;

use std::fs;
use std::path::Path;
use std::process::Command;

use serde_json::{Value, json};

/// A box as an OBJ file.
fn cuboid(file: &Path, lo: [f64; 3], hi: [f64; 3]) {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { lo[a] } else { hi[a] });
    let vertices: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    fs::write(file, vertices + faces).unwrap();
}

/// A block in a box whose walls are parts, and which is open below alone.
fn box_open_below(folder: &Path) {
    let parts = folder.join("parts");
    fs::create_dir(&parts).unwrap();
    cuboid(&parts.join("block.obj"), [1.0, 1.0, 1.0], [9.0, 9.0, 9.0]);
    cuboid(&parts.join("front.obj"), [-2.0, -2.0, 0.0], [12.0, 0.0, 10.0]);
    cuboid(&parts.join("left.obj"), [-2.0, 0.0, 0.0], [0.0, 10.0, 10.0]);
    cuboid(&parts.join("rear.obj"), [-2.0, 10.0, 0.0], [12.0, 12.0, 10.0]);
    cuboid(&parts.join("right.obj"), [10.0, 0.0, 0.0], [12.0, 10.0, 10.0]);
    cuboid(&parts.join("roof.obj"), [-2.0, -2.0, 10.0], [12.0, 12.0, 12.0]);
}

fn planned(folder: &Path, runtime: Option<&Path>, options: &[&str]) -> (Option<i32>, Value) {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.current_dir(folder).env("SBDP_CACHE_DIR", folder.join("cache"));
    let backend = match runtime {
        Some(runtime) => command.env("SBDP_RUNTIME_DIR", runtime).args(["plan", "parts", "--daemon"]),
        None => command.args(["plan", "parts", "--embedded"]),
    };
    let found = backend.args(["-q", "--json", "-"]).args(options).output().unwrap();
    assert!(!found.stdout.is_empty(), "{found:?}");
    (found.status.code(), serde_json::from_slice(&found.stdout).unwrap())
}

#[test]
fn nothing_passes_below_the_floor() {
    let folder = tempfile::tempdir().unwrap();
    box_open_below(folder.path());
    let walls = ["front", "left", "rear", "right", "roof"].map(|part| ["--fixed", part]).concat();
    let with = |options: &[&str]| planned(folder.path(), None, &[&walls[..], options].concat());
    let (code, plan) = with(&[]);
    assert_eq!((code, &plan["remaining"]), (Some(0), &json!(["front", "left", "rear", "right", "roof"])));
    // Of the block, no more than the gap below it can be used.
    let (code, plan) = with(&["--floor"]);
    assert_eq!((code, &plan["steps"]), (Some(3), &json!([])), "{plan}");
    assert!(plan["fixed"].as_array().unwrap().contains(&json!("floor")), "{plan}");
    // Upside down, the roof is on the floor.
    assert_eq!(with(&["--floor", "--up=-z"]).0, Some(0));
    // What was planned can be shown and measured again.
    let file = folder.path().join("plan.json");
    fs::write(&file, with(&["--floor", "--up=-z"]).1.to_string()).unwrap();
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    let found =
        command.current_dir(folder.path()).args(["clearance", "plan.json", "--json", "-"]).output().unwrap();
    let found: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(found["steps"][0]["closest"]["assembled"], json!(1.0), "{found}");
}

/// A base is chosen, parts stand on the floor, and the last part may stay on it.
#[test]
fn what_is_in_the_way_is_no_base_and_no_part_that_is_left() {
    let folder = tempfile::tempdir().unwrap();
    let daemon = common::Daemon::start();
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    cuboid(&parts.join("a.obj"), [0.0, 0.0, 0.0], [8.0, 8.0, 4.0]);
    cuboid(&parts.join("b.obj"), [2.0, 2.0, 4.0], [6.0, 6.0, 8.0]);
    cuboid(&parts.join("table.obj"), [-9.0, -9.0, -2.0], [20.0, 20.0, 0.0]);
    let (_, fixed) = planned(folder.path(), None, &["--fixed", "table"]);
    assert_eq!((&fixed["base"], fixed["steps"].as_array().unwrap().len()), (&json!([]), 2));
    let options = ["--keep-out", "table", "--report", "stability", "--up", "+z"];
    let (code, plan) = planned(folder.path(), None, &options);
    assert_eq!((code, &plan["base"], &plan["remaining"]), (Some(0), &json!(["a"]), &json!(["a", "table"])));
    assert_eq!(plan["initial"]["stability"]["unstable"], json!([]), "{plan}");
    let (code, other) = planned(folder.path(), Some(&daemon.runtime_dir()), &options);
    assert_eq!((code, &other["steps"], &other["base"]), (Some(0), &plan["steps"], &plan["base"]));
    // Alone it may stay on the table, unless it is asked for.
    let alone = ["--keep-out", "table", "--removed", "b"];
    let (code, stays) = planned(folder.path(), None, &alone);
    assert_eq!((code, &stays["steps"]), (Some(0), &json!([])), "{stays}");
    let (code, leaves) = planned(folder.path(), None, &[&alone[..], &["--target", "a"]].concat());
    assert_eq!((code, &leaves["remaining"]), (Some(0), &json!(["table"])), "{leaves}");
    // The description of the assembly may say it.
    fs::write(parts.join("assembly.json"), r#"{"keep_out": ["table"]}"#).unwrap();
    assert_eq!(planned(folder.path(), None, &[]).1["base"], json!(["a"]));
    fs::write(parts.join("assembly.json"), r#"{"keep_out": ["desk"]}"#).unwrap();
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    let refused = command.current_dir(folder.path()).args(["plan", "parts", "--embedded"]).output().unwrap();
    assert!(String::from_utf8_lossy(&refused.stderr).contains("there is no part `desk`"), "{refused:?}");
}
