//! `sbdp tools`, from outside.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn sbdp(folder: &Path, arguments: &[&str]) -> Output {
    let command = &mut Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.current_dir(folder).env("SBDP_CACHE_DIR", folder.join("cache")).args(arguments).output().unwrap()
}

/// A folder with the plan of one of the assemblies for tests.
fn planned(assembly: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let assembly = format!("{}/tests/assemblies/{assembly}", env!("CARGO_MANIFEST_DIR"));
    let found = sbdp(folder.path(), &["plan", &assembly, "--embedded", "-q", "--json", "plan.json"]);
    assert!(found.status.success(), "{found:?}");
    folder
}

#[test]
fn every_nut_and_bolt_of_the_bracket_has_its_size_and_its_tools() {
    let folder = planned("bolted-bracket-20");
    let found = sbdp(folder.path(), &["tools", "plan.json", "--json", "-", "--required"]);
    assert!(found.status.success(), "{found:?}");
    let document: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(document["schema"], "sbdp-tools/2");
    let steps = document["steps"].as_array().unwrap();
    assert_eq!(steps.len(), 12, "six bolts and six nuts: {document}");
    for step in steps {
        let part = step["part"].as_str().unwrap();
        assert!(part.contains("nut") || part.contains("bolt"), "{step}");
        assert!((step["size"].as_f64().unwrap() - 9.53).abs() < 0.01, "{step}");
        let tools = step["tools"].as_array().unwrap();
        let names: Vec<&str> = tools.iter().map(|tool| tool["tool"].as_str().unwrap()).collect();
        assert_eq!(names, ["socket", "ring_spanner", "open_end_wrench"]);
        for tool in tools {
            let swing = tool["swing"].as_f64().unwrap();
            assert!(tool["fits"] == true && (60.0..=360.0).contains(&swing), "{step}");
            assert_eq!(tool["blocked_by"].as_array().unwrap().is_empty(), swing == 360.0, "{step}");
        }
    }
    let table = sbdp(folder.path(), &["tools", "plan.json"]);
    let table = String::from_utf8_lossy(&table.stdout);
    assert!(table.contains("9.53 mm") && table.contains("all around"), "{table}");
}

#[test]
fn an_assembly_without_fasteners_has_no_tools() {
    let folder = planned("l-slot");
    let found = sbdp(folder.path(), &["tools", "plan.json", "--required"]);
    assert!(found.status.success(), "{found:?}");
    assert!(String::from_utf8_lossy(&found.stdout).starts_with("No step takes off"), "{found:?}");
    let found = sbdp(folder.path(), &["tools", "none.json"]);
    assert!(found.status.code() == Some(2), "{found:?}");
}
