//! Writes the small assemblies beside this file: `cargo run --example make-assemblies`.
//!
//! They are kept in the repository too, so that they can be planned without building this; a
//! test compares both.

mod generator;

use std::fs;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies");
    for (path, bytes) in generator::all_files() {
        let path = here.join(path);
        fs::create_dir_all(path.parent().unwrap_or(&here))?;
        fs::write(&path, bytes)?;
        println!("{}", path.display());
    }
    Ok(())
}
