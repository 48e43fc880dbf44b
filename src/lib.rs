//! Plans how mechanical assemblies come apart, and how they are put together.
//!
//! # Plan in this process
//! [`files`] reads an assembly, [`service`] plans it. (Programs that ask for many plans use a running daemon instead:
//! crate `sbdp-client`.)
//!
//! ```
//! use std::path::Path;
//!
//! use sbdp::files::load_assembly;
//! use sbdp::search::PlanRequest;
//! use sbdp::service::Service;
//! use sbdp::termination::Termination;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let assembly = load_assembly(Path::new("tests/assemblies/pin-bolt-cover"))?;
//! let service = Service::default();
//! let id = service.admit(&assembly)?.id;
//! let plan = service.plan(id, &PlanRequest::default(), &Termination::default(), &mut ())?;
//! let order: Vec<&str> = plan.steps.iter().map(|step| plan.parts[step.parts[0]].as_str()).collect();
//! assert_eq!(order, ["pin", "bolt", "cover"]);
//! # Ok(())
//! # }
//! ```
//!
//! # Write and read plans
//! [`document`] is the JSON contract `sbdp-plan/2`; `src/document/JSON.md` describes its fields.
//!
//! ```
//! use sbdp::document::PlanDocument;
//!
//! # use std::path::Path;
//! # use sbdp::{files::load_assembly, search::PlanRequest, service::Service, termination::Termination};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let service = Service::default();
//! # let id = service.admit(&load_assembly(Path::new("tests/assemblies/pin-bolt-cover"))?)?.id;
//! # let plan = service.plan(id, &PlanRequest::default(), &Termination::default(), &mut ())?;
//! let json = PlanDocument::from(&plan).to_json()?;
//! let document = PlanDocument::from_json(&json)?;
//! assert_eq!(document.status, "complete");
//! # Ok(())
//! # }
//! ```
//!
//! # Find a stage
//! Each module is a stage or a program; `src/README.md` describes them in the order of the data flow, with the rules
//! that they keep.

/// The version, and of a release build from a repository its commit and the commit's date.
pub const BUILD: &str = env!("SBDP_BUILD");

pub mod assembling;
pub mod bench;
pub mod blocking_graph;
mod budgets;
pub mod cache;
pub mod cli;
pub mod config;
pub mod contact;
pub mod daemon;
pub mod document;
pub mod exchange;
pub mod fasteners;
pub mod files;
#[cfg(test)]
mod fixtures;
pub mod geometry;
pub mod hostile_input;
mod lru;
pub mod plan;
pub mod report;
mod rrt;
pub mod scene;
pub mod schedule;
pub mod sdf;
pub mod search;
pub mod service;
pub mod simulation;
pub mod statics;
pub mod telemetry;
pub mod termination;
mod tolerances;
pub mod tools;
pub mod view;
