//! Folders and single files, and what is said about them.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use super::*;

const TETRA: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

/// A folder of the given files, dropped at the end of the test.
fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        fs::write(folder.path().join(name), text).unwrap();
    }
    folder
}

fn refusal(files: &[(&str, &str)]) -> String {
    load_assembly(folder(files).path()).unwrap_err().to_string()
}

#[test]
fn parts_come_in_natural_order_with_their_offsets() {
    for offsets in [r#"{"2": [1, 2, 3], "10.obj": [0, 0, 5]}"#, "[[0,0,0], [1,2,3], [0,0,5]]"] {
        let files = [("10.obj", TETRA), ("2.obj", TETRA), ("1.OBJ", TETRA), ("translation.json", offsets)];
        let assembly = load_assembly(folder(&files).path()).unwrap();
        let names: Vec<&str> = assembly.parts.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["1", "2", "10"]);
        let first: Vec<[f64; 3]> = assembly.parts.iter().map(|p| p.mesh.vertices[0]).collect();
        assert_eq!(first, [[0., 0., 0.], [1., 2., 3.], [0., 0., 5.]]);
    }
}

#[test]
fn descriptions_are_read_and_unknown_keys_left_alone() {
    let json = r#"{"name": "pair", "units": "mm", "fixed": ["a.obj"], "source": "x", "densities": {"b": 7.8},
        "parts": ["a.obj", {"file": "b.obj", "name": "bolt", "faces": 4}]}"#;
    let toml = "name = 'pair'\nunits = 'mm'\nfixed = ['a']\nparts = ['a.obj', {file = 'b.obj'}]\n";
    for (file, text) in [("assembly.json", json), ("assembly.toml", toml)] {
        let files = [("a.obj", TETRA), ("b.obj", TETRA), (file, text), ("._b.obj", "x"), ("notes.txt", "")];
        let assembly = load_assembly(folder(&files).path()).unwrap();
        assert_eq!((assembly.name.as_str(), assembly.units.as_deref()), ("pair", Some("mm")));
        assert_eq!(assembly.fixed, ["a"]);
    }
}

