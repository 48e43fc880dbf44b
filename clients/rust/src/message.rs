//! Messages that are longer than a chunk.

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::headers::ResponseHeader;

use crate::error::ClientError;

/// Bytes of the longest message that is put together from chunks, a guard against a damaged length. A plan of 4,000
/// parts takes some megabytes; at half nothing changes, at double a damaged length costs twice the memory.
const LONGEST_MESSAGE: u64 = 1 << 30;

/// A message that comes in several chunks.
#[derive(Debug, Default)]
pub(crate) struct Assembler(Option<Begun>);

#[derive(Debug)]
struct Begun {
    kind: u32,
    bytes: AlignedBytes,
    filled: u64,
}

impl Assembler {
    /// Adds a chunk. Returns the message if this was the last chunk.
    pub(crate) fn add(
        &mut self,
        header: &ResponseHeader,
        payload: &[u8],
    ) -> Result<Option<AlignedBytes>, ClientError> {
        if header.offset == 0 && header.total <= LONGEST_MESSAGE {
            let bytes = AlignedBytes::zeroed(header.total as usize);
            self.0 = Some(Begun { kind: header.kind, bytes, filled: 0 });
        }
        let wrong = || ClientError::Protocol("the chunks of a message do not fit together".to_owned());
        let mut begun = self.0.take().ok_or_else(wrong)?;
        let (start, end) = (begun.filled, begun.filled + payload.len() as u64);
        if header.offset != start || header.kind != begun.kind {
            return Err(wrong());
        }
        let target = begun.bytes.as_mut_slice().get_mut(start as usize..end as usize).ok_or_else(wrong)?;
        target.copy_from_slice(payload);
        begun.filled = end;
        if end == header.total {
            return Ok(Some(begun.bytes));
        }
        self.0 = Some(begun);
        Ok(None)
    }
}
