//! Client of the sbdp daemon.
