//! STL, binary and text.

use std::collections::HashMap;

use super::content::{Body, Content, PieceKind, Pieces};
use super::text::{decimal_comma, decoded, excerpt};
use crate::geometry::SourceMesh;

const HEADER: usize = 84;
const RECORD: usize = 50;

/// Reads an STL file of either kind.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_stl(bytes: &[u8]) -> Result<Content, String> {
    if is_binary(bytes) { parse_binary(bytes) } else { parse_text(&decoded(bytes)) }
}

/// Whether a file has just the length that its count of triangles gives: text hardly ever does.
pub(super) fn is_binary_by_length(bytes: &[u8]) -> bool {
    announced(bytes).is_some_and(|n| n > 0 && (n as usize).checked_mul(RECORD) == Some(bytes.len() - HEADER))
}

/// Exporters write `solid` into binary headers, too, and comments before `solid` in texts. Zero bytes are in no text.
fn is_binary(bytes: &[u8]) -> bool {
    is_binary_by_length(bytes) || bytes.contains(&0) || !bytes.is_ascii() && !has_facets(bytes)
}

/// Whether the words of a text are there.
fn has_facets(bytes: &[u8]) -> bool {
    let text = decoded(bytes).to_ascii_lowercase();
    text.contains("facet") && text.contains("vertex") || text.trim_start().starts_with("solid")
}

fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(80..HEADER).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes)
}

fn parse_binary(bytes: &[u8]) -> Result<Content, String> {
    let again = "export the part again";
    let count =
        announced(bytes).ok_or_else(|| format!("neither binary nor text STL (too short); {again}"))? as usize;
    let records = &bytes[HEADER..];
    let present = records.len() / RECORD;
    if present < count {
        return Err(format!(
            "truncated, or no STL file: the header announces {count} triangles, {present} are there; {again}"
        ));
    }
    let beyond = records.len() - count * RECORD;
    let mut notes = Vec::new();
    // Streaming writers leave the count at 0; anything else may be a second file behind the first.
    let count = match (count, beyond % RECORD) {
        (0, _) if present == 0 => return Err(format!("it has no triangles; {again}")),
        (0, 0) => {
            notes.push(format!("the header announces no triangles; all {present} that are there are read"));
            present
        }
        (0, _) => {
            return Err(format!(
                "the header announces no triangles, and {beyond} bytes are no whole number of them; {again}"
            ));
        }
        (_, _) if beyond >= RECORD => {
            let more = format!("the header announces {count} triangles, and {beyond} bytes follow these");
            return Err(format!("{more}: triangles would be lost; {again}"));
        }
        (_, 0) => count,
        (_, _) => {
            notes.push(format!("{beyond} bytes after the {count} announced triangles are not read"));
            count
        }
    };
    let mut surface = Welded::default();
    for record in records.chunks_exact(RECORD).take(count) {
        // The normal comes first; it follows from the corners.
        let number = |i: usize| f32::from_le_bytes([record[i], record[i + 1], record[i + 2], record[i + 3]]);
        let corner = |i: usize| [12, 16, 20].map(|at| f64::from(number(12 * i + at)));
        surface.add([0, 1, 2].map(corner));
    }
    Ok(surface.content(notes, Pieces::default()))
}

/// A surface whose equal vertices are one.
#[derive(Default)]
struct Welded {
    mesh: SourceMesh,
    vertices: HashMap<[u64; 3], u32>,
}

impl Welded {
    fn add(&mut self, corners: [[f64; 3]; 3]) {
        let vertices = corners.map(|p| {
            *self.vertices.entry(p.map(f64::to_bits)).or_insert_with(|| {
                self.mesh.vertices.push(p);
                (self.mesh.vertices.len() - 1) as u32
            })
        });
        self.mesh.triangles.push(vertices);
    }

    fn content(self, notes: Vec<String>, mut pieces: Pieces) -> Content {
        pieces.kind = PieceKind::Solids;
        pieces.of.resize(self.mesh.triangles.len(), 0);
        if pieces.names.is_empty() {
            pieces.names.push(String::new());
        }
        Content {
            bodies: vec![Body { path: Vec::new(), mesh: self.mesh, pieces }],
            notes,
            ..Content::default()
        }
    }
}

