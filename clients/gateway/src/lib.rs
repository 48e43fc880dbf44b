//! The gateway of the sbdp daemon: gRPC outside, as `ipc/proto/sbdp/v1/planner.proto` defines it, and an ordinary client of
//! the daemon inside.
//!
//! A call passes through these modules: [`Server`] accepts it and `routes` passes it to its service, `service` reads it with
//! `request` or `upload`, takes a client from `pool`, and has a thread that may block do the rest: `plan_call` follows a
//! plan, and `answer` converts what comes. `status` makes gRPC errors.

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
