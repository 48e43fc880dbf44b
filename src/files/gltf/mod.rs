//! glTF and GLB scenes: every node with a mesh is a body, its pose that of the node.
//!
//! The crate `gltf` parses and validates the JSON. Buffers are read here (`buffers.rs`), as its feature `import` brings
//! image decoders along, and accessors, with checked offsets: its own readers trust the counts and offsets of the file
//! and may panic on them.

mod buffers;
mod extensions;
mod scene;

use std::path::Path;

use super::content::Content;

/// Reads a scene. `folder` is where buffers beside the file are looked for.
///
/// # Errors
/// What is wrong and what to do, without the file's name.
pub(super) fn parse_gltf(bytes: &[u8], folder: &Path) -> Result<Content, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let beyond = check_glb_length(bytes)?;
    let again = |e: gltf::Error| format!("{e}; export the scene again");
    let gltf = gltf::Gltf::from_slice_without_validation(bytes).map_err(again)?;
    let mut root = gltf.document.into_json();
    check_accessor_indices(&root)?;
    extensions::check_required(&mut root)?;
    let document = gltf::Document::from_json(root).map_err(again)?;
    let buffers = buffers::Buffers::read(&document, gltf.blob, folder)?;
    let mut content = scene::read(&document, &buffers)?;
    if beyond > 0 {
        content.notes.push(format!("{beyond} bytes after the announced end of the file are not read"));
    }
    Ok(content)
}

