//! Triangles in the order of their distance from a point.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::Point3;

use super::{Corners, LEAF, ROUNDING, TriangleTree, WIDTH};

/// Who is shown triangles in the order of their distance.
pub(in super::super) trait Visitor {
    /// Triangles further than this are not asked for any more.
    fn reach(&self) -> f64;
    /// Which of eight boxes (of single precision, relative to `origin`) need not be looked into.
    fn hides_boxes(
        &self,
        origin: &Point3<f64>,
        min: &[[f32; WIDTH]; 3],
        max: &[[f32; WIDTH]; 3],
    ) -> [bool; WIDTH];
    /// Which of eight triangles need not be shown.
    fn hides_triangles(&self, corners: &Corners) -> [bool; WIDTH];
    /// A triangle.
    fn visit(&mut self, triangle: u32);
}

/// Marks a node of the tree; leaves have their own mark, triangles none: so at equal distances
/// triangles come first, and places in the order of the tree.
const NODE: u32 = 1 << 30;

/// Something at a squared distance, as a number that has the order of both: the bits of a float that
/// is not negative grow with it.
fn near(squared: f32, at: u32) -> Reverse<u64> {
    Reverse(u64::from(squared.to_bits()) << 32 | u64::from(at))
}

/// Where in the tree a child is, as a place of the queue.
fn place(child: u32) -> u32 {
    if child & LEAF == 0 { child | NODE } else { child }
}

impl TriangleTree {
    /// Shows `visitor` the triangles within its reach of `p`, nearest first but for rounding.
    pub(in super::super) fn nearest_first(&self, p: &Point3<f64>, visitor: &mut impl Visitor) {
        let q = p - self.origin;
        let slack = ROUNDING * (q.amax() + self.radius);
        let q: [f32; 3] = q.map(|x| x as f32).into();
        let mut queue = BinaryHeap::with_capacity(128);
        queue.push(near(0.0, place(self.root)));
        while let Some(Reverse(next)) = queue.pop() {
            let (squared, at) = (f32::from_bits((next >> 32) as u32), next as u32);
            let limit = ((visitor.reach() + slack).powi(2) * (1.0 + 1e-6)) as f32;
            if squared > limit {
                return;
            }
            if at & LEAF != 0 {
                let leaf = &self.leaves[(at & !LEAF) as usize];
                let bounds = leaf.squared_distances(&q);
                let hidden = visitor.hides_triangles(&leaf.corners);
                for k in (0..WIDTH).filter(|&k| bounds[k] <= limit && !hidden[k]) {
                    queue.push(near(bounds[k], leaf.triangle[k]));
                }
            } else if at & NODE != 0 {
                let node = &self.nodes[(at & !NODE) as usize];
                let bounds = node.squared_distances(&q);
                let hidden = visitor.hides_boxes(&self.origin, &node.min, &node.max);
                for k in (0..WIDTH).filter(|&k| bounds[k] <= limit && !hidden[k]) {
                    queue.push(near(bounds[k], place(node.child[k])));
                }
            } else {
                visitor.visit(at);
            }
        }
    }
}
