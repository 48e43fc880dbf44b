//! Pairs of parts up to a common motion: what holds for one bolt in its nut holds for all congruent pairs, in this
//! assembly and in others.
//!
//! Poses are rounded, far finer than contact is measured, and questions about a pair are answered for the rounded
//! poses in a scene of the two alone. So the answer is the same to the bit for all congruent pairs, whichever comes
//! first.

use std::collections::HashMap;
use std::hash::Hash;

use nalgebra::{Point3, UnitQuaternion, Vector3};

use crate::geometry::{Bounds, Pose};

use super::Scene;

/// Two parts with rounded poses of their shapes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CongruentPair {
    /// The parts' numbers.
    pub parts: [usize; 2],
    /// Where they stand, up to a motion of both together.
    pub poses: [Pose; 2],
}

impl CongruentPair {
    /// A part at a pose and another as assembled, shifted together: for questions that depend on how
    /// they are turned against the axes of the world.
    #[must_use]
    pub fn shifted(scene: &Scene, part: usize, pose: &Pose, other: usize) -> Self {
        let there = scene.bodies[other].planning_from_shape;
        let way = (there.translation.vector - pose.translation.vector).map(rounded);
        let turned = [pose, &there].map(|p| rounded_turn(&p.rotation));
        let poses =
            [Pose::from_parts(Vector3::zeros().into(), turned[0]), Pose::from_parts(way.into(), turned[1])];
        Self { parts: [part, other], poses }
    }

    /// Two parts as assembled, turned together such that the first is not turned at all: for questions
    /// that depend on their relative pose only, and not on which of them is named first.
    #[must_use]
    pub fn turned(scene: &Scene, a: usize, b: usize) -> Self {
        let of = |parts: [usize; 2]| {
            let [from, to] = parts.map(|part| scene.bodies[part].planning_from_shape);
            let between = from.inverse() * to;
            Self { parts, poses: [Pose::identity(), rounded_pose(&between)] }
        };
        let hash = |part: usize| scene.bodies[part].shape.content();
        let bits = |pair: &Self| -> ([u64; 3], [u64; 4]) {
            let there = pair.poses[1];
            (
                there.translation.vector.map(f64::to_bits).into(),
                there.rotation.coords.map(f64::to_bits).into(),
            )
        };
        let (one, other) = (of([a, b]), of([b, a]));
        let first = (hash(a), bits(&one)) <= (hash(b), bits(&other));
        if first { one } else { other }
    }

    /// A scene of the two alone, as parts 0 and 1, with their allowed penetration and the resolution of the whole.
    #[must_use]
    pub fn scene(&self, scene: &Scene) -> Scene {
        let [a, b] = self.parts;
        let mut bodies = self.parts.map(|part| scene.bodies[part].clone());
        for (body, pose) in bodies.iter_mut().zip(&self.poses) {
            let hull: Vec<Point3<f64>> = body.shape.hull.iter().map(|p| pose * p).collect();
            (body.planning_from_shape, body.bounds) = (*pose, Bounds::of(&hull));
        }
        let mut pair = Scene::of(bodies.into(), scene.longest_side);
        let allowed = scene.allowed.of(a, b);
        if allowed > 0.0 {
            pair.allowed.allow(0, 1, allowed);
        }
        pair
    }
}

/// Of things with equal keys the first one's place, in order, and for each thing the place of its key among these.
pub fn grouped<K: Eq + Hash>(keys: impl IntoIterator<Item = K>) -> (Vec<usize>, Vec<usize>) {
    let (mut groups, mut first) = (HashMap::new(), Vec::new());
    let group = |(i, key)| {
        *groups.entry(key).or_insert_with(|| {
            first.push(i);
            first.len() - 1
        })
    };
    let group_of = keys.into_iter().enumerate().map(group).collect();
    (first, group_of)
}

/// To about a billionth, as are lengths in the planning frame.
#[must_use]
pub fn rounded(x: f64) -> f64 {
    const STEP: f64 = 1.0 / (1u64 << 30) as f64;
    // Without the sign of zero.
    (x / STEP).round() * STEP + 0.0
}

