//! Gives the shared library its name for the dynamic linker.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Programs are bound to the contract of `sbdp.h`: the number changes with every change that they would notice.
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libsbdp.so.0");
    // What libraries in it show is not for programs: iceoryx2 has a logger that is found by its name.
    println!("cargo::rustc-cdylib-link-arg=-Wl,--exclude-libs,ALL");
}
