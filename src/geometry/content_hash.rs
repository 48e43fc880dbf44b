//! The content handle of an assembly: equal content, equal handle, on every machine.
//!
//! The hashed byte stream is part of the wire contract (`ipc/PROTOCOL.md`), because clients
//! compute the same handle over what they are about to upload. A test pins that both agree.

use crate::geometry::{Mesh, Solidity, SourceAssembly};

/// Names the byte stream; a changed stream gets a new tag.
const TAG: &str = "sbdp-content/1";
/// The same for meshes in caches.
const MESH_TAG: &str = "sbdp-mesh/1";

/// The handle of an assembly as given, before anything is healed. The assembly's own name and
/// where its parts came from do not count.
#[must_use]
pub fn content_hash(assembly: &SourceAssembly) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    text(&mut hasher, TAG);
    hasher.update(&[u8::from(assembly.units.is_some())]);
    text(&mut hasher, assembly.units.as_deref().unwrap_or(""));
    number(&mut hasher, assembly.fixed.len());
    for name in &assembly.fixed {
        text(&mut hasher, name);
    }
    number(&mut hasher, assembly.parts.len());
    for part in &assembly.parts {
        text(&mut hasher, &part.name);
        number(&mut hasher, part.mesh.vertices.len());
        hasher.update(bytemuck::cast_slice(&part.mesh.vertices));
        number(&mut hasher, part.mesh.triangles.len());
        hasher.update(bytemuck::cast_slice(&part.mesh.triangles));
    }
    hasher.finalize().into()
}

/// The hash of a healed mesh as it is used: in its own frame, in lengths of the planning frame.
pub(super) fn mesh_hash(mesh: &Mesh) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    text(&mut hasher, MESH_TAG);
    hasher.update(&[match mesh.solidity {
        Solidity::Closed => 0,
        Solidity::Winding => 1,
        Solidity::Wall => 2,
    }]);
    number(&mut hasher, mesh.vertices.len());
    for vertex in &mesh.vertices {
        hasher.update(bytemuck::cast_slice(vertex.coords.as_slice()));
    }
    number(&mut hasher, mesh.triangles.len());
    hasher.update(bytemuck::cast_slice(&mesh.triangles));
    hasher.finalize().into()
}

fn number(hasher: &mut blake3::Hasher, value: usize) {
    hasher.update(&(value as u64).to_le_bytes());
}

fn text(hasher: &mut blake3::Hasher, value: &str) {
    number(hasher, value.len());
    hasher.update(value.as_bytes());
}
