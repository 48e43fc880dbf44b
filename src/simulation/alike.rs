//! Pairs of parts that stand alike: what holds for one bolt in its nut holds for all.

use std::collections::HashMap;
use std::sync::Arc;

use crate::geometry::Shape;

use super::Scene;

/// The first of each group of pairs that stand alike, and for every pair the group that it is in.
#[must_use]
pub fn alike(scene: &Scene, pairs: &[(usize, usize)]) -> (Vec<(usize, usize)>, Vec<usize>) {
    let mut groups: HashMap<PairKey, usize> = HashMap::new();
    let mut first = Vec::new();
    let group_of = pairs
        .iter()
        .map(|&(mover, other)| {
            *groups.entry(PairKey::of(scene, mover, other)).or_insert_with(|| {
                first.push((mover, other));
                first.len() - 1
            })
        })
        .collect();
    (first, group_of)
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
        // Far finer than contact is measured, far coarser than poses are rounded.
        let snapped = |x: f64| (x * 1e8).round() as i64;
        let [a, b] = bodies.map(|body| body.planning_from_shape);
        Self {
            shapes: bodies.map(|body| Arc::as_ptr(&body.shape)),
            rotations: [a, b].map(|pose| {
                let q = pose.rotation.coords;
                // A rotation has two quaternions.
                let sign = q.iter().find(|c| c.abs() > 1e-7).map_or(1.0, |c| c.signum());
                (q * sign).map(snapped).into()
            }),
            between: (b.translation.vector - a.translation.vector).map(snapped).into(),
            allowance: snapped(scene.allowances.of(mover, other)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, scene};

    #[test]
    fn equal_pairs_are_one_group() {
        let post = |x: f64| cuboid([x, 0.0, 1.0], [x + 1.0, 1.0, 3.0]);
        let foot = |x: f64| cuboid([x - 1.0, -1.0, 0.0], [x + 2.0, 2.0, 1.0]);
        let (scene, _) = scene([foot(0.0), post(0.0), foot(5.0), post(5.0)]);
        let (first, group_of) = alike(&scene, &[(0, 1), (2, 3), (0, 3)]);
        assert_eq!((first, group_of), (vec![(0, 1), (0, 3)], vec![0, 0, 1]));
    }
}
