//! The convex hull of all standing parts, kept up to date while parts leave one by one.
//!
//! The nodes of a binary tree over the parts, neighbours in space together, hold the hulls of their parts. If one
//! part leaves, only the hulls above it change, each made of two smaller ones: this costs the logarithm of the number
//! of parts, where a hull of all points would cost their number. Most of these need not be joined at once: the points
//! of both halves serve as well, as long as they are few. All parts of the scene have their places in the tree,
//! whether they stand or not: parts that are gone from the start are taken out of the tree of all parts, which the
//! scene keeps.

use std::sync::Arc;

use nalgebra::Point3;
use rayon::prelude::*;

use crate::budgets::{LOOSE_HULL, MOSTLY_STANDING};
use crate::geometry::{Bounds, transformed};
use crate::termination::{Interrupt, Termination};

use super::{Scene, StandingParts};

/// The parts that stand, with the hulls of groups of them.
#[derive(Debug, Clone)]
pub struct HullTree {
    standing: Vec<usize>,
    /// Node `i` has the children `2 i` and `2 i + 1`; the root is 1. Empty for nodes without parts.
    hulls: Vec<Arc<[Point3<f64>]>>,
    /// How many points each had when it was last joined.
    joined: Vec<usize>,
    /// Per part of the scene: its leaf, or 0.
    leaf: Vec<usize>,
}

impl HullTree {
    /// Of some parts (ascending) at their assembled poses.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn new(scene: &Scene, standing: Vec<usize>, termination: &Termination) -> Result<Self, Interrupt> {
        let all = 0..scene.bodies.len();
        if MOSTLY_STANDING * (all.len() - standing.len()) > all.len() {
            return Self::joined(scene, standing, termination);
        }
        let mut tree = match scene.whole.get() {
            Some(whole) => whole.clone(),
            None => {
                let whole = Self::joined(scene, all.clone().collect(), termination)?;
                scene.whole.get_or_init(|| whole).clone()
            }
        };
        for gone in all.filter(|part| standing.binary_search(part).is_err()) {
            tree.remove(scene, gone);
        }
        Ok(tree)
    }

    /// The parts that stand, without any hull: of a search that was interrupted before it began.
    #[must_use]
    pub fn without_hulls(scene: &Scene, standing: Vec<usize>) -> Self {
        let count = scene.bodies.len();
        let nodes = 2 * count.next_power_of_two();
        Self { standing, hulls: vec![Arc::default(); nodes], joined: vec![0; nodes], leaf: vec![0; count] }
    }

    /// The same, each hull joined of two.
    fn joined(scene: &Scene, standing: Vec<usize>, termination: &Termination) -> Result<Self, Interrupt> {
        let mut order: Vec<usize> = (0..scene.bodies.len()).collect();
        let leaves = order.len().next_power_of_two();
        group(scene, &mut order);
        let mut tree = Self::without_hulls(scene, standing);
        for (k, &part) in order.iter().enumerate() {
            if tree.standing.binary_search(&part).is_err() {
                continue;
            }
            let body = &scene.bodies[part];
            tree.leaf[part] = leaves + k;
            tree.hulls[leaves + k] = transformed(&body.shape.hull, &body.planning_from_shape).into();
        }
        // Level by level: the hulls of one do not depend on each other.
        let mut level = leaves / 2;
        while level > 0 {
            let (above, below) = tree.hulls.split_at_mut(2 * level);
            above[level..].par_iter_mut().zip(below.par_chunks_exact(2)).try_for_each(
                |(hull, children)| {
                    termination.check()?;
                    *hull = scene.hulls.of(&children[0], &children[1]);
                    Ok(())
                },
            )?;
            level /= 2;
        }
        tree.joined = tree.hulls.iter().map(|hull| hull.len()).collect();
        Ok(tree)
    }

    /// Bytes in memory, about.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.hulls.iter().map(|hull| size_of_val(&**hull)).sum::<usize>()
            + size_of_val(&*self.joined)
            + size_of_val(&*self.leaf)
    }

    /// The parts that stand, ascending.
    #[must_use]
    pub fn standing(&self) -> &[usize] {
        &self.standing
    }

    /// Vertices of the hull of them all, and perhaps other points of them.
    #[must_use]
    pub fn hull(&self) -> &[Point3<f64>] {
        self.hulls.get(1).map_or(&[], |hull| hull)
    }

    /// All that stands but one part.
    #[must_use]
    pub fn without(&self, scene: &Scene, part: usize) -> StandingParts {
        let standing = self.standing.iter().copied().filter(|&i| i != part).collect();
        if !self.shapes_hull(scene, part) {
            return StandingParts { standing, hull: self.hull().to_vec() };
        }
        // The hulls beside its way to the root hold all others. To join them would cost more than
        // the few inner points that they have too many.
        let mut node = self.leaf[part];
        let mut hull = Vec::new();
        while node > 1 {
            hull.extend_from_slice(&self.hulls[node ^ 1]);
            node /= 2;
        }
        StandingParts { standing, hull }
    }

    /// Whether the hull may be another one without a part.
    #[must_use]
    pub fn shapes_hull(&self, scene: &Scene, part: usize) -> bool {
        let bounds = scene.bodies[part].bounds.grown(1e-9);
        self.hull().iter().any(|v| bounds.contains(v))
    }

    /// Takes a part out; whether the hull may have changed.
    pub fn remove(&mut self, scene: &Scene, part: usize) -> bool {
        let Ok(at) = self.standing.binary_search(&part) else { return false };
        let shaped = self.shapes_hull(scene, part);
        self.standing.remove(at);
        let mut node = self.leaf[part];
        self.leaf[part] = 0;
        let gone = std::mem::take(&mut self.hulls[node]);
        let bounds = Bounds::of(gone.iter());
        while node > 1 {
            node /= 2;
            // A hull that had none of its points stays, and all above. Few others are where they were.
            if !self.hulls[node].iter().any(|v| bounds.contains(v) && gone.contains(v)) {
                break;
            }
            let [one, other] = [2 * node, 2 * node + 1].map(|child| &self.hulls[child]);
            // The points of both hold no more than their hull does: some that are inside cost less than to
            // find them out at every step.
            self.hulls[node] = if one.len() + other.len() <= LOOSE_HULL * self.joined[node] {
                [&**one, &**other].concat().into()
            } else {
                let joined = scene.hulls.of(one, other);
                self.joined[node] = joined.len();
                joined
            };
        }
        shaped
    }
}

