//! glTF and GLB scenes: every node with a mesh is a part, its pose that of the node.
//!
//! The crate `gltf` parses and validates the JSON. Buffers are read here, as its feature `import`
//! brings image decoders along, and accessors, with checked offsets: its own readers trust the
//! counts and offsets of the file and may panic on them.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use base64::engine::DecodePaddingMode;
use base64::engine::general_purpose::{GeneralPurpose, GeneralPurposeConfig};
use base64::{Engine, alphabet};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::mesh::Mode;
use nalgebra::{Matrix4, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::geometry::SourceMesh;

/// Reads a scene: names (unique) and meshes, in the order of the scene's tree. `folder` is
/// where buffers beside the file are looked for.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(crate) fn parse_gltf(bytes: &[u8], folder: &Path) -> Result<Vec<(String, SourceMesh)>, String> {
    if bytes.is_empty() {
        return Err("the file is empty (0 bytes); export the scene again".into());
    }
    check_glb_length(bytes)?;
    let again = |e: gltf::Error| format!("{e}; export the scene again");
    let gltf = gltf::Gltf::from_slice_without_validation(bytes).map_err(again)?;
    check_accessor_indices(gltf.document.as_json())?;
    let document = gltf::Document::from_json(gltf.document.into_json()).map_err(again)?;
    let buffers = read_buffers(&document, gltf.blob, folder)?;
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or("it holds no scene; export the assembly as a scene with nodes")?;
    let mut reader =
        SceneReader { buffers, visited: HashSet::new(), names: HashSet::new(), parts: Vec::new() };
    for node in scene.nodes() {
        reader.visit(&node, &Matrix4::identity())?;
    }
    if reader.parts.is_empty() {
        return Err("no node of the scene has a mesh; export the assembly's bodies as meshes".into());
    }
    Ok(reader.parts)
}

/// The crate subtracts the header's size from the length without looking.
fn check_glb_length(bytes: &[u8]) -> Result<(), String> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else { return Ok(()) };
    let length = rest.get(4..8).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    match length {
        Some(length) if length >= 20 && length as usize <= bytes.len() => Ok(()),
        _ => Err("truncated: the header announces more than the file holds; export the scene again".into()),
    }
}

/// The crate's own validation looks primitives' accessors up before it has checked them.
fn check_accessor_indices(root: &gltf::json::Root) -> Result<(), String> {
    let primitives = root.meshes.iter().flat_map(|m| &m.primitives);
    let used = primitives.flat_map(|p| p.attributes.values().chain(&p.indices));
    match used.map(|i| i.value()).find(|i| *i >= root.accessors.len()) {
        Some(index) => Err(format!("accessor {index} does not exist; export the scene again")),
        None => Ok(()),
    }
}

fn read_buffers(
    document: &gltf::Document,
    mut blob: Option<Vec<u8>>,
    folder: &Path,
) -> Result<Vec<Vec<u8>>, String> {
    let read = |buffer: gltf::Buffer<'_>| {
        let data = match buffer.source() {
            Source::Bin => blob.take().ok_or_else(|| "missing binary portion of binary glTF".to_owned()),
            Source::Uri(uri) => read_uri(uri, folder),
        };
        let mut data = data.map_err(|e| format!("buffer {}: {e}", buffer.index()))?;
        // As the crate's own reader does it: announced lengths may be rounded up to whole words.
        data.resize(data.len().next_multiple_of(4), 0);
        if data.len() < buffer.length() {
            return Err(format!("buffer {} is truncated; export the scene again", buffer.index()));
        }
        Ok(data)
    };
    document.buffers().map(read).collect()
}

