//! STL, binary and text.

use std::collections::HashMap;
use std::io::Cursor;

use crate::geometry::SourceMesh;

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Reads an STL file of either kind.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_stl(bytes: &[u8]) -> Result<SourceMesh, String> {
    if bytes.is_empty() {
        return Err("the file is empty (0 bytes); export the part again".into());
    }
    if is_binary(bytes) { parse_binary(bytes) } else { parse_text(&String::from_utf8_lossy(bytes)) }
}

/// Exporters write `solid` into binary headers too: what decides is whether the length fits
/// the count, then whether it is text.
fn is_binary(bytes: &[u8]) -> bool {
    let fits = announced(bytes).is_some_and(|n| (n as usize) <= (bytes.len() - HEADER) / RECORD);
    let text = bytes.trim_ascii_start().get(..5).is_some_and(|w| w.eq_ignore_ascii_case(b"solid"));
    !text || (fits && bytes.contains(&0))
}

fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(80..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
}

fn parse_binary(bytes: &[u8]) -> Result<SourceMesh, String> {
    let count = announced(bytes).ok_or("neither binary nor text STL (too short); export the part again")?;
    let present = (bytes.len() - HEADER) / RECORD;
    if present < count as usize {
        return Err(format!(
            "truncated, or no STL file: the header announces {count} triangles, {present} are there; export the part again"
        ));
    }
    // stl_io takes every file that begins with `solid ` for text.
    let mut owned = bytes.to_vec();
    owned[..80].fill(b' ');
    read(owned)
}

fn parse_text(text: &str) -> Result<SourceMesh, String> {
    let mut mesh = SourceMesh::default();
    let mut welded = HashMap::new();
    let mut solid = String::new();
    for line in text.lines() {
        let line = line.trim().to_ascii_lowercase();
        let first = line.split_whitespace().next().unwrap_or_default();
        match first {
            // stl_io wants a name, and stops at the first of several solids.
            "solid" => solid = String::from("solid part\n"),
            // Normals follow from the vertices; some exporters write NaN there.
            "facet" => solid.push_str("facet normal 0 0 1\n"),
            "endsolid" => {
                solid.push_str("endsolid\n");
                append(&mut mesh, &mut welded, std::mem::take(&mut solid))?;
            }
            _ => solid.extend([line.as_str(), "\n"]),
        }
    }
    if !solid.trim().is_empty() {
        append(&mut mesh, &mut welded, solid)?;
    }
    Ok(mesh)
}

fn append(mesh: &mut SourceMesh, welded: &mut HashMap<[u64; 3], u32>, solid: String) -> Result<(), String> {
    let more = read(solid.into_bytes())?;
    for triangle in more.triangles {
        let corners = triangle.map(|i| {
            let p = more.vertices[i as usize];
            *welded.entry(p.map(f64::to_bits)).or_insert_with(|| {
                mesh.vertices.push(p);
                (mesh.vertices.len() - 1) as u32
            })
        });
        mesh.triangles.push(corners);
    }
    Ok(())
}

fn read(bytes: Vec<u8>) -> Result<SourceMesh, String> {
    let stl = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            "truncated: the file ends too early; export the part again".into()
        }
        _ => format!("{e}; export the part again"),
    })?;
    Ok(SourceMesh {
        vertices: stl.vertices.iter().map(|v| v.0.map(f64::from)).collect(),
        triangles: stl.faces.iter().map(|f| f.vertices.map(|i| i as u32)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::parse_stl;
    use proptest::prelude::*;

    const TEXT: &str = "solid\n facet normal nan 0 0\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid\n";

    fn binary(header: &[u8], count: u32, records: usize) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, 0);
        bytes.extend(count.to_le_bytes());
        for _ in 0..records {
            for x in [0f32, 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 0.] {
                bytes.extend(x.to_le_bytes());
            }
            bytes.extend([0, 0]);
        }
        bytes
    }

    #[test]
    fn both_kinds_are_read() {
        for bytes in [
            TEXT.as_bytes().to_vec(),
            TEXT.replace('\n', "\r\n").to_uppercase().into_bytes(),
            binary(b"solid misleading", 1, 1),
            binary(b"", 1, 1),
        ] {
            let mesh = parse_stl(&bytes).unwrap();
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
            assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        }
    }

    #[test]
    fn several_solids_become_one_part() {
        let mesh = parse_stl(TEXT.repeat(2).as_bytes()).unwrap();
        assert_eq!((mesh.vertices.len(), mesh.triangles.len()), (3, 2));
    }

    #[test]
    fn truncated_files_are_refused() {
        let half = &TEXT[..TEXT.len() / 2];
        for bytes in [Vec::new(), half.into(), binary(b"", 2, 1), binary(b"solid", 2, 1), b"abc".to_vec()] {
            let error = parse_stl(&bytes).unwrap_err();
            assert!(error.contains("export the part again"), "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300), solid: bool) {
            let start: &[u8] = if solid { b"solid " } else { b"" };
            let _ = parse_stl(&[start, &bytes].concat());
        }

        #[test]
        fn no_text_makes_it_panic(text in "(solid|endsolid|facet|normal|outer|loop|vertex|endloop|endfacet|\n|0|1e99|nan| ){0,60}") {
            let _ = parse_stl(text.as_bytes());
        }
    }
}
