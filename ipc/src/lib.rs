//! The wire contract of the sbdp daemon.
