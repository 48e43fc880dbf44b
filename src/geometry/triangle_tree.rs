//! Which triangle is closest to a point: a tree of boxes, eight to a node and eight triangles to a
//! leaf, so that one pass of vector instructions tests all eight.
//!
//! Single precision decides only what cannot be closest, with a margin for its rounding; what
//! remains is measured in double precision. In a leaf, the bound of a triangle is the distance to
//! its plane joined with the distance beyond its sides in that plane: exact except beyond corners.

#![allow(clippy::needless_range_loop, reason = "loops over all lanes alike become vector instructions")]

mod crossings;
mod nearest_first;
mod split;

use nalgebra::{Point3, Vector3, center};

use super::triangle::area_normal;
use super::{Bounds, Closest, Mesh};

pub(super) use nearest_first::Visitor;
use split::{BoxedTriangle, split};

/// Boxes in a node, and triangles in a leaf.
pub(super) const WIDTH: usize = 8;
/// Most leaves hold more triangles than this.
const FILLED: usize = 4;
/// Bits of a child that is a leaf.
const LEAF: u32 = 1 << 31;
/// Rounding of coordinates and products, as a share of the coordinates' size.
const ROUNDING: f64 = 2e-6;

type Lanes = [f32; WIDTH];
/// The corners of eight triangles, in double precision: by corner, axis and triangle.
pub(super) type Corners = [[[f64; WIDTH]; 3]; 3];

/// Eight boxes and what they hold.
#[derive(Clone)]
#[repr(align(32))]
struct Node {
    min: [Lanes; 3],
    max: [Lanes; 3],
    child: [u32; WIDTH],
}

/// Eight triangles, each as a plane and three planes through its sides, all with unit normals
/// (outward, for the sides): a point of the triangle is on the first and below the others.
#[derive(Clone)]
#[repr(align(32))]
struct Leaf {
    normal: [Lanes; 3],
    height: Lanes,
    sides: [[Lanes; 3]; 3],
    limits: [Lanes; 3],
    corners: Corners,
    triangle: [u32; WIDTH],
}

