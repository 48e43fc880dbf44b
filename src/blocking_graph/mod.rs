//! Directional blocking graphs: who keeps whom from following an action, per state.
//!
//! Source: R. H. Wilson and J.-C. Latombe 1994 for the graphs; the paper (section "Directional
//! Blocking Graphs") for their use over states. A state is one displaced part among the others at
//! their assembled poses, so a state's graphs are that part's outgoing edges: its [`Blockage`].

mod audit;
mod blockage;
mod graph;
mod literal;
mod records;
mod static_analysis;

pub use audit::{Audit, audit};
pub use blockage::{Blockage, Evaluation, Reopening};
pub use graph::DirectionalGraph;
pub(crate) use records::BLOCKING;
pub use static_analysis::{Analysis, StateGraphs, StaticAnalysis};
