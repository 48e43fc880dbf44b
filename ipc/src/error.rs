//! Why a request failed.

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, TextWriter, Texts, Writer};

/// Stable codes: a number keeps its meaning for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum ErrorCode {
    /// The request cannot be read.
    Malformed = 1,
    /// No assembly has this handle: upload it (again).
    UnknownHandle = 2,
    /// The queue is full: try again later.
    Busy = 3,
    /// The deadline passed before planning began.
    Expired = 4,
    /// The geometry was refused; the message names part and reason.
    Geometry = 5,
    /// The request names a part that is not there.
    NoSuchPart = 6,
    /// The request needs something that this daemon does not offer.
    Unsupported = 7,
    /// The daemon failed; its log says more.
    Failed = 8,
    /// The client did not read its stream, which was ended.
    SlowReader = 9,
    /// The daemon is shutting down.
    ShuttingDown = 10,
    /// The message exceeds a limit of the daemon, or the memory that is left.
    TooLarge = 11,
    /// The client cancelled, or left, before planning began.
    Cancelled = 12,
}

impl ErrorCode {
    /// The code of a number on the wire.
    #[must_use]
    pub fn from_wire(code: u32) -> Option<Self> {
        const ALL: [ErrorCode; 12] = [
            ErrorCode::Malformed,
            ErrorCode::UnknownHandle,
            ErrorCode::Busy,
            ErrorCode::Expired,
            ErrorCode::Geometry,
            ErrorCode::NoSuchPart,
            ErrorCode::Unsupported,
            ErrorCode::Failed,
            ErrorCode::SlowReader,
            ErrorCode::ShuttingDown,
            ErrorCode::TooLarge,
            ErrorCode::Cancelled,
        ];
        ALL.into_iter().find(|c| *c as u32 == code)
    }
}

/// Header of an error message; the text follows.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ErrorHeader {
    /// An [`ErrorCode`].
    pub code: u32,
    /// Bytes of text.
    pub text_bytes: u32,
}

const _: () = assert!(size_of::<ErrorHeader>() == 8);

/// An error on the wire.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WireError {
    /// Its kind.
    pub code: ErrorCode,
    /// What happened and what to do.
    pub message: String,
    /// For `Busy`: milliseconds to wait before the next try; otherwise 0. It is sent in the response's
    /// header, not in the message.
    pub retry_ms: u32,
}

impl WireError {
    /// An error with a message.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), retry_ms: 0 }
    }

    /// `Busy`, with the time to wait before the next try.
    pub fn busy(message: impl Into<String>, retry_ms: u32) -> Self {
        Self { retry_ms, ..Self::new(ErrorCode::Busy, message) }
    }

    /// The message's bytes. Long texts are cut so that an error always fits one chunk.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        const LONGEST: usize = 16 * 1024;
        let mut end = self.message.len().min(LONGEST);
        while !self.message.is_char_boundary(end) {
            end -= 1;
        }
        let mut texts = TextWriter::default();
        let text = texts.add(&self.message[..end]);
        let mut writer = Writer::default();
        writer.value(ErrorHeader { code: self.code as u32, text_bytes: text.length });
        writer.array(texts.bytes());
        writer.finish()
    }

    /// Reads an error. A code that this version does not know counts as `Failed`.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let header: ErrorHeader = reader.value("error header")?;
        let texts = Texts(reader.array("error text", u64::from(header.text_bytes))?);
        let all = crate::bytes::Text { offset: 0, length: header.text_bytes };
        let code = ErrorCode::from_wire(header.code).unwrap_or(ErrorCode::Failed);
        Ok(Self::new(code, texts.get(all, "error text")?))
    }
}