/// The tree of a surface's triangles.
#[derive(Clone)]
pub(super) struct TriangleTree {
    /// Coordinates are relative to this point.
    origin: Point3<f64>,
    radius: f64,
    root: u32,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

impl TriangleTree {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.leaves)
    }

    /// The tree of a mesh's triangles.
    pub(super) fn new(mesh: &Mesh) -> Self {
        let count = mesh.triangles.len();
        let boxed = |t| BoxedTriangle::new(t, &Bounds::of(&mesh.corners(t as usize)));
        let mut items: Vec<BoxedTriangle> = (0..count as u32).map(boxed).collect();
        let all = BoxedTriangle::around(&items).bounds();
        let empty = count == 0;
        let origin = if empty { Point3::origin() } else { all.centre() };
        let radius = if empty { 0.0 } else { all.extents().max() * 0.5 };
        // Leaves are large: to move them as they become more took a third of the time.
        let leaves = Vec::with_capacity(count.div_ceil(FILLED));
        let mut tree = Self { origin, radius, root: 0, nodes: Vec::new(), leaves };
        tree.root = tree.build(mesh, &mut items);
        tree.nodes.shrink_to_fit();
        tree.leaves.shrink_to_fit();
        tree
    }

    fn build(&mut self, mesh: &Mesh, items: &mut [BoxedTriangle]) -> u32 {
        if items.len() <= WIDTH {
            self.leaves.push(Leaf::new(mesh, items, &self.origin));
            return (self.leaves.len() - 1) as u32 | LEAF;
        }
        let mut groups = vec![items];
        while groups.len() < WIDTH {
            let largest = (0..groups.len()).max_by_key(|&i| groups[i].len()).unwrap_or(0);
            if groups[largest].len() <= WIDTH {
                break;
            }
            let group = groups.swap_remove(largest);
            let (left, right) = split(group);
            groups.extend([left, right]);
        }
        let mut node = Node {
            min: [[f32::INFINITY; WIDTH]; 3],
            max: [[f32::NEG_INFINITY; WIDTH]; 3],
            child: [0; WIDTH],
        };
        for (k, group) in groups.into_iter().enumerate() {
            let bounds = BoxedTriangle::around(group).bounds();
            for a in 0..3 {
                node.min[a][k] = (bounds.min[a] - self.origin[a]) as f32;
                node.max[a][k] = (bounds.max[a] - self.origin[a]) as f32;
            }
            node.child[k] = self.build(mesh, group);
        }
        self.nodes.push(node);
        (self.nodes.len() - 1) as u32
    }

    /// The triangle whose `measure` is the smallest below `reach`, if there is one.
    pub(super) fn closest(
        &self,
        p: &Point3<f64>,
        reach: f64,
        measure: impl Fn(u32) -> Closest,
    ) -> Option<Closest> {
        let q = p - self.origin;
        let slack = ROUNDING * (q.amax() + self.radius);
        let mut query =
            Query { q: q.map(|x| x as f32).into(), slack, best: None, limit: 0.0, reach, measure };
        query.tighten(reach);
        self.descend(self.root, &mut query);
        query.best
    }

    /// Whether any triangle whose box the segment from `p` along the unit vector `direction` meets
    /// passes `test`. The order of the triangles is that of the tree.
    pub(super) fn any_along(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        test: impl FnMut(u32) -> bool,
    ) -> bool {
        self.any_met(&self.segment(&(p - self.origin), direction, length), test)
    }

    /// The same of a segment `[a, b]` that is moved along `direction` by `length`.
    pub(super) fn any_swept(
        &self,
        [a, b]: &[Point3<f64>; 2],
        direction: &Vector3<f64>,
        length: f64,
        test: impl FnMut(u32) -> bool,
    ) -> bool {
        let mut segment = self.segment(&(center(a, b) - self.origin), direction, length);
        let half = (b - a).abs() / 2.0;
        for (margin, half) in segment.margin.iter_mut().zip(&half) {
            *margin += *half as f32;
        }
        self.any_met(&segment, test)
    }

    fn any_met(&self, segment: &Segment, mut test: impl FnMut(u32) -> bool) -> bool {
        let mut stack = vec![self.root];
        while let Some(at) = stack.pop() {
            if at & LEAF != 0 {
                let leaf = &self.leaves[(at & !LEAF) as usize];
                if (0..WIDTH).any(|k| leaf.height[k].is_finite() && test(leaf.triangle[k])) {
                    return true;
                }
                continue;
            }
            let node = &self.nodes[at as usize];
            let meets = node.meets(segment);
            stack.extend((0..WIDTH).filter(|&k| meets[k]).map(|k| node.child[k]));
        }
        false
    }

    fn descend<M: Fn(u32) -> Closest>(&self, at: u32, query: &mut Query<M>) {
        if at & LEAF != 0 {
            return query.visit(&self.leaves[(at & !LEAF) as usize]);
        }
        let node = &self.nodes[at as usize];
        let bounds = node.squared_distances(&query.q);
        // Nearest first; eight at most.
        let mut order = [(f32::INFINITY, 0u32); WIDTH];
        let mut count = 0;
        for k in 0..WIDTH {
            if bounds[k] < query.limit {
                let mut i = count;
                while i > 0 && order[i - 1].0 > bounds[k] {
                    order[i] = order[i - 1];
                    i -= 1;
                }
                order[i] = (bounds[k], node.child[k]);
                count += 1;
            }
        }
        for &(bound, child) in &order[..count] {
            if bound < query.limit {
                self.descend(child, query);
            }
        }
    }
}

struct Query<M> {
    q: [f32; 3],
    slack: f64,
    best: Option<Closest>,
    reach: f64,
    /// Squared, what is surely further than the best.
    limit: f32,
    measure: M,
}

impl<M: Fn(u32) -> Closest> Query<M> {
    fn tighten(&mut self, reach: f64) {
        self.reach = reach;
        self.limit = ((reach + self.slack).powi(2) * (1.0 + 1e-6)) as f32;
    }

    fn visit(&mut self, leaf: &Leaf) {
        let bounds = leaf.squared_distances(&self.q);
        for k in 0..WIDTH {
            if bounds[k] < self.limit {
                let found = (self.measure)(leaf.triangle[k]);
                if found.distance < self.reach {
                    self.tighten(found.distance);
                    self.best = Some(found);
                }
            }
        }
    }
}

/// A segment in single precision, with a margin for its rounding.
struct Segment {
    q: [f32; 3],
    /// One over the direction.
    inverse: [f32; 3],
    /// Where it begins, behind the point, and where it ends.
    before: f32,
    length: f32,
    /// So much larger are boxes taken, along each axis.
    margin: [f32; 3],
}

