//! What questions about a surface need of its mesh: adjacency, normals, trees.

use nalgebra::{Unit, Vector3};

use super::NO_TRIANGLE;
use crate::geometry::dipoles::DipoleTree;
use crate::geometry::folds::Folds;
use crate::geometry::incidence::Sides;
use crate::geometry::mesh::directed_edges;
use crate::geometry::rim::Rim;
use crate::geometry::triangle::area_normal;
use crate::geometry::triangle_tree::TriangleTree;
use crate::geometry::{Mesh, Solidity};

/// All that derives from a mesh.
#[derive(Clone)]
pub(super) struct Derived {
    pub(super) face_normals: Vec<Vector3<f64>>,
    /// Per triangle and edge: the triangle on the other side.
    pub(super) neighbours: Vec<[u32; 3]>,
    pub(super) vertex_normals: Vec<Vector3<f64>>,
    /// Triangles around each vertex, as ranges of `fan`.
    pub(super) fan_start: Vec<u32>,
    pub(super) fan: Vec<u32>,
    pub(super) tree: TriangleTree,
    /// Where signs come from winding numbers.
    pub(super) rim: Option<Rim>,
    /// Where the rim has so many edges that winding numbers are summed.
    pub(super) dipoles: Option<DipoleTree>,
    pub(super) folds: Option<Folds>,
}

impl Derived {
    pub(super) fn of(mesh: &Mesh) -> Self {
        let face_normals = (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                area_normal(&a, &b, &c).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
            })
            .collect::<Vec<_>>();
        let (fan_start, fan) = fans(mesh);
        let is_open = mesh.solidity == Solidity::Winding;
        let rim = is_open.then(|| Rim::of(&mesh.vertices, &mesh.triangles)).filter(|r| !r.edges().is_empty());
        let is_soup = rim.as_ref().is_some_and(Rim::is_long);
        let neighbours = neighbours(mesh);
        let folds = if is_open { None } else { Folds::of(mesh, &face_normals, &neighbours) };
        let corners: Vec<_> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        Self {
            dipoles: is_soup.then(|| DipoleTree::new(&mesh.vertices, &mesh.triangles)),
            rim,
            folds,
            neighbours,
            vertex_normals: vertex_normals(mesh, &face_normals),
            face_normals,
            fan_start,
            fan,
            tree: TriangleTree::new(&corners),
        }
    }

    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        size_of_val(&*self.face_normals)
            + size_of_val(&*self.neighbours)
            + size_of_val(&*self.vertex_normals)
            + size_of_val(&*self.fan_start)
            + size_of_val(&*self.fan)
            + self.tree.memory()
            + self.dipoles.as_ref().map_or(0, DipoleTree::memory)
            + self.rim.as_ref().map_or(0, Rim::memory)
            + self.folds.as_ref().map_or(0, Folds::memory)
    }
}

fn neighbours(mesh: &Mesh) -> Vec<[u32; 3]> {
    let mut out = vec![[NO_TRIANGLE; 3]; mesh.triangles.len()];
    let mut set = |triangle: u32, edge: [u32; 2], other: u32| {
        let edges = directed_edges(&mesh.triangles[triangle as usize]);
        let at = edges.iter().position(|[a, b]| [*a.min(b), *a.max(b)] == edge);
        if let Some(at) = at {
            out[triangle as usize][at] = other;
        }
    };
    for (edge, sides) in Sides::of(&mesh.triangles).iter() {
        // Edges of more than two faces are paired in order: there, any pairing is as good.
        for pair in sides.chunks_exact(2) {
            set(pair[0].triangle, edge, pair[1].triangle);
            set(pair[1].triangle, edge, pair[0].triangle);
        }
    }
    out
}

fn vertex_normals(mesh: &Mesh, face_normals: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let mut out = vec![Vector3::zeros(); mesh.vertices.len()];
    for (t, n) in mesh.triangles.iter().zip(face_normals) {
        for k in 0..3 {
            let p = mesh.vertices[t[k] as usize];
            let a = mesh.vertices[t[(k + 1) % 3] as usize] - p;
            let b = mesh.vertices[t[(k + 2) % 3] as usize] - p;
            if let (Some(a), Some(b)) = (Unit::try_new(a, 0.0), Unit::try_new(b, 0.0)) {
                out[t[k] as usize] += n * a.dot(&b).clamp(-1.0, 1.0).acos();
            }
        }
    }
    out
}

fn fans(mesh: &Mesh) -> (Vec<u32>, Vec<u32>) {
    let mut start = vec![0u32; mesh.vertices.len() + 1];
    for t in &mesh.triangles {
        for &v in t {
            start[v as usize + 1] += 1;
        }
    }
    for i in 0..mesh.vertices.len() {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut fan = vec![0u32; mesh.triangles.len() * 3];
    for (i, t) in mesh.triangles.iter().enumerate() {
        for &v in t {
            fan[next[v as usize] as usize] = i as u32;
            next[v as usize] += 1;
        }
    }
    (start, fan)
}
