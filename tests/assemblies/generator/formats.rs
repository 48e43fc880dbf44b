//! The files of an assembly.

use std::borrow::Cow;
use std::fmt::Write as _;

use serde_json::json;

use super::Assembly;
use super::fasteners::ROUND;
use super::shapes::{ngon, prism, rectangle};
use super::solid::{Point, Solid};

type File = (String, Vec<u8>);

/// A folder of OBJ files with its `assembly.json`.
pub(super) fn obj_folder(assembly: &Assembly) -> Vec<File> {
    let path = |file: &str| format!("{}/{file}", assembly.name);
    let mut files = vec![(path("assembly.json"), manifest(assembly))];
    files.extend(assembly.parts.iter().map(|(n, solid)| (path(&format!("{n}.obj")), obj(solid))));
    files
}

/// The same assembly with every part about an origin of its own, and the offsets in
/// `translation.json`.
pub(super) fn translated_folder(assembly: &Assembly) -> Vec<File> {
    let mut apart = Assembly::new("translated", "as bolt-washer-plate, offsets in translation.json");
    let mut offsets = serde_json::Map::new();
    for (number, (name, solid)) in (1..).zip(&assembly.parts) {
        let offset = [8.0 * f64::from(number), -4.0, 2.0 * f64::from(number)];
        apart = apart.with(name.as_str(), solid.moved(offset.map(|c| -c)));
        offsets.insert(name.clone(), json!(offset));
    }
    let mut files = obj_folder(&apart);
    files.push(("translated/translation.json".into(), pretty(&offsets.into())));
    files
}

/// A peg in a plate, one as text and one binary.
pub(super) fn stl_folder() -> Vec<File> {
    let bore = ngon(ROUND, 4.125, [0.0; 2], 0.0);
    let plate = prism(&rectangle([-16.0, -16.0], [16.0, 16.0], 0.0), &[bore], 0.0, 8.0);
    let peg = prism(&ngon(ROUND, 4.0, [0.0; 2], 0.0), &[], -2.0, 12.0);
    vec![
        ("peg-stl/plate.stl".into(), stl_binary(&plate)),
        ("peg-stl/peg.stl".into(), stl_text(&peg)),
        (
            "peg-stl/assembly.toml".into(),
            b"name = \"peg-stl\"\nunits = \"mm\"\nfixed = [\"plate\"]\n".to_vec(),
        ),
    ]
}

