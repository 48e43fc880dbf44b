//! The gateway of the sbdp daemon: serves its planner to other machines by gRPC.
//!
//! # Serve
//! ```no_run
//! use sbdp_gateway::{Config, Server};
//!
//! # async fn example() -> Result<(), sbdp_gateway::ServeError> {
//! let server = Server::bind(Config::default(), false)?;    // 127.0.0.1:50051, without TLS
//! println!("{}", server.address()?);
//! server.serve(std::future::pending()).await
//! # }
//! ```
//!
//! # Configure
//! [`Config`] sets the address, TLS and limits. `clients/gateway/README.md` explains every key, and the errors that
//! clients receive.
//!
//! # Call it
//! `ipc/proto/sbdp/v1/planner.proto` is the contract, from which a client in any language is generated; [`proto`] has
//! the Rust types.
//!
//! # Inside
//! [`Server`] accepts a call and `routes` passes it to its service. `service` reads it with `request` or `upload`, takes
//! a client from `pool`, and starts a thread that may block for the rest: `plan_call` follows a plan, and `answer`
//! converts the events. `status` makes gRPC errors. To the daemon, the gateway is an ordinary client.

mod answer;
mod budget;
mod cancel_keys;
mod config;
mod deadline;
mod plan_call;
mod plan_events;
mod pool;
pub mod proto;
mod request;
mod routes;
mod server;
mod service;
mod status;
mod summary;
mod upload;

pub use config::{Config, ConfigError, Limits, TlsFiles};
pub use server::{ServeError, Server};
