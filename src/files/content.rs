//! What readers find in a file, before it is decided what is a part.

use nalgebra::{Matrix4, Point3};

use crate::geometry::SourceMesh;

/// All of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Content {
    /// The surfaces: one, or one for each node of a scene.
    pub(super) bodies: Vec<Body>,
    /// The unit of length, if the file says it.
    pub(super) units: Option<String>,
    /// How far triangles may be from the surfaces that they stand for, in that unit, if the file has others than triangles.
    pub(super) resolution: Option<f64>,
    /// What was skipped or is in doubt, in whole sentences without the file's name.
    pub(super) notes: Vec<String>,
}

/// A surface as a file has it.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Body {
    /// The names of the nodes above it and its own, last; empty where a file has one surface without a name.
    pub(super) path: Vec<String>,
    /// All of it.
    pub(super) mesh: SourceMesh,
    /// The pieces that the file makes of it.
    pub(super) pieces: Pieces,
}

/// What a file calls pieces of a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum PieceKind {
    /// Of an OBJ file (`o`).
    #[default]
    Objects,
    /// Of an OBJ file (`g`): often the faces of a body.
    Groups,
    /// Of an STL file.
    Solids,
    /// Of a glTF mesh: often what has one material.
    Primitives,
    /// Of a scene among other files.
    Nodes,
}

impl PieceKind {
    pub(super) fn plural(self) -> &'static str {
        match self {
            Self::Objects => "objects",
            Self::Groups => "groups",
            Self::Solids => "solids",
            Self::Primitives => "primitives",
            Self::Nodes => "nodes",
        }
    }

    /// Whether each is meant as a thing of its own, even if its surface has holes.
    pub(super) fn is_thing(self) -> bool {
        matches!(self, Self::Objects | Self::Solids | Self::Nodes)
    }
}

/// Which triangle belongs to which piece.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Pieces {
    /// What the file calls them.
    pub(super) kind: PieceKind,
    /// Their names, some of them empty.
    pub(super) names: Vec<String>,
    /// By triangle, its piece's place in `names`.
    pub(super) of: Vec<u32>,
}

/// A scene of more nodes or instances is no assembly.
pub(super) const MAX_NODES: usize = 20_000;
/// One that is nested deeper is none, either: trees are walked by recursion.
pub(super) const MAX_DEPTH: usize = 200;

/// A mesh as an affine pose places it; whether that mirrors it. Mirroring turns triangles inside out, so they are turned
/// back.
pub(super) fn placed(mesh: &SourceMesh, pose: &Matrix4<f64>) -> (SourceMesh, bool) {
    let is_mirrored = pose.fixed_view::<3, 3>(0, 0).determinant() < 0.0;
    let moved = |p: &[f64; 3]| {
        let q = pose * Point3::from(*p).to_homogeneous();
        [q.x, q.y, q.z]
    };
    let vertices = mesh.vertices.iter().map(moved).collect();
    let mut triangles = mesh.triangles.clone();
    if is_mirrored {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    (SourceMesh { vertices, triangles }, is_mirrored)
}
