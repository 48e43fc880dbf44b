//! Rapidly-exploring random trees: poses of a body, each reached from the one before, that grow towards random poses
//! (S. LaValle, "Rapidly-exploring random trees: a new tool for path planning", 1998).
//!
//! Stages give a [`Space`]: which ways between poses are free. The planners `rrt` and `bk-rrt` grow one tree until it
//! is out; assembly plans link two poses by RRT-Connect (J. Kuffner and S. LaValle, "RRT-Connect: an efficient approach
//! to single-query path planning", 2000): a tree grows from the start and another from the goal, each in turn towards a
//! random pose, and the other one greedily towards what was reached.
//!
//! Ways between poses are asked for as a whole, so a greedy try costs one question; where it fails, the tree goes as far
//! as its shorter steps get.

mod pose_sampler;

use crate::geometry::{Pose, Uniform};
use crate::scene::PartMetric;
use crate::termination::Interrupt;

pub(crate) use pose_sampler::PoseSampler;

/// A step towards a random pose goes all the way, or so much of it where something is in the way.
const STEPS: [f64; 4] = [1.0, 0.5, 0.25, 0.125];
/// Poses closer than this share of the extent are the same.
const SAME: f64 = 1e-9;

/// Where a body moves.
pub(crate) trait Space {
    /// How far apart poses are, and what lies between them.
    fn metric(&self) -> PartMetric;
    /// Whether the way from one pose to another is free.
    ///
    /// # Errors
    /// The termination condition became true.
    fn is_free(&self, from: &Pose, to: &Pose) -> Result<bool, Interrupt>;
    /// A random pose.
    fn sample(&mut self) -> Pose;
    /// The largest distance that there is, about.
    fn extent(&self) -> f64;
}

/// A way from `start` to `goal` by free pieces, if one is found with that many random poses.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn rrt_connect(
    space: &mut impl Space,
    start: &Pose,
    goal: &Pose,
    most_samples: usize,
) -> Result<Option<Vec<Pose>>, Interrupt> {
    if space.is_free(start, goal)? {
        return Ok(Some(vec![*start, *goal]));
    }
    let (mut growing, mut other) = (Tree::from(start), Tree::from(goal));
    for turn in 0..most_samples {
        let target = space.sample();
        if let Some(new) = growing.extended(space, growing.nearest(&space.metric(), &target), &target)? {
            let reached = growing.poses[new];
            if let Some(meeting) = other.connected(space, &reached)? {
                let (mut one, mut two) = (growing.way_to(new), other.way_to(meeting));
                if turn % 2 == 1 {
                    std::mem::swap(&mut one, &mut two);
                }
                two.pop();
                one.extend(two.into_iter().rev());
                return Ok(Some(one));
            }
        }
        std::mem::swap(&mut growing, &mut other);
    }
    Ok(None)
}

/// Poses that are reached from the first one.
#[derive(Debug)]
pub(crate) struct Tree {
    poses: Vec<Pose>,
    /// From which pose each was reached; the first from itself.
    parents: Vec<usize>,
}

impl Tree {
    pub(crate) fn from(root: &Pose) -> Self {
        Self { poses: vec![*root], parents: vec![0] }
    }

    pub(crate) fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The node nearest to a pose.
    pub(crate) fn nearest(&self, metric: &PartMetric, target: &Pose) -> usize {
        metric.nearest(&self.poses, target)
    }

    pub(crate) fn add(&mut self, pose: Pose, parent: usize) -> usize {
        self.poses.push(pose);
        self.parents.push(parent);
        self.poses.len() - 1
    }

    /// A step from a node towards a pose, if there is a free one.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn extended(
        &mut self,
        space: &impl Space,
        from: usize,
        target: &Pose,
    ) -> Result<Option<usize>, Interrupt> {
        let start = self.poses[from];
        let distance = space.metric().distance(&start, target);
        if distance <= SAME * space.extent() {
            return Ok(None);
        }
        for step in STEPS {
            let pose = if step < 1.0 { space.metric().between(&start, target, step) } else { *target };
            if space.is_free(&start, &pose)? {
                return Ok(Some(self.add(pose, from)));
            }
        }
        Ok(None)
    }

    /// The node at a pose, if it can be reached from the nearest one without going round anything.
    fn connected(&mut self, space: &impl Space, target: &Pose) -> Result<Option<usize>, Interrupt> {
        let mut node = self.nearest(&space.metric(), target);
        if space.is_free(&self.poses[node], target)? {
            return Ok(Some(self.add(*target, node)));
        }
        while let Some(next) = self.extended(space, node, target)? {
            if space.metric().distance(&self.poses[next], target) <= SAME * space.extent() {
                return Ok(Some(next));
            }
            node = next;
        }
        Ok(None)
    }

    /// The nodes from the first one to a node.
    pub(crate) fn nodes_to(&self, node: usize) -> Vec<usize> {
        let mut nodes = vec![node];
        while self.parents[nodes[nodes.len() - 1]] != nodes[nodes.len() - 1] {
            nodes.push(self.parents[nodes[nodes.len() - 1]]);
        }
        nodes.reverse();
        nodes
    }

    /// The poses from the first one to a node.
    pub(crate) fn way_to(&self, node: usize) -> Vec<Pose> {
        self.nodes_to(node).into_iter().map(|node| self.poses[node]).collect()
    }
}