/// Orders parts such that halves, quarters and so on lie together.
fn group(scene: &Scene, parts: &mut [usize]) {
    if parts.len() < 2 {
        return;
    }
    let centre = |&i: &usize| scene.bodies[i].bounds.centre();
    let centres: Vec<_> = parts.iter().map(centre).collect();
    let axis = Bounds::of(&centres).extents().imax();
    parts.sort_by(|i, j| centre(i)[axis].total_cmp(&centre(j)[axis]).then(i.cmp(j)));
    // As the tree is full from the left.
    let (left, right) = parts.split_at_mut(parts.len().next_power_of_two() / 2);
    group(scene, left);
    group(scene, right);
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{cuboid, scene, spread};
    use crate::geometry::gap_along;

    #[test]
    fn hulls_reach_as_far_as_those_of_all_points_while_parts_leave() {
        let cubes = spread([-4.0; 3], [3.0; 3], 21)
            .map(|p| cuboid([p.x, p.y, p.z], [p.x + 0.6, p.y + 0.5, p.z + 0.7]));
        let (scene, _) = scene(cubes.chain([cuboid([-4.0; 3], [-3.9; 3]), cuboid([3.9; 3], [4.0; 3])]));
        let mut left: Vec<usize> = (0..scene.bodies.len()).collect();
        let mut tree = HullTree::new(&scene, left.clone(), &Termination::default()).unwrap();
        let same = |hull: &[Point3<f64>], parts: Vec<usize>| {
            let all = StandingParts::new(&scene, parts).hull;
            for d in spread([-1.0; 3], [1.0; 3], 40) {
                let d: Vector3<f64> = d.coords.normalize();
                let reach = |points: &[Point3<f64>]| gap_along(&d, points, &[Point3::origin()]);
                assert!((reach(hull) - reach(&all)).abs() < 1e-9);
            }
        };
        while left.len() > 1 {
            assert_eq!(tree.standing(), left);
            same(tree.hull(), left.clone());
            for &part in &left {
                let rest: Vec<usize> = left.iter().copied().filter(|&i| i != part).collect();
                let around = tree.without(&scene, part);
                assert_eq!(around.standing, rest);
                same(&around.hull, rest);
            }
            let gone = left.remove(left.len() * 2 / 3);
            let before = tree.hull().to_vec();
            assert!(tree.remove(&scene, gone) || tree.hull().len() == before.len());
        }
        assert!(tree.remove(&scene, left[0]) && tree.hull().is_empty());
        assert!(!tree.remove(&scene, left[0]), "it is gone");
    }

    #[test]
    fn an_interrupted_tree_is_an_error_and_leaves_nothing_behind() {
        let cubes =
            spread([-4.0; 3], [3.0; 3], 8).map(|p| cuboid(p.into(), (p.coords.add_scalar(0.5)).into()));
        let (scene, _) = scene(cubes);
        let over = Termination::default();
        over.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        for standing in [vec![0, 1, 3, 4, 5, 6, 7], vec![2, 5]] {
            assert_eq!(HullTree::new(&scene, standing.clone(), &over).err(), Some(Interrupt::Cancelled));
            assert_eq!(HullTree::without_hulls(&scene, standing.clone()).standing(), standing);
        }
        let whole = HullTree::new(&scene, (0..8).collect(), &Termination::default()).unwrap();
        assert!(!whole.hull().is_empty());
    }

    #[test]
    fn what_is_gone_from_the_start_costs_no_hulls() {
        let cubes =
            spread([-4.0; 3], [3.0; 3], 32).map(|p| cuboid(p.into(), (p.coords.add_scalar(0.5)).into()));
        let (scene, _) = scene(cubes.chain([cuboid([-4.0; 3], [-3.9; 3]), cuboid([3.9; 3], [4.0; 3])]));
        let all: Vec<usize> = (0..scene.bodies.len()).collect();
        let mut whole = HullTree::new(&scene, all.clone(), &Termination::default()).unwrap();
        let joined = scene.hulls.count();
        for gone in [0, 7, 33] {
            let before = scene.hulls.count();
            let without = HullTree::new(
                &scene,
                all.iter().copied().filter(|&part| part != gone).collect(),
                &Termination::default(),
            )
            .unwrap();
            assert_eq!(scene.hulls.count(), before, "{joined}");
            let mut whole = whole.clone();
            whole.remove(&scene, gone);
            assert_eq!(without.standing(), whole.standing());
            for d in spread([-1.0; 3], [1.0; 3], 40).map(|d| d.coords.normalize()) {
                let reach = |hull: &[Point3<f64>]| gap_along(&d, hull, &[Point3::origin()]);
                assert!((reach(without.hull()) - reach(whole.hull())).abs() < 1e-9);
            }
        }
        assert!(joined >= 31 && whole.remove(&scene, 33));
        // Of few parts, theirs alone are joined, and hold the same.
        let few = vec![1, 5, 9, 13];
        let tree = HullTree::new(&scene, few.clone(), &Termination::default()).unwrap();
        assert_eq!(tree.standing(), few);
        let alone = StandingParts::new(&scene, few).hull;
        for d in spread([-1.0; 3], [1.0; 3], 40).map(|d| d.coords.normalize()) {
            let reach = |hull: &[Point3<f64>]| gap_along(&d, hull, &[Point3::origin()]);
            assert!((reach(tree.hull()) - reach(&alone)).abs() < 1e-9);
        }
    }
}
