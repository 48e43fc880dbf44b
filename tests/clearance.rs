//! `sbdp clearance`, from outside.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn sbdp(folder: &Path, arguments: &[&str]) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.current_dir(folder).env("SBDP_CACHE_DIR", folder.join("cache")).args(arguments).output().unwrap()
}

/// A box as an OBJ file.
fn cuboid(file: &Path, lo: [f64; 3], hi: [f64; 3]) {
    let corner = |i: usize| [0, 1, 2].map(|a| if i >> a & 1 == 0 { lo[a] } else { hi[a] });
    let vertices: String = (0..8).map(corner).map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    let faces = "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
    fs::write(file, vertices + faces).unwrap();
}

/// A block that lies on a plate between two walls, 2 from the one and 3 from the other, and a way out of it.
fn block_between_walls(path: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    cuboid(&parts.join("block.obj"), [0.0; 3], [10.0, 10.0, 10.0]);
    cuboid(&parts.join("left.obj"), [-8.0, -20.0, 0.0], [-2.0, 20.0, 30.0]);
    cuboid(&parts.join("plate.obj"), [-20.0, -20.0, -5.0], [30.0, 20.0, 0.0]);
    cuboid(&parts.join("right.obj"), [13.0, -20.0, 0.0], [20.0, 20.0, 30.0]);
    let fixed = ["--fixed", "left", "--fixed", "plate", "--fixed", "right"];
    let command = [&["plan", "parts", "--embedded", "-q", "--json", "plan.json"], &fixed[..]].concat();
    sbdp(folder.path(), &command);
    let file = folder.path().join("plan.json");
    let mut plan: Value = serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
    assert_eq!(plan["steps"][0]["parts"], serde_json::json!(["block"]));
    plan["steps"][0]["path"] = serde_json::from_str(path).unwrap();
    fs::write(file, plan.to_string()).unwrap();
    folder
}

