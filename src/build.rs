//! Hashes what answers depend on: the sources of the planning modules, and the versions of all crates.
//!
//! Remembered answers carry the hash in their keys, so that another build never takes an answer for its own
//! that it would not give: a raised version number alone is forgotten too easily.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

const SOURCES: [&str; 15] = [
    "Cargo.lock",
    "src/geometry",
    "src/sdf",
    "src/scene",
    "src/contact",
    "src/tolerances.rs",
    "src/simulation",
    "src/blocking_graph",
    "src/search",
    "src/plan",
    "src/assembling",
    "src/service",
    "src/cache",
    "src/daemon",
    "ipc/src",
];

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut hash = Fnv(0xcbf2_9ce4_8422_2325);
    for source in SOURCES {
        println!("cargo:rerun-if-changed={source}");
        add(&mut hash, &root.join(source))?;
    }
    println!("cargo:rustc-env=SBDP_SOURCES={:016x}", hash.0);
    Ok(())
}

/// A file's name and content, or all files of a folder in the order of their names.
fn add(hash: &mut Fnv, path: &Path) -> io::Result<()> {
    if path.is_dir() {
        let entries = fs::read_dir(path)?.map(|entry| entry.map(|e| e.path()));
        let mut entries = entries.collect::<io::Result<Vec<_>>>()?;
        entries.sort();
        return entries.iter().try_for_each(|entry| add(hash, entry));
    }
    hash.add(path.file_name().map(|name| name.as_encoded_bytes()).unwrap_or_default());
    hash.add(&fs::read(path)?);
    Ok(())
}

/// FNV-1a with 64 bits: enough to tell builds apart.
struct Fnv(u64);

impl Fnv {
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().chain(&(bytes.len() as u64).to_le_bytes()) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}
