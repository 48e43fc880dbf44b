//! Between files and clients of the daemon: assemblies to be uploaded. The command line, the benchmarks and the Python module
//! share it.

mod upload;

pub use upload::{wire_assembly, wire_mesh, wire_part};
