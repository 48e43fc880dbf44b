//! The client of the sbdp daemon for C and C++: `sbdp.h` is made from this crate, `sbdp.hpp` stands on it. All of it is
//! the owned client core of `sbdp-client`; here its values get the shapes of C.
#![allow(unsafe_code, reason = "pointers of C are what this crate is about: each use says why it is sound")]

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
