//! Whether surfaces meet, or cross themselves.

use std::sync::OnceLock;

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use parry3d_f64::query;
use parry3d_f64::shape::Triangle;
use rayon::prelude::*;

use super::Draft;
use crate::geometry::mesh;
use crate::termination::{Interrupt, Poll, Termination, try_all};

/// Surfaces nearer than this (of the part's size) touch: their nearest points could be
/// confused.
const TOUCH: f64 = 1e-7;

/// A surface crosses itself where an edge comes out behind a triangle by more than this (of
/// the part's size); less is rounding between neighbours.
const PIERCE: f64 = 1e-6;

/// Fewer triangles are not worth another thread.
const FEW: usize = 512;

/// Triangles between two looks at the termination condition.
const CROSSING_POLL: u32 = 256;

/// The shells of a part, scaled to unit size, in trees that are built when first asked.
pub(super) struct Surfaces<'a> {
    termination: &'a Termination,
    shells: &'a [Vec<u32>],
    corners: Vec<[Vector; 3]>,
    indices: Vec<[u32; 3]>,
    trees: Vec<OnceLock<Bvh>>,
}

impl<'a> Surfaces<'a> {
    pub(super) fn new(draft: &Draft, shells: &'a [Vec<u32>], termination: &'a Termination) -> Self {
        let (lo, hi) = mesh::bounds(&draft.vertices);
        let scale = (hi - lo).amax().max(f64::MIN_POSITIVE);
        let unit = |v: u32| {
            let p = (draft.vertices[v as usize] - lo) / scale;
            Vector::new(p.x, p.y, p.z)
        };
        let corners = draft.triangles.iter().map(|t| t.map(unit)).collect();
        let trees = shells.iter().map(|_| OnceLock::new()).collect();
        Self { termination, shells, corners, indices: draft.triangles.clone(), trees }
    }

    /// Whether two shells cross or touch.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn meet(&self, a: usize, b: usize) -> Result<bool, Interrupt> {
        let (few, many) = if self.shells[a].len() <= self.shells[b].len() { (a, b) } else { (b, a) };
        let poll = Poll::every(CROSSING_POLL, Some(self.termination));
        let are_apart = try_all(&self.shells[few], |&t| {
            poll.check()?;
            let region = self.aabb(t).loosened(TOUCH);
            Ok(!self.within(many, &region).any(|u| self.touch(t, u)))
        })?;
        Ok(!are_apart)
    }

    /// Whether a shell crosses itself. Triangles with a common vertex are taken on trust.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn crosses_itself(&self, shell: usize) -> Result<bool, Interrupt> {
        let apart = |t: u32, u: u32| {
            let (t, u) = (&self.indices[t as usize], &self.indices[u as usize]);
            !t.iter().any(|v| u.contains(v))
        };
        let is_free = |some: &[u32]| {
            let poll = Poll::every(CROSSING_POLL, Some(self.termination));
            try_all(some, |&t| {
                poll.check()?;
                let region = self.aabb(t);
                Ok(!self.within(shell, &region).any(|u| u > t && apart(t, u) && self.cross(t, u)))
            })
        };
        // The first chunk that crosses, or was interrupted, ends the search.
        let ended = self.shells[shell].par_chunks(FEW).map(is_free).find_any(|free| *free != Ok(true));
        Ok(!ended.unwrap_or(Ok(true))?)
    }

    /// A shell's triangles whose boxes meet a region.
    fn within<'s>(&'s self, shell: usize, region: &'s Aabb) -> impl Iterator<Item = u32> + 's {
        let triangles = &self.shells[shell];
        self.tree(shell).intersect_aabb(region).map(|place| triangles[place as usize])
    }

    fn tree(&self, shell: usize) -> &Bvh {
        self.trees[shell].get_or_init(|| {
            // By their places in the shell: of one or two leaves parry panics on other numbers than 0 and 1.
            let leaves = self.shells[shell].iter().map(|&t| self.aabb(t)).enumerate();
            Bvh::from_iter(BvhBuildStrategy::Binned, leaves)
        })
    }

    fn aabb(&self, triangle: u32) -> Aabb {
        let [a, b, c] = self.corners[triangle as usize];
        Aabb::new(a.min(b).min(c), a.max(b).max(c))
    }

    fn touch(&self, t: u32, u: u32) -> bool {
        let shape = |t: u32| {
            let [a, b, c] = self.corners[t as usize];
            Triangle::new(a, b, c)
        };
        let distance = query::distance(&Pose::IDENTITY, &shape(t), &Pose::IDENTITY, &shape(u));
        // What cannot be measured is taken for a touch: the winding number is never wrong.
        !distance.is_ok_and(|d| d.distance > TOUCH)
    }

    fn cross(&self, t: u32, u: u32) -> bool {
        let (t, u) = (&self.corners[t as usize], &self.corners[u as usize]);
        pierces(t, u) || pierces(u, t)
    }
}

/// Whether an edge of `t` goes through the inside of `u`.
fn pierces(t: &[Vector; 3], [a, b, c]: &[Vector; 3]) -> bool {
    let normal = (*b - *a).cross(*c - *a);
    let double_area = normal.length();
    if double_area == 0.0 {
        return false;
    }
    let heights = t.map(|p| (p - *a).dot(normal) / double_area);
    [(0, 1), (1, 2), (2, 0)].into_iter().any(|(i, j)| {
        let (from, to) = (heights[i], heights[j]);
        if from.min(to) > -PIERCE || from.max(to) < PIERCE {
            return false;
        }
        let point = t[i] + (t[j] - t[i]) * (from / (from - to));
        let inside = |p: Vector, q: Vector| (q - p).cross(point - p).dot(normal) > PIERCE * double_area;
        inside(*a, *b) && inside(*b, *c) && inside(*c, *a)
    })
}
