//! What is remembered, and under which key.

use std::fmt;

/// What the build script hashed (`src/build.rs`).
const SOURCES: &str = env!("SBDP_SOURCES");

/// A kind of record. Its number is part of the format on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Kind {
    /// How deep two parts overlap as assembled.
    Overlap = 1,
    /// Along which translations one part keeps another from moving.
    Blocking = 2,
    /// Where motions with one key looked, and at what.
    Witness = 3,
    /// A motion of the transition function.
    Motion = 4,
    /// What verification found along a path past one part.
    Verdict = 5,
    /// What a search answered.
    Plan = 6,
    /// The planes that a part lies against.
    Touching = 7,
    /// An assembly as it was given, or how it was revised.
    Source = 8,
    /// A plan as it was sent.
    Answer = 9,
    /// A healed mesh in its own frame.
    Shape = 10,
    /// An assembly of such shapes.
    Healed = 11,
    /// The hull of two hulls.
    Hull = 12,
    /// What a part that goes along a line enters.
    Swept = 13,
    /// The distance field of a shape, in a file of its own.
    Field = 14,
}

impl Kind {
    /// All kinds, in the order of their numbers.
    pub const ALL: [Self; 14] = [
        Self::Overlap,
        Self::Blocking,
        Self::Witness,
        Self::Motion,
        Self::Verdict,
        Self::Plan,
        Self::Touching,
        Self::Source,
        Self::Answer,
        Self::Shape,
        Self::Healed,
        Self::Hull,
        Self::Swept,
        Self::Field,
    ];

    /// The name in statistics.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Overlap => "overlap",
            Self::Blocking => "blocking",
            Self::Witness => "witness",
            Self::Motion => "motion",
            Self::Verdict => "verdict",
            Self::Plan => "plan",
            Self::Touching => "touching",
            Self::Source => "source",
            Self::Answer => "answer",
            Self::Shape => "shape",
            Self::Healed => "healed",
            Self::Hull => "hull",
            Self::Swept => "swept",
            Self::Field => "field",
        }
    }

    /// Whether records are kept in memory, too. Assemblies, answers and hulls are there already, as what was
    /// made of them and as they are used.
    pub(super) fn stays_in_memory(self) -> bool {
        !matches!(self, Self::Source | Self::Answer | Self::Shape | Self::Healed | Self::Hull | Self::Field)
    }

    /// Whether it is told without the disk if there is a record: of assemblies and answers, which are few, that
    /// is asked where nobody may wait.
    pub(super) fn is_noted(self) -> bool {
        matches!(self, Self::Source | Self::Answer | Self::Shape | Self::Healed)
    }

    /// Whether it is no record among others, but a file.
    pub(super) fn is_file(self) -> bool {
        self == Self::Field
    }

    /// The version of what computes such records: to be raised with every change that may give another
    /// answer to the same question, or another layout of the record. Older records are then misses.
    #[must_use]
    pub fn algorithm(self) -> u32 {
        match self {
            Self::Source | Self::Shape | Self::Field => 1,
            Self::Healed | Self::Touching | Self::Hull | Self::Swept => 2,
            Self::Blocking => 7,
            Self::Overlap => 9,
            Self::Verdict | Self::Witness => 10,
            Self::Motion => 11,
            Self::Answer | Self::Plan => 15,
        }
    }

    /// The kind of a number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|k| *k as u8 == number)
    }

    /// Where it stands in [`Kind::ALL`].
    pub(super) fn index(self) -> usize {
        self as usize - 1
    }
}

/// The address of a record: its kind, and the hash of everything that it depends on.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key {
    kind: Kind,
    hash: [u8; 32],
}

impl Key {
    /// Bytes of a key.
    pub(super) const LENGTH: usize = 33;

    /// The key of a kind with a hash.
    #[must_use]
    pub fn new(kind: Kind, hash: [u8; 32]) -> Self {
        Self { kind, hash }
    }

    /// The kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
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
        bytes[0] = self.kind as u8;
        bytes[1..].copy_from_slice(&self.hash);
        bytes
    }

    /// The inverse, if the bytes are a key's.
    pub(super) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (&number, hash) = bytes.split_first()?;
        Some(Self { kind: Kind::from_number(number)?, hash: hash.try_into().ok()? })
    }
}

impl fmt::Debug for Key {
    /// The kind and the first digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [a, b, c, d, ..] = self.hash;
        write!(f, "{} {a:02x}{b:02x}{c:02x}{d:02x}", self.kind.name())
    }
}

/// Collects what something depends on, as BLAKE3 of a byte stream. Whoever hashes lists of varying
/// length hashes their length, too.
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

    /// The key of a record of a kind that depends on what was added, on the version of its algorithm, and on
    /// the sources that this was built from.
    #[must_use]
    pub fn key(&self, kind: Kind) -> Key {
        let mut all = self.clone();
        all.text(SOURCES).text(kind.name()).integer(u64::from(kind.algorithm()));
        Key { kind, hash: all.finish() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_apart_by_kind_and_content_and_survive_their_bytes() {
        let keys: Vec<Key> = Kind::ALL
            .into_iter()
            .flat_map(|kind| [1, 2].map(|x| Digest::new().integer(x).key(kind)))
            .collect();
        for (i, key) in keys.iter().enumerate() {
            assert_eq!(keys.iter().position(|k| k == key), Some(i));
            assert_eq!(keys.iter().position(|k| k.hash() == key.hash()), Some(i), "hashes alone differ, too");
            assert_eq!(Key::from_bytes(&key.to_bytes()), Some(*key));
        }
        assert_eq!(Key::from_bytes(&[0; Key::LENGTH]), None, "no kind has the number 0");
        assert_eq!(Key::from_bytes(&[1; 5]), None);
    }

    #[test]
    fn kinds_stand_at_their_index() {
        for (i, kind) in Kind::ALL.into_iter().enumerate() {
            assert_eq!((kind.index(), Kind::from_number(kind as u8)), (i, Some(kind)));
        }
    }

    #[test]
    fn where_a_text_ends_counts() {
        let of = |a: &str, b: &str| Digest::new().text(a).text(b).finish();
        assert_ne!(of("ab", "c"), of("a", "bc"));
    }
}
