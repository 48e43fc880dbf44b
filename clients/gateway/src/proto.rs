//! What `ipc/proto/sbdp/v1/planner.proto` defines, as `prost` and `tonic` generate it. The file documents all of it.

#![allow(missing_docs, unreachable_pub, clippy::all, reason = "generated")]

tonic::include_proto!("sbdp.v1");
