//! The layout of the Fusion 360 Gallery assembly data set: an `assembly.json` with a tree of occurrences, and a mesh file
//! for each body, in centimetres.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use nalgebra::{Matrix4, Point3};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::content::{Body, Content, Pieces};
use super::split::listed;
use super::{assembly_error, read_file, read_text};
use crate::geometry::{GeometryError, SourceMesh};

/// The keys that are needed of an `assembly.json` of this layout.
#[derive(Debug, Deserialize)]
struct Document {
    tree: Tree,
    root: Root,
    #[serde(default)]
    occurrences: BTreeMap<String, Occurrence>,
    bodies: BTreeMap<String, BodyFile>,
}

#[derive(Debug, Deserialize)]
struct Tree {
    #[serde(default)]
    root: Map<String, Value>,
}

#[derive(Debug, Deserialize)]
struct Root {
    #[serde(default)]
    bodies: BTreeMap<String, Shown>,
}

#[derive(Debug, Deserialize)]
struct Occurrence {
    name: String,
    #[serde(default = "yes")]
    is_visible: bool,
    #[serde(default)]
    bodies: BTreeMap<String, Shown>,
    transform: Option<Frame>,
}

#[derive(Debug, Deserialize)]
struct Shown {
    #[serde(default = "yes")]
    is_visible: bool,
}

#[derive(Debug, Deserialize)]
struct BodyFile {
    name: String,
    obj: String,
}

/// A coordinate system in that of the occurrence above.
#[derive(Debug, Deserialize)]
struct Frame {
    origin: Xyz,
    x_axis: Xyz,
    y_axis: Xyz,
    z_axis: Xyz,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Xyz {
    x: f64,
    y: f64,
    z: f64,
}

fn yes() -> bool {
    true
}

/// An occurrence that is nested deeper is none: the tree is walked by recursion.
const MAX_DEPTH: usize = 200;
/// More bodies are no assembly.
const MAX_BODIES: usize = 20_000;

/// Reads a folder of this layout: none if its `assembly.json` is another one.
///
/// # Errors
/// A file that it names cannot be read, or it names something that it does not describe.
pub(super) fn read(folder: &Path) -> Result<Option<Content>, GeometryError> {
    let path = folder.join("assembly.json");
    if !path.exists() {
        return Ok(None);
    }
    let file = |name: &str| {
        let content = read_file(&folder.join(name), None).map_err(|e| e.to_string())?;
        Ok(content.bodies.into_iter().next().unwrap_or_default().mesh)
    };
    content(&read_text(&path)?, file).map_err(|reason| assembly_error(&path, &reason))
}

/// What a description of this layout says; `file` reads a mesh file by its name.
fn content(
    text: &str,
    file: impl FnMut(&str) -> Result<SourceMesh, String>,
) -> Result<Option<Content>, String> {
    let Ok(value) = serde_json::from_str::<Value>(text) else { return Ok(None) };
    if ["tree", "root", "bodies"].iter().any(|key| value.get(key).is_none()) {
        return Ok(None);
    }
    let document = Document::deserialize(value).map_err(|e| e.to_string())?;
    let mut reader =
        Reader { document: &document, file, meshes: HashMap::new(), hidden: Vec::new(), bodies: Vec::new() };
    for (id, shown) in &document.root.bodies {
        reader.body(id, shown, &[], &Matrix4::identity(), true)?;
    }
    reader.walk(&document.tree.root, &mut Vec::new(), &Matrix4::identity())?;
    let Reader { bodies, hidden, .. } = reader;
    if bodies.is_empty() {
        return Err("it shows no body".to_owned());
    }
    let hidden =
        (!hidden.is_empty()).then(|| format!("{} not visible in the assembly and not read", listed(&hidden)));
    let notes = hidden.into_iter().collect();
    Ok(Some(Content { bodies, units: Some("cm".to_owned()), notes, ..Content::default() }))
}

/// Reads a text as such a description, without its files; what came of it, in words.
pub(super) fn parse(text: &str) -> String {
    let mesh = |_: &str| Ok(SourceMesh { vertices: vec![[0.0; 3]], triangles: Vec::new() });
    match content(text, mesh) {
        Ok(Some(content)) => content.notes.join("; "),
        Ok(None) => "another layout".to_owned(),
        Err(reason) => reason,
    }
}

struct Reader<'a, F> {
    document: &'a Document,
    file: F,
    /// By file.
    meshes: HashMap<&'a str, SourceMesh>,
    hidden: Vec<String>,
    bodies: Vec<Body>,
}

