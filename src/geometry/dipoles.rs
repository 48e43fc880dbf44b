//! Generalised winding numbers by a tree of dipoles.
//!
//! Source: G. Barill et al., "Fast Winding Numbers for Soups and Clouds" (2018), first-order
//! expansion; near nodes are summed exactly by the solid angle of each triangle. Known error: about 1e-2 at the far-field factor used here, so only
//! the comparison with 0.5 away from the surface is meaningful.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use super::solid_angle::SolidAngle;
use super::triangle::area_normal;

/// Nodes further than this many radii are summed as one dipole.
const FAR: f64 = 2.5;
const LEAF: usize = 8;

#[derive(Debug, Clone)]
struct DipoleNode {
    centre: Point3<f64>,
    radius: f64,
    dipole: Vector3<f64>,
    /// Triangles of the subtree, as a range of the ordered list.
    range: (u32, u32),
    /// Index of the right child; the left one follows its parent. 0 for a leaf.
    right: u32,
}

/// Answers how often a triangle soup winds around a point (1 inside a closed outward mesh).
#[derive(Debug, Clone)]
pub(super) struct DipoleTree {
    nodes: Vec<DipoleNode>,
    corners: Vec<[Point3<f64>; 3]>,
}

impl DipoleTree {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.corners)
    }

    /// Builds the tree over triangles.
    #[must_use]
    pub(super) fn new(vertices: &[Point3<f64>], triangles: &[[u32; 3]]) -> Self {
        let mut corners: Vec<_> = triangles.iter().map(|t| t.map(|i| vertices[i as usize])).collect();
        let mut nodes = Vec::new();
        let n = corners.len();
        build(&mut corners, 0, n, &mut nodes);
        Self { nodes, corners }
    }

    /// The winding number at `p`.
    #[must_use]
    pub(super) fn winding(&self, p: &Point3<f64>) -> f64 {
        let mut sum = 0.0;
        let mut near = SolidAngle::default();
        let mut stack = Vec::with_capacity(64);
        if !self.nodes.is_empty() {
            stack.push(0usize);
        }
        while let Some(i) = stack.pop() {
            let node = &self.nodes[i];
            let d = node.centre - p;
            let r2 = d.norm_squared();
            if r2 > (FAR * node.radius).powi(2) {
                sum += node.dipole.dot(&d) / (r2 * r2.sqrt());
            } else if node.right == 0 {
                let (a, b) = node.range;
                self.corners[a as usize..b as usize].iter().for_each(|t| near.add_triangle(p, t));
            } else {
                stack.push(node.right as usize);
                stack.push(i + 1);
            }
        }
        (sum + near.sum()) / (4.0 * PI)
    }
}

fn build(corners: &mut [[Point3<f64>; 3]], offset: usize, end: usize, nodes: &mut Vec<DipoleNode>) {
    let me = nodes.len();
    nodes.push(summary(&corners[offset..end], offset));
    if end - offset <= LEAF {
        return;
    }
    let mid = offset + (end - offset) / 2;
    let centroid = |t: &[Point3<f64>; 3]| (t[0].coords + t[1].coords + t[2].coords) / 3.0;
    let (lo, hi) = corners[offset..end]
        .iter()
        .map(centroid)
        .fold((Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)), |(l, h), c| {
            (l.inf(&c), h.sup(&c))
        });
    let axis = (hi - lo).imax();
    corners[offset..end]
        .select_nth_unstable_by(mid - offset, |s, t| centroid(s)[axis].total_cmp(&centroid(t)[axis]));
    build(corners, offset, mid, nodes);
    nodes[me].right = nodes.len() as u32;
    build(corners, mid, end, nodes);
}

fn summary(triangles: &[[Point3<f64>; 3]], offset: usize) -> DipoleNode {
    let mut weight = 0.0;
    let mut centre = Vector3::zeros();
    let mut dipole = Vector3::zeros();
    for t in triangles {
        let n = area_normal(&t[0], &t[1], &t[2]) / 2.0;
        let area = n.norm();
        centre += (t[0].coords + t[1].coords + t[2].coords) * (area / 3.0);
        weight += area;
        dipole += n;
    }
    let centre = Point3::from(if weight > 0.0 { centre / weight } else { Vector3::zeros() });
    let radius = triangles.iter().flatten().map(|v| (v - centre).norm_squared()).fold(0.0, f64::max).sqrt();
    DipoleNode { centre, radius, dipole, range: (offset as u32, (offset + triangles.len()) as u32), right: 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, healed, l_shape, spread, surface};
    use crate::geometry::SourceMesh;

    /// What the expansion may be off by.
    const ERROR: f64 = 0.05;

    fn tree(mesh: SourceMesh) -> DipoleTree {
        let mesh = healed(mesh);
        DipoleTree::new(&mesh.vertices, &mesh.triangles)
    }

    #[test]
    fn a_closed_surface_winds_once_around_its_inside_and_not_around_its_outside() {
        for mesh in [cuboid([-1.0; 3], [1.0; 3]), ball(4), l_shape()] {
            let s = surface(mesh.clone());
            let tree = tree(mesh);
            for p in spread([-1.5; 3], [2.5; 3], 3000) {
                let d = s.signed_distance(&p);
                let expected = if d < 0.0 { 1.0 } else { 0.0 };
                let w = tree.winding(&p);
                assert!(d.abs() < 1e-6 || (w - expected).abs() < ERROR, "{w} at {p}, distance {d}");
            }
        }
    }

    #[test]
    fn far_away_nothing_winds() {
        let tree = tree(ball(3));
        for p in [Point3::new(1e3, 0.0, 0.0), Point3::new(-50.0, 70.0, 1e6)] {
            assert!(tree.winding(&p).abs() < 1e-6);
        }
    }

    #[test]
    fn a_surface_turned_inside_out_winds_the_other_way() {
        let mut mesh = healed(cuboid([-1.0; 3], [1.0; 3]));
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let w = DipoleTree::new(&mesh.vertices, &mesh.triangles).winding(&Point3::new(0.1, 0.2, -0.3));
        assert!((w + 1.0).abs() < 1e-9, "{w}");
    }

    #[test]
    fn no_triangles_wind_around_nothing() {
        assert_eq!(DipoleTree::new(&[], &[]).winding(&Point3::origin()), 0.0);
    }
}