/// The data in a `data:` URI, or of the file that the URI names.
fn read_uri(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    let path = match uri.split_once(':') {
        Some(("data", rest)) => {
            let data = rest.split(";base64,").nth(1).unwrap_or(rest);
            return BASE64.decode(data).map_err(|e| e.to_string());
        }
        Some(("file", rest)) => PathBuf::from(rest.strip_prefix("//").unwrap_or(rest)),
        Some(_) => return Err("unsupported URI scheme".into()),
        None => {
            let name =
                urlencoding::decode(uri).map_err(|_| format!("`{uri}`: rename it to ASCII characters"))?;
            folder.join(&*name)
        }
    };
    fs::read(path).map_err(|e| e.to_string())
}

/// Padding may be missing.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

struct SceneReader {
    buffers: Vec<Vec<u8>>,
    visited: HashSet<usize>,
    names: HashSet<String>,
    parts: Vec<(String, SourceMesh)>,
}

impl SceneReader {
    fn visit(&mut self, node: &gltf::Node<'_>, scene_from_parent: &Matrix4<f64>) -> Result<(), String> {
        // The standard wants a strict tree; a loop would never end.
        if !self.visited.insert(node.index()) || self.visited.len() > MAX_NODES {
            return Err(format!("node {} has two parents, or the scene has too many nodes", node.index()));
        }
        let scene_from_node = scene_from_parent * node_transform(node);
        if let Some(mesh) = node.mesh() {
            let name = self.unique_name(node, &mesh);
            let part = self.part_mesh(&mesh, &scene_from_node).map_err(|e| format!("part `{name}`: {e}"))?;
            self.parts.push((name, part));
        }
        node.children().try_for_each(|child| self.visit(&child, &scene_from_node))
    }

    fn unique_name(&mut self, node: &gltf::Node<'_>, mesh: &gltf::Mesh<'_>) -> String {
        let given = node.name().or(mesh.name()).map(str::trim).filter(|n| !n.is_empty());
        let base = given.map_or_else(|| format!("node{}", node.index()), str::to_owned);
        let mut name = base.clone();
        let mut count = 1;
        while !self.names.insert(name.clone()) {
            count += 1;
            name = format!("{base}-{count}");
        }
        name
    }

    fn part_mesh(&self, mesh: &gltf::Mesh<'_>, scene_from_node: &Matrix4<f64>) -> Result<SourceMesh, String> {
        let mut part = SourceMesh::default();
        for primitive in mesh.primitives() {
            let base = u32::try_from(part.vertices.len()).map_err(|_| "too many vertices")?;
            let positions =
                primitive.get(&gltf::Semantic::Positions).ok_or("a primitive without positions")?;
            let points = self.positions(&positions)?;
            let indices = match primitive.indices() {
                Some(accessor) => self.indices(&accessor)?,
                None => (0..points.len() as u32).collect(),
            };
            part.vertices.extend(points.iter().map(|p| transformed(scene_from_node, p)));
            let triangles = triangles_of(primitive.mode(), &indices);
            part.triangles.extend(triangles.into_iter().map(|t| t.map(|i| base.saturating_add(i))));
        }
        // A mirrored instance turns its triangles inside out.
        if scene_from_node.fixed_view::<3, 3>(0, 0).determinant() < 0.0 {
            part.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        Ok(part)
    }

    fn positions(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<[f64; 3]>, String> {
        if (accessor.data_type(), accessor.dimensions()) != (DataType::F32, Dimensions::Vec3) {
            return Err("its positions are not 32-bit floats; export without quantisation".into());
        }
        let float = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        Ok(self.elements(accessor)?.map(|b| [float(b), float(&b[4..]), float(&b[8..])]).collect())
    }

    fn indices(&self, accessor: &gltf::Accessor<'_>) -> Result<Vec<u32>, String> {
        let read: fn(&[u8]) -> u32 = match (accessor.data_type(), accessor.dimensions()) {
            (DataType::U8, Dimensions::Scalar) => |b| u32::from(b[0]),
            (DataType::U16, Dimensions::Scalar) => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
            (DataType::U32, Dimensions::Scalar) => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            _ => return Err("its indices are not unsigned integers; export the scene again".into()),
        };
        Ok(self.elements(accessor)?.map(read).collect())
    }

    /// The bytes of each element of an accessor.
    fn elements(&self, accessor: &gltf::Accessor<'_>) -> Result<impl Iterator<Item = &[u8]>, String> {
        if accessor.sparse().is_some() {
            return Err("it uses sparse accessors, which are not supported; export without them".into());
        }
        let view = accessor.view().ok_or("an accessor without data")?;
        let buffer: &[u8] = self.buffers.get(view.buffer().index()).map_or(&[], Vec::as_slice);
        let end = view.offset().checked_add(view.length());
        let bytes = end.and_then(|end| buffer.get(view.offset()..end));
        let bytes = bytes.and_then(|b| b.get(accessor.offset()..));
        let bytes =
            bytes.ok_or("truncated: an accessor reaches beyond its buffer; export the scene again")?;
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size).max(size);
        let available = if bytes.len() < size { 0 } else { (bytes.len() - size) / stride + 1 };
        if available < accessor.count() {
            return Err("truncated: an accessor reaches beyond its buffer; export the scene again".into());
        }
        Ok((0..accessor.count()).map(move |i| &bytes[i * stride..i * stride + size]))
    }
}

/// A scene's tree is walked by recursion: deeper or larger ones are no assembly.
const MAX_NODES: usize = 20_000;

fn node_transform(node: &gltf::Node<'_>) -> Matrix4<f64> {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => Matrix4::from_fn(|r, c| f64::from(matrix[c][r])),
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            let [i, j, k, w] = rotation.map(f64::from);
            let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
            Translation3::from(Vector3::from(translation.map(f64::from))).to_homogeneous()
                * rotation.to_homogeneous()
                * Matrix4::new_nonuniform_scaling(&Vector3::from(scale.map(f64::from)))
        }
    }
}

