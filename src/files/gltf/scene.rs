//! The nodes of a scene, and the bodies in them.

use std::collections::HashSet;

use gltf::mesh::Mode;
use nalgebra::{Matrix4, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::content::{Body, Content, MAX_DEPTH, MAX_NODES, PieceKind, Pieces, placed};
use super::super::split::listed;
use super::super::text::printable;
use super::buffers::Buffers;
use super::extensions::{INSTANCING, unit};
use crate::geometry::SourceMesh;

/// Reads the default scene, or the first.
pub(super) fn read(document: &gltf::Document, buffers: &Buffers) -> Result<Content, String> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    let scene = scene.ok_or("it holds no scene; export the assembly as a scene with nodes")?;
    let mut reader = SceneReader {
        document,
        buffers,
        visited: HashSet::new(),
        path: Vec::new(),
        content: Content::default(),
    };
    for node in scene.nodes() {
        reader.visit(&node, &Matrix4::identity())?;
    }
    let SceneReader { visited, mut content, .. } = reader;
    if content.bodies.iter().all(|body| body.mesh.triangles.is_empty()) {
        return Err(
            "no node of the scene has a mesh of triangles; export the assembly's bodies as meshes".into()
        );
    }
    content.notes.extend(left_out(document, &visited));
    let extras = std::iter::once(&document.as_json().asset.extras).chain([scene.extras()]);
    for extras in extras.chain(scene.nodes().map(|node| node.extras()).collect::<Vec<_>>()) {
        match unit(extras) {
            Ok(Some(named)) if content.units.is_none() => content.units = Some(named),
            Ok(Some(other)) if content.units.as_ref() != Some(&other) => {
                let first = content.units.as_deref().unwrap_or_default();
                content
                    .notes
                    .push(format!("its extras name two units, {first} and {other}; {first} is taken"));
            }
            Ok(_) => {}
            Err(word) => {
                content.notes.push(format!("the unit `{}` in its extras is not known here", printable(&word)))
            }
        }
    }
    // The standard fixes it.
    content.units.get_or_insert_with(|| "m".to_owned());
    Ok(content)
}

/// Nodes with meshes that the scene does not show.
fn left_out(document: &gltf::Document, visited: &HashSet<usize>) -> Option<String> {
    // Coarser copies of nodes are in no scene.
    let is_copy = |name: &String| name == "MSFT_lod";
    if document.as_json().extensions_used.iter().any(is_copy) {
        return None;
    }
    let missed = document.nodes().filter(|n| n.mesh().is_some() && !visited.contains(&n.index()));
    let names: Vec<String> = missed.map(|n| shown(&n)).collect();
    let where_to = if document.scenes().len() > 1 { "in another scene" } else { "in no scene" };
    let are = if names.len() == 1 { "is" } else { "are" };
    (!names.is_empty()).then(|| format!("{} {are} {where_to} and not read", listed(&names)))
}

fn shown(node: &gltf::Node<'_>) -> String {
    let name = node.name().or_else(|| node.mesh().and_then(|m| m.name())).unwrap_or_default();
    if name.trim().is_empty() { format!("node {}", node.index()) } else { printable(name) }
}

struct SceneReader<'a> {
    document: &'a gltf::Document,
    buffers: &'a Buffers,
    visited: HashSet<usize>,
    /// The names from the root to the node that is visited.
    path: Vec<String>,
    content: Content,
}

