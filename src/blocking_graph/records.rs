//! What is remembered of pairs of parts: along which translations one keeps the other from moving. That depends on the
//! two shapes, on how they stand to each other (rounded: see [`CongruentPair`]), and on the question, so a pair analysed once
//! serves each state, request and assembly that has it.

use crate::cache::{Digest, RecordKey, RecordKind, Storage, Validity};
use crate::scene::{CongruentPair, Scene, add_pair, add_samples};
use crate::simulation::{Action, add_action};

const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_BLOCKING_GRAPH"));
/// For each translation, whether one part keeps another from it.
pub(crate) static BLOCKING: RecordKind =
    RecordKind::of::<Vec<bool>>(2, "blocking", Storage::MemoryAndDisk, SOURCES);

/// The key of what one part of a pair keeps the other from, by a rule; `least` is the travel that counts as motion.
pub(super) fn blocking_key(
    scene: &Scene,
    pair: &CongruentPair,
    rule: &str,
    translations: &[Action],
    least: f64,
) -> RecordKey {
    let mut digest = Digest::new();
    add_pair(&mut digest, scene, pair);
    let [a, b] = pair.parts;
    digest.text(rule).numbers([scene.allowed.of(a, b), least]).integer(translations.len() as u64);
    for body in pair.parts.map(|part| &scene.bodies[part]) {
        add_samples(&mut digest, body);
    }
    for action in translations {
        add_action(&mut digest, action);
    }
    digest.key(&BLOCKING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, scene};
    use crate::geometry::Pose;

    fn keys(scene: &Scene) -> Vec<RecordKey> {
        let translations = Action::translations();
        let pair = CongruentPair::shifted(scene, 1, &scene.bodies[1].planning_from_shape, 0);
        let key = |rule, translations, least| blocking_key(scene, &pair, rule, translations, least);
        vec![
            key("sliding", &translations, 0.05),
            key("paper", &translations, 0.05),
            key("sliding", &translations[..4], 0.05),
            key("sliding", &translations, 0.04),
        ]
    }

    #[test]
    fn every_part_of_a_question_is_in_its_key() {
        let (first, _) = scene(block_on_plate());
        let mut all = keys(&first);
        let mut allowed = first.clone();
        allowed.allowed.allow(0, 1, 1e-3);
        all.extend(keys(&allowed));
        let [plate, block] = block_on_plate();
        let nearer = moved(block.clone(), &Pose::translation(1e-6, 0.0, 0.0));
        all.extend(keys(&scene([plate.clone(), nearer]).0));
        all.extend(keys(&scene(peg_in_hole(0.0)).0));
        let distinct: std::collections::HashSet<_> = all.iter().collect();
        assert_eq!(distinct.len(), all.len());
        // The same elsewhere, and under a rounding error.
        let elsewhere = Pose::translation(0.5, -0.25, 8.0);
        let there = scene([moved(plate, &elsewhere), moved(block, &elsewhere)]).0;
        assert_eq!(keys(&there), keys(&first));
    }
}