/// A rounded pose: congruent pairs have equal ones to the bit.
#[must_use]
pub fn rounded_pose(pose: &Pose) -> Pose {
    Pose::from_parts(pose.translation.vector.map(rounded).into(), rounded_turn(&pose.rotation))
}

/// A rotation, by one of its two quaternions.
fn rounded_turn(q: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let coords = q.coords.map(rounded);
    let sign = coords.iter().find(|c| **c != 0.0).map_or(1.0, |c| c.signum());
    UnitQuaternion::new_normalize(nalgebra::Quaternion::from(coords.map(|c| c * sign + 0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::fixtures::{cuboid, moved, scene};

    #[test]
    fn equal_keys_are_one_group() {
        assert_eq!(grouped(["a", "b", "a", "c", "b"]), (vec![0, 1, 3], vec![0, 1, 0, 2, 1]));
    }

    #[test]
    fn shifted_pairs_stand_alike() {
        let post = |x: f64| cuboid([x, 0.0, 1.0], [x + 1.0, 1.0, 3.0]);
        let foot = |x: f64| cuboid([x - 1.0, -1.0, 0.0], [x + 2.0, 2.0, 1.0]);
        let (scene, _) = scene([foot(0.0), post(0.0), foot(5.1), post(5.1)]);
        let pair = |a: usize, b: usize| {
            CongruentPair::shifted(&scene, a, &scene.bodies[a].planning_from_shape, b).poses
        };
        assert_eq!(pair(0, 1), pair(2, 3));
        assert_ne!(pair(0, 1), pair(0, 3));
        assert_ne!(pair(0, 1), pair(1, 0));
    }

    #[test]
    fn pairs_that_are_turned_together_stand_alike_whichever_is_first() {
        let quarter = Pose::rotation(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let foot = || cuboid([-1.0, -1.5, 0.0], [2.0, 2.0, 1.0]);
        let post = || cuboid([0.0, 0.0, 1.0], [1.0, 1.25, 3.0]);
        let turned = |mesh| moved(moved(mesh, &quarter), &Pose::translation(6.0, 0.0, 0.0));
        let (scene, _) = scene([foot(), post(), turned(post()), turned(foot())]);
        let pair = |a: usize, b: usize| {
            let pair = CongruentPair::turned(&scene, a, b);
            (pair.parts.map(|p| scene.bodies[p].shape.content()), pair.poses)
        };
        assert_eq!(pair(0, 1), pair(2, 3));
        assert_eq!(pair(0, 1), pair(1, 0));
        assert_ne!(pair(0, 1), pair(0, 2));
        let shifted = |a: usize, b: usize| {
            CongruentPair::shifted(&scene, a, &scene.bodies[a].planning_from_shape, b).poses
        };
        assert_ne!(shifted(0, 1), shifted(3, 2));
    }

    #[test]
    fn a_pair_stands_as_its_parts_do_in_the_assembly() {
        let turn = Pose::new(Vector3::new(3.0, -1.0, 0.5), Vector3::new(0.2, -0.4, 1.0));
        let (scene, _) =
            scene([cuboid([-4.0; 3], [0.0; 3]), moved(cuboid([0.0; 3], [1.0, 2.0, 3.0]), &turn)]);
        for pair in [
            CongruentPair::turned(&scene, 0, 1),
            CongruentPair::shifted(&scene, 1, &scene.bodies[1].planning_from_shape, 0),
        ] {
            let alone = pair.scene(&scene);
            let between = |s: &Scene, a: usize, b: usize| {
                s.bodies[a].planning_from_shape.inverse() * s.bodies[b].planning_from_shape
            };
            let (here, there) = (between(&alone, 0, 1), between(&scene, pair.parts[0], pair.parts[1]));
            assert!((here.to_matrix() - there.to_matrix()).norm() < 1e-8);
            for body in alone.bodies.iter() {
                let inside = |v| body.bounds.grown(1e-12).contains(&(body.planning_from_shape * v));
                assert!(body.shape.surface.vertices().iter().all(inside));
            }
        }
    }
}
