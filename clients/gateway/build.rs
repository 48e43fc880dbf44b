//! Compiles the proto file, without a `protoc` on the machine.

use std::error::Error;

const INCLUDES: &str = "../../ipc/proto";
const FILE: &str = "sbdp/v1/planner.proto";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={INCLUDES}");
    let files = protox::compile([FILE], [INCLUDES])?;
    tonic_prost_build::configure()
        // Meshes are not copied out of the message that they came in.
        .bytes(".")
        // The file's comments are no Markdown.
        .disable_comments(["."])
        .build_transport(false)
        .compile_fds(files)?;
    Ok(())
}
