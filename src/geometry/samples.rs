//! Points on a surface at which contact is looked for, in a tree of bounding spheres.
//!
//! Two surfaces first touch where a vertex or convex edge of one meets the other, so vertices and
//! convex edges are sampled closely and faces sparsely (faces matter where parts are flush and all
//! their edges coincide). Both surfaces of a pair are sampled. Known miss: features between two
//! samples that enter by less than half the spacing.

use nalgebra::Point3;

use super::surface::{NO_TRIANGLE, Surface};

/// How densely a surface is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Along convex edges.
    pub edge: f64,
    /// Along convex edges so blunt that a straight chord is close to the surface.
    pub blunt_edge: f64,
    /// Over faces.
    pub face: f64,
}

/// A node: a sphere that holds the samples of its subtree.
#[derive(Debug, Clone)]
pub struct Node {
    /// Centre of the sphere.
    pub centre: Point3<f64>,
    /// Its radius.
    pub radius: f64,
    start: u32,
    end: u32,
    /// Index of the right child (the left one follows its parent); 0 for a leaf.
    right: u32,
}

/// Whether a subtree can be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Descend {
    /// Nothing of interest in this sphere.
    Skip,
    /// Look further.
    Into,
}

/// Samples of one surface.
#[derive(Debug, Clone, Default)]
pub struct SampleTree {
    points: Vec<Point3<f64>>,
    nodes: Vec<Node>,
}

const LEAF: usize = 6;
/// cos of the dihedral deviation below which an edge counts as blunt (about 20 degrees).
const BLUNT_COS: f64 = 0.94;

impl SampleTree {
    /// Samples a surface.
    #[must_use]
    pub fn new(surface: &Surface, spacing: &Spacing) -> Self {
        let mut points = surface.vertices().to_vec();
        for t in 0..surface.triangles().len() as u32 {
            sample_edges(surface, t, spacing, &mut points);
            sample_face(surface, t, spacing.face, &mut points);
        }
        Self::over(points)
    }

    /// A tree over given points.
    #[must_use]
    pub fn over(mut points: Vec<Point3<f64>>) -> Self {
        let mut nodes = Vec::new();
        let n = points.len();
        if n > 0 {
            build(&mut points, 0, n, &mut nodes);
        }
        Self { points, nodes }
    }

    /// All samples, in tree order.
    #[must_use]
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// Walks the tree; `enter` decides per sphere, `visit` gets the samples (index and point) of
    /// all leaves entered.
    pub fn walk(&self, mut enter: impl FnMut(&Node) -> Descend, mut visit: impl FnMut(u32, &Point3<f64>)) {
        let mut stack = Vec::with_capacity(48);
        if !self.nodes.is_empty() {
            stack.push(0usize);
        }
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            if enter(node) == Descend::Skip {
                continue;
            }
            if node.right == 0 {
                for k in node.start..node.end {
                    visit(k, &self.points[k as usize]);
                }
            } else {
                stack.push(node.right as usize);
                stack.push(i + 1);
            }
        }
    }
}

fn sample_edges(surface: &Surface, t: u32, spacing: &Spacing, out: &mut Vec<Point3<f64>>) {
    let corners = surface.corners(t);
    for e in 0..3u8 {
        let other = surface.neighbour(t, e);
        // Each edge once, from its first triangle.
        if other != NO_TRIANGLE && other < t {
            continue;
        }
        let (a, b) = (corners[e as usize], corners[(e as usize + 1) % 3]);
        let step = if other == NO_TRIANGLE {
            spacing.edge
        } else {
            let (n, m) = (surface.face_normal(t), surface.face_normal(other));
            // Convex: the neighbour's normal leans away from this face's inside.
            let convex = n.cross(&m).dot(&(b - a)) > 1e-3 * (b - a).norm();
            match (convex, n.dot(&m) < BLUNT_COS) {
                (false, _) => continue,
                (true, true) => spacing.edge,
                (true, false) => spacing.blunt_edge,
            }
        };
        let n = ((b - a).norm() / step).ceil().max(1.0) as usize;
        out.extend((1..n).map(|k| a + (b - a) * (k as f64 / n as f64)));
    }
}

fn sample_face(surface: &Surface, t: u32, step: f64, out: &mut Vec<Point3<f64>>) {
    let [a, b, c] = surface.corners(t);
    let area = (b - a).cross(&(c - a)).norm() / 2.0;
    // Slivers and small faces are held by their edges and vertices.
    if area < 0.02 * step * step {
        return;
    }
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    let n = (longest / step).ceil().max(1.0) as usize;
    // Centroids of the upright sub-triangles of a regular subdivision: all strictly inside.
    for i in 0..n {
        for j in 0..(n - i) {
            let u = (i as f64 + 1.0 / 3.0) / n as f64;
            let v = (j as f64 + 1.0 / 3.0) / n as f64;
            out.push(a + (b - a) * u + (c - a) * v);
        }
    }
}

fn build(points: &mut [Point3<f64>], offset: usize, end: usize, nodes: &mut Vec<Node>) {
    let me = nodes.len();
    let slice = &mut points[offset..end];
    let bounds = super::Bounds::of(slice.iter());
    let centre = bounds.centre();
    let radius = slice.iter().map(|p| (p - centre).norm_squared()).fold(0.0, f64::max).sqrt();
    nodes.push(Node { centre, radius, start: offset as u32, end: end as u32, right: 0 });
    if slice.len() <= LEAF {
        return;
    }
    let axis = bounds.extents().imax();
    let mid = slice.len() / 2;
    slice.select_nth_unstable_by(mid, |p, q| {
        // All coordinates decide, so that equal keys cannot depend on the input's order.
        p[axis].total_cmp(&q[axis]).then_with(|| {
            let k = |r: &Point3<f64>| [r.x, r.y, r.z];
            k(p).partial_cmp(&k(q)).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    build(points, offset, offset + mid, nodes);
    nodes[me].right = nodes.len() as u32;
    build(points, offset + mid, end, nodes);
}
