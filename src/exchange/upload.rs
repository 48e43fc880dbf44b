//! An assembly as clients of the daemon upload it.

use sbdp_client::{Assembly, Meshes, Part, Vertices};

use crate::geometry::{SourceAssembly, SourceMesh, SourcePart};

/// An assembly to be uploaded; its meshes are borrowed.
#[must_use]
pub fn wire_assembly(assembly: &SourceAssembly) -> Assembly<'_> {
    Assembly {
        name: &assembly.name,
        units: assembly.units.as_deref(),
        parts: assembly.parts.iter().map(wire_part).collect(),
        fixed: assembly.fixed.iter().map(String::as_str).collect(),
    }
}

/// A part to be uploaded.
#[must_use]
pub fn wire_part(part: &SourcePart) -> Part<'_> {
    wire_mesh(&part.name, &part.mesh)
}

/// A mesh to be uploaded as a part of this name.
#[must_use]
pub fn wire_mesh<'a>(name: &'a str, mesh: &'a SourceMesh) -> Part<'a> {
    Part { name, vertices: Vertices::F64(&mesh.vertices), triangles: &mesh.triangles }
}

impl Meshes for SourceAssembly {
    fn assembly(&self) -> Assembly<'_> {
        wire_assembly(self)
    }
}