impl Node {
    /// Which boxes a segment meets.
    #[inline]
    fn meets(&self, segment: &Segment) -> [bool; WIDTH] {
        let (mut from, mut to) = ([-segment.before; WIDTH], [segment.length; WIDTH]);
        for a in 0..3 {
            let (q, inverse) = (segment.q[a], segment.inverse[a]);
            // By the direction's sign: so an empty place, whose box is inside out, is never met.
            let (near, far) =
                if inverse > 0.0 { (&self.min[a], &self.max[a]) } else { (&self.max[a], &self.min[a]) };
            let margin = segment.margin[a].copysign(inverse);
            for k in 0..WIDTH {
                from[k] = larger(from[k], (near[k] - margin - q) * inverse);
                to[k] = -larger(-to[k], -((far[k] + margin - q) * inverse));
            }
        }
        std::array::from_fn(|k| from[k] <= to[k])
    }

    #[inline]
    fn squared_distances(&self, q: &[f32; 3]) -> Lanes {
        let mut sum = [0.0; WIDTH];
        for a in 0..3 {
            for k in 0..WIDTH {
                let outside = larger(larger(self.min[a][k] - q[a], q[a] - self.max[a][k]), 0.0);
                sum[k] += outside * outside;
            }
        }
        sum
    }
}

impl Leaf {
    fn new(mesh: &Mesh, members: &[BoxedTriangle], origin: &Point3<f64>) -> Self {
        let mut leaf = Self {
            normal: [[0.0; WIDTH]; 3],
            // No point is near the plane of an empty place.
            height: [f32::INFINITY; WIDTH],
            sides: [[[0.0; WIDTH]; 3]; 3],
            limits: [[0.0; WIDTH]; 3],
            corners: [[[0.0; WIDTH]; 3]; 3],
            triangle: [0; WIDTH],
        };
        for (k, t) in members.iter().map(BoxedTriangle::triangle).enumerate() {
            let [a, b, c] = mesh.corners(t as usize);
            let corners = [a, b, c].map(|p| p - origin);
            // Planes that rounding makes doubtful are left out: the bound becomes weaker.
            let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
            let normal = area_normal(&a, &b, &c);
            let sound = normal.norm() > 1e-4 * longest * longest;
            let normal = if sound { normal.normalize() } else { Vector3::zeros() };
            let put = |plane: Vector3<f64>, to: &mut [Lanes; 3], limit: &mut Lanes, on: &Vector3<f64>| {
                for axis in 0..3 {
                    to[axis][k] = plane[axis] as f32;
                }
                limit[k] = plane.dot(on) as f32;
            };
            put(normal, &mut leaf.normal, &mut leaf.height, &corners[0]);
            for e in 0..3 {
                let along = corners[(e + 1) % 3] - corners[e];
                let outward = along.cross(&normal).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                put(outward, &mut leaf.sides[e], &mut leaf.limits[e], &corners[e]);
            }
            for (lanes, p) in leaf.corners.iter_mut().zip(&[a, b, c]) {
                (0..3).for_each(|axis| lanes[axis][k] = p[axis]);
            }
            leaf.triangle[k] = t;
        }
        leaf
    }

    #[inline]
    fn squared_distances(&self, q: &[f32; 3]) -> Lanes {
        let height = above(&self.normal, &self.height, q);
        let [a, b, c] = [0, 1, 2].map(|e| above(&self.sides[e], &self.limits[e], q));
        let mut out = [0.0; WIDTH];
        for k in 0..WIDTH {
            let beyond = larger(larger(larger(a[k], b[k]), c[k]), 0.0);
            out[k] = height[k] * height[k] + beyond * beyond;
        }
        out
    }
}

/// Heights of a point above eight planes.
#[inline]
fn above(plane: &[Lanes; 3], limit: &Lanes, q: &[f32; 3]) -> Lanes {
    let mut out = [0.0; WIDTH];
    for k in 0..WIDTH {
        out[k] = plane[0][k] * q[0] + plane[1][k] * q[1] + plane[2][k] * q[2] - limit[k];
    }
    out
}

/// One vector instruction, which `f32::max` with its rule for NaN is not.
#[inline]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
