//! Which question comes next: the same sequence for the same seed.

use serde::{Deserialize, Serialize};

/// What a client does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// The same plan again.
    Repeat,
    /// A plan with two parts gone.
    Removed,
    /// A plan with a part that stands elsewhere.
    Moved,
    /// A plan with a part that may not move.
    Locked,
    /// Another assembly; one that is known is not sent again.
    Upload,
    /// A part with another mesh, which is always sent.
    Revise,
    /// A mesh that cannot be taken.
    BadUpload,
    /// A plan that is cancelled at once, and answered all the same.
    Cancel,
    /// A plan whose request is let go at once: nobody is to answer.
    Drop,
    /// A plan that is due within a millisecond.
    Deadline,
}

/// All kinds, and how many of a hundred requests are of it.
const SHARES: [(Kind, u64); 10] = [
    (Kind::Repeat, 40),
    (Kind::Removed, 10),
    (Kind::Moved, 10),
    (Kind::Locked, 10),
    (Kind::Upload, 6),
    (Kind::Revise, 6),
    (Kind::BadUpload, 3),
    (Kind::Cancel, 5),
    (Kind::Drop, 5),
    (Kind::Deadline, 5),
];

/// Of so many changed questions one is asked past everything that is remembered.
const UNREMEMBERED: u64 = 10;

/// One question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Question {
    pub(super) kind: Kind,
    /// Which of the questions of this kind.
    pub(super) variant: u64,
    /// Nothing remembered is used.
    pub(super) no_cache: bool,
}

/// A source of questions (SplitMix64, as of Steele, Lea and Flood, 2014).
#[derive(Debug)]
pub(super) struct Mix {
    state: u64,
    variety: u64,
}

impl Mix {
    /// Questions of each kind come in so many variants.
    pub(super) fn new(seed: u64, variety: u64) -> Self {
        Self { state: seed, variety: variety.max(1) }
    }

    pub(super) fn random(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(super) fn next(&mut self) -> Question {
        let mut draw = self.random() % 100;
        let mut kind = Kind::Repeat;
        for (candidate, share) in SHARES {
            if draw < share {
                kind = candidate;
                break;
            }
            draw -= share;
        }
        let variant = self.random() % self.variety;
        let past = self.random().is_multiple_of(UNREMEMBERED);
        let no_cache = match kind {
            Kind::Cancel | Kind::Drop | Kind::Deadline => true,
            Kind::Removed | Kind::Moved | Kind::Locked => past,
            _ => false,
        };
        Question { kind, variant, no_cache }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn every_kind_comes_about_as_often_as_its_share_and_the_same_seed_asks_the_same() {
        let ask = |seed| {
            let mut mix = Mix::new(seed, 8);
            (0..10_000).map(|_| mix.next()).collect::<Vec<_>>()
        };
        let questions = ask(1);
        assert_eq!(questions, ask(1));
        assert_ne!(questions, ask(2));
        let mut counts = BTreeMap::new();
        questions.iter().for_each(|q| *counts.entry(q.kind).or_insert(0_u64) += 1);
        for (kind, share) in SHARES {
            assert!(counts[&kind].abs_diff(share * 100) < share * 30, "{kind:?}: {}", counts[&kind]);
        }
        assert_eq!(SHARES.iter().map(|(_, share)| share).sum::<u64>(), 100);
        assert!(questions.iter().all(|q| q.variant < 8));
    }
}
