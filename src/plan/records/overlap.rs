//! How deep pairs of parts overlap as assembled. That depends on the two shapes and on how they stand to each other
//! (rounded: see [`CongruentPair`]), so a pair measured once serves each assembly that has it.

use super::SOURCES;
use crate::cache::{Digest, RecordKey, RecordKind, Storage};
use crate::plan::PairOverlap;
use crate::scene::{CongruentPair, Scene, add_pair};

/// How deep two parts overlap as assembled, in the planning frame.
pub(crate) static OVERLAP: RecordKind =
    RecordKind::of::<PairOverlap>(1, "overlap", Storage::MemoryAndDisk, SOURCES);

/// The key of how deep a pair overlaps.
pub(crate) fn overlap_key(scene: &Scene, pair: &CongruentPair) -> RecordKey {
    let mut digest = Digest::new();
    add_pair(&mut digest, scene, pair);
    digest.numbers([scene.longest_side]).key(&OVERLAP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, scene};
    use crate::geometry::Pose;

    fn key(scene: &Scene) -> RecordKey {
        overlap_key(scene, &CongruentPair::turned(scene, 1, 0))
    }

    #[test]
    fn the_pair_is_in_the_key_and_nothing_else() {
        let (first, _) = scene(block_on_plate());
        let mut allowed = first.clone();
        allowed.allowed.allow(0, 1, 1e-3);
        assert_eq!(key(&allowed), key(&first), "what is allowed does not change the depth");
        let [plate, block] = block_on_plate();
        let elsewhere = Pose::translation(0.5, -0.25, 8.0);
        let there = scene([moved(plate.clone(), &elsewhere), moved(block.clone(), &elsewhere)]).0;
        assert_eq!(key(&there), key(&first));
        let nearer = scene([plate, moved(block, &Pose::translation(1e-6, 0.0, 0.0))]).0;
        assert_ne!(key(&nearer), key(&first));
        assert_ne!(key(&scene(peg_in_hole(0.0)).0), key(&first));
    }
}
