#![doc = include_str!("FORMAT.md")]

use super::key::RecordKey;

const MAGIC: [u8; 4] = *b"SBDC";
const VERSION: u16 = 1;
/// Bytes before the payload.
pub(super) const ENVELOPE: usize = 32;
const CHECKSUM_AT: usize = 16;

/// A payload in its envelope; `None` if it is too long for one.
pub(super) fn sealed(key: &RecordKey, payload: &[u8]) -> Option<Vec<u8>> {
    let head = head(key, payload.len())?;
    let mut bytes = Vec::with_capacity(ENVELOPE + payload.len());
    bytes.extend(head);
    bytes.extend(checksum(&head, key, payload));
    bytes.extend(payload);
    Some(bytes)
}

/// The payload in an envelope, if that is intact and the one of the key.
pub(super) fn opened<'a>(key: &RecordKey, bytes: &'a [u8]) -> Option<&'a [u8]> {
    let (envelope, payload) = bytes.split_at_checked(ENVELOPE)?;
    let (head, sum) = envelope.split_at(CHECKSUM_AT);
    (head == self::head(key, payload.len())? && sum == checksum(head, key, payload)).then_some(payload)
}

/// The envelope up to its checksum.
fn head(key: &RecordKey, length: usize) -> Option<[u8; CHECKSUM_AT]> {
    let mut head = [0; CHECKSUM_AT];
    head[..4].copy_from_slice(&MAGIC);
    head[4..6].copy_from_slice(&VERSION.to_le_bytes());
    head[6] = key.kind().number;
    head[8..12].copy_from_slice(&key.kind().format().to_le_bytes());
    head[12..].copy_from_slice(&u32::try_from(length).ok()?.to_le_bytes());
    Some(head)
}

/// Binds a record to its key: no record is taken for that of another key.
fn checksum(head: &[u8], key: &RecordKey, payload: &[u8]) -> [u8; 16] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(head).update(&key.to_bytes()).update(payload);
    let mut sum = [0; 16];
    sum.copy_from_slice(&hasher.finalize().as_bytes()[..16]);
    sum
}

#[cfg(test)]
mod tests {
    use super::super::tests::{OTHER, RECORDS, VERSIONED};
    use super::*;

    const PAYLOAD: [u8; 11] = [3, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1];

    fn key() -> RecordKey {
        RecordKey::new(&RECORDS, [7; 32])
    }

    /// Bytes written down once: files of other builds are read wrongly if these change and the version does not.
    #[test]
    fn the_bytes_are_those_that_were_agreed() {
        let hex = |bytes: &[u8]| -> String { bytes.iter().map(|b| format!("{b:02x}")).collect() };
        let bytes = sealed(&key(), &PAYLOAD).unwrap();
        assert_eq!(hex(&bytes[..16]), "5342444301000100000000000b000000");
        assert_eq!(hex(&bytes[16..32]), "de9eaa5cb6b6d0d7f92b309c3c53a7b7");
        assert_eq!(bytes[32..], PAYLOAD);
        let versioned = sealed(&RecordKey::new(&VERSIONED, [7; 32]), &PAYLOAD).unwrap();
        assert_eq!(hex(&versioned[..16]), "5342444301000500030000000b000000");
    }

    #[test]
    fn a_record_with_any_bit_changed_cut_short_or_under_another_key_is_none() {
        let bytes = sealed(&key(), &PAYLOAD).unwrap();
        assert_eq!(opened(&key(), &bytes), Some(&PAYLOAD[..]));
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(opened(&key(), &damaged).is_none(), "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert!(opened(&key(), &bytes[..length]).is_none(), "{length} bytes");
        }
        assert!(opened(&key(), &[&bytes[..], &[0]].concat()).is_none());
        assert!(opened(&RecordKey::new(&RECORDS, [8; 32]), &bytes).is_none());
        assert!(opened(&RecordKey::new(&OTHER, [7; 32]), &bytes).is_none());
    }
}
