//! The wire contract of the sbdp daemon: names and limits of its iceoryx2 services, the layout of every message, and
//! where a client finds the daemon; and plans as JSON ([`document`]). Programs that only want plans use the crate `sbdp-client`.
//!
//! `PROTOCOL.md` lists the whole contract in tables, which are generated from these definitions and their comments.
//!
//! # Find the daemon
//! ```no_run
//! use sbdp_ipc::endpoint::{Endpoint, default_runtime_dir};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let daemon = Endpoint::find(&default_runtime_dir())?;
//! let node = sbdp_ipc::services::node(&sbdp_ipc::layout::iceoryx2_config(&daemon.prefix, &daemon.root)?)?;
//! let plans = sbdp_ipc::services::plan(&node)?;
//! # Ok(())
//! # }
//! ```
//!
//! # Write a request
//! ```
//! use sbdp_ipc::bytes::AlignedBytes;
//! use sbdp_ipc::geometry::{Assembly, Part, Vertices};
//!
//! let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
//! let part = Part { name: "wedge", vertices: Vertices::F64(&vertices), triangles: &triangles };
//! let assembly = Assembly { units: Some("mm"), parts: vec![part], ..Assembly::default() };
//! let mut message = AlignedBytes::zeroed(assembly.encoded_len());
//! assert!(assembly.encode_into(message.as_mut_slice()));
//! ```
//!
//! # Read a message
//! Every received message may come from a faulty or hostile process. A view checks all bounds once, when it is created,
//! and no byte string makes one panic.
//!
//! ```
//! use sbdp_ipc::plan::StepsView;
//!
//! # let message = sbdp_ipc::bytes::AlignedBytes::zeroed(8);
//! match StepsView::new(message.as_slice()) {
//!     Ok(steps) => steps.iter().for_each(|step| println!("{:?}: {:?}", step.parts, step.path)),
//!     Err(malformed) => eprintln!("{malformed}"),
//! }
//! ```

pub mod bytes;
pub mod clock;
pub mod document;
pub mod endpoint;
pub mod error;
pub mod geometry;
pub mod headers;
pub mod layout;
pub mod plan;
pub mod polling;
pub mod progress;
pub mod revision;
pub mod services;
pub mod status;
pub mod summary;

/// The iceoryx2 service flavour that both sides use: ports may be used from several threads.
pub type Transport = iceoryx2::prelude::ipc_threadsafe::Service;

/// Version of this contract, a count of its incompatible changes. It is part of every service name, so that a client
/// never opens a service of another version.
pub const PROTOCOL: u32 = 11;
/// The iceoryx2 version both sides must have: nodes and services carry it.
pub const ICEORYX2_VERSION: &str = "0.10.0";
