//! Payloads: records as bincode writes them.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// What can be a record: plain data.
pub trait Storable: Serialize + DeserializeOwned {}

impl<R: Serialize + DeserializeOwned> Storable for R {}

/// Bytes, 256 MB: no longer record is read. A damaged length would be asked of the allocator before the end of the
/// payload is found; the longest records are meshes, with some tens of MB for a million triangles.
const LONGEST: usize = 256 << 20;

const LAYOUT: bincode::config::Configuration<
    bincode::config::LittleEndian,
    bincode::config::Fixint,
    bincode::config::Limit<LONGEST>,
> = bincode::config::standard().with_fixed_int_encoding().with_limit::<LONGEST>();

/// The payload of a record; `None` if it cannot be encoded, as no plain data is.
pub(crate) fn payload(record: &impl Storable) -> Option<Vec<u8>> {
    bincode::serde::encode_to_vec(record, LAYOUT).ok()
}

/// The record of a payload, if it is one, to the last byte.
pub(super) fn decode<R: Storable>(payload: &[u8]) -> Option<R> {
    match bincode::serde::decode_from_slice(payload, LAYOUT) {
        Ok((record, read)) if read == payload.len() => Some(record),
        _ => None,
    }
}

/// Whether a payload is a record of some type.
pub(super) fn is_record<R: Storable>(payload: &[u8]) -> bool {
    decode::<R>(payload).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_with_something_behind_it_or_missing_is_no_record() {
        let payload = payload(&vec![true; 4]).unwrap();
        assert_eq!(decode(&payload), Some(vec![true; 4]));
        assert!(!is_record::<Vec<bool>>(&[&payload[..], &[0]].concat()));
        assert!(!is_record::<Vec<bool>>(&payload[..payload.len() - 1]));
        // A length that no memory holds.
        assert!(!is_record::<Vec<bool>>(&[0xff; 16]));
    }
}
