//! What readers find in a file, before it is decided what is a part.

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

/// Which triangle belongs to which piece.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Pieces {
    /// What the file calls them: `objects`, `groups`, `solids`, `primitives`.
    pub(super) what: &'static str,
    /// Their names, some of them empty.
    pub(super) names: Vec<String>,
    /// By triangle, its piece's place in `names`.
    pub(super) of: Vec<u32>,
}
