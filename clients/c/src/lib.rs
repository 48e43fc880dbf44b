//! The client of the sbdp daemon for C and C++. The header `sbdp.h` is generated from this crate; `sbdp.hpp` is built
//! on it. The work is done by `sbdp-client`; this crate gives its values the shapes of C.
//!
//! # Plan
//! ```c
//! SbdpError error;
//! SbdpClient *client = NULL;
//! SbdpStream *stream = NULL;
//! SbdpPlan *plan = NULL;
//! if (sbdp_client_connect(NULL, &client, &error) != SBDP_CODE_OK ||
//!     sbdp_client_upload(client, &assembly, &handle, &error) != SBDP_CODE_OK ||
//!     sbdp_client_plan(client, &handle, NULL, &stream, &error) != SBDP_CODE_OK ||
//!     sbdp_stream_to_end(&stream, &plan, &error) != SBDP_CODE_OK)
//!     fprintf(stderr, "%s\n", error.message);    // says what to do
//! ```
//!
//! # Build, install and link
//! `README.md` shows it with CMake and pkg-config, and explains lifetimes, threads and errors. Complete programs:
//! `examples/two_cubes.cpp`, `examples/controller.cpp`, `tests/client.c`.
//!
//! # Find a function
//!
//! | module | functions |
//! |---|---|
//! | [`client`] | connect, upload, revise, plan |
//! | [`stream`] | events of a plan as it is made; cancel, poll |
//! | [`plan`], [`step`], [`summary`] | a whole plan, its steps, and how it ended |
//! | [`session`] | plan the rest while an assembly is taken apart |
//! | [`geometry`], [`options`] | the structs that describe meshes and requests |
//! | [`code`], [`border`] | error codes and messages; what all functions share |
#![allow(unsafe_code, reason = "this crate exchanges pointers with C: each use says why it is sound")]

pub mod border;
pub mod client;
pub mod code;
pub mod geometry;
mod input;
pub mod options;
pub mod plan;
pub mod session;
pub mod step;
pub mod stream;
pub mod summary;
