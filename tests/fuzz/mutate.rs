//! Bytes made from bytes: what damaged files, broken senders and attackers' numbers look like.

/// A source of numbers (SplitMix64, as of Steele, Lea and Flood, 2014).
#[derive(Debug, Clone)]
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `n`, or 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    pub(crate) fn of<'l, T>(&mut self, list: &'l [T]) -> &'l T {
        &list[self.below(list.len())]
    }
}

/// Inputs grow no longer than this.
const LONGEST: usize = 16 * 1024;
/// Counts, lengths and offsets that code is most often wrong about.
const NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    7,
    8,
    0x7f,
    0xff,
    0x100,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    0x1_0000_0000,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_fff8,
    u64::MAX,
];
/// Numbers and other tokens of text formats.
const TOKENS: [&str; 24] = [
    "nan",
    "inf",
    "-inf",
    "1e308",
    "1e-320",
    "-0",
    "0",
    "-1",
    "4294967296",
    "99999999999999999999",
    "1/2/3",
    "1//",
    "//",
    "\"",
    "\\u0000",
    "[[[[",
    "{\"a\":",
    "\n\n",
    "\r",
    "\0",
    "é",
    "# ",
    "endsolid",
    "null",
];
const FLOATS: [f64; 8] = [0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN_POSITIVE, 1e-300];

/// A damaged copy of `seed`, in which pieces of `other` may occur.
pub(crate) fn mutated(random: &mut Random, seed: &[u8], other: &[u8]) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..1 + random.below(4) {
        step(random, &mut bytes, other);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn step(random: &mut Random, bytes: &mut Vec<u8>, other: &[u8]) {
    let length = bytes.len();
    let at = random.below(length + 1);
    match random.below(12) {
        0 if at < length => bytes[at] ^= 1 << random.below(8),
        1 if at < length => bytes[at] = random.next() as u8,
        2 => bytes.truncate(at),
        3 => {
            let end = (at + 1 + random.below(32)).min(length);
            bytes.drain(at..end);
        }
        4 => drop(bytes.splice(at..at, (0..random.below(24)).map(|i| (i * 37) as u8).collect::<Vec<_>>())),
        // A field of a binary format: aligned, of 4 or 8 bytes.
        5 | 6 => overwrite(bytes, at & !3, &(*random.of(&NUMBERS) as u32).to_le_bytes()),
        7 => overwrite(bytes, at & !7, &random.of(&NUMBERS).to_le_bytes()),
        8 => overwrite(bytes, at & !7, &random.of(&FLOATS).to_le_bytes()),
        9 => {
            let start = random.below(other.len() + 1);
            let end = (start + random.below(128)).min(other.len());
            drop(bytes.splice(at..at, other[start..end].iter().copied()));
        }
        10 => {
            let (start, end) = token(bytes, at);
            drop(bytes.splice(start..end, random.of(&TOKENS).bytes()));
        }
        _ => {
            let end = (at + random.below(64)).min(length);
            let again = bytes[at..end].to_vec();
            (0..random.below(8)).for_each(|_| drop(bytes.splice(at..at, again.iter().copied())));
        }
    }
}

fn overwrite(bytes: &mut [u8], at: usize, value: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + value.len()) {
        place.copy_from_slice(value);
    }
}

/// The word of a text that stands there.
fn token(bytes: &[u8], at: usize) -> (usize, usize) {
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || b"+-._".contains(b);
    let start = bytes[..at].iter().rposition(|b| !is_word(b)).map_or(0, |p| p + 1);
    let end = bytes[at..].iter().position(|b| !is_word(b)).map_or(bytes.len(), |p| at + p);
    (start, end)
}