/// A way with fewer and shorter pieces, by trying to leave poses out and to go straight between random
/// places on it.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn shortened(
    space: &impl Space,
    path: Vec<Pose>,
    tries: usize,
    uniform: &mut Uniform,
) -> Result<Vec<Pose>, Interrupt> {
    let mut path = pruned(space, &path)?;
    for _ in 0..tries {
        if path.len() < 3 {
            break;
        }
        let mut places = [(); 2].map(|()| uniform.number() * (path.len() - 1) as f64);
        places.sort_by(f64::total_cmp);
        let [first, last] = places.map(|p| p as usize);
        if first == last {
            continue;
        }
        let at = |place: f64| {
            let piece = place as usize;
            space.metric().between(&path[piece], &path[piece + 1], place - piece as f64)
        };
        let (from, to) = (at(places[0]), at(places[1]));
        if space.is_free(&from, &to)? {
            path.splice(first + 1..=last, [from, to]);
        }
    }
    pruned(space, &path)
}

/// A way without the poses that it can go straight past.
fn pruned(space: &impl Space, path: &[Pose]) -> Result<Vec<Pose>, Interrupt> {
    let mut kept: Vec<Pose> = path.first().copied().into_iter().collect();
    let mut at = 0;
    while at + 1 < path.len() {
        let mut next = path.len() - 1;
        while next > at + 1 && !space.is_free(&path[at], &path[next])? {
            next -= 1;
        }
        kept.push(path[next]);
        at = next;
    }
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, Vector3};
    use proptest::prelude::*;

    use super::*;

    /// A point in a square of side 10 with a wall at x = 5 that has a gap, or none.
    struct Walled {
        gap: Option<[f64; 2]>,
        uniform: Uniform,
    }

    impl Space for Walled {
        fn metric(&self) -> PartMetric {
            PartMetric { centre: Point3::new(0.0, 0.0, 0.0), reach: 0.0 }
        }

        fn is_free(&self, from: &Pose, to: &Pose) -> Result<bool, Interrupt> {
            let (a, b) = (from.translation.vector, to.translation.vector);
            if (a.x < 5.0) == (b.x < 5.0) {
                return Ok(true);
            }
            let y = a.y + (b.y - a.y) * (5.0 - a.x) / (b.x - a.x);
            Ok(self.gap.is_some_and(|[low, high]| low < y && y < high))
        }

        fn sample(&mut self) -> Pose {
            let [x, y] = [(); 2].map(|()| 10.0 * self.uniform.number());
            Pose::translation(x, y, 0.0)
        }

        fn extent(&self) -> f64 {
            10.0
        }
    }

    fn at(x: f64, y: f64) -> Pose {
        Pose::from(Vector3::new(x, y, 0.0))
    }

    proptest! {
        #[test]
        fn a_way_leads_through_the_gap_by_free_pieces(
            low in 0.5..8.0f64, width in 0.4..2.0f64, seed in 0u64..1000, ends in (0.0..10.0f64, 0.0..10.0f64),
        ) {
            let uniform = Uniform::seeded(&seed.to_le_bytes());
            let mut space = Walled { gap: Some([low, low + width]), uniform };
            let (start, goal) = (at(1.0, ends.0), at(9.0, ends.1));
            // Some hundreds of poses find it, but now and then it takes some thousands.
            let way = rrt_connect(&mut space, &start, &goal, 100_000).unwrap().expect("there is a gap");
            let mut uniform = Uniform::seeded(b"shortened");
            let short = shortened(&space, way.clone(), 30, &mut uniform).unwrap();
            let length = |way: &[Pose]| way.windows(2).map(|w| space.metric().distance(&w[0], &w[1])).sum::<f64>();
            prop_assert!(length(&short) <= length(&way) + 1e-9);
            for way in [way, short] {
                prop_assert_eq!((way[0], *way.last().unwrap()), (start, goal));
                for piece in way.windows(2) {
                    prop_assert!(space.is_free(&piece[0], &piece[1]).unwrap());
                }
            }
        }
    }

    #[test]
    fn no_way_leads_through_a_wall() {
        let mut space = Walled { gap: None, uniform: Uniform::seeded(b"wall") };
        assert_eq!(rrt_connect(&mut space, &at(1.0, 1.0), &at(9.0, 9.0), 200).unwrap(), None);
    }

    #[test]
    fn what_is_in_sight_is_gone_to_straight() {
        let mut space = Walled { gap: None, uniform: Uniform::seeded(b"near") };
        let way = rrt_connect(&mut space, &at(1.0, 1.0), &at(4.0, 9.0), 0).unwrap().unwrap();
        assert_eq!(way, [at(1.0, 1.0), at(4.0, 9.0)]);
    }
}
