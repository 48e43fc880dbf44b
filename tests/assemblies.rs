//! The small assemblies in `tests/assemblies`: what is kept is what the generator makes, and
//! all of it is sound.

#[path = "assemblies/generator/mod.rs"]
mod generator;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use sbdp::files::load_assembly;
use sbdp::geometry::{Solidity, heal};

fn here() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies")
}

#[test]
fn the_kept_files_are_what_the_generator_makes() {
    let mut made = BTreeSet::new();
    for (path, bytes) in generator::all_files() {
        let kept = fs::read(here().join(&path)).unwrap_or_default();
        assert!(kept == bytes, "{path} differs: run `cargo run --example make-assemblies`");
        made.insert(here().join(path));
    }
    for entry in fs::read_dir(here()).unwrap().map(|e| e.unwrap().path()) {
        let inside = fs::read_dir(&entry).map(|d| d.map(|e| e.unwrap().path()).collect());
        for file in inside.unwrap_or_else(|_| vec![entry.clone()]) {
            let source = file.extension().is_some_and(|e| e == "rs");
            assert!(source || made.contains(&file), "{} is not made by the generator", file.display());
        }
    }
}

#[test]
fn every_part_is_closed_and_needs_no_healing() {
    for (name, parts) in [
        ("bolt-washer-plate", 3),
        ("pin-bolt-cover", 4),
        ("l-slot", 2),
        ("threaded-bolt-and-nut", 2),
        ("linked-rings", 2),
        ("bolted-bracket-20", 20),
        ("pinned-block", 4),
        ("covered-pin", 3),
        ("translated", 3),
        ("peg-stl", 2),
        ("pegs.glb", 3),
    ] {
        let assembly = load_assembly(&here().join(name)).unwrap();
        assert_eq!(assembly.parts.len(), parts, "{name}");
        for part in &assembly.parts {
            let healed = heal(part).unwrap();
            assert_eq!(healed.mesh.solidity, Solidity::Closed, "{name}/{}: {:?}", part.name, healed.findings);
            assert_eq!(healed.findings, [""; 0], "{name}/{}", part.name);
            assert!(healed.mesh.volume() > 0.0);
        }
    }
}

#[test]
fn offsets_bring_the_translated_parts_to_their_places() {
    let placed = load_assembly(&here().join("bolt-washer-plate")).unwrap();
    let translated = load_assembly(&here().join("translated")).unwrap();
    for (a, b) in placed.parts.iter().zip(&translated.parts) {
        assert_eq!(a.name, b.name);
        let far = a.mesh.vertices.iter().flatten().zip(b.mesh.vertices.iter().flatten());
        assert!(far.map(|(x, y)| (x - y).abs()).fold(0.0, f64::max) < 1e-9, "{}", a.name);
    }
}

#[test]
fn scene_nodes_give_poses_and_names() {
    let scene = load_assembly(&here().join("pegs.glb")).unwrap();
    let names: Vec<&str> = scene.parts.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["peg", "peg-2", "plate"]);
    assert_eq!(scene.units.as_deref(), Some("m"));
    // The plate stands on edge, thick along −y, its middle at (2, ·, 0.5).
    let (lo, hi) = heal(&scene.parts[2]).unwrap().mesh.bounds();
    assert_eq!(
        (lo.coords.as_slice(), hi.coords.as_slice()),
        (&[1.5, -0.125, 0.25][..], &[2.5, 0.0, 0.75][..])
    );
}
