#![doc = include_str!("FORMAT.md")]

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::kind::Key;

const MAGIC: [u8; 4] = *b"SBDC";
const VERSION: u16 = 1;
/// Bytes before the payload.
pub(super) const ENVELOPE: usize = 32;
const CHECKSUM_AT: usize = 16;

/// What can be remembered: the types of `records.rs`.
pub trait Record: Serialize + DeserializeOwned {}

/// No record is read that announces more bytes than this: a count in a damaged one is asked of the
/// allocator before anything is seen to be missing.
const LONGEST: usize = 256 << 20;

const LAYOUT: bincode::config::Configuration<
    bincode::config::LittleEndian,
    bincode::config::Fixint,
    bincode::config::Limit<LONGEST>,
> = bincode::config::standard().with_fixed_int_encoding().with_limit::<LONGEST>();

/// The payload of a record; `None` if it cannot be encoded, which the types of `records.rs` can.
pub(super) fn encode(record: &impl Record) -> Option<Vec<u8>> {
    bincode::serde::encode_to_vec(record, LAYOUT).ok()
}

/// The record of a payload, if it is one, to the last byte.
pub(super) fn decode<R: Record>(payload: &[u8]) -> Option<R> {
    match bincode::serde::decode_from_slice(payload, LAYOUT) {
        Ok((record, read)) if read == payload.len() => Some(record),
        _ => None,
    }
}

/// A payload in its envelope; `None` if it is too long for one.
pub(super) fn sealed(key: &Key, payload: &[u8]) -> Option<Vec<u8>> {
    let head = head(key, payload.len())?;
    let mut bytes = Vec::with_capacity(ENVELOPE + payload.len());
    bytes.extend(head);
    bytes.extend(checksum(&head, key, payload));
    bytes.extend(payload);
    Some(bytes)
}

/// The payload of a record in its envelope, if it is intact and the one that was asked for.
pub(super) fn opened<'a>(key: &Key, bytes: &'a [u8]) -> Option<&'a [u8]> {
    let (envelope, payload) = bytes.split_at_checked(ENVELOPE)?;
    let (head, sum) = envelope.split_at(CHECKSUM_AT);
    (head == self::head(key, payload.len())? && sum == checksum(head, key, payload)).then_some(payload)
}

/// The envelope up to its checksum.
fn head(key: &Key, length: usize) -> Option<[u8; CHECKSUM_AT]> {
    let mut head = [0; CHECKSUM_AT];
    head[..4].copy_from_slice(&MAGIC);
    head[4..6].copy_from_slice(&VERSION.to_le_bytes());
    head[6] = key.kind() as u8;
    head[8..12].copy_from_slice(&key.kind().algorithm().to_le_bytes());
    head[12..].copy_from_slice(&u32::try_from(length).ok()?.to_le_bytes());
    Some(head)
}

/// Binds a record to its key, so that no other one is taken for it.
fn checksum(head: &[u8], key: &Key, payload: &[u8]) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(head).update(&key.to_bytes()).update(payload);
    let mut sum = [0; 16];
    sum.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    sum
}

#[cfg(test)]
mod tests {
    use super::super::kind::Kind;
    use super::super::records::{BlockingRecord, MotionEnd, MotionRecord};
    use super::*;

    fn key() -> Key {
        Key::new(Kind::Blocking, [7; 32])
    }

    fn hex(bytes: &[u8]) -> String {
        bytes.iter().map(|b| format!("{b:02x}")).collect()
    }

    /// Bytes written down once: if these change, files of older builds are read wrongly unless the
    /// version of the format, or of the algorithm, changes with them.
    #[test]
    fn the_bytes_are_those_that_were_agreed() {
        let record = BlockingRecord { blocked: vec![true, false, true] };
        let payload = encode(&record).unwrap();
        assert_eq!(hex(&payload), "0300000000000000010001");
        let bytes = sealed(&key(), &payload).unwrap();
        assert_eq!(hex(&bytes[..16]), "5342444301000200070000000b000000");
        assert_eq!(hex(&bytes[16..32]), "ca24fa0228df66e7716870575bb05707");
        assert_eq!(bytes[32..], payload);
        let motion = MotionRecord {
            path: vec![[1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]],
            asked: vec![0],
            end: MotionEnd::Collision { with: vec![2] },
        };
        let zeros = |n: usize| "0".repeat(2 * n);
        let one = "000000000000f03f";
        assert_eq!(
            hex(&encode(&motion).unwrap()),
            format!(
                "0100000000000000{one}{}{one}{}010000000000000000000000010000000100000000000000{}",
                zeros(16),
                zeros(24),
                "02000000"
            )
        );
    }

    #[test]
    fn what_was_written_is_read() {
        let record = BlockingRecord { blocked: vec![false; 9] };
        let bytes = sealed(&key(), &encode(&record).unwrap()).unwrap();
        let payload = opened(&key(), &bytes).unwrap();
        assert_eq!(decode::<BlockingRecord>(payload), Some(record));
    }

    #[test]
    fn a_record_with_any_bit_changed_cut_short_or_under_another_key_is_none() {
        let bytes = sealed(&key(), &encode(&BlockingRecord { blocked: vec![true; 4] }).unwrap()).unwrap();
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(opened(&key(), &damaged).is_none(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(opened(&key(), &bytes[..length]).is_none(), "{length} bytes");
        }
        assert!(opened(&key(), &[&bytes[..], &[0]].concat()).is_none());
        assert!(opened(&Key::new(Kind::Blocking, [8; 32]), &bytes).is_none());
    }

    #[test]
    fn a_payload_with_something_behind_it_or_missing_is_no_record() {
        let payload = encode(&BlockingRecord { blocked: vec![true; 4] }).unwrap();
        assert!(decode::<BlockingRecord>(&[&payload[..], &[0]].concat()).is_none());
        assert!(decode::<BlockingRecord>(&payload[..payload.len() - 1]).is_none());
        // A length that no memory holds.
        assert!(decode::<BlockingRecord>(&[0xff; 16]).is_none());
    }
}
