//! Which parts' boxes meet a box, at the assembled poses: parry's tree of boxes.

use std::sync::{Arc, Mutex, PoisonError};

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector as ParryVector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

use crate::geometry::Bounds;

/// The boxes of all parts, in a tree.
#[derive(Debug, Clone)]
pub struct BroadPhase {
    boxes: Arc<PartBoxes>,
    /// Extended by every box of a query.
    watched: Option<Arc<Mutex<Bounds>>>,
}

#[derive(Debug)]
struct PartBoxes {
    tree: Bvh,
    list: Vec<Bounds>,
}

/// Single precision may decide in the tree: what it lets through is compared again, what it must not
/// miss is asked with this share of its coordinates more on every side.
const ROUNDING: f64 = 1e-5;

impl BroadPhase {
    /// The tree of some boxes.
    #[must_use]
    pub fn new(boxes: &[Bounds]) -> Self {
        let leaves: Vec<Aabb> = boxes.iter().map(|b| aabb(b, 0.0)).collect();
        let tree = Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves);
        Self { boxes: Arc::new(PartBoxes { tree, list: boxes.to_vec() }), watched: None }
    }

    /// The same boxes; `looked_at` is extended by every box of a query.
    #[must_use]
    pub fn watched(&self, looked_at: Arc<Mutex<Bounds>>) -> Self {
        Self { boxes: Arc::clone(&self.boxes), watched: Some(looked_at) }
    }

    fn asked_about(&self, bounds: &Bounds) {
        if let Some(looked_at) = &self.watched {
            let mut all = looked_at.lock().unwrap_or_else(PoisonError::into_inner);
            *all = all.union(bounds);
        }
    }

    /// All parts whose boxes meet a box, ascending.
    #[must_use]
    pub fn meeting(&self, bounds: &Bounds) -> Vec<usize> {
        self.asked_about(bounds);
        let size = bounds.min.coords.amax().max(bounds.max.coords.amax());
        let query = aabb(bounds, size * ROUNDING);
        let mut out: Vec<usize> = self.boxes.tree.intersect_aabb(&query).map(|i| i as usize).collect();
        out.retain(|&i| self.boxes.list[i].meets(bounds));
        out.sort_unstable();
        out
    }

    /// Of some parts (ascending), those whose boxes meet a box, ascending.
    #[must_use]
    pub fn meeting_of(&self, parts: &[usize], bounds: &Bounds) -> Vec<usize> {
        // Asking each is as quick for a few.
        if parts.len() < 16 {
            self.asked_about(bounds);
            return parts.iter().copied().filter(|&i| self.boxes.list[i].meets(bounds)).collect();
        }
        let mut out = self.meeting(bounds);
        out.retain(|i| parts.binary_search(i).is_ok());
        out
    }

    /// All pairs (the smaller number first) of which one's box, grown by `margin`, meets the other's,
    /// ascending.
    #[must_use]
    pub fn pairs(&self, margin: f64) -> Vec<(usize, usize)> {
        let mut out = Vec::new();
        for (a, bounds) in self.boxes.list.iter().enumerate() {
            let near = self.meeting(&bounds.grown(margin));
            out.extend(near.into_iter().filter(|&b| b > a).map(|b| (a, b)));
        }
        out
    }
}

fn aabb(bounds: &Bounds, margin: f64) -> Aabb {
    let b = bounds.grown(margin);
    Aabb::new(ParryVector::new(b.min.x, b.min.y, b.min.z), ParryVector::new(b.max.x, b.max.y, b.max.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::spread;

    fn boxes() -> Vec<Bounds> {
        let sizes = spread([0.01; 3], [1.5; 3], 200);
        spread([-5.0; 3], [5.0; 3], 200)
            .zip(sizes)
            .map(|(p, s)| Bounds { min: p, max: p + s.coords })
            .collect()
    }

    #[test]
    fn the_tree_finds_what_asking_all_finds() {
        let boxes = boxes();
        let tree = BroadPhase::new(&boxes);
        let some: Vec<usize> = (0..boxes.len()).step_by(3).collect();
        for (k, query) in boxes.iter().enumerate() {
            let expected: Vec<usize> = (0..boxes.len()).filter(|&i| boxes[i].meets(query)).collect();
            assert_eq!(tree.meeting(query), expected);
            assert!(expected.contains(&k));
            let expected: Vec<usize> = some.iter().copied().filter(|&i| boxes[i].meets(query)).collect();
            assert_eq!(tree.meeting_of(&some, query), expected);
            assert_eq!(
                tree.meeting_of(&some[..5], query),
                tree.meeting(query).into_iter().filter(|i| some[..5].contains(i)).collect::<Vec<_>>()
            );
        }
        let all = (0..boxes.len()).flat_map(|a| (a + 1..boxes.len()).map(move |b| (a, b)));
        let near = all.filter(|&(a, b)| boxes[a].grown(0.2).meets(&boxes[b])).collect::<Vec<_>>();
        assert_eq!(tree.pairs(0.2), near);
    }

    #[test]
    fn boxes_that_just_touch_meet() {
        let unit = |x: f64| Bounds { min: [x, 0.0, 0.0].into(), max: [x + 0.1, 1.0, 1.0].into() };
        let row: Vec<Bounds> = (0..40).map(|i| unit(f64::from(i) * 0.1)).collect();
        let tree = BroadPhase::new(&row);
        for i in 0..row.len() {
            let expected: Vec<usize> = (0..row.len()).filter(|&j| row[j].meets(&row[i])).collect();
            assert_eq!(tree.meeting(&row[i]), expected);
        }
    }

    #[test]
    fn a_tree_of_no_boxes_finds_nothing() {
        let tree = BroadPhase::new(&[]);
        assert!(tree.meeting(&boxes()[0]).is_empty() && tree.pairs(1.0).is_empty());
    }
}
