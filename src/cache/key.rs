//! Keys of records: a kind, and the hash of all that the record depends on.

use std::fmt;

use super::kind::{RecordKind, Validity};

/// The address of a record.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct RecordKey {
    kind: &'static RecordKind,
    hash: [u8; 32],
}

impl RecordKey {
    /// Bytes of a key.
    pub(super) const LENGTH: usize = 33;

    /// The key of a record that is found by a hash alone. [`Digest::key`] makes all others.
    #[must_use]
    pub fn new(kind: &'static RecordKind, hash: [u8; 32]) -> Self {
        Self { kind, hash }
    }

    /// The kind.
    #[must_use]
    pub fn kind(&self) -> &'static RecordKind {
        self.kind
    }

    /// The hash.
    #[must_use]
    pub fn hash(&self) -> &[u8; 32] {
        &self.hash
    }

    /// The number of the kind, then the hash.
    pub(super) fn to_bytes(self) -> [u8; Self::LENGTH] {
        let mut bytes = [0; Self::LENGTH];
        bytes[0] = self.kind.number;
        bytes[1..].copy_from_slice(&self.hash);
        bytes
    }

    /// The inverse, if the bytes are the key of one of these kinds.
    pub(super) fn from_bytes(kinds: &[&'static RecordKind], bytes: &[u8]) -> Option<Self> {
        let (&number, hash) = bytes.split_first()?;
        let kind = kinds.iter().find(|kind| kind.number == number)?;
        Some(Self { kind, hash: hash.try_into().ok()? })
    }
}

impl fmt::Debug for RecordKey {
    /// The kind and the first digits of the hash.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, ..] = self.hash;
        write!(f, "{} {a:02x}{b:02x}{c:02x}{d:02x}", self.kind.name)
    }
}

/// Collects what a record depends on, as BLAKE3 of a byte stream. A list of varying length is added after its length.
#[derive(Debug, Clone, Default)]
pub struct Digest(blake3::Hasher);

impl Digest {
    /// Of nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds another hash.
    pub fn hash(&mut self, hash: &[u8; 32]) -> &mut Self {
        self.0.update(hash);
        self
    }

    /// Adds numbers, bit by bit.
    pub fn numbers(&mut self, numbers: impl IntoIterator<Item = f64>) -> &mut Self {
        for x in numbers {
            self.0.update(&x.to_bits().to_le_bytes());
        }
        self
    }

    /// Adds an integer.
    pub fn integer(&mut self, x: u64) -> &mut Self {
        self.0.update(&x.to_le_bytes());
        self
    }

    /// Adds a text with its length.
    pub fn text(&mut self, text: &str) -> &mut Self {
        self.integer(text.len() as u64);
        self.0.update(text.as_bytes());
        self
    }

    /// The hash of what was added.
    #[must_use]
    pub fn finish(&self) -> [u8; 32] {
        self.0.finalize().into()
    }

    /// The key of a record of a kind that depends on what was added, and on the sources that its stage was built from.
    #[must_use]
    pub fn key(&self, kind: &'static RecordKind) -> RecordKey {
        let mut all = self.clone();
        match kind.validity {
            Validity::Sources(hash) => all.text(hash),
            Validity::Format(version) => all.integer(u64::from(version)),
        };
        RecordKey { kind, hash: all.text(kind.name).finish() }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{KINDS, OTHER, RECORDS};
    use super::*;

    #[test]
    fn keys_are_told_apart_by_kind_and_content_and_survive_their_bytes() {
        let keys: Vec<RecordKey> =
            KINDS.into_iter().flat_map(|kind| [1, 2].map(|x| Digest::new().integer(x).key(kind))).collect();
        for (i, key) in keys.iter().enumerate() {
            assert_eq!(keys.iter().position(|k| k == key), Some(i));
            assert_eq!(keys.iter().position(|k| k.hash() == key.hash()), Some(i), "hashes alone differ, too");
            assert_eq!(RecordKey::from_bytes(&KINDS, &key.to_bytes()), Some(*key));
        }
        assert_eq!(RecordKey::from_bytes(&KINDS, &[0; RecordKey::LENGTH]), None, "no kind has the number 0");
        assert_eq!(RecordKey::from_bytes(&KINDS, &[1; 5]), None);
        assert_eq!(RecordKey::from_bytes(&[&OTHER], &RecordKey::new(&RECORDS, [1; 32]).to_bytes()), None);
    }

    /// As far as keys go, a build is the hash of its sources.
    #[test]
    fn another_build_finds_none_of_the_records_that_depend_on_sources() {
        fn key(validity: Validity) -> [u8; 32] {
            let kind = RecordKind::of::<u8>(9, "test", super::super::Storage::MemoryAndDisk, validity);
            *Digest::new().integer(7).key(Box::leak(Box::new(kind))).hash()
        }
        let of = |sources| key(Validity::Sources(sources));
        assert_eq!(of("these"), of("these"));
        assert_ne!(of("these"), of("those"));
        assert_ne!(key(Validity::Format(1)), key(Validity::Format(2)));
    }

    #[test]
    fn where_a_text_ends_counts() {
        let of = |a: &str, b: &str| Digest::new().text(a).text(b).finish();
        assert_ne!(of("ab", "c"), of("a", "bc"));
    }
}