impl<'a, F: FnMut(&str) -> Result<SourceMesh, String>> Reader<'a, F> {
    fn walk(
        &mut self,
        tree: &'a Map<String, Value>,
        above: &mut Vec<String>,
        pose: &Matrix4<f64>,
    ) -> Result<(), String> {
        if above.len() >= MAX_DEPTH || self.bodies.len() >= MAX_BODIES {
            return Err(format!("more than {MAX_DEPTH} levels of occurrences, or {MAX_BODIES} bodies"));
        }
        for (id, below) in tree {
            let occurrence = self.document.occurrences.get(id);
            let undescribed = || format!("`tree` names the occurrence {id}, which is not in `occurrences`");
            let occurrence = occurrence.ok_or_else(undescribed)?;
            if !occurrence.is_visible {
                self.hidden.push(occurrence.name.clone());
                continue;
            }
            let pose = pose * occurrence.transform.as_ref().map_or_else(Matrix4::identity, Frame::matrix);
            above.push(occurrence.name.clone());
            let is_named = occurrence.bodies.len() > 1;
            for (body, shown) in &occurrence.bodies {
                self.body(body, shown, above, &pose, is_named)?;
            }
            if let Some(below) = below.as_object() {
                self.walk(below, above, &pose)?;
            }
            above.pop();
        }
        Ok(())
    }

    /// Adds a body: by its own name if the occurrence has several, else by that of the occurrence.
    fn body(
        &mut self,
        id: &str,
        shown: &Shown,
        above: &[String],
        pose: &Matrix4<f64>,
        is_named: bool,
    ) -> Result<(), String> {
        let undescribed = || format!("it names the body {id}, which is not in `bodies`");
        let body = self.document.bodies.get(id).ok_or_else(undescribed)?;
        if !shown.is_visible {
            self.hidden.push(body.name.clone());
            return Ok(());
        }
        let mesh = match self.meshes.get(body.obj.as_str()) {
            Some(mesh) => mesh.clone(),
            None => {
                // Only a name: a description may not lead out of its folder.
                if Path::new(&body.obj).file_name().is_none_or(|name| name != body.obj.as_str()) {
                    return Err(format!("the file `{}` of body {id} is not in this folder", body.obj));
                }
                let mesh = (self.file)(&body.obj)?;
                self.meshes.entry(&body.obj).or_insert(mesh).clone()
            }
        };
        let vertices = mesh.vertices.iter().map(|v| pose.transform_point(&Point3::from(*v)).into()).collect();
        let mesh = SourceMesh { vertices, triangles: mesh.triangles };
        let own = is_named.then(|| body.name.clone());
        // Its groups are the faces of the body.
        let path = above.iter().cloned().chain(own).collect();
        self.bodies.push(Body { path, mesh, pieces: Pieces::default() });
        Ok(())
    }
}

impl Frame {
    fn matrix(&self) -> Matrix4<f64> {
        let column = |v: Xyz, last: f64| nalgebra::Vector4::new(v.x, v.y, v.z, last);
        let axes = [self.x_axis, self.y_axis, self.z_axis].map(|axis| column(axis, 0.0));
        Matrix4::from_columns(&[axes[0], axes[1], axes[2], column(self.origin, 1.0)])
    }
}
