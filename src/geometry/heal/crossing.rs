//! Whether surfaces meet, or cross themselves.

use std::sync::OnceLock;

use nalgebra::Point3;
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query;
use parry3d_f64::shape::Triangle;
use rayon::prelude::*;

use super::Draft;
use super::box_tree::{BoxTree, LooseBox};
use crate::geometry::mesh;
use crate::termination::{Interrupt, Poll, Termination};

/// Surfaces nearer than this (of the part's size) touch: their nearest points could be
/// confused.
const TOUCH: f64 = 1e-7;

/// A surface crosses itself where an edge comes out behind a triangle by more than this (of
/// the part's size); less is rounding between neighbours.
const PIERCE: f64 = 1e-6;

/// Triangles between two looks at the termination condition.
const CROSSING_POLL: u32 = 256;

/// The shells of a part, scaled to unit size, in trees that are built when first asked.
pub(super) struct Surfaces<'a> {
    termination: &'a Termination,
    shells: &'a [Vec<u32>],
    triangles: &'a [[u32; 3]],
    vertices: Vec<Vector>,
    lo: Point3<f64>,
    scale: f64,
    trees: Vec<OnceLock<BoxTree>>,
}

impl<'a> Surfaces<'a> {
    pub(super) fn new(draft: &'a Draft, shells: &'a [Vec<u32>], termination: &'a Termination) -> Self {
        let (lo, hi) = mesh::bounds(&draft.vertices);
        let scale = (hi - lo).amax().max(f64::MIN_POSITIVE);
        let vertices = draft.vertices.iter().map(|p| unit(p, &lo, scale)).collect();
        let trees = shells.iter().map(|_| OnceLock::new()).collect();
        Self { termination, shells, triangles: &draft.triangles, vertices, lo, scale, trees }
    }

    /// The pairs of shells whose boxes, as given, have a point in common, ascending.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn overlapping(
        &self,
        boxes: &[(Point3<f64>, Point3<f64>)],
    ) -> Result<Vec<[usize; 2]>, Interrupt> {
        let corner = |p: &Point3<f64>| unit(p, &self.lo, self.scale);
        let loose = |(lo, hi): &_| LooseBox::of(&Aabb::new(corner(lo), corner(hi)));
        let tree = BoxTree::new(&boxes.iter().map(loose).collect::<Vec<_>>());
        let overlap = |i: u32, j: u32| {
            let (a, b) = (&boxes[i as usize], &boxes[j as usize]);
            (0..3).all(|k| a.0[k] <= b.1[k] && b.0[k] <= a.1[k])
        };
        let poll = Poll::every(CROSSING_POLL, Some(self.termination));
        let mut pairs = Vec::new();
        for group in 0..tree.groups() {
            tree.any_pair(group, |i, j| {
                poll.check()?;
                pairs.extend(overlap(i, j).then_some([i.min(j) as usize, i.max(j) as usize]));
                Ok(false)
            })?;
        }
        pairs.sort_unstable();
        Ok(pairs)
    }

    /// Whether two shells cross or touch.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn meet(&self, a: usize, b: usize) -> Result<bool, Interrupt> {
        let (few, many) = if self.shells[a].len() <= self.shells[b].len() { (a, b) } else { (b, a) };
        let poll = Poll::every(CROSSING_POLL, Some(self.termination));
        for &t in &self.shells[few] {
            poll.check()?;
            let region = self.aabb(t).loosened(TOUCH);
            let touches = |place: u32| {
                let u = self.shells[many][place as usize];
                Ok(region.intersects(&self.aabb(u)) && self.touch(t, u))
            };
            if self.tree(many).any_meeting(&LooseBox::of(&region), touches)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether a shell crosses itself. Triangles with a common vertex are taken on trust.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn crosses_itself(&self, shell: usize) -> Result<bool, Interrupt> {
        let apart = |t: u32, u: u32| {
            let (t, u) = (&self.triangles[t as usize], &self.triangles[u as usize]);
            !t.iter().any(|v| u.contains(v))
        };
        let tree = self.tree(shell);
        let is_crossing = |group: usize| {
            let poll = Poll::every(CROSSING_POLL, Some(self.termination));
            tree.any_pair(group, |i, j| {
                let [t, u] = [i, j].map(|place| self.shells[shell][place as usize]);
                if !apart(t, u) {
                    return Ok(false);
                }
                poll.check()?;
                Ok(self.aabb(t).intersects(&self.aabb(u)) && self.cross(t, u))
            })
        };
        // The first group that crosses, or was interrupted, ends the search.
        let ended = (0..tree.groups()).into_par_iter().map(is_crossing).find_any(|found| *found != Ok(false));
        ended.unwrap_or(Ok(false))
    }

    fn tree(&self, shell: usize) -> &BoxTree {
        self.trees[shell].get_or_init(|| {
            let boxes = self.shells[shell].iter().map(|&t| LooseBox::of(&self.aabb(t)));
            BoxTree::new(&boxes.collect::<Vec<_>>())
        })
    }

    fn corners(&self, triangle: u32) -> [Vector; 3] {
        self.triangles[triangle as usize].map(|v| self.vertices[v as usize])
    }

    fn aabb(&self, triangle: u32) -> Aabb {
        let [a, b, c] = self.corners(triangle);
        Aabb::new(a.min(b).min(c), a.max(b).max(c))
    }

    fn touch(&self, t: u32, u: u32) -> bool {
        let shape = |t: u32| {
            let [a, b, c] = self.corners(t);
            Triangle::new(a, b, c)
        };
        let distance = query::distance(&Pose::IDENTITY, &shape(t), &Pose::IDENTITY, &shape(u));
        // What cannot be measured is taken for a touch: the winding number is never wrong.
        !distance.is_ok_and(|d| d.distance > TOUCH)
    }

    fn cross(&self, t: u32, u: u32) -> bool {
        let (t, u) = (&self.corners(t), &self.corners(u));
        pierces(t, u) || pierces(u, t)
    }
}

/// A point in units of the part's size.
fn unit(p: &Point3<f64>, lo: &Point3<f64>, scale: f64) -> Vector {
    let p = (p - lo) / scale;
    Vector::new(p.x, p.y, p.z)
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
