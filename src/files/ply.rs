//! PLY, as text and binary. Positions count, and faces of any number of corners or strips of triangles. Colours, normals
//! and the like are skipped; other elements are skipped with a note.
//!
//! The crate `ply-rs-bw` reads header and elements. It takes the counts of a header on trust, so they are checked here.

use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult};

use super::content::{Body, Content};
use super::polygon::Triangulator;
use super::text::excerpt;
use crate::geometry::SourceMesh;

const AGAIN: &str = "export the part again";

/// Reads a PLY file.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_ply(bytes: &[u8]) -> Result<Content, String> {
    let mut reader = Reader::new(bytes);
    let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|e| reason(&e))?;
    let (mut vertices, mut faces, mut strips) = (None, Vec::new(), Vec::new());
    let mut notes = Vec::new();
    for (name, element) in &header.elements {
        check_count(element, header.encoding, reader.get_ref().len())?;
        match name.as_str() {
            "vertex" => {
                needs(element, &["x", "y", "z"])?;
                vertices = Some(elements::<Vertex>(&mut reader, element, &header)?);
            }
            "face" => faces = elements::<Corners>(&mut reader, element, &header)?,
            "tristrips" => strips = elements::<Corners>(&mut reader, element, &header)?,
            _ => {
                elements::<Skipped>(&mut reader, element, &header)?;
                if element.count > 0 {
                    notes.push(format!("{} of `{}` skipped: no faces", element.count, excerpt(name)));
                }
            }
        }
    }
    let rest = reader.get_ref().trim_ascii();
    if !rest.is_empty() {
        notes.push(format!("{} bytes after the announced elements are not read", rest.len()));
    }
    let vertices = vertices.ok_or_else(|| format!("it has no vertices; {AGAIN}"))?;
    let mesh = triangulated(vertices.into_iter().map(|v| v.0).collect(), &faces, &strips)?;
    if mesh.triangles.is_empty() {
        return Err("it has points but no faces (a scan?); export it as a closed triangle mesh".into());
    }
    Ok(Content { bodies: vec![Body { mesh, ..Body::default() }], notes, ..Content::default() })
}

/// A vertex's position.
#[derive(Default)]
struct Vertex([f64; 3]);

/// The vertices of a face, or of strips of triangles with -1 between them.
#[derive(Default)]
struct Corners(Vec<i64>);

