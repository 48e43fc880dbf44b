//! Hashes the sources that the answers of each stage depend on.
//!
//! A stage's hash is part of the keys of what the stage remembers (`src/cache/FORMAT.md`), so no build finds an answer
//! of other sources. It covers `Cargo.lock` (all of it: answers depend on numerical crates), the stage's own sources,
//! and the hashes of the stages that it depends on. Files that have only tests do not count.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

/// Every stage, and the stages that its code imports. A stage comes after all that it depends on.
/// `.ci/structure` compares this table with the imports.
const STAGES: [(&str, &str); 25] = [
    ("lru", ""),
    ("termination", ""),
    ("tolerances", ""),
    ("budgets", ""),
    ("ipc", ""),
    ("cache", "lru"),
    ("config", "cache ipc"),
    ("geometry", "budgets cache termination tolerances"),
    ("files", "budgets geometry tolerances"),
    ("sdf", "cache geometry termination"),
    ("scene", "budgets cache geometry lru sdf termination tolerances"),
    ("rrt", "geometry scene termination"),
    ("contact", "budgets geometry scene sdf termination tolerances"),
    ("fasteners", "geometry tolerances"),
    ("statics", "budgets geometry scene termination tolerances"),
    ("tools", "contact fasteners geometry termination tolerances"),
    ("simulation", "budgets cache contact geometry scene sdf termination tolerances"),
    ("blocking_graph", "cache geometry scene simulation termination"),
    ("plan", "budgets cache contact geometry scene termination tolerances"),
    (
        "search",
        "blocking_graph budgets cache contact geometry plan rrt scene simulation termination tolerances",
    ),
    ("assembling", "contact geometry plan rrt scene search termination"),
    (
        "service",
        "assembling blocking_graph budgets cache contact fasteners geometry lru plan scene sdf search simulation statics termination tolerances tools",
    ),
    ("document", "files geometry ipc plan"),
    ("report", "document geometry ipc plan service statics termination tools"),
    (
        "daemon",
        "blocking_graph cache config files geometry ipc lru plan report search service simulation termination",
    ),
];

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    println!("cargo:rustc-env=SBDP_BUILD={}", build(&root));
    println!("cargo:rerun-if-changed=Cargo.lock");
    let lock = fs::read(root.join("Cargo.lock"))?;
    let mut hashes: HashMap<&str, u64> = HashMap::new();
    for (stage, dependencies) in STAGES {
        let mut hasher = DefaultHasher::new();
        lock.hash(&mut hasher);
        for dependency in dependencies.split_whitespace() {
            let undeclared = || io::Error::other(format!("{stage} comes before {dependency}"));
            hashes.get(dependency).ok_or_else(undeclared)?.hash(&mut hasher);
        }
        let places = [format!("src/{stage}"), format!("src/{stage}.rs"), format!("{stage}/src")];
        let place = places.iter().find(|place| root.join(place).exists());
        let place = place.ok_or_else(|| io::Error::other(format!("{stage} has no sources")))?;
        println!("cargo:rerun-if-changed={place}");
        add(&mut hasher, &root, Path::new(place))?;
        let hash = hasher.finish();
        println!("cargo:rustc-env=SBDP_SOURCES_{}={hash:016x}", stage.to_uppercase());
        hashes.insert(stage, hash);
    }
    Ok(())
}

/// The version, and of a release build from a repository its commit and the commit's date. Other builds are made too
/// often for that: each commit would build everything anew.
fn build(root: &Path) -> String {
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let is_release = env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let git = |arguments: &[&str]| {
        let output = Command::new("git").arg("-C").arg(root).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let commit = is_release.then(|| git(&["log", "-1", "--format=%h %cs", "--", "."])).flatten();
    // What moves with each commit, wherever the repository lies.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|_| is_release) {
        println!("cargo:rerun-if-changed={}", root.join(log).display());
    }
    match commit.filter(|commit| !commit.is_empty()) {
        Some(commit) => format!("{version} ({commit})"),
        None => version,
    }
}

/// Adds a source file's name and content, or the files of a folder in the order of their names.
fn add(hasher: &mut DefaultHasher, root: &Path, path: &Path) -> io::Result<()> {
    let file = root.join(path);
    if file.is_dir() {
        let entries = fs::read_dir(file)?.map(|entry| entry.map(|e| path.join(e.file_name())));
        let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
        entries.sort();
        return entries.iter().try_for_each(|entry| add(hasher, root, entry));
    }
    let stem = path.file_stem().map(|stem| stem.to_string_lossy()).unwrap_or_default();
    let is_source = path.extension().is_some_and(|extension| extension == "rs");
    if is_source && stem != "tests" && !stem.ends_with("_tests") {
        path.hash(hasher);
        fs::read(file)?.hash(hasher);
    }
    Ok(())
}