/// A plate on edge with two pegs that share one mesh, posed by nodes in nodes. In metres, as
/// the format has it.
pub(super) fn glb_scene() -> Vec<File> {
    let bores = [-0.25, 0.25].map(|x| ngon(ROUND, 0.0625, [x, 0.0], 0.0));
    let plate = prism(&rectangle([-0.5, -0.25], [0.5, 0.25], 0.0), &bores, 0.0, 0.125);
    let peg = prism(&ngon(ROUND, 0.0615, [0.0; 2], 0.0), &[], -0.0625, 0.25);
    let (plate_bytes, plate_counts) = gltf_arrays(&plate);
    let (peg_bytes, peg_counts) = gltf_arrays(&peg);
    let mut accessors = accessors(&plate, 0);
    accessors.extend(self::accessors(&peg, 2));
    let mut views = views(0, plate_counts);
    views.extend(self::views(plate_bytes.len(), peg_counts));
    let bytes = [plate_bytes, peg_bytes].concat();
    let mesh =
        |first: usize| json!({"primitives": [{"attributes": {"POSITION": first}, "indices": first + 1}]});
    let scene = json!({
        "asset": {"version": "2.0", "generator": "sbdp make-assemblies"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            // A quarter turn about x as a matrix, column by column.
            {"name": "frame", "children": [1, 2, 3],
             "matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 2, 0, 0.5, 1]},
            {"name": "plate", "mesh": 0},
            {"name": "peg", "mesh": 1, "translation": [-0.25, 0, 0]},
            // Half a turn about z.
            {"name": "peg", "mesh": 1, "translation": [0.25, 0, 0], "rotation": [0, 0, 1, 0]},
        ],
        "meshes": [mesh(0), mesh(2)],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": bytes.len()}],
    });
    vec![("pegs.glb".into(), glb(&scene, bytes))]
}

fn manifest(assembly: &Assembly) -> Vec<u8> {
    let files: Vec<String> = assembly.parts.iter().map(|(name, _)| format!("{name}.obj")).collect();
    let mut manifest = json!({"name": assembly.name, "units": "mm", "notes": assembly.notes, "parts": files});
    if let Some(fixed) = assembly.fixed {
        manifest["fixed"] = json!([fixed]);
    }
    pretty(&manifest)
}

fn pretty(value: &serde_json::Value) -> Vec<u8> {
    let mut text = format!("{value:#}");
    text.push('\n');
    text.into_bytes()
}

fn obj(solid: &Solid) -> Vec<u8> {
    let mut text = String::new();
    for [x, y, z] in &solid.vertices {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for t in &solid.triangles {
        let [a, b, c] = t.map(|v| v + 1);
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    text.into_bytes()
}

fn corners(solid: &Solid) -> impl Iterator<Item = [Point; 3]> {
    solid.triangles.iter().map(|t| t.map(|v| solid.vertices[v]))
}

fn stl_text(solid: &Solid) -> Vec<u8> {
    let mut text = String::from("solid peg\n");
    for triangle in corners(solid) {
        text.push_str("facet normal 0 0 0\nouter loop\n");
        for [x, y, z] in triangle {
            let _ = writeln!(text, "vertex {x} {y} {z}");
        }
        text.push_str("endloop\nendfacet\n");
    }
    text.push_str("endsolid peg\n");
    text.into_bytes()
}

fn stl_binary(solid: &Solid) -> Vec<u8> {
    // Many exporters begin a binary file like a text.
    let mut bytes = b"solid binary".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((solid.triangles.len() as u32).to_le_bytes());
    for triangle in corners(solid) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flatten().flat_map(|c| (*c as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// Positions, then indices, and how many bytes each takes.
fn gltf_arrays(solid: &Solid) -> (Vec<u8>, [usize; 2]) {
    let positions: Vec<u8> =
        solid.vertices.iter().flatten().flat_map(|c| (*c as f32).to_le_bytes()).collect();
    let indices: Vec<u8> = solid.triangles.iter().flatten().flat_map(|v| (*v as u32).to_le_bytes()).collect();
    let counts = [positions.len(), indices.len()];
    ([positions, indices].concat(), counts)
}

fn views(start: usize, [positions, indices]: [usize; 2]) -> Vec<serde_json::Value> {
    vec![
        json!({"buffer": 0, "byteOffset": start, "byteLength": positions}),
        json!({"buffer": 0, "byteOffset": start + positions, "byteLength": indices}),
    ]
}

fn accessors(solid: &Solid, first_view: usize) -> Vec<serde_json::Value> {
    let extreme = |pick: fn(f32, f32) -> f32| -> [f32; 3] {
        std::array::from_fn(|k| solid.vertices.iter().map(|p| p[k] as f32).reduce(pick).unwrap_or(0.0))
    };
    vec![
        json!({"bufferView": first_view, "componentType": 5126, "count": solid.vertices.len(), "type": "VEC3",
               "min": extreme(f32::min), "max": extreme(f32::max)}),
        json!({"bufferView": first_view + 1, "componentType": 5125, "count": 3 * solid.triangles.len(), "type": "SCALAR"}),
    ]
}

fn glb(scene: &serde_json::Value, mut binary: Vec<u8>) -> Vec<u8> {
    let mut json = scene.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    binary.resize(binary.len().next_multiple_of(4), 0);
    let header =
        gltf::binary::Header { magic: *b"glTF", version: 2, length: (28 + json.len() + binary.len()) as u32 };
    let glb = gltf::Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(binary)) };
    glb.to_vec().unwrap_or_default()
}
