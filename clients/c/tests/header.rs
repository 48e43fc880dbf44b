//! `include/sbdp.h` is what cbindgen makes of the crate. `SBDP_WRITE_HEADER=1 cargo test -p sbdp-c` writes it anew.

use std::path::Path;

#[test]
fn the_header_is_that_of_the_sources() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(here.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_src(here.join("src/lib.rs"));
    let modules =
        ["border", "client", "code", "geometry", "options", "plan", "session", "step", "stream", "summary"];
    let bindings = modules.iter().fold(bindings, |b, m| b.with_src(here.join(format!("src/{m}.rs"))));
    let mut made = Vec::new();
    bindings.with_config(config).generate().unwrap().write(&mut made);
    let made = String::from_utf8(made).unwrap();
    let path = here.join("include/sbdp.h");
    if std::env::var_os("SBDP_WRITE_HEADER").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == made, "{} is not of these sources: SBDP_WRITE_HEADER=1 writes it", path.display());
}
