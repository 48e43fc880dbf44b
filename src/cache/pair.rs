//! What is remembered about pairs of parts: how deep they overlap as assembled, and along which
//! translations one keeps the other from moving.
//!
//! Such an answer depends on the two shapes, on how they stand to each other (rounded: see [`Pair`]), and
//! on what is in the question; so a pair analysed once serves every state, request and assembly in
//! which it recurs.

use super::recall::About;
use super::records::{BlockingRecord, OverlapRecord};
use super::{Digest, Key, Kind, Recall};
use crate::geometry::Pose;
use crate::scene::{Body, Pair, Scene};
use crate::simulation::Action;
use crate::termination::Interrupt;

impl Recall {
    /// The depth of a pair, as remembered, or else as measured, which is then remembered.
    ///
    /// # Errors
    /// What `measure` returns.
    pub fn overlap<E>(&self, key: Key, measure: impl FnOnce() -> Result<f64, E>) -> Result<f64, E> {
        if let Some(OverlapRecord { depth }) = self.get(&key) {
            self.count(About::Overlap);
            return Ok(depth);
        }
        let depth = measure()?;
        self.put(key, &OverlapRecord { depth });
        Ok(depth)
    }

    /// For each of so many translations whether it is blocked, as remembered, or else as analysed, which is
    /// then remembered.
    ///
    /// # Errors
    /// The analysis was interrupted.
    pub fn blocking(
        &self,
        key: Key,
        actions: usize,
        analyse: impl FnOnce() -> Result<Vec<bool>, Interrupt>,
    ) -> Result<Vec<bool>, Interrupt> {
        if let Some(BlockingRecord { blocked }) = self.get(&key)
            && blocked.len() == actions
        {
            self.count(About::Blocking);
            return Ok(blocked);
        }
        let blocked = analyse()?;
        self.put(key, &BlockingRecord { blocked: blocked.clone() });
        Ok(blocked)
    }
}

/// The key of how deep a pair overlaps.
#[must_use]
pub fn overlap_key(scene: &Scene, pair: &Pair) -> Key {
    let mut digest = Digest::new();
    add_pair(&mut digest, scene, pair);
    digest.numbers([scene.longest_side]).key(Kind::Overlap)
}

/// The key of what one part of a pair keeps the other from, by a rule; `least` is the travel that counts
/// as motion.
#[must_use]
pub fn blocking_key(scene: &Scene, pair: &Pair, rule: &str, actions: &[Action], least: f64) -> Key {
    let mut digest = Digest::new();
    add_pair(&mut digest, scene, pair);
    let [a, b] = pair.parts;
    digest.text(rule).numbers([scene.allowances.of(a, b), least]).integer(actions.len() as u64);
    for body in pair.parts.map(|part| &scene.bodies[part]) {
        add_samples(&mut digest, body);
    }
    for action in actions {
        add_action(&mut digest, action);
    }
    digest.key(Kind::Blocking)
}

fn add_pair(digest: &mut Digest, scene: &Scene, pair: &Pair) {
    for (part, pose) in pair.parts.iter().zip(&pair.poses) {
        digest.hash(scene.bodies[*part].shape.content());
        add_pose(digest, pose);
    }
}

/// A pose, bit by bit.
pub(super) fn add_pose(digest: &mut Digest, pose: &Pose) {
    digest.numbers(pose.translation.vector.iter().copied()).numbers(pose.rotation.coords.iter().copied());
}

/// Where verification found samples missing.
pub(super) fn add_samples(digest: &mut Digest, body: &Body) {
    let points = body.extra_samples.points();
    digest.integer(points.len() as u64);
    points.iter().for_each(|p| {
        digest.numbers(p.iter().copied());
    });
}

/// Force, torque, and whether the part may turn: that is all there is to an action.
pub(super) fn add_action(digest: &mut Digest, action: &Action) {
    let (force, torque) = (action.force(), action.torque());
    digest.numbers(force.iter().chain(torque.iter()).copied()).integer(u64::from(action.turns()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, moved, peg_in_hole, scene};

    fn pairs(scene: &Scene) -> [Pair; 2] {
        [Pair::turned(scene, 1, 0), Pair::shifted(scene, 1, &scene.bodies[1].planning_from_shape, 0)]
    }

    fn keys(scene: &Scene) -> Vec<Key> {
        let actions = Action::translations();
        let [turned, shifted] = pairs(scene);
        let blocking = |rule, actions, least| blocking_key(scene, &shifted, rule, actions, least);
        vec![
            overlap_key(scene, &turned),
            blocking("sliding", &actions, 0.05),
            blocking("paper", &actions, 0.05),
            blocking("sliding", &actions[..4], 0.05),
            blocking("sliding", &actions, 0.04),
        ]
    }

    #[test]
    fn every_part_of_a_question_is_in_its_key() {
        let (first, _) = scene(block_on_plate());
        let mut all = keys(&first);
        let mut granted = first.clone();
        granted.allowances.grant(0, 1, 1e-3);
        // The depth of an overlap does not depend on what is granted.
        assert_eq!(keys(&granted)[0], all[0]);
        all.extend(keys(&granted).into_iter().skip(1));
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
