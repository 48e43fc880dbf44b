//! sbdp plans how assemblies come apart. The stages, in the order of the data flow:

pub mod config;
pub mod daemon;
pub mod geometry;
pub mod plan;
pub mod search;
pub mod service;
pub mod telemetry;