/// An element that is not read.
#[derive(Default)]
struct Skipped;

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let Some(axis) = ["x", "y", "z"].iter().position(|axis| *axis == name) else {
            return PropertyAccessResult::Ignored;
        };
        self.0[axis] = match property {
            Property::Char(n) => n.into(),
            Property::UChar(n) => n.into(),
            Property::Short(n) => n.into(),
            Property::UShort(n) => n.into(),
            Property::Int(n) => n.into(),
            Property::UInt(n) => n.into(),
            Property::Float(n) => n.into(),
            Property::Double(n) => n,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Corners {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !["vertex_indices", "vertex_index"].contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = match property {
            Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
            Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
            Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
            Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

fn elements<E: PropertyAccess>(
    reader: &mut Reader<&[u8]>,
    element: &ElementDef,
    header: &ply_rs_bw::ply::Header,
) -> Result<Vec<E>, String> {
    // There is nothing to read of them, however many the header announces.
    if element.properties.is_empty() && header.encoding != Encoding::Ascii {
        return Ok(Vec::new());
    }
    Parser::<E>::new().read_payload_for_element(reader, element, header).map_err(|e| reason(&e))
}

/// Each element takes a byte at least.
fn check_count(element: &ElementDef, encoding: Encoding, left: usize) -> Result<(), String> {
    if element.count <= left || element.properties.is_empty() && encoding != Encoding::Ascii {
        return Ok(());
    }
    let (count, name) = (element.count, excerpt(&element.name));
    Err(format!("truncated: the header announces {count} of `{name}`, and {left} bytes are left; {AGAIN}"))
}

fn needs(element: &ElementDef, names: &[&str]) -> Result<(), String> {
    match names.iter().find(|name| !element.properties.contains_key(**name)) {
        Some(name) => Err(format!("its vertices have no `{name}`; {AGAIN}")),
        None => Ok(()),
    }
}

fn triangulated(
    vertices: Vec<[f64; 3]>,
    faces: &[Corners],
    strips: &[Corners],
) -> Result<SourceMesh, String> {
    let count = vertices.len();
    let checked = |&corner: &i64| match usize::try_from(corner) {
        Ok(place) if place < count && u32::try_from(place).is_ok() => Ok(place as u32),
        _ => Err(format!("vertex {corner} does not exist, there are {count}; {AGAIN}")),
    };
    let mut triangles = Vec::with_capacity(faces.len());
    let mut triangulator = Triangulator::default();
    for Corners(face) in faces {
        let polygon = face.iter().map(checked).collect::<Result<Vec<u32>, String>>()?;
        triangulator.add(&vertices, &polygon, &mut triangles);
    }
    for strip in strips.iter().flat_map(|Corners(all)| all.split(|corner| *corner < 0)) {
        let strip = strip.iter().map(checked).collect::<Result<Vec<u32>, String>>()?;
        let turned =
            |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
        triangles.extend(strip.windows(3).enumerate().map(turned));
    }
    Ok(SourceMesh { vertices, triangles })
}

/// The crate's message, in one line; the line that it names counts from the start of the file.
fn reason(error: &ParseError) -> String {
    let text = error.to_string();
    let first = text.lines().next().unwrap_or_default();
    let cause = text.lines().last().filter(|last| *last != first).map(|last| format!(" ({})", excerpt(last)));
    format!("{}{}; {AGAIN}", super::text::printable(first), cause.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 2\n\
        property list uchar int vertex_indices\nend_header\n0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0.5 9\n4 0 1 2 3\n3 0 3 1\n";

    fn binary(is_big: bool) -> Vec<u8> {
        let (order, two) = if is_big { ("big", [0u8, 2]) } else { ("little", [2, 0]) };
        let mut bytes = format!(
            "ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n\
             property double z\nelement face 1\nproperty list uchar ushort vertex_index\nend_header\n"
        )
        .into_bytes();
        for x in [0.0f64, 0., 0., 1., 0., 0., 0., 1., 0.] {
            bytes.extend(if is_big { x.to_be_bytes() } else { x.to_le_bytes() });
        }
        let one = if is_big { [0u8, 1] } else { [1, 0] };
        bytes.extend([&[3u8][..], &[0, 0], &one, &two].concat());
        bytes
    }

    #[test]
    fn text_and_both_byte_orders_are_read() {
        let mesh = |bytes: &[u8]| parse_ply(bytes).unwrap().bodies.remove(0).mesh;
        let text = mesh(TEXT.as_bytes());
        assert_eq!(text.vertices[3], [0.0, 1.0, 0.5]);
        assert_eq!(text.triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 1]]);
        assert_eq!(mesh(TEXT.replace('\n', "\r\n").as_bytes()), text);
        for is_big in [false, true] {
            let mesh = mesh(&binary(is_big));
            assert_eq!(mesh.vertices, [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]]);
            assert_eq!(mesh.triangles, [[0, 1, 2]]);
        }
    }

    #[test]
    fn strips_are_triangles() {
        let strips = TEXT.replace("element face 2", "element tristrips 1").replace("uchar int", "int int");
        let strips = strips.replace("4 0 1 2 3\n3 0 3 1\n", "8 0 1 2 3 -1 0 3 1\n");
        let mesh = parse_ply(strips.as_bytes()).unwrap().bodies.remove(0).mesh;
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [0, 3, 1]]);
    }

    #[test]
    fn nothing_is_lost_without_a_word() {
        let edges =
            TEXT.replace("end_header\n", "element edge 1\nproperty int a\nend_header\n").to_owned() + "7\n";
        assert_eq!(parse_ply(edges.as_bytes()).unwrap().notes, ["1 of `edge` skipped: no faces"]);
        let longer = [&binary(false)[..], &[1; 5]].concat();
        assert!(parse_ply(&longer).unwrap().notes[0].contains("5 bytes after"));
        for (text, expected) in [
            (TEXT.replace("3 0 3 1\n", ""), "Unexpected end of file"),
            (TEXT.replace("vertex 4", "vertex 4000000000"), "truncated: the header announces 4000000000"),
            (TEXT.replace("float z", "float depth"), "no `z`"),
            (TEXT.replace("0 3 1", "0 3 4"), "vertex 4 does not exist, there are 4"),
            (TEXT.replace("0 3 1", "0 3 -1"), "vertex -1 does not exist"),
            (TEXT.replace("list uchar int vertex_indices", "list uchar int corners"), "no faces"),
            (TEXT.replace("list uchar int", "list uchar float"), "export the part again"),
            (TEXT.replace("1 0 0 9", "1,5 0 0 9"), "Line 13"),
            ("ply\n".into(), "export the part again"),
        ] {
            let error = parse_ply(text.as_bytes()).unwrap_err();
            assert!(error.contains(expected), "{expected}: {error}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(at in 0usize..400, with: Vec<u8>, big: bool, is_text: bool) {
            let mut bytes = if is_text { TEXT.as_bytes().to_vec() } else { binary(big) };
            let at = at.min(bytes.len());
            let end = (at + with.len()).min(bytes.len());
            bytes.splice(at..end, with);
            let _ = parse_ply(&bytes);
        }

        #[test]
        fn no_header_makes_it_panic(text in "(ply|format|ascii|binary_little_endian|1.0|element|vertex|face|property|list|uchar|int|float|x|y|z|vertex_indices|end_header|\n| |-1|99999999999|0|3){0,80}") {
            let _ = parse_ply(format!("ply\nformat {text}").as_bytes());
        }
    }
}
