//! The wire contract of the sbdp daemon: names and limits of its iceoryx2 services, the layout
//! of every message, and where a client finds the daemon. `PROTOCOL.md` has all of it in tables,
//! made of these definitions and their comments.
//!
//! Everything received is a stranger's input: views check all bounds once when they are made,
//! and no byte string makes one panic.

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
pub const PROTOCOL: u32 = 8;
/// The iceoryx2 version both sides must have: nodes and services carry it.
pub const ICEORYX2_VERSION: &str = "0.10.0";
