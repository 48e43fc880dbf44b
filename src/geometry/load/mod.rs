//! Assemblies from files: folders of OBJ and STL, single files, glTF scenes.

mod gltf;
mod manifest;
mod natural_order;
mod obj;
mod stl;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use self::manifest::Manifest;
use super::{GeometryError, SourceAssembly, SourceMesh, SourcePart};

pub(crate) use gltf::parse_gltf as parse_scene;
pub(crate) use manifest::parse_notes;
pub use natural_order::natural_order;

/// Reads an assembly: a folder of OBJ and STL files in assembled pose (with an optional
/// `assembly.json` or `assembly.toml` and `translation.json`), one OBJ or STL file, or a glTF
/// or GLB scene. Meshes are as given; [`heal`](super::heal) makes them usable.
///
/// # Errors
/// A file cannot be read, is damaged or not what its name says, or the description does not
/// fit the files. The error names the file, the part and the reason.
pub fn load_assembly(path: &Path) -> Result<SourceAssembly, GeometryError> {
    if path.is_dir() {
        return load_folder(path);
    }
    if !path.exists() {
        return Err(assembly_error(path, "there is no such file or folder"));
    }
    match Format::of(path) {
        Some(Format::Gltf) => load_scene(path),
        Some(_) => {
            let part = load_part(path)?;
            Ok(SourceAssembly { name: part.name.clone(), parts: vec![part], ..Default::default() })
        }
        None => Err(assembly_error(path, "not a folder and not an .obj, .stl, .gltf or .glb file")),
    }
}

/// What a file is by its extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Obj,
    Stl,
    Gltf,
}

impl Format {
    fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "obj" => Some(Self::Obj),
            "stl" => Some(Self::Stl),
            "gltf" | "glb" => Some(Self::Gltf),
            _ => None,
        }
    }
}

fn load_folder(folder: &Path) -> Result<SourceAssembly, GeometryError> {
    let described = manifest::read_manifest(folder)?;
    let files = part_files(folder, described.as_ref())?;
    if let [scene] = &files[..]
        && Format::of(scene) == Some(Format::Gltf)
    {
        let assembly = load_scene(scene)?;
        return described.map_or(Ok(assembly.clone()), |(origin, m)| apply(assembly, m, &origin));
    }
    // Of several that cannot be read always the first is named.
    let parts: Vec<_> = files.par_iter().map(|f| load_part(f)).collect();
    let mut parts = parts.into_iter().collect::<Result<Vec<_>, _>>()?;
    parts.sort_by(|a, b| natural_order(&a.name, &b.name));
    let names: Vec<String> = parts.iter().map(|p| p.name.clone()).collect();
    if let Some(offsets) = manifest::read_translations(folder, &names)? {
        parts.iter_mut().zip(offsets).for_each(|(part, offset)| translate(&mut part.mesh, offset));
    }
    let assembly = SourceAssembly { name: stem(folder), parts, ..Default::default() };
    match described {
        Some((origin, manifest)) => apply(assembly, manifest, &origin),
        None => Ok(assembly),
    }
}

/// The files that make up the assembly: those in the folder, which must be those in the list
/// if there is one. To guess which of the two is right could plan without a part.
fn part_files(folder: &Path, described: Option<&(String, Manifest)>) -> Result<Vec<PathBuf>, GeometryError> {
    let present = mesh_files(folder)?;
    let listed = described.and_then(|(origin, m)| m.parts.as_ref().map(|parts| (origin, parts)));
    if let Some((origin, parts)) = listed {
        let refused = |reason: String| GeometryError::Assembly { origin: origin.clone(), reason };
        for (at, part) in parts.iter().enumerate() {
            let file = part.file();
            if !present.iter().any(|p| p.file_name().is_some_and(|n| n == file)) {
                return Err(refused(format!("`parts` names {file}, which is not in the folder")));
            }
            if parts[..at].iter().any(|p| p.file() == file) {
                return Err(refused(format!("`parts` names {file} twice")));
            }
        }
        let is_listed = |p: &&PathBuf| parts.iter().any(|l| p.file_name().is_some_and(|n| n == l.file()));
        if let Some(stray) = present.iter().find(|p| !is_listed(p)) {
            let name = stray.file_name().unwrap_or_default().display();
            return Err(refused(format!(
                "{name} is in the folder but not in `parts`; add it there or take it away"
            )));
        }
    }
    if present.is_empty() {
        return Err(assembly_error(folder, "the folder holds no .obj, .stl, .gltf or .glb file"));
    }
    check_stems(folder, &present)?;
    Ok(present)
}