fn clearance(folder: &Path, options: &[&str]) -> (Option<i32>, Value) {
    let command = [&["clearance", "plan.json", "--meshes", "parts", "--json", "-"], options].concat();
    let found = sbdp(folder, &command);
    assert!(!found.stdout.is_empty(), "{found:?}");
    (found.status.code(), serde_json::from_slice(&found.stdout).unwrap())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn the_nearest_wall_on_the_way_is_named_with_its_distance() {
    // Aside by 1.5 towards the left wall on its way up.
    let up = "[[0,0,0,1,0,0,0], [-1.5,0,8,1,0,0,0], [0,0,60,1,0,0,0]]";
    let folder = block_between_walls(up);
    let (code, found) = clearance(folder.path(), &[]);
    assert_eq!((code, &found["schema"]), (Some(0), &"sbdp-clearance/1".into()));
    let step = &found["steps"][0];
    assert_eq!(step["touching"], serde_json::json!(["plate"]));
    let closest = &step["closest"];
    assert_eq!((&closest["moving"], &closest["standing"]), (&"block".into(), &"left".into()));
    assert!((number(&closest["distance"]) - 0.5).abs() < 1e-6, "{closest}");
    assert!((0.49..=0.5).contains(&number(&closest["at_least"])), "{closest}");
    assert!((number(&closest["assembled"]) - 2.0).abs() < 1e-6, "{closest}");
    let place = number(&closest["segment"]) + number(&closest["share"]);
    assert!((place - 1.0).abs() < 1e-3, "{closest}");
}

#[test]
fn what_is_wanted_is_asked_of_parts_that_have_it() {
    let folder = block_between_walls("[[0,0,0,1,0,0,0], [-1.5,0,8,1,0,0,0], [0,0,60,1,0,0,0]]");
    for (wanted, code, short) in [("0.4", 0, 0), ("0.6", 3, 1), ("2.5", 3, 1), ("9", 3, 1)] {
        let (found, document) = clearance(folder.path(), &["--at-least", wanted]);
        let pairs = document["steps"][0]["short"].as_array().unwrap();
        assert_eq!((found, pairs.len()), (Some(code), short), "{wanted}: {pairs:?}");
    }
    // Straight up it keeps the 2 and 3 that it has, whatever is wanted.
    let folder = block_between_walls("[[0,0,0,1,0,0,0], [0,0,60,1,0,0,0]]");
    assert_eq!(clearance(folder.path(), &["--at-least", "9"]).0, Some(0));
    let text = sbdp(folder.path(), &["clearance", "plan.json", "--meshes", "parts", "--at-least", "9"]);
    assert!(
        String::from_utf8_lossy(&text.stdout).contains("All parts keep 9.00, or what they have"),
        "{text:?}"
    );
}

#[test]
fn a_part_that_slides_along_a_wall_has_no_distance_from_it() {
    let folder = block_between_walls("[[0,0,0,1,0,0,0], [-2,0,0,1,0,0,0], [-2,0,60,1,0,0,0]]");
    let closest = &clearance(folder.path(), &[]).1["steps"][0]["closest"];
    assert_eq!((&closest["standing"], number(&closest["at_least"])), (&"left".into(), 0.0));
    assert!(number(&closest["distance"]) < 1e-6, "{closest}");
}

#[test]
fn what_cannot_be_asked_is_refused_by_name() {
    let folder = block_between_walls("[[0,0,0,1,0,0,0], [0,0,60,1,0,0,0]]");
    let other = sbdp(folder.path(), &["clearance", "plan.json", "--meshes", "parts/left.obj"]);
    let text = String::from_utf8_lossy(&other.stderr);
    assert!(other.status.code() == Some(2) && text.contains("other parts"), "{other:?}");
    let folder = block_between_walls("[]");
    for (arguments, named) in [
        (vec!["clearance", "plan.json", "--meshes", "parts"], "`steps[0].path` is empty"),
        (vec!["clearance", "plan.json", "--at-least", "-1"], "from 0 up"),
        (vec!["clearance", "none.json"], "none.json"),
    ] {
        let found = sbdp(folder.path(), &arguments);
        let text = String::from_utf8_lossy(&found.stderr);
        assert!(found.status.code() == Some(2) && text.contains(named), "{arguments:?}: {found:?}");
    }
}

/// The slider of a closed room leaves through the hole in its roof; a way that touches the wall is pushed away from it.
#[test]
fn a_plan_keeps_the_clearance_that_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let parts = folder.path().join("parts");
    fs::create_dir(&parts).unwrap();
    // A roof over the block leaves it one way: towards the right wall, and up along it.
    cuboid(&parts.join("block.obj"), [0.0, 0.0, 0.5], [10.0, 10.0, 10.0]);
    cuboid(&parts.join("left.obj"), [-8.0, -20.0, 0.0], [-2.0, 20.0, 30.0]);
    cuboid(&parts.join("plate.obj"), [-20.0, -20.0, -5.0], [40.0, 20.0, 0.0]);
    cuboid(&parts.join("right.obj"), [30.0, -20.0, 0.0], [38.0, 20.0, 30.0]);
    cuboid(&parts.join("roof.obj"), [-2.0, -20.0, 12.0], [16.0, 20.0, 14.0]);
    cuboid(&parts.join("front.obj"), [-8.0, -24.0, 0.0], [38.0, -20.0, 30.0]);
    cuboid(&parts.join("rear.obj"), [-8.0, 20.0, 0.0], [38.0, 24.0, 30.0]);
    let fixed = ["left", "plate", "right", "roof", "front", "rear"].map(|part| ["--fixed", part]).concat();
    let planned = |clearance: &str| {
        let command = ["plan", "parts", "--embedded", "-q", "--json", "plan.json", "--clearance", clearance];
        sbdp(folder.path(), &[&command[..], &fixed].concat()).status.code()
    };
    // There are 14 between the roof and the wall, and the block has 10 of them. The roof is 2 above it: it keeps 1 from that at
    // least.
    for (given, code) in [("1.5", Some(0)), ("4", Some(3))] {
        assert_eq!(planned(given), code, "{given}");
        if code == Some(0) {
            assert_eq!(clearance(folder.path(), &["--at-least", given]).0, Some(0));
        }
    }
    let plan: Value = serde_json::from_slice(&fs::read(folder.path().join("plan.json")).unwrap()).unwrap();
    let reason = plan["reason"].as_str().unwrap();
    assert!(plan["status"] == "exhausted" && reason.contains("% of the wanted distance from"), "{reason}");
}

#[test]
fn what_is_not_certain_is_not_said_to_be_kept() {
    // All along the thread, the flanks of bolt and nut are equally near: more than can be looked into.
    let folder = tempfile::tempdir().unwrap();
    let assembly = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/assemblies/threaded-bolt-and-nut");
    sbdp(folder.path(), &["plan", assembly, "--embedded", "-q", "--json", "plan.json"]);
    let found = sbdp(folder.path(), &["clearance", "plan.json", "--at-least", "1", "--json", "-"]);
    let document: Value = serde_json::from_slice(&found.stdout).unwrap();
    let pairs = document["steps"][0]["short"].as_array().unwrap();
    assert_eq!((found.status.code(), pairs.len()), (Some(3), 1), "{document}");
    let [bound, distance, assembled] =
        ["at_least", "distance", "assembled"].map(|key| number(&pairs[0][key]));
    assert!(bound < 0.98 * assembled && bound <= distance, "{document}");
}