fn transformed(scene_from_node: &Matrix4<f64>, p: &[f64; 3]) -> [f64; 3] {
    let q = scene_from_node * Point3::from(*p).to_homogeneous();
    [q.x, q.y, q.z]
}

fn triangles_of(mode: Mode, indices: &[u32]) -> Vec<[u32; 3]> {
    match mode {
        Mode::Triangles => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        Mode::TriangleStrip => {
            let turned =
                |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
        // Points and lines bound no volume.
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::parse_gltf;
    use proptest::prelude::*;
    use std::path::Path;

    /// One triangle, used by two nodes: one under a moved and turned parent, one mirrored.
    fn scene() -> String {
        r#"{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,2]}],
"nodes":[{"name":"frame","translation":[10,0,0],"rotation":[0,0,0.70710678118,0.70710678118],"children":[1]},
{"name":"bolt","mesh":0,"translation":[1,0,0]},{"name":"bolt","mesh":0,"scale":[1,1,-2]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
"buffers":[{"byteLength":42,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAIA/AAABAAIA"}]}"#
            .into()
    }

    fn glb(json: &str) -> Vec<u8> {
        let mut chunk = json.as_bytes().to_vec();
        chunk.resize(chunk.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        bytes.extend((chunk.len() as u32 + 20).to_le_bytes());
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(b"JSON");
        bytes.extend(chunk);
        bytes
    }

    fn parse(text: &str) -> Result<Vec<(String, crate::geometry::SourceMesh)>, String> {
        parse_gltf(text.as_bytes(), Path::new("/nowhere"))
    }

    #[test]
    fn nodes_are_parts_with_poses_and_unique_names() {
        for bytes in [scene().into_bytes(), glb(&scene())] {
            let parts = parse_gltf(&bytes, Path::new("/nowhere")).unwrap();
            let names: Vec<&str> = parts.iter().map(|(n, _)| n.as_str()).collect();
            assert_eq!(names, ["bolt", "bolt-2"]);
            let moved = parts[0].1.vertices[1];
            for (got, want) in moved.iter().zip([10.0, 2.0, 0.0]) {
                assert!((got - want).abs() < 1e-6, "{moved:?}");
            }
            assert_eq!(parts[0].1.triangles, [[0, 1, 2]]);
            assert_eq!(parts[1].1.triangles, [[0, 2, 1]], "mirrored");
        }
    }

    #[test]
    fn buffers_are_read_from_files_and_the_binary_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let start = "data:application/octet-stream;base64,";
        let (data, uri) = (42, &scene()[scene().find(start).unwrap()..][..start.len() + 56]);
        let bytes = super::read_uri(uri, folder.path()).unwrap();
        assert_eq!(bytes.len(), data);
        std::fs::write(folder.path().join("sc ne é.bin"), &bytes).unwrap();
        let whole = parse(&scene()).unwrap();
        let absolute = format!("file://{}/sc ne é.bin", folder.path().display());
        for other in ["sc ne é.bin", "sc%20ne%20%C3%A9.bin", &absolute] {
            let parts = parse_gltf(scene().replace(uri, other).as_bytes(), folder.path()).unwrap();
            assert_eq!(parts, whole, "{other}");
        }
        let mut glb = glb(&scene().replace(&format!(",\"uri\":\"{uri}\""), ""));
        glb.extend([44, 0, 0, 0].iter().chain(b"BIN\0").chain(&bytes).chain(&[0; 2]));
        let length = glb.len() as u32;
        glb[8..12].copy_from_slice(&length.to_le_bytes());
        assert_eq!(parse_gltf(&glb, folder.path()).unwrap(), whole);
    }

    #[test]
    fn damage_is_refused() {
        for (damage, expected) in [
            (scene().replace("\"byteLength\":36", "\"byteLength\":35"), "truncated"),
            (scene().replace("\"count\":3", "\"count\":4"), "truncated"),
            (scene().replace("\"count\":3", "\"count\":99999999999999"), "truncated"),
            (scene().replace("\"byteOffset\":36", "\"byteOffset\":99999999999"), "truncated"),
            (scene().replace("\"byteLength\":42", "\"byteLength\":4200"), "truncated"),
            (
                scene().replace("{\"name\":\"bolt\",\"mesh\":0,\"tr", "{\"children\":[0],\"mesh\":0,\"tr"),
                "two parents",
            ),
            (scene().replace("data:application/octet-stream;base64,", "a%ff"), "rename"),
            (scene().replace("data:application/octet-stream;base64,", "absent"), "buffer 0: No such file"),
            (scene().replace("data:application/octet-stream;base64,", "http://"), "unsupported URI scheme"),
            (scene().replace(";base64,", ";base64,!"), "buffer 0: Invalid symbol 33, offset 0."),
            (scene().replace("\"uri\"", "\"x\""), "buffer 0: missing binary portion"),
            (scene().replace("\"mesh\":0,", ""), "no node"),
            (scene().replace("\"scenes\"", "\"x\"").replace("\"scene\":0,", ""), "no scene"),
            ("{".into(), "export the scene again"),
            (String::new(), "0 bytes"),
        ] {
            let error = parse(&damage).unwrap_err();
            assert!(error.contains(expected), "{expected}: {error}");
        }
        let whole = glb(&scene());
        for length in [4, 11, 12, 19, 40, whole.len() - 1] {
            assert!(parse_gltf(&whole[..length], Path::new("/")).is_err());
        }
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), magic: bool) {
            let start: &[u8] = if magic { b"glTF\x02\0\0\0" } else { b"" };
            let _ = parse_gltf(&[start, &bytes].concat(), Path::new("/nowhere"));
        }

        #[test]
        fn no_changed_number_makes_it_panic(at in 0usize..900, with in "[0-9]{1,20}|-1|\\[|null") {
            let text = scene();
            let at = text.floor_char_boundary(at.min(text.len() - 1));
            let start = text[at..].find(|c: char| c.is_ascii_digit()).map_or(at, |d| at + d);
            let end = text[start..].find(|c: char| !c.is_ascii_digit()).map_or(text.len(), |d| start + d);
            let _ = parse(&format!("{}{with}{}", &text[..start], &text[end..]));
        }
    }
}
