//! The content handle over what is about to be uploaded; the daemon computes the same one.
//! The byte stream is defined in `ipc/PROTOCOL.md`.

use sbdp_ipc::geometry::{Assembly, Vertices};

use crate::options::Handle;

const TAG: &str = "sbdp-content/1";
/// Single-precision vertices are widened in pieces of this many.
const WIDEN_AT_ONCE: usize = 4096;

/// The handle that the daemon will give this assembly. Its own name does not count.
#[must_use]
pub fn content_hash(assembly: &Assembly<'_>) -> Handle {
    let mut hasher = blake3::Hasher::new();
    text(&mut hasher, TAG);
    hasher.update(&[u8::from(assembly.units.is_some())]);
    text(&mut hasher, assembly.units.unwrap_or(""));
    number(&mut hasher, assembly.fixed.len());
    for name in &assembly.fixed {
        text(&mut hasher, name);
    }
    number(&mut hasher, assembly.parts.len());
    for part in &assembly.parts {
        text(&mut hasher, part.name);
        number(&mut hasher, part.vertices.len());
        vertices(&mut hasher, part.vertices);
        number(&mut hasher, part.triangles.len());
        hasher.update(bytemuck::cast_slice(part.triangles));
    }
    Handle(hasher.finalize().into())
}

fn vertices(hasher: &mut blake3::Hasher, vertices: Vertices<'_>) {
    match vertices {
        Vertices::F64(wide) => {
            hasher.update(bytemuck::cast_slice(wide));
        }
        Vertices::F32(narrow) => {
            for piece in narrow.chunks(WIDEN_AT_ONCE) {
                let wide: Vec<[f64; 3]> = piece.iter().map(|v| v.map(f64::from)).collect();
                hasher.update(bytemuck::cast_slice(&wide));
            }
        }
    }
}

fn number(hasher: &mut blake3::Hasher, value: usize) {
    hasher.update(&(value as u64).to_le_bytes());
}

fn text(hasher: &mut blake3::Hasher, value: &str) {
    number(hasher, value.len());
    hasher.update(value.as_bytes());
}
