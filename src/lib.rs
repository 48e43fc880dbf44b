//! sbdp plans how assemblies come apart. The stages, in the order of the data flow:

pub mod assembling;
pub mod bench;
pub mod blocking_graph;
mod budgets;
pub mod cache;
pub mod cli;
pub mod config;
pub mod contact;
pub mod daemon;
pub mod exchange;
pub mod files;
#[cfg(test)]
mod fixtures;
pub mod geometry;
pub mod hostile_input;
mod lru;
pub mod plan;
mod rrt;
pub mod scene;
pub mod sdf;
pub mod search;
pub mod service;
pub mod simulation;
pub mod telemetry;
pub mod termination;
mod tolerances;
pub mod view;