fn parse_text(text: &str) -> Result<Content, String> {
    let mut surface = Welded::default();
    let mut pieces = Pieces::default();
    let mut notes = Vec::new();
    let mut corners: Vec<[f64; 3]> = Vec::with_capacity(3);
    // Where the facet began that is not ended yet, and the solid.
    let (mut facet, mut solid) = (None, None);
    let mut unknown: Option<(usize, &str, usize)> = None;
    for (number, line) in (1..).zip(text.lines()) {
        let mut words = line.split_ascii_whitespace();
        let Some(word) = words.next() else { continue };
        let is = |keyword: &str| word.eq_ignore_ascii_case(keyword);
        if is("vertex") {
            corners
                .push(vertex(words).map_err(|e| format!("line {number}: {e}, found `{}`", excerpt(line)))?);
        } else if is("facet") {
            if let Some(began) = facet.replace(number) {
                return Err(format!(
                    "line {number}: a facet begins before the one of line {began} ends; export the part again"
                ));
            }
        } else if is("endfacet") {
            let Ok(triangle) = <[[f64; 3]; 3]>::try_from(std::mem::take(&mut corners)) else {
                return Err(format!("line {number}: a facet without three vertices; export the part again"));
            };
            facet = None;
            surface.add(triangle);
            pieces.of.push(pieces.names.len().saturating_sub(1) as u32);
        } else if is("solid") {
            if let Some(began) = solid.replace(number) {
                notes.push(format!(
                    "line {number}: a solid begins before the one of line {began} ends; both are read"
                ));
            }
            pieces.names.push(line.trim_start().get(5..).unwrap_or_default().trim().to_owned());
        } else if is("endsolid") {
            solid = None;
        } else if !(is("outer") || is("endloop") || is("loop") || word.starts_with(['#', ';', '/'])) {
            unknown = Some(unknown.map_or((number, line, 1), |(first, text, n)| (first, text, n + 1)));
        }
    }
    if facet.is_some() || !corners.is_empty() {
        return Err("truncated: the file ends within a facet; export the part again".into());
    }
    if surface.mesh.triangles.is_empty() {
        if text.lines().any(|line| line.starts_with("v ")) {
            return Err("this is the text of an OBJ file; rename it to .obj".into());
        }
        return Err("neither binary nor text STL: it has no facets; export the part again".into());
    }
    if let Some((line, text, count)) = unknown {
        let more = if count > 1 { format!(" and {} more", count - 1) } else { String::new() };
        notes.push(format!(
            "line {line} (`{}`){more} skipped: no line of an STL file begins so",
            excerpt(text)
        ));
    }
    if let Some(line) = solid {
        notes.push(format!("the solid of line {line} is not ended (`endsolid`): the file may be truncated"));
    }
    Ok(surface.content(notes, pieces))
}

fn vertex<'a>(words: impl Iterator<Item = &'a str>) -> Result<[f64; 3], &'static str> {
    let words: Vec<&str> = words.collect();
    // In single precision, as binary files have them: what is equal in one form is equal in the other.
    let numbers: Option<Vec<f64>> = words.iter().map(|w| w.parse::<f32>().ok().map(f64::from)).collect();
    let numbers = numbers.and_then(|n| <[f64; 3]>::try_from(n).ok());
    numbers.ok_or_else(|| decimal_comma(&words).unwrap_or("a vertex needs three numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;
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

    fn only(content: Result<Content, String>) -> Body {
        content.unwrap().bodies.pop().unwrap()
    }

    #[test]
    fn both_kinds_are_read() {
        for bytes in [
            TEXT.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", TEXT.as_bytes()].concat(),
            format!("; of a scanner\n# 2\n{TEXT}").into_bytes(),
            TEXT.replace('\n', "\r\n").to_uppercase().into_bytes(),
            binary(b"solid misleading", 1, 1),
            binary(b"", 1, 1),
        ] {
            let mesh = only(parse_stl(&bytes)).mesh;
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
            assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
        }
    }

    #[test]
    fn solids_are_pieces_of_one_surface() {
        let body = only(parse_stl(TEXT.repeat(2).as_bytes()));
        assert_eq!((body.mesh.vertices.len(), body.mesh.triangles.len()), (3, 2));
        assert_eq!(body.pieces.of, [0, 1]);
    }

    #[test]
    fn nothing_is_lost_without_a_word() {
        let open = TEXT.replace("endsolid\n", "");
        let two = parse_stl(format!("{open}{TEXT}").as_bytes()).unwrap();
        assert_eq!(two.bodies[0].mesh.triangles.len(), 2);
        assert!(
            two.notes[0].contains("line 9: a solid begins before the one of line 1 ends"),
            "{:?}",
            two.notes
        );
        for (bytes, note) in [
            (open.clone().into_bytes(), "not ended"),
            (TEXT.replace("  outer", "  inner\n  outer").into_bytes(), "line 3 (`inner`)"),
            (binary(b"", 0, 2), "all 2 that are there"),
            ([binary(b"", 1, 1), vec![7; 10]].concat(), "10 bytes after"),
        ] {
            let content = parse_stl(&bytes).unwrap();
            assert!(content.notes[0].contains(note), "{note}: {:?}", content.notes);
        }
        for (bytes, reason) in [
            ([binary(b"", 1, 1), binary(b"", 1, 1)].concat(), "134 bytes follow"),
            ([binary(b"", 0, 1), vec![7; 10]].concat(), "no whole number"),
            (binary(b"", 0, 0), "no triangles"),
            (TEXT.replace(" 0 0 0\n", " 0,5 0 0\n").into_bytes(), "decimal commas"),
            (TEXT.replace("vertex 0 0 0", "vertex 0 0").into_bytes(), "line 4: a vertex needs three numbers"),
            (TEXT.replace("endfacet", "").into_bytes(), "within a facet"),
            (b"o a\nv 1 2 3\n".to_vec(), "rename it to .obj"),
        ] {
            let error = parse_stl(&bytes).unwrap_err();
            assert!(error.contains(reason), "{reason}: {error}");
        }
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
