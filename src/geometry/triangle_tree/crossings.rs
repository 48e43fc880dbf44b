//! How often a ray leaves a surface more than it enters it.

use nalgebra::Vector3;

use super::super::ray::{Ray, edge};
use super::{LEAF, Leaf, Segment, TriangleTree, WIDTH};

/// The ray passes through an edge or a vertex: another one has to be asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) struct Ambiguous;

impl TriangleTree {
    /// How many triangles a ray crosses from below, less those from above.
    ///
    /// # Errors
    /// The ray passes through an edge or a vertex.
    pub(in super::super) fn crossings(&self, ray: &Ray) -> Result<i32, Ambiguous> {
        let q = ray.from() - self.origin;
        // Along its axis it is out of the tree so far on.
        let segment = self.segment(&q, ray.direction(), q.amax() + self.radius);
        self.crossings_below(self.root, ray, &segment)
    }

    fn crossings_below(&self, at: u32, ray: &Ray, segment: &Segment) -> Result<i32, Ambiguous> {
        if at & LEAF != 0 {
            return self.leaves[(at & !LEAF) as usize].crossings(ray);
        }
        let node = &self.nodes[at as usize];
        let meets = node.meets(segment);
        let met = (0..WIDTH).filter(|&k| meets[k]);
        met.map(|k| self.crossings_below(node.child[k], ray, segment)).sum()
    }

    /// In single precision, with a margin for rounding.
    pub(super) fn segment(&self, q: &Vector3<f64>, direction: &Vector3<f64>, length: f64) -> Segment {
        let slack = (super::ROUNDING * (q.amax() + self.radius + length)) as f32;
        // Nearly parallel to a slab counts as parallel, without infinities.
        let steep = |x: f64| if x.abs() < 1e-12 { 1e12 } else { 1.0 / x };
        let (inverse, q) = (direction.map(|x| steep(x) as f32), q.map(|x| x as f32));
        let (inverse, margin) = (inverse.into(), [slack; 3]);
        Segment { q: q.into(), inverse, before: slack, length: length as f32 + slack, margin }
    }
}

impl Leaf {
    fn crossings(&self, ray: &Ray) -> Result<i32, Ambiguous> {
        let axes = ray.axes();
        let from = axes.map(|a| ray.from()[a]);
        // By corner and coordinate.
        let mut seen = [[[0.0; WIDTH]; 3]; 3];
        for (seen, corners) in seen.iter_mut().zip(&self.corners) {
            let [x, y, z] = axes.map(|a| &corners[a]);
            for k in 0..WIDTH {
                [seen[0][k], seen[1][k], seen[2][k]] = ray.seen([x[k], y[k], z[k]], from);
            }
        }
        let [a, b, c] = &seen;
        let mut sides = [[0.0; WIDTH]; 3];
        for k in 0..WIDTH {
            sides[0][k] = edge([b[0][k], b[1][k]], [c[0][k], c[1][k]]);
            sides[1][k] = edge([c[0][k], c[1][k]], [a[0][k], a[1][k]]);
            sides[2][k] = edge([a[0][k], a[1][k]], [b[0][k], b[1][k]]);
        }
        let [a, b, c] = [&a[2], &b[2], &c[2]];
        let mut sum = 0;
        for k in (0..WIDTH).filter(|&k| self.height[k].is_finite()) {
            let [u, v, w] = [sides[0][k], sides[1][k], sides[2][k]];
            let (least, most) = (u.min(v).min(w), u.max(v).max(w));
            if least < 0.0 && most > 0.0 {
                continue;
            }
            // All of it lies behind.
            if a[k] < 0.0 && b[k] < 0.0 && c[k] < 0.0 {
                continue;
            }
            if u == 0.0 || v == 0.0 || w == 0.0 {
                return Err(Ambiguous);
            }
            let around = least > 0.0;
            let along = u * a[k] + v * b[k] + w * c[k];
            if (along > 0.0) == around && along != 0.0 {
                sum += if around == (ray.sense() > 0.0) { 1 } else { -1 };
            }
        }
        Ok(sum)
    }
}
