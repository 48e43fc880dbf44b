//! An assembly as clients of the daemon upload it: the command line's and the benchmarks'.

use sbdp_client::{Assembly, Part, Vertices};

use crate::geometry::{SourceAssembly, SourceMesh, SourcePart};

pub(crate) fn wire_assembly(assembly: &SourceAssembly) -> Assembly<'_> {
    Assembly {
        name: &assembly.name,
        units: assembly.units.as_deref(),
        parts: assembly.parts.iter().map(wire_part).collect(),
        fixed: assembly.fixed.iter().map(String::as_str).collect(),
    }
}

pub(crate) fn wire_part(part: &SourcePart) -> Part<'_> {
    wire_mesh(&part.name, &part.mesh)
}

pub(crate) fn wire_mesh<'a>(name: &'a str, mesh: &'a SourceMesh) -> Part<'a> {
    Part { name, vertices: Vertices::F64(&mesh.vertices), triangles: &mesh.triangles }
}
