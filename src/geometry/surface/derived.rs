//! What questions about a surface need of its mesh: normals, adjacency, trees. Each is worked out when it is first
//! asked for: of most parts that were known before a restart, little is.

use std::sync::OnceLock;

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

/// All that derives from a mesh, as far as it was asked for.
#[derive(Clone, Default)]
pub(super) struct Derived {
    face_normals: OnceLock<Vec<Vector3<f64>>>,
    adjacency: OnceLock<Adjacency>,
    tree: OnceLock<TriangleTree>,
    opening: OnceLock<Opening>,
}

/// What lies beside what.
#[derive(Clone)]
pub(super) struct Adjacency {
    /// Per triangle and edge: the triangle on the other side.
    pub(super) neighbours: Vec<[u32; 3]>,
    pub(super) vertex_normals: Vec<Vector3<f64>>,
    /// Triangles around each vertex, as ranges of `fan`.
    pub(super) fan_start: Vec<u32>,
    pub(super) fan: Vec<u32>,
    pub(super) folds: Option<Folds>,
}

/// Where signs come from winding numbers.
#[derive(Clone, Default)]
pub(super) struct Opening {
    pub(super) rim: Option<Rim>,
    /// Where the rim has so many edges that winding numbers are summed.
    pub(super) dipoles: Option<DipoleTree>,
}

impl Derived {
    /// The unit normals of the triangles; zero if degenerate.
    #[inline]
    pub(super) fn face_normals(&self, mesh: &Mesh) -> &[Vector3<f64>] {
        self.face_normals.get_or_init(|| face_normals(mesh))
    }

    #[inline]
    pub(super) fn adjacency(&self, mesh: &Mesh) -> &Adjacency {
        self.adjacency.get_or_init(|| Adjacency::of(mesh, self.face_normals(mesh)))
    }

    #[inline]
    pub(super) fn tree(&self, mesh: &Mesh) -> &TriangleTree {
        self.tree.get_or_init(|| TriangleTree::new(mesh))
    }

    pub(super) fn opening(&self, mesh: &Mesh) -> &Opening {
        self.opening.get_or_init(|| Opening::of(mesh))
    }

    /// Works out what is not there yet.
    pub(super) fn all(&self, mesh: &Mesh) {
        self.adjacency(mesh);
        self.tree(mesh);
        self.opening(mesh);
    }

    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        self.face_normals.get().map_or(0, |normals| size_of_val(&**normals))
            + self.adjacency.get().map_or(0, Adjacency::memory)
            + self.tree.get().map_or(0, TriangleTree::memory)
            + self.opening.get().map_or(0, Opening::memory)
    }
}

impl Adjacency {
    fn of(mesh: &Mesh, face_normals: &[Vector3<f64>]) -> Self {
        let (fan_start, fan) = fans(mesh);
        let (neighbours, shared) = across(mesh);
        let is_open = mesh.solidity != Solidity::Closed;
        let folds = if is_open { None } else { Folds::of(mesh, face_normals, &neighbours, &shared) };
        Self { neighbours, vertex_normals: vertex_normals(mesh, face_normals), fan_start, fan, folds }
    }

    fn memory(&self) -> usize {
        size_of_val(&*self.neighbours)
            + size_of_val(&*self.vertex_normals)
            + size_of_val(&*self.fan_start)
            + size_of_val(&*self.fan)
            + self.folds.as_ref().map_or(0, Folds::memory)
    }
}

impl Opening {
    fn of(mesh: &Mesh) -> Self {
        if mesh.solidity == Solidity::Closed {
            return Self::default();
        }
        let rim = Some(Rim::of(&mesh.vertices, &mesh.triangles)).filter(|r| !r.edges().is_empty());
        let is_soup = rim.as_ref().is_some_and(Rim::is_long);
        Self { dipoles: is_soup.then(|| DipoleTree::new(&mesh.vertices, &mesh.triangles)), rim }
    }

    fn memory(&self) -> usize {
        self.dipoles.as_ref().map_or(0, DipoleTree::memory) + self.rim.as_ref().map_or(0, Rim::memory)
    }
}

fn face_normals(mesh: &Mesh) -> Vec<Vector3<f64>> {
    let normal = |t| {
        let [a, b, c] = mesh.corners(t);
        area_normal(&a, &b, &c).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
    };
    (0..mesh.triangles.len()).map(normal).collect()
}

/// Per triangle and edge: the triangle on the other side, and whether more than two share it.
fn across(mesh: &Mesh) -> (Vec<[u32; 3]>, Vec<[bool; 3]>) {
    let mut neighbours = vec![[NO_TRIANGLE; 3]; mesh.triangles.len()];
    let mut shared = vec![[false; 3]; mesh.triangles.len()];
    let place = |triangle: u32, edge: [u32; 2]| {
        let edges = directed_edges(&mesh.triangles[triangle as usize]);
        edges.iter().position(|[a, b]| [*a.min(b), *a.max(b)] == edge)
    };
    for (edge, sides) in Sides::of(&mesh.triangles).iter() {
        // Edges of more than two faces are paired in order: there, any pairing is as good.
        for pair in sides.chunks_exact(2) {
            for (side, other) in [(pair[0], pair[1]), (pair[1], pair[0])] {
                if let Some(at) = place(side.triangle(), edge) {
                    neighbours[side.triangle() as usize][at] = other.triangle();
                }
            }
        }
        for side in sides.iter().filter(|_| sides.len() > 2) {
            if let Some(at) = place(side.triangle(), edge) {
                shared[side.triangle() as usize][at] = true;
            }
        }
    }
    (neighbours, shared)
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
