//! Pairs of parts that stand alike: what holds for one bolt in its nut holds for all.

use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use crate::geometry::{Pose, Shape};

use super::Scene;

/// The first of each group of pairs that stand alike, and for every pair the group that it is in.
#[must_use]
pub fn alike(scene: &Scene, pairs: &[(usize, usize)]) -> (Vec<(usize, usize)>, Vec<usize>) {
    grouped(pairs, |mover, other| PairKey::of(scene, mover, other))
}

/// The same for pairs that may be turned together: what is asked about them depends on their relative
/// pose only, and not on which of the two is named first.
#[must_use]
pub fn placed_alike(scene: &Scene, pairs: &[(usize, usize)]) -> (Vec<(usize, usize)>, Vec<usize>) {
    let mut shapes: HashMap<*const Shape, usize> = HashMap::new();
    let of_body = scene.bodies.iter().map(|body| Arc::as_ptr(&body.shape));
    let kinds: Vec<usize> = of_body.enumerate().map(|(i, s)| *shapes.entry(s).or_insert(i)).collect();
    grouped(pairs, |a, b| {
        let [a, b] = if kinds[a] <= kinds[b] { [a, b] } else { [b, a] };
        let [from, to] = [a, b].map(|part| scene.bodies[part].planning_from_shape);
        let between = from.inverse() * to;
        let way: [i64; 3] = between.translation.vector.map(snapped).into();
        ([kinds[a], kinds[b]], turned(&between), way)
    })
}

fn grouped<K: Eq + Hash>(
    pairs: &[(usize, usize)],
    key: impl Fn(usize, usize) -> K,
) -> (Vec<(usize, usize)>, Vec<usize>) {
    let mut groups: HashMap<K, usize> = HashMap::new();
    let mut first = Vec::new();
    let group_of = pairs
        .iter()
        .map(|&(a, b)| {
            *groups.entry(key(a, b)).or_insert_with(|| {
                first.push((a, b));
                first.len() - 1
            })
        })
        .collect();
    (first, group_of)
}

/// Far finer than contact is measured, far coarser than poses are rounded.
fn snapped(x: f64) -> i64 {
    (x * 1e8).round() as i64
}

/// A rotation, of whose two quaternions one is taken.
fn turned(pose: &Pose) -> [i64; 4] {
    let q = pose.rotation.coords;
    let sign = q.iter().find(|c| c.abs() > 1e-7).map_or(1.0, |c| c.signum());
    (q * sign).map(snapped).into()
}

/// Pairs with equal keys stand alike: the same shapes at the same relative place, turned alike
/// against the axes of the actions.
#[derive(PartialEq, Eq, Hash)]
struct PairKey {
    shapes: [*const Shape; 2],
    rotations: [[i64; 4]; 2],
    between: [i64; 3],
    allowance: i64,
}

impl PairKey {
    fn of(scene: &Scene, mover: usize, other: usize) -> Self {
        let bodies = [&scene.bodies[mover], &scene.bodies[other]];
        let [a, b] = bodies.map(|body| body.planning_from_shape);
        Self {
            shapes: bodies.map(|body| Arc::as_ptr(&body.shape)),
            rotations: [a, b].map(|pose| turned(&pose)),
            between: (b.translation.vector - a.translation.vector).map(snapped).into(),
            allowance: snapped(scene.allowances.of(mover, other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    use crate::fixtures::{cuboid, moved, scene};

    #[test]
    fn equal_pairs_are_one_group() {
        let post = |x: f64| cuboid([x, 0.0, 1.0], [x + 1.0, 1.0, 3.0]);
        let foot = |x: f64| cuboid([x - 1.0, -1.0, 0.0], [x + 2.0, 2.0, 1.0]);
        let (scene, _) = scene([foot(0.0), post(0.0), foot(5.0), post(5.0)]);
        let (first, group_of) = alike(&scene, &[(0, 1), (2, 3), (0, 3)]);
        assert_eq!((first, group_of), (vec![(0, 1), (0, 3)], vec![0, 0, 1]));
    }

    #[test]
    fn pairs_that_are_turned_together_are_placed_alike() {
        let quarter = Pose::rotation(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let foot = || cuboid([-1.0, -1.5, 0.0], [2.0, 2.0, 1.0]);
        let post = || cuboid([0.0, 0.0, 1.0], [1.0, 1.25, 3.0]);
        let turned = |mesh| moved(moved(mesh, &quarter), &Pose::translation(6.0, 0.0, 0.0));
        let (scene, _) = scene([foot(), post(), turned(post()), turned(foot())]);
        let pairs = [(0, 1), (2, 3), (0, 2)];
        assert_eq!(alike(&scene, &pairs).0.len(), 3);
        assert_eq!(placed_alike(&scene, &pairs), (vec![(0, 1), (0, 2)], vec![0, 0, 1]));
    }
}
