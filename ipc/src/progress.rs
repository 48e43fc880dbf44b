//! Progress: lossy, and for display only.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// Building distance fields.
pub const STAGE_SDF: u32 = 1;
/// Searching and verifying.
pub const STAGE_SEARCH: u32 = 2;
/// Finding the paths to where insertions begin.
pub const STAGE_TRANSFER: u32 = 3;
/// In `tried`: the part is turned, and not only pushed.
pub const TRIED_TURNS: u32 = 1 << 31;

/// One sample on `progress`, received by every client; each picks its own.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("sbdp/v11/Progress")]
pub struct ProgressSample {
    /// Id of the client port that asked, low half first.
    pub client: [u64; 2],
    /// Number of its plan request.
    pub request: u64,
    /// Simulations so far.
    pub simulations: u64,
    /// [`STAGE_SDF`], [`STAGE_SEARCH`] or [`STAGE_TRANSFER`].
    pub stage: u32,
    /// Units of the stage done.
    pub done: u32,
    /// Units of the stage in all.
    pub total: u32,
    /// What the search tries: 1 + the index of the part, with [`TRIED_TURNS`] if it is turned; 0 if that is not known.
    pub tried: u32,
}

const _: () = {
    assert!(size_of::<ProgressSample>() == 48 && align_of::<ProgressSample>() == 8);
    assert!(offset_of!(ProgressSample, request) == 16);
    assert!(offset_of!(ProgressSample, simulations) == 24);
    assert!(offset_of!(ProgressSample, stage) == 32);
    assert!(offset_of!(ProgressSample, tried) == 44);
};
