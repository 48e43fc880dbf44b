//! The user headers of every request and response.
//!
//! Request ids and timings are here and not in the payload, so that a stored answer's bytes
//! never change.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

/// The kind of a request on `plan` or `geometry`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum RequestKind {
    /// `plan`: a plan request.
    Plan = 1,
    /// `plan`: no payload; grants credit to the plan request named in the header, and may end it.
    Control = 2,
    /// `plan`: no payload; asks for the daemon's status.
    Status = 3,
    /// `geometry`: 32 bytes; asks whether this handle is known.
    Have = 4,
    /// `geometry`: an upload.
    Upload = 5,
    /// `geometry`: changes of a known assembly.
    Revise = 6,
    /// `plan`: no payload; asks for the daemon's metrics, to which later versions may add.
    Metrics = 7,
}

impl RequestKind {
    /// The kind of a number on the wire.
    #[must_use]
    pub fn from_wire(kind: u32) -> Option<Self> {
        [Self::Plan, Self::Control, Self::Status, Self::Have, Self::Upload, Self::Revise, Self::Metrics]
            .into_iter()
            .find(|k| *k as u32 == kind)
    }
}

/// What a response holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum ResponseKind {
    /// One or more verified steps.
    Steps = 1,
    /// Everything else about the plan; ends the request.
    Summary = 2,
    /// Why there is no answer; ends the request.
    Error = 3,
    /// The daemon's status.
    Status = 4,
    /// The answer to `Have`, `Upload` and `Revise`.
    Handle = 5,
    /// The answer to `Metrics`: a JSON text.
    Metrics = 6,
    /// Events of the search, as lines of JSON.
    Trace = 7,
}

impl ResponseKind {
    /// The kind of a number on the wire.
    #[must_use]
    pub fn from_wire(kind: u32) -> Option<Self> {
        [Self::Steps, Self::Summary, Self::Error, Self::Status, Self::Handle, Self::Metrics, Self::Trace]
            .into_iter()
            .find(|k| *k as u32 == kind)
    }
}

/// Control flag: end the plan request soon; it is still answered, with status `cancelled`.
pub const CONTROL_CANCEL: u32 = 1;

/// The header of every request.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("sbdp/v11/RequestHeader")]
pub struct RequestHeader {
    /// A [`RequestKind`].
    pub kind: u32,
    /// Flags of the kind: [`CONTROL_CANCEL`] for `Control`; else 0.
    pub flags: u32,
    /// Number of the plan request, unique within its client port; for `Control` that of the request to control.
    pub request: u64,
    /// For `Control`: chunks of that request received so far, in all. For `Upload` and `Revise`: the deadline of the
    /// answer (CLOCK_MONOTONIC nanoseconds), 0 for none.
    pub consumed: u64,
    /// Id of the listener on `wake/client` that the daemon notifies, low half first; 0 for none.
    pub listener: [u64; 2],
}

/// The header of every response.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("sbdp/v11/ResponseHeader")]
pub struct ResponseHeader {
    /// A [`ResponseKind`].
    pub kind: u32,
    /// With the error `busy`: milliseconds to wait before the next try. Otherwise 0.
    pub retry_ms: u32,
    /// Number of the plan request that is answered.
    pub request: u64,
    /// Number of this chunk in its request, from 0 without gaps.
    pub sequence: u64,
    /// At which byte of the message this chunk begins.
    pub offset: u64,
    /// Bytes of the whole message. A message longer than a chunk is sent in consecutive chunks.
    pub total: u64,
    /// When the daemon admitted the request (CLOCK_MONOTONIC nanoseconds).
    pub admitted_ns: u64,
    /// When a worker started on the request (CLOCK_MONOTONIC nanoseconds); 0 before.
    pub started_ns: u64,
    /// When this chunk was sent (CLOCK_MONOTONIC nanoseconds).
    pub sent_ns: u64,
}

impl RequestHeader {
    /// The deadline of an upload or revision.
    #[must_use]
    pub fn upload_deadline_ns(&self) -> Option<u64> {
        (self.consumed != 0).then_some(self.consumed)
    }
}

const _: () = {
    assert!(size_of::<RequestHeader>() == 40 && align_of::<RequestHeader>() == 8);
    assert!(offset_of!(RequestHeader, request) == 8);
    assert!(offset_of!(RequestHeader, consumed) == 16);
    assert!(offset_of!(RequestHeader, listener) == 24);
    assert!(size_of::<ResponseHeader>() == 64 && align_of::<ResponseHeader>() == 8);
    assert!(offset_of!(ResponseHeader, retry_ms) == 4);
    assert!(offset_of!(ResponseHeader, request) == 8);
    assert!(offset_of!(ResponseHeader, sequence) == 16);
    assert!(offset_of!(ResponseHeader, offset) == 24);
    assert!(offset_of!(ResponseHeader, total) == 32);
    assert!(offset_of!(ResponseHeader, admitted_ns) == 40);
    assert!(offset_of!(ResponseHeader, started_ns) == 48);
    assert!(offset_of!(ResponseHeader, sent_ns) == 56);
};

/// An iceoryx2 id as two words, low half first (a `u128` would be aligned to 16).
#[must_use]
pub const fn id_words(id: u128) -> [u64; 2] {
    [id as u64, (id >> 64) as u64]
}

/// The id of two words.
#[must_use]
pub const fn id_of_words(words: [u64; 2]) -> u128 {
    (words[0] as u128) | ((words[1] as u128) << 64)
}