/// How many bytes follow what the header of a GLB file announces. The crate subtracts the header's size from the length
/// without looking.
fn check_glb_length(bytes: &[u8]) -> Result<usize, String> {
    let Some(rest) = bytes.strip_prefix(b"glTF") else { return Ok(0) };
    let length = rest.get(4..8).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    match length {
        Some(length) if length >= 20 && length as usize <= bytes.len() => Ok(bytes.len() - length as usize),
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

#[cfg(test)]
mod tests {
    use super::super::content::Body;
    use super::buffers::read_uri;
    use super::*;
    use base64::Engine;
    use proptest::prelude::*;

    use super::buffers::BASE64;

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

    fn parse(text: &str) -> Result<Vec<Body>, String> {
        Ok(parse_gltf(text.as_bytes(), Path::new("/nowhere"))?.bodies)
    }

    /// The notes on a scene with something changed.
    fn notes(from: &str, to: &str) -> Vec<String> {
        let changed = scene().replacen(from, to, 1);
        assert_ne!(changed, scene());
        parse_gltf(changed.as_bytes(), Path::new("/nowhere")).unwrap().notes
    }

    #[test]
    fn nodes_are_bodies_with_poses_and_paths() {
        for bytes in [scene().into_bytes(), format!("\u{feff}{}", scene()).into_bytes(), glb(&scene())] {
            let bodies = parse_gltf(&bytes, Path::new("/nowhere")).unwrap().bodies;
            assert_eq!(bodies[0].path, ["frame", "bolt"]);
            assert_eq!(bodies[1].path, ["bolt"]);
            let moved = bodies[0].mesh.vertices[1];
            for (got, want) in moved.iter().zip([10.0, 2.0, 0.0]) {
                assert!((got - want).abs() < 1e-6, "{moved:?}");
            }
            assert_eq!(bodies[0].mesh.triangles, [[0, 1, 2]]);
            assert_eq!(bodies[1].mesh.triangles, [[0, 2, 1]], "mirrored");
        }
    }

    #[test]
    fn buffers_are_read_from_files_and_the_binary_chunk() {
        let folder = tempfile::tempdir().unwrap();
        let start = "data:application/octet-stream;base64,";
        let (data, uri) = (42, &scene()[scene().find(start).unwrap()..][..start.len() + 56]);
        let bytes = read_uri(uri, folder.path()).unwrap();
        assert_eq!(bytes.len(), data);
        std::fs::write(folder.path().join("sc ne é.bin"), &bytes).unwrap();
        let whole = parse(&scene()).unwrap();
        let absolute = format!("file://{}/sc ne é.bin", folder.path().display());
        for other in ["sc ne é.bin", "sc%20ne%20%C3%A9.bin", &absolute] {
            let parts = parse_gltf(scene().replace(uri, other).as_bytes(), folder.path()).unwrap().bodies;
            assert_eq!(parts, whole, "{other}");
        }
        let mut glb = glb(&scene().replace(&format!(",\"uri\":\"{uri}\""), ""));
        glb.extend([44, 0, 0, 0].iter().chain(b"BIN\0").chain(&bytes).chain(&[0; 2]));
        let length = glb.len() as u32;
        glb[8..12].copy_from_slice(&length.to_le_bytes());
        assert_eq!(parse_gltf(&glb, folder.path()).unwrap().bodies, whole);
        glb.extend([0; 7]);
        assert!(parse_gltf(&glb, folder.path()).unwrap().notes[1].contains("7 bytes after"));
    }

    #[test]
    fn instances_and_integers_are_read() {
        let positions = [0u16, 0, 0, 0, 65535, 0, 0, 0, 0, 65535, 0, 0].map(u16::to_le_bytes).concat();
        let corners = [0u8, 1, 2, 0];
        let shifts = [0f32, 0., 0., 5., 0., 0.].map(f32::to_le_bytes).concat();
        let data = BASE64.encode([&positions[..], &corners, &shifts].concat());
        let text = format!(
            r#"{{"asset":{{"version":"2.0","extras":{{"units":"millimeters"}}}},"scenes":[{{"nodes":[0]}}],
"extensionsUsed":["EXT_mesh_gpu_instancing","KHR_mesh_quantization"],
"extensionsRequired":["EXT_mesh_gpu_instancing","KHR_mesh_quantization","KHR_materials_unlit","KHR_texture_basisu","MSFT_lod"],
"nodes":[{{"name":"bolt","mesh":0,"scale":[2,2,2],
"extensions":{{"EXT_mesh_gpu_instancing":{{"attributes":{{"TRANSLATION":2}}}}}}}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5123,"normalized":true,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
{{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}},
{{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}}],
"bufferViews":[{{"buffer":0,"byteLength":24,"byteStride":8}},{{"buffer":0,"byteOffset":24,"byteLength":4}},
{{"buffer":0,"byteOffset":28,"byteLength":24}}],
"buffers":[{{"byteLength":52,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
        );
        let content = parse_gltf(text.as_bytes(), Path::new("/nowhere")).unwrap();
        assert_eq!(content.units.as_deref(), Some("mm"));
        let firsts: Vec<[f64; 3]> = content.bodies.iter().map(|b| b.mesh.vertices[0]).collect();
        assert_eq!(firsts, [[0.0; 3], [10.0, 0.0, 0.0]]);
        assert_eq!(content.bodies[0].mesh.vertices[1], [2.0, 0.0, 0.0]);
        assert_eq!(content.bodies[1].path, ["bolt"]);
        for (extension, advice) in [
            ("KHR_draco_mesh_compression", "Draco"),
            ("EXT_meshopt_compression", "gltfpack"),
            ("ABC_shapes", "`ABC_shapes`"),
        ] {
            let error = parse(&text.replace("MSFT_lod", extension)).unwrap_err();
            assert!(error.contains(advice), "{error}");
        }
        for (from, to, reason) in [
            ("\"TRANSLATION\":2", "\"TRANSLATION\":9", "accessor 9 does not exist"),
            ("\"TRANSLATION\":2", "\"TRANSLATION\":1", "not vectors of 3"),
            ("\"TRANSLATION\":2", "\"TRANSLATION\":2,\"ROTATION\":0", "not vectors of 4"),
        ] {
            let error = parse(&text.replace(from, to)).unwrap_err();
            assert!(error.contains(reason), "{error}");
        }
    }

    #[test]
    fn what_a_scene_loses_is_noted() {
        for (from, to, note) in [
            ("[0,2]", "[0]", "`bolt` is in no scene"),
            ("\"primitives\"", "\"weights\":[0.5],\"primitives\"", "`bolt` has morph targets"),
            ("[{\"nodes\":[0,2]}]", "[{\"nodes\":[0]},{\"nodes\":[2]}]", "another scene"),
            ("\"version\":\"2.0\"", "\"version\":\"2.0\",\"extras\":{\"unit\":\"furlong\"}", "`furlong`"),
        ] {
            let notes = notes(from, to);
            assert!(notes.iter().any(|n| n.contains(note)), "{note}: {notes:?}");
        }
        assert_eq!(notes("1,1,-2", "1,1,2"), Vec::<String>::new());
        assert!(notes("\"frame\"", "\"f\"")[0].contains("`bolt` is mirrored"));
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