#[test]
fn refusals_name_file_and_reason() {
    let a = ("a.obj", TETRA);
    for (files, expected) in [
        (vec![], vec!["no .obj"]),
        (vec![a, ("assembly.json", "{\n\"parts\": [")], vec!["assembly.json", "line 2"]),
        (vec![a, ("assembly.toml", "name = 'a'\nunits = [")], vec!["assembly.toml", "line 2"]),
        (vec![a, ("assembly.json", r#"{"parts": []}"#)], vec!["assembly.json", "empty"]),
        (
            vec![a, ("assembly.json", r#"{"parts": [{"name": "a", "mesh": "a.obj"}]}"#)],
            vec!["assembly.json", "entry 1", "`file`", r#"{"mesh":"a.obj""#],
        ),
        (vec![a, ("assembly.json", r#"{"split": "all"}"#)], vec!["assembly.json", "`split`", "objects"]),
        (vec![a, ("assembly.json", r#"{"ignore": ["[a"]}"#)], vec!["assembly.json", "`ignore`", "[a"]),
        (vec![a, ("assembly.json", r#"{"ignore": ["*"]}"#)], vec!["no .obj", "that is not ignored"]),
        (vec![a, ("assembly.json", r#"{"parts": ["a.obj", "b.obj"]}"#)], vec!["b.obj", "not in the folder"]),
        (
            vec![a, ("b.obj", TETRA), ("assembly.json", r#"{"parts": ["a.obj"]}"#)],
            vec!["b.obj", "not in `parts`"],
        ),
        (vec![a, ("assembly.json", r#"{"parts": ["a.obj", "a.obj"]}"#)], vec!["a.obj", "twice"]),
        (vec![a, ("assembly.json", r#"{"fixed": ["z"]}"#)], vec!["assembly.json", "no part `z`"]),
        (vec![a, ("assembly.json", r#"{"densities": {"a": -1}}"#)], vec!["assembly.json", "density"]),
        (vec![a, ("assembly.json", "{}"), ("assembly.toml", "")], vec!["keep one"]),
        (vec![a, ("translation.json", r#"{"z": [0,0,0]}"#)], vec!["translation.json", "no part `z`"]),
        (vec![a, ("translation.json", "[[0,0,0],[0,0,0]]")], vec!["translation.json", "2 offsets for 1"]),
        (vec![a, ("translation.json", "{\"a\": 3}")], vec!["translation.json", "expected"]),
        (vec![a, ("translation.json", "{\n,")], vec!["translation.json", "line 2"]),
        (vec![a, ("b.obj", "v 0 0 0")], vec!["b.obj", "no faces"]),
        (vec![a, ("b.stl", "garbage")], vec!["b.stl", "export"]),
        (vec![a, ("config.json", "{")], vec!["config.json", "line 1"]),
        (
            vec![a, ("config.json", r#"{"a": {"final_state": [1]}}"#)],
            vec!["config.json", "`a` has 1 numbers"],
        ),
        (vec![a, ("config.json", r#"{"b": {"final_state": [1,2,3]}}"#)], vec!["config.json", "no part `b`"]),
        (vec![a, ("config.json", "{}"), ("translation.json", "{}")], vec!["keep one"]),
        (
            vec![("a.amf", "x"), ("b.iges", "x")],
            vec!["no .obj", "a.amf: open it in a slicer", "b.iges: IGES"],
        ),
        (vec![a, ("a.stl", "garbage")], vec!["a.obj and a.stl"]),
        (vec![a, ("b.glb", "")], vec!["scene beside"]),
        (vec![("b.glb", "")], vec!["b.glb", "0 bytes"]),
    ] {
        let error = refusal(&files);
        assert!(expected.iter().all(|e| error.contains(e)), "{expected:?}: {error}");
    }
    assert!(load_assembly(Path::new("/no/such")).unwrap_err().to_string().contains("/no/such"));
}

#[test]
fn one_file_is_an_assembly_of_one_part() {
    let folder = folder(&[("bolt.obj", TETRA), ("x.step", "")]);
    let assembly = load_assembly(&folder.path().join("bolt.obj")).unwrap();
    assert_eq!((assembly.name.as_str(), assembly.parts.len()), ("bolt", 1));
    assert!(assembly.notes[0].contains("nothing to take apart"), "{:?}", assembly.notes);
    assert!(load_assembly(&folder.path().join("x.step")).unwrap_err().to_string().contains("0 bytes"));
}

/// A tetrahedron elsewhere, whose vertices come after `before` others.
fn tetra(x: f64, before: usize) -> String {
    let vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        .map(|[a, b, c]| format!("v {} {b} {c}\n", x + f64::from(a)));
    let faces =
        [[1, 3, 2], [1, 2, 4], [2, 3, 4], [1, 4, 3]].map(|f| f.map(|i| (i + before).to_string()).join(" "));
    vertices.concat() + &faces.map(|f| format!("f {f}\n")).concat()
}

fn loaded(files: &[(&str, &str)], options: &LoadOptions) -> SourceAssembly {
    load(folder(files).path(), options).unwrap()
}

fn names(assembly: &SourceAssembly) -> Vec<&str> {
    assembly.parts.iter().map(|p| p.name.as_str()).collect()
}

fn split(split: Split) -> LoadOptions {
    LoadOptions { split: Some(split), ..LoadOptions::default() }
}

#[test]
fn what_a_file_of_the_whole_assembly_names_is_a_part_each() {
    let two = format!("o left\n{}o right\n{}", tetra(0.0, 0), tetra(5.0, 4));
    let faces =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng face 1\nf 1 3 2\ng face 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
    let unnamed = format!("{}{}", tetra(0.0, 0), tetra(5.0, 4));
    let sheet = format!("{two}o sheet\nv 9 0 0\nv 9 1 0\nv 9 0 1\nf 9 10 11\n");
    // Without one face.
    let open = two.replacen("f 1 3 2\n", "", 1);
    for (text, options, expected, note) in [
        (
            &two,
            LoadOptions::default(),
            vec!["left", "right"],
            "2 objects (`left`, `right`) taken as a part each",
        ),
        (&two, split(Split::None), vec!["all"], "one part only"),
        (&two, split(Split::Bodies), vec!["1", "2"], ""),
        (&unnamed, LoadOptions::default(), vec!["all"], "2 separate bodies"),
        (&unnamed, split(Split::Bodies), vec!["1", "2"], ""),
        (&faces.to_owned(), LoadOptions::default(), vec!["all"], "pieces of one surface"),
        (&faces.to_owned(), split(Split::Objects), vec!["face 2"], "`face 1` skipped: no volume"),
        (&open, LoadOptions::default(), vec!["left", "right"], "2 objects"),
        (&open.replace("o ", "g "), LoadOptions::default(), vec!["all"], "pieces of one surface"),
        (&sheet, LoadOptions::default(), vec!["left", "right"], "`sheet` skipped: no volume"),
    ] {
        let assembly = loaded(&[("all.obj", text)], &options);
        assert_eq!(names(&assembly), expected, "{options:?}");
        assert!(
            note.is_empty() || assembly.notes.iter().any(|n| n.contains(note)),
            "{note}: {:?}",
            assembly.notes
        );
    }
    // Among others, a file is one part.
    let files = [("a.obj", two.as_str()), ("b.obj", TETRA)];
    let assembly = loaded(&files, &LoadOptions::default());
    assert_eq!(names(&assembly), ["a", "b"]);
    assert!(
        assembly.notes[0].starts_with("a.obj: 2 objects (`left`, `right`) taken as one part"),
        "{:?}",
        assembly.notes
    );
    let assembly = loaded(&files, &split(Split::Objects));
    assert_eq!(names(&assembly), ["a/left", "a/right", "b"]);
    assert_eq!(assembly.groups[0].parts, ["a/left", "a/right"]);
    let assembly =
        loaded(&[files[0], files[1], ("assembly.toml", "split = 'objects'\n")], &LoadOptions::default());
    assert_eq!(assembly.parts.len(), 3);
}

#[test]
fn patterns_leave_parts_out() {
    let damaged = ("broken.stl", "garbage");
    let files = [("bolt1.obj", TETRA), ("bolt2.obj", TETRA), ("plate.obj", TETRA), damaged];
    for (patterns, expected, note) in [
        (vec!["*.stl", "bolt*"], vec!["plate"], "`bolt1.obj`, `bolt2.obj`, `broken.stl` ignored"),
        (vec!["broken", "bolt[2]"], vec!["bolt1", "plate"], "`bolt2.obj`"),
        (
            vec!["broken.stl", "nut*"],
            vec!["bolt1", "bolt2", "plate"],
            "`nut*` is to be ignored and fits no part",
        ),
    ] {
        let ignore = patterns.iter().map(|p| p.parse().unwrap()).collect();
        let assembly = loaded(&files, &LoadOptions { ignore, ..LoadOptions::default() });
        assert_eq!(names(&assembly), expected);
        assert!(assembly.notes.iter().any(|n| n.contains(note)), "{note}: {:?}", assembly.notes);
    }
}

#[test]
fn files_that_are_not_read_are_named() {
    let a = [("a.obj", TETRA), ("b.obj", TETRA)];
    for (file, note) in [
        ("plate.step", Some("plate.step is not read: STEP files are converted")),
        ("plate.xyz", Some("plate.xyz is not read: not a file that sbdp knows")),
        ("scene.bin", Some("scene.bin is not read")),
        ("a.mtl", None),
        ("README.md", None),
        (".hidden", None),
    ] {
        let assembly = loaded(&[a[0], a[1], (file, "x")], &LoadOptions::default());
        let notes = assembly.notes.join("; ");
        assert_eq!(note.is_none(), notes.is_empty(), "{file}: {notes}");
        assert!(notes.contains(note.unwrap_or_default()), "{notes}");
    }
    let folder = folder(&a);
    fs::create_dir(folder.path().join("hardware")).unwrap();
    fs::write(folder.path().join("hardware/pin.stl"), "").unwrap();
    let assembly = load_assembly(folder.path()).unwrap();
    assert!(
        assembly.notes[0].contains("the folder hardware is not read, with `pin.stl`"),
        "{:?}",
        assembly.notes
    );
    fs::remove_file(folder.path().join("a.obj")).unwrap();
    fs::remove_file(folder.path().join("b.obj")).unwrap();
    let error = load_assembly(folder.path()).unwrap_err().to_string();
    assert!(error.contains("give one of them, as hardware"), "{error}");
}

#[test]
fn files_that_are_something_else_say_what() {
    let utf16: Vec<u8> = "\u{feff}v 1 2 3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
    for (name, bytes, expected) in [
        ("a.obj", &b""[..], "0 bytes"),
        ("a.obj", &utf16, "UTF-16; save it as UTF-8"),
        ("a.stl", &utf16, "UTF-16; save it as UTF-8"),
        ("a.stl", b"<!DOCTYPE html><html>404</html>", "this is HTML"),
        ("a.glb", b"\n <html>", "this is HTML"),
        ("a.stl", b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
        ("a.obj", b"PK\x03\x04....", "a ZIP archive"),
        ("a.obj", b"glTF....", "rename it to .glb"),
        ("a.stl", b"ISO-10303-21;\n", "rename it to .step"),
        ("a.obj", b"ply\nformat ascii 1.0\n", "a PLY file"),
        ("a.obj", b"<?xml version='1.0'?>", "XML"),
        ("a.obj", b"solid a\nfacet normal 0 0 1\n", "rename it to .stl"),
        ("a.stl", b"v 0 0 0\nf 1 1 1\n", "rename it to .obj"),
        ("a.obj", b"v 1 2 3\x00", "binary data"),
        ("a.stl", b"solid truncated\x00", "too short"),
        ("a.obj", b"v 1,5 2 3\n", "line 1: its numbers have decimal commas"),
        ("a.obj", b"v 1 \x1b[2J 3\n", "line 1: a vertex needs three numbers, found `v 1 \\u{1b}[2J 3`"),
        ("a.sldprt", b"x", "a CAD program"),
        ("a.dae", b"x", "Blender"),
        ("a.zip", b"x", "unpack it"),
        ("a.urdf", b"x", "names mesh files"),
        ("a.xyz", b"x", "give a folder"),
    ] {
        let error = parse_file(name, bytes, None).unwrap_err();
        assert!(error.contains(expected), "{name}: {expected}: {error}");
    }
}

#[test]
fn poses_of_the_asap_data_set_are_read() {
    let config = r#"{"a": {"initial_state": [9, 9, 9], "final_state": [1, 2, 3, 0, 0, 1.5707963267948966]}}"#;
    let assembly =
        loaded(&[("a.obj", TETRA), ("b.obj", TETRA), ("config.json", config)], &LoadOptions::default());
    let second = assembly.parts[0].mesh.vertices[1];
    assert!(second.iter().zip([1.0, 3.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{second:?}");
    let [(waiting, pose)] = &assembly.waiting[..] else { panic!("{:?}", assembly.waiting) };
    let waits = pose * nalgebra::Point3::from(second);
    assert!(waiting == "a" && (waits - nalgebra::Point3::new(10.0, 9.0, 9.0)).norm() < 1e-12, "{waits}");
    assert_eq!(assembly.notes, ["config.json does not name `b`: taken where the mesh stands"]);
    let other = loaded(
        &[("a.obj", TETRA), ("b.obj", TETRA), ("config.json", "{\"robot\": 1}")],
        &LoadOptions::default(),
    );
    assert!(other.notes[0].contains("config.json not read"), "{:?}", other.notes);
}

#[test]
fn the_layout_of_the_fusion_data_set_is_read() {
    let frame = |x: f64| {
        let axis = |x: u8, y: u8, z: u8| format!(r#"{{"x": {x}.0, "y": {y}.0, "z": {z}.0}}"#);
        let (i, j, k) = (axis(0, 1, 0), axis(0, 0, 1), axis(1, 0, 0));
        format!(
            r#"{{"origin": {{"x": {x}, "y": 0.0, "z": 0.0}}, "x_axis": {i}, "y_axis": {j}, "z_axis": {k}}}"#
        )
    };
    let occurrence = |name: &str, x: f64, bodies: &str, visible: bool| {
        let frame = frame(x);
        format!(r#"{{"name": "{name}", "is_visible": {visible}, "bodies": {bodies}, "transform": {frame}}}"#)
    };
    let text = format!(
        r#"{{"tree": {{"root": {{"o1": {{"o2": {{}}, "o3": {{}}}}, "o4": {{}}}}}},
            "root": {{"component": "c", "bodies": {{"b1": {{"is_visible": true}}, "b3": {{"is_visible": false}}}}}},
            "occurrences": {{"o1": {}, "o2": {}, "o3": {}, "o4": {}}},
            "bodies": {{"b1": {{"name": "Body1", "obj": "b1.obj"}}, "b2": {{"name": "Body2", "obj": "b2.obj"}},
                "b3": {{"name": "Body3", "obj": "b1.obj"}}}}}}"#,
        occurrence("caster", 10.0, "{}", true),
        occurrence("wheel", 5.0, r#"{"b2": {"is_visible": true}}"#, true),
        occurrence("fork", 0.0, r#"{"b1": {}, "b2": {}}"#, true),
        occurrence("ghost", 0.0, r#"{"b2": {}}"#, false),
    );
    let faces = "g face 1\n".to_owned() + TETRA;
    let files =
        [("assembly.json", &text[..]), ("b1.obj", TETRA), ("b2.obj", &faces), ("assembly.obj", TETRA)];
    let assembly = loaded(&files, &LoadOptions::default());
    assert_eq!(names(&assembly), ["Body1", "Body2", "fork/Body1", "wheel"]);
    assert_eq!(assembly.units.as_deref(), Some("cm"));
    assert_eq!(assembly.parts[3].mesh.vertices[0], [10.0, 5.0, 0.0]);
    let groups: Vec<(&str, usize)> =
        assembly.groups.iter().map(|g| (g.name.as_str(), g.parts.len())).collect();
    assert_eq!(groups, [("caster", 3), ("caster/fork", 2)]);
    assert!(assembly.notes[0].contains("`Body3`, `ghost` not visible"), "{:?}", assembly.notes);
    for (from, to, reason) in [
        ("\"b2.obj\"", "\"../b2.obj\"", "not in this folder"),
        ("\"b2.obj\"", "\"b9.obj\"", "b9.obj"),
        ("{\"o2\": {}", "{\"o9\": {}", "occurrence o9"),
        ("\"b2\": {\"name\"", "\"b9\": {\"name\"", "body b2"),
    ] {
        let changed = text.replacen(from, to, 1);
        let error = refusal(&[("assembly.json", &changed), files[1], files[2]]);
        assert!(error.contains(reason), "{reason}: {error}");
    }
}

/// A converter that makes of every file one tetrahedron, as the node `a` below `group`, in a unit.
fn converter(folder: &Path, unit: &str) -> StepSettings {
    let positions = [0f32, 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.].map(f32::to_le_bytes).concat();
    let indices = [0u8, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2];
    let data = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, [&positions[..], &indices].concat());
    let scene = format!(
        r#"{{"asset":{{"version":"2.0","extras":{{"unit":"{unit}"}}}},"scenes":[{{"nodes":[0]}}],
"nodes":[{{"name":"group","children":[1]}},{{"name":"a","mesh":0}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
"accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3","min":[0,0,0],"max":[1,1,1]}},
{{"bufferView":1,"componentType":5121,"count":12,"type":"SCALAR"}}],
"bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
"buffers":[{{"byteLength":60,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    );
    let mut glb = b"glTF\x02\0\0\0".to_vec();
    let padded = scene.len().next_multiple_of(4);
    glb.extend((padded as u32 + 20).to_le_bytes());
    glb.extend((padded as u32).to_le_bytes());
    glb.extend(b"JSON");
    glb.extend(scene.bytes().chain(std::iter::repeat_n(b' ', padded - scene.len())));
    let (output, program) = (folder.join("made.glb"), folder.join("converter"));
    fs::write(&output, glb).unwrap();
    let script = format!(
        "#!/bin/sh\n[ \"$1\" = --version ] && echo 1 && exit\ngrep -q broken \"$1\" && echo 'it is broken' >&2 && exit 3\n\
         cp {} \"$2\"\necho '{{\"sbdp-step\": 1, \"unit\": \"mm\", \"deflection\": 0.02, \"warnings\": [\"`b` is odd\"]}}'\n",
        output.display()
    );
    fs::write(&program, script).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    StepSettings { converter: Some(program), ..StepSettings::default() }
}

#[test]
fn step_files_are_read_through_a_converter() {
    let programs = tempfile::tempdir().unwrap();
    let options = LoadOptions { step: Some(converter(programs.path(), "mm")), ..LoadOptions::default() };
    let step = "ISO-10303-21;";
    let files = folder(&[("x.STP", step)]);
    for path in [files.path().to_owned(), files.path().join("x.STP")] {
        let assembly = load(&path, &options).unwrap();
        assert_eq!(names(&assembly), ["a"]);
        assert_eq!((assembly.units.as_deref(), assembly.resolution), (Some("mm"), Some(0.02)));
        assert!(assembly.notes.iter().any(|n| n.contains("x.STP: `b` is odd")), "{:?}", assembly.notes);
    }
    // Beside meshes it is one part; what cannot be converted is left out by name.
    let beside =
        loaded(&[("bolt.obj", TETRA), ("x.step", step), ("y.step", "ISO-10303-21; broken")], &options);
    assert_eq!(names(&beside), ["bolt", "x"]);
    assert_eq!((beside.units.as_deref(), beside.resolution), (Some("mm"), Some(0.02)));
    let notes = beside.notes.join("; ");
    for note in ["y.step is not read: the converter refuses it: it is broken", "bolt.obj names no unit"] {
        assert!(notes.contains(note), "{note}: {notes}");
    }
    // Alone it is refused, with what to do with all that is there.
    let alone = folder(&[("y.step", "ISO-10303-21; broken"), ("a.amf", "x")]);
    let error = load(alone.path(), &options).unwrap_err().to_string();
    assert!(
        ["y.step", "it is broken", "a.amf: open it"].iter().all(|words| error.contains(words)),
        "{error}"
    );
    // The line and the scene must agree.
    let other = tempfile::tempdir().unwrap();
    let options = LoadOptions { step: Some(converter(other.path(), "in")), ..LoadOptions::default() };
    let error = load(&files.path().join("x.STP"), &options).unwrap_err().to_string();
    assert!(error.contains("unit is mm") && error.contains("it is in"), "{error}");
}