fn mesh_files(folder: &Path) -> Result<Vec<PathBuf>, GeometryError> {
    let unreadable = |e: std::io::Error| unreadable(folder, &e);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        if !hidden && Format::of(&path).is_some() {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

fn check_stems(folder: &Path, files: &[PathBuf]) -> Result<(), GeometryError> {
    if files.len() > 1 && files.iter().any(|f| Format::of(f) == Some(Format::Gltf)) {
        let reason = "a glTF scene beside other meshes; give the scene or the folder of its parts";
        return Err(assembly_error(folder, reason));
    }
    let mut by_stem: HashMap<String, &PathBuf> = HashMap::new();
    for file in files {
        if let Some(other) = by_stem.insert(stem(file), file) {
            let [a, b] = [other, file].map(|f| f.file_name().unwrap_or_default().display().to_string());
            return Err(assembly_error(folder, &format!("{a} and {b} would both be part `{}`", stem(file))));
        }
    }
    Ok(())
}

/// Adds what the description says; parts may be named by stem or by file.
fn apply(
    mut assembly: SourceAssembly,
    manifest: Manifest,
    origin: &str,
) -> Result<SourceAssembly, GeometryError> {
    let resolve = |name: &str| {
        let stem = Path::new(name).file_stem().and_then(|s| s.to_str());
        let found = assembly.parts.iter().find(|p| p.name == name || Some(p.name.as_str()) == stem);
        found.map(|p| p.name.clone()).ok_or_else(|| GeometryError::Assembly {
            origin: origin.to_owned(),
            reason: format!("there is no part `{name}`"),
        })
    };
    let fixed = manifest.fixed.iter().map(|n| resolve(n)).collect::<Result<Vec<_>, _>>()?;
    let base = manifest.base.iter().map(|n| resolve(n)).collect::<Result<Vec<_>, _>>()?;
    manifest.densities.keys().try_for_each(|n| resolve(n).map(drop))?;
    (assembly.fixed, assembly.base) = (fixed, base);
    assembly.name = manifest.name.unwrap_or(assembly.name);
    assembly.units = manifest.units.or(assembly.units);
    Ok(assembly)
}

/// The mesh of a file of this name with these bytes; what is wrong with it, without its name.
pub(crate) fn parse_part(name: impl AsRef<Path>, bytes: &[u8]) -> Result<SourceMesh, String> {
    match Format::of(name.as_ref()) {
        Some(Format::Stl) => stl::parse_stl(bytes),
        _ => obj::parse_obj(bytes),
    }
}

fn load_part(path: &Path) -> Result<SourcePart, GeometryError> {
    let parsed = parse_part(path, &read_bytes(path)?);
    let origin = path.display().to_string();
    match parsed {
        Ok(mesh) => Ok(SourcePart { name: stem(path), origin, mesh }),
        Err(reason) => Err(GeometryError::Part { origin, part: stem(path), reason }),
    }
}

fn load_scene(path: &Path) -> Result<SourceAssembly, GeometryError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let parts = parse_scene(&read_bytes(path)?, folder).map_err(|e| assembly_error(path, &e))?;
    let origin = path.display().to_string();
    let mut parts: Vec<SourcePart> =
        parts.into_iter().map(|(name, mesh)| SourcePart { name, origin: origin.clone(), mesh }).collect();
    parts.sort_by(|a, b| natural_order(&a.name, &b.name));
    // The standard fixes the unit.
    Ok(SourceAssembly { name: stem(path), units: Some("m".into()), parts, ..Default::default() })
}

fn translate(mesh: &mut SourceMesh, offset: [f64; 3]) {
    for vertex in &mut mesh.vertices {
        vertex.iter_mut().zip(offset).for_each(|(x, o)| *x += o);
    }
}

fn stem(path: &Path) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    match name {
        Some(name) => name.to_string_lossy().into_owned(),
        // `.` and `..` have a name all the same.
        None => path.canonicalize().ok().filter(|p| p != path).map_or_else(String::new, |p| stem(&p)),
    }
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, GeometryError> {
    std::fs::read(path).map_err(|e| unreadable(path, &e))
}

fn read_text(path: &Path) -> Result<String, GeometryError> {
    std::fs::read_to_string(path).map_err(|e| unreadable(path, &e))
}

fn unreadable(path: &Path, error: &std::io::Error) -> GeometryError {
    GeometryError::Unreadable { path: path.display().to_string(), reason: error.to_string() }
}

fn assembly_error(path: &Path, reason: &str) -> GeometryError {
    GeometryError::Assembly { origin: path.display().to_string(), reason: reason.to_owned() }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::load_assembly;

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
            let files =
                [("10.obj", TETRA), ("2.obj", TETRA), ("1.OBJ", TETRA), ("translation.json", offsets)];
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
            let files =
                [("a.obj", TETRA), ("b.obj", TETRA), (file, text), ("._b.obj", "x"), ("notes.txt", "")];
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
                vec![a, ("assembly.json", r#"{"parts": ["a.obj", "b.obj"]}"#)],
                vec!["b.obj", "not in the folder"],
            ),
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
            (vec![a, ("b.obj", "v 0 0 0")], vec!["b.obj", "part `b`", "no faces"]),
            (vec![a, ("b.stl", "garbage")], vec!["b.stl", "part `b`", "export"]),
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
        assert!(load_assembly(&folder.path().join("x.step")).is_err());
    }
}
