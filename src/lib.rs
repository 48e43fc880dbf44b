//! sbdp plans how assemblies come apart. The stages, in the order of the data flow:

pub mod cli;
pub mod geometry;
pub mod plan;
pub mod search;
pub mod service;
