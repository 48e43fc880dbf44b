//! A healed triangle mesh.

use std::collections::HashMap;

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// How inside and outside of a mesh are told apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Solidity {
    /// One or more closed shells, each a manifold with vertices of its own, outward oriented
    /// (voids inward), that neither cross nor touch: the pseudo-normal at the nearest point of
    /// the surface gives the sign.
    Closed,
    /// Crossing or non-manifold shells without holes: the sign comes from the winding number.
    Winding,
    /// With holes: a wall, which nothing crosses from either side. It has no inside for solids; for another wall the
    /// sign comes from the winding number.
    Wall,
}

/// An undirected edge and the triangles that meet there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Edge {
    /// Its two vertices, the smaller index first.
    pub vertices: [u32; 2],
    /// Indices of the triangles that have it, ascending: two on a closed manifold.
    pub triangles: Vec<u32>,
}

/// A triangle mesh after healing: indices in range, coordinates finite, no vertex unused, no
/// triangle degenerate or given twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mesh {
    /// Vertex positions.
    pub vertices: Vec<Point3<f64>>,
    /// Vertex indices, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// What gives the sign of distances.
    pub solidity: Solidity,
}

impl Mesh {
    /// The corners of the axis-aligned bounding box, least and greatest. Of an empty mesh:
    /// twice the origin.
    #[must_use]
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        bounds(&self.vertices)
    }

    /// The enclosed volume; negative if inverted. Of open meshes: that of the cone over the
    /// surface from the box centre, for what it is worth.
    #[must_use]
    pub fn volume(&self) -> f64 {
        let (lo, hi) = self.bounds();
        signed_volume(&self.vertices, self.triangles.iter().copied(), &nalgebra::center(&lo, &hi))
    }

    /// The corners of a triangle.
    #[must_use]
    pub fn corners(&self, triangle: usize) -> [Point3<f64>; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// All edges with their triangles, in the order of their first triangle.
    #[must_use]
    pub fn edges(&self) -> Vec<Edge> {
        let mut position: HashMap<[u32; 2], usize> = HashMap::with_capacity(self.triangles.len() * 2);
        let mut edges: Vec<Edge> = Vec::with_capacity(self.triangles.len() * 3 / 2);
        for (index, triangle) in (0u32..).zip(&self.triangles) {
            for [a, b] in directed_edges(triangle) {
                let vertices = [a.min(b), a.max(b)];
                let at = *position.entry(vertices).or_insert_with(|| {
                    edges.push(Edge { vertices, triangles: Vec::with_capacity(2) });
                    edges.len() - 1
                });
                edges[at].triangles.push(index);
            }
        }
        edges
    }
}

/// The edges of a triangle in its direction of travel.
pub(in crate::geometry) fn directed_edges(t: &[u32; 3]) -> [[u32; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
}

/// The bounding box of points.
pub(super) fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    let Some(first) = points.first() else {
        return (Point3::origin(), Point3::origin());
    };
    points.iter().fold((*first, *first), |(lo, hi), p| (lo.inf(p), hi.sup(p)))
}

/// The volume of the cones over triangles, seen from `about`; of a closed surface it is the
/// same from everywhere, but near it fewer digits are lost.
pub(super) fn signed_volume(
    vertices: &[Point3<f64>],
    triangles: impl Iterator<Item = [u32; 3]>,
    about: &Point3<f64>,
) -> f64 {
    triangles
        .map(|t| {
            let [a, b, c]: [Vector3<f64>; 3] = t.map(|v| vertices[v as usize] - about);
            a.dot(&b.cross(&c)) / 6.0
        })
        .sum()
}
