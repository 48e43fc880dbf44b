//! Contact reduction: of thousands of constraints that point nearly the same way, the tightest decides.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use crate::contact::constraint::VelocityConstraint;

/// Keeps, of rows that point nearly the same way, the tightest; also returns which they were.
/// `lever` is the length that makes moments comparable with forces.
pub(super) fn reduced(
    rows: impl IntoIterator<Item = VelocityConstraint>,
    lever: f64,
) -> (Vec<VelocityConstraint>, Vec<usize>) {
    const BINS: f64 = 16.0;
    let mut index: HashMap<u128, usize, BuildHasherDefault<BinHasher>> = HashMap::default();
    let (mut out, mut kept): (Vec<VelocityConstraint>, Vec<usize>) = (Vec::new(), Vec::new());
    for (i, row) in rows.into_iter().enumerate() {
        let key = (0..6).fold(row.other as u128, |key, i| {
            let x = if i < 3 { row.a[i] } else { row.a[i] / lever };
            key << 16 | u128::from((x * BINS).round() as i16 as u16)
        });
        match index.entry(key) {
            std::collections::hash_map::Entry::Occupied(e) => {
                let at = *e.get();
                if row.b < out[at].b {
                    (out[at], kept[at]) = (row, i);
                }
            }
            std::collections::hash_map::Entry::Vacant(e) => {
                e.insert(out.len());
                out.push(row);
                kept.push(i);
            }
        }
    }
    (out, kept)
}

/// Hashes keys of bins: thousands of them at every step, and no input chooses them to collide.
#[derive(Default)]
struct BinHasher(u64);

impl Hasher for BinHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u128(u128::from(byte));
        }
    }

    fn write_u128(&mut self, key: u128) {
        // Two odd factors with their bits spread (2^64 divided by the golden ratio, and by √2).
        let low = (key as u64 ^ self.0).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let high = ((key >> 64) as u64).wrapping_mul(0xb504_f333_f9de_6485);
        let mixed = low ^ high.rotate_left(32);
        self.0 = (mixed ^ mixed >> 29).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}