impl SceneReader<'_> {
    fn visit(&mut self, node: &gltf::Node<'_>, scene_from_parent: &Matrix4<f64>) -> Result<(), String> {
        // The standard wants a strict tree; a loop would never end.
        if !self.visited.insert(node.index())
            || self.visited.len() > MAX_NODES
            || self.path.len() >= MAX_DEPTH
        {
            let index = node.index();
            return Err(format!(
                "node {index} has two parents, or the scene has too many nodes or levels of them"
            ));
        }
        let scene_from_node = scene_from_parent * node_transform(node);
        let own = node.name().or_else(|| node.mesh().and_then(|m| m.name())).unwrap_or_default();
        self.path.push(own.to_owned());
        if let Some(mesh) = node.mesh() {
            self.bodies(node, &mesh, &scene_from_node).map_err(|e| format!("node `{}`: {e}", shown(node)))?;
        }
        node.children().try_for_each(|child| self.visit(&child, &scene_from_node))?;
        self.path.pop();
        Ok(())
    }

    fn bodies(
        &mut self,
        node: &gltf::Node<'_>,
        mesh: &gltf::Mesh<'_>,
        pose: &Matrix4<f64>,
    ) -> Result<(), String> {
        let notes = &mut self.content.notes;
        if node.skin().is_some() {
            notes.push(format!(
                "`{}` is skinned: read without its skeleton; apply the pose before export",
                shown(node)
            ));
        }
        if [node.weights(), mesh.weights()].into_iter().flatten().flatten().any(|w| *w != 0.0) {
            notes.push(format!(
                "`{}` has morph targets: read without them; apply them before export",
                shown(node)
            ));
        }
        let (local, pieces) = self.local(mesh)?;
        let mut path = self.path.clone();
        // A node without a name of its own and of its mesh is known by its place.
        if path.iter().all(|name| name.trim().is_empty()) {
            path.push(format!("node{}", node.index()));
        }
        for instance in self.instances(node)? {
            let (mesh, is_mirrored) = placed(&local, &(pose * instance));
            if is_mirrored {
                self.content
                    .notes
                    .push(format!("`{}` is mirrored: its pose has a negative scale", shown(node)));
            }
            self.content.bodies.push(Body { path: path.clone(), mesh, pieces: pieces.clone() });
        }
        Ok(())
    }

    /// Where the node's mesh stands in the node: once, or at each place that the extension for instances lists.
    fn instances(&self, node: &gltf::Node<'_>) -> Result<Vec<Matrix4<f64>>, String> {
        let Some(attributes) = node.extension_value(INSTANCING).and_then(|e| e.get("attributes")) else {
            return Ok(vec![Matrix4::identity()]);
        };
        let accessor = |name: &str| {
            let Some(index) = attributes.get(name) else { return Ok(None) };
            let found = index.as_u64().and_then(|i| self.document.accessors().nth(usize::try_from(i).ok()?));
            found.map(Some).ok_or_else(|| format!("accessor {index} does not exist; export the scene again"))
        };
        let vectors = |name: &str| accessor(name)?.map(|a| self.buffers.vectors::<3>(&a)).transpose();
        let (shifts, scales) = (vectors("TRANSLATION")?, vectors("SCALE")?);
        let turns = accessor("ROTATION")?.map(|a| self.buffers.vectors::<4>(&a)).transpose()?;
        let counts =
            [shifts.as_ref().map(Vec::len), scales.as_ref().map(Vec::len), turns.as_ref().map(Vec::len)];
        let count = counts
            .into_iter()
            .flatten()
            .min()
            .ok_or("its instances have no poses; export the scene again")?;
        if counts.into_iter().flatten().any(|other| other != count) {
            return Err(
                "its instances have not as many shifts, turns and scales as each other; export it again"
                    .into(),
            );
        }
        if count > MAX_NODES {
            return Err(format!("it has {count} instances; no assembly has more than {MAX_NODES}"));
        }
        let pose = |i: usize| {
            let shift = shifts.as_ref().map_or([0.0; 3], |s| s[i]);
            let turn = turns.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |t| t[i]);
            let scale = scales.as_ref().map_or([1.0; 3], |s| s[i]);
            composed(shift, turn, scale)
        };
        Ok((0..count).map(pose).collect())
    }

    /// A mesh in its own frame.
    fn local(&self, mesh: &gltf::Mesh<'_>) -> Result<(SourceMesh, Pieces), String> {
        let mut local = SourceMesh::default();
        let mut pieces = Pieces { kind: PieceKind::Primitives, ..Pieces::default() };
        for (number, primitive) in (0..).zip(mesh.primitives()) {
            pieces.names.push(primitive.material().name().unwrap_or_default().to_owned());
            let first = u32::try_from(local.vertices.len()).map_err(|_| "too many vertices")?;
            let positions =
                primitive.get(&gltf::Semantic::Positions).ok_or("a primitive without positions")?;
            if !bounds_volume(primitive.mode()) {
                continue;
            }
            let points = self.buffers.vectors::<3>(&positions)?;
            let indices = match primitive.indices() {
                Some(accessor) => self.buffers.indices(&accessor)?,
                None => (0..points.len() as u32).collect(),
            };
            local.vertices.extend(points);
            let triangles = triangles_of(primitive.mode(), &indices);
            local.triangles.extend(triangles.into_iter().map(|t| t.map(|i| first.saturating_add(i))));
            pieces.of.resize(local.triangles.len(), number);
        }
        // An index beyond the vertices is refused when the part is healed; splitting must not meet it.
        let count = local.vertices.len() as u32;
        match local.triangles.iter().flatten().find(|&&v| v >= count) {
            Some(v) => Err(format!("vertex {v} does not exist, there are {count}; export the scene again")),
            None => Ok((local, pieces)),
        }
    }
}

fn node_transform(node: &gltf::Node<'_>) -> Matrix4<f64> {
    match node.transform() {
        gltf::scene::Transform::Matrix { matrix } => Matrix4::from_fn(|r, c| f64::from(matrix[c][r])),
        gltf::scene::Transform::Decomposed { translation, rotation, scale } => {
            composed(translation.map(f64::from), rotation.map(f64::from), scale.map(f64::from))
        }
    }
}

/// A pose from a shift, a quaternion (i, j, k, w) and a scale.
fn composed(shift: [f64; 3], [i, j, k, w]: [f64; 4], scale: [f64; 3]) -> Matrix4<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k));
    Translation3::from(Vector3::from(shift)).to_homogeneous()
        * rotation.to_homogeneous()
        * Matrix4::new_nonuniform_scaling(&Vector3::from(scale))
}

fn bounds_volume(mode: Mode) -> bool {
    matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
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
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => Vec::new(),
    }
}
