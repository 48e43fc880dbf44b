//! Between the planning modules and clients of the daemon: uploaded assemblies, received plans, and the
//! documents of plans. The command line, the benchmarks and the clients in other languages have it in common.

mod plan;
mod upload;

pub use plan::{plan, plan_step};
pub use upload::{wire_assembly, wire_mesh, wire_part};
