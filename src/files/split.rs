//! What is a part in a file that holds several.

use std::collections::BTreeMap;

use super::content::{Body, Content, PieceKind, Pieces};
use super::names::{shown_path, unique_names};
use super::options::Split;
use super::text::printable;
use crate::geometry::{GeometryError, SourceGroup, SourceMesh, SourcePart, bodies, is_closed};

/// A file, as its parts are named after it.
pub(super) struct FileNames<'a> {
    /// Its name without the extension.
    pub(super) stem: &'a str,
    /// Its path, for messages.
    pub(super) origin: &'a str,
    /// Whether it holds the whole assembly.
    pub(super) is_whole: bool,
}

/// The parts of a file, how they belong together, and what was decided about them.
#[derive(Default)]
pub(super) struct FileParts {
    pub(super) parts: Vec<SourcePart>,
    pub(super) groups: Vec<SourceGroup>,
    pub(super) notes: Vec<String>,
}

/// Decides what is a part. A file among others is one part, unless it is said otherwise; a file of a whole assembly is
/// taken apart into what it names, unless these are pieces of one surface.
///
/// # Errors
/// Bodies are asked for and a surface cannot be healed.
pub(super) fn parts_of(
    content: Content,
    file: &FileNames<'_>,
    split: Option<Split>,
) -> Result<FileParts, GeometryError> {
    let Content { bodies, mut notes, .. } = content;
    let bodies = if file.is_whole { bodies } else { vec![joined(bodies)] };
    let mut found: Vec<(Vec<String>, SourceMesh)> = Vec::new();
    let mut split_nodes: Vec<String> = Vec::new();
    let count = bodies.len();
    for body in bodies {
        let is_node = !body.path.is_empty();
        let path = if is_node { body.path.clone() } else { vec![file.stem.to_owned()] };
        let own = path.last().cloned().unwrap_or_default();
        let (pieces, note) = taken_apart(body, file, split)?;
        let is_split = pieces.len() > 1;
        if count == 1 {
            notes.extend(note);
        } else if is_split && split.is_none() {
            split_nodes.push(own.clone());
        }
        for (name, mesh) in pieces {
            let mut path = path.clone();
            if is_split {
                // Primitives have the names of materials, or numbers: these say something only together with the node's.
                path.push(if is_node { format!("{own}-{name}") } else { name });
            }
            found.push((path, mesh));
        }
    }
    if !split_nodes.is_empty() {
        let nodes = listed(&split_nodes);
        notes.push(format!(
            "the primitives of {nodes} taken as a part each (`--split none` makes a part of each node)"
        ));
    }
    if found.len() > 1 {
        let flat: Vec<String> = found
            .extract_if(.., |(_, mesh)| is_flat(mesh))
            .map(|(path, _)| path.last().cloned().unwrap_or_default())
            .collect();
        if !flat.is_empty() {
            notes.push(format!("{} skipped: no volume (points, lines or a flat sheet)", listed(&flat)));
        }
    }
    let paths: Vec<Vec<String>> = found.iter().map(|(path, _)| path.clone()).collect();
    let names = if file.is_whole { unique_names(&paths) } else { names_under(file.stem, &paths) };
    let mut groups = groups(&paths, &names);
    // A group of the whole assembly says nothing.
    groups.retain(|group| !file.is_whole || group.parts.len() < names.len());
    let part = |(name, (_, mesh))| SourcePart { name, origin: file.origin.to_owned(), mesh };
    let parts = names.into_iter().zip(found).map(part).collect();
    Ok(FileParts { parts, groups, notes })
}

/// A surface with the name that it has in its file.
type Named = (String, SourceMesh);

/// The pieces of a body that are parts, with their names, and what was decided without being asked.
fn taken_apart(
    body: Body,
    file: &FileNames<'_>,
    split: Option<Split>,
) -> Result<(Vec<Named>, Option<String>), GeometryError> {
    let Body { mesh, pieces, path } = body;
    let own = path.last().map_or(file.stem, String::as_str).to_owned();
    if split == Some(Split::Bodies) && !is_flat(&mesh) {
        let part = SourcePart { name: own, origin: file.origin.to_owned(), mesh };
        return Ok(((1..).zip(bodies(&part)?).map(|(n, mesh)| (n.to_string(), mesh)).collect(), None));
    }
    let named = pieces.meshes(&mesh);
    match split {
        _ if named.len() < 2 => return Ok((vec![(own, mesh)], None)),
        Some(Split::Objects) => return Ok((named, None)),
        Some(Split::None | Split::Bodies) => return Ok((vec![(own, mesh)], None)),
        None => {}
    }
    let names: Vec<String> = named.iter().map(|(name, _)| name.clone()).collect();
    let what = format!("{} {} ({})", named.len(), pieces.kind.plural(), listed(&names));
    // Open pieces of a closed surface are faces of one body, and so may be open groups and primitives of any: a mesh of a
    // primitive per face is hardly ever closed to the last digit.
    let are_closed = named.iter().all(|(_, piece)| is_closed(piece) || is_flat(piece));
    let are_bodies = are_closed || pieces.kind.is_thing() && !is_closed(&mesh);
    Ok(match (are_bodies, file.is_whole) {
        (true, true) => {
            let note = format!("{what} taken as a part each (`--split none` makes one part of them)");
            (named, Some(note))
        }
        (true, false) => {
            let note = format!("{what} taken as one part (`--split objects` makes a part of each)");
            (vec![(own, mesh)], Some(note))
        }
        (false, true) => {
            let advice = "`--split bodies` makes a part of each separate body";
            let note = format!("{what} are pieces of one surface and taken as one part ({advice})");
            (vec![(own, mesh)], Some(note))
        }
        (false, false) => (vec![(own, mesh)], None),
    })
}

/// All bodies as one, whose pieces they are.
fn joined(mut bodies: Vec<Body>) -> Body {
    if bodies.len() < 2 {
        let body = bodies.pop().unwrap_or_default();
        return Body { path: Vec::new(), ..body };
    }
    let names = unique_names(&bodies.iter().map(|b| b.path.clone()).collect::<Vec<_>>());
    let mut all =
        Body { pieces: Pieces { kind: PieceKind::Nodes, names, of: Vec::new() }, ..Body::default() };
    for (number, body) in (0..).zip(bodies) {
        let first = all.mesh.vertices.len() as u32;
        all.mesh.vertices.extend(body.mesh.vertices);
        all.mesh.triangles.extend(body.mesh.triangles.iter().map(|t| t.map(|v| first.saturating_add(v))));
        all.pieces.of.resize(all.mesh.triangles.len(), number);
    }
    all
}

/// Names of the parts of a file among others: the file's, before that of the piece if there are several.
fn names_under(stem: &str, paths: &[Vec<String>]) -> Vec<String> {
    let own = printable(stem);
    if let [_] = paths {
        return vec![own];
    }
    let pieces: Vec<Vec<String>> = paths.iter().map(|path| path[1..].to_vec()).collect();
    unique_names(&pieces).into_iter().map(|name| format!("{own}/{name}")).collect()
}

/// The nodes that several parts are under, outer ones first.
fn groups(paths: &[Vec<String>], names: &[String]) -> Vec<SourceGroup> {
    let mut under: BTreeMap<&[String], Vec<String>> = BTreeMap::new();
    for (path, name) in paths.iter().zip(names) {
        for depth in 1..path.len() {
            under.entry(&path[..depth]).or_default().push(name.clone());
        }
    }
    let group = |(above, parts): (&[String], Vec<String>)| SourceGroup { name: shown_path(above), parts };
    under.into_iter().filter(|(_, parts)| parts.len() > 1).map(group).collect()
}

impl Pieces {
    /// The pieces that have triangles, in the order of their names; what has no name gets a number.
    fn meshes(&self, mesh: &SourceMesh) -> Vec<Named> {
        let mut of: Vec<Vec<u32>> = vec![Vec::new(); self.names.len()];
        for (triangle, &piece) in (0..).zip(&self.of) {
            if let Some(list) = of.get_mut(piece as usize) {
                list.push(triangle);
            }
        }
        let used = (1..).zip(self.names.iter().zip(&of)).filter(|(_, (_, triangles))| !triangles.is_empty());
        let name = |number: usize, name: &str| {
            if name.trim().is_empty() { number.to_string() } else { printable(name) }
        };
        used.map(|(number, (given, triangles))| (name(number, given), mesh.some(triangles))).collect()
    }
}

/// Some names for a message.
pub(super) fn listed(names: &[String]) -> String {
    /// As many as one line has room for.
    const SHOWN: usize = 5;
    let shown = names.iter().take(SHOWN).map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN { format!("{shown} and {} more", names.len() - SHOWN) } else { shown }
}

/// Whether all of a mesh lies in a plane, as far as its coordinates are exact.
fn is_flat(mesh: &SourceMesh) -> bool {
    use nalgebra::Vector3;
    /// As a share of the size: single precision, with a digit to spare. Ten times less takes a tilted sheet for a body,
    /// ten times more a foil for a sheet.
    const ROUNDING: f64 = 1e-6;
    let used = || {
        mesh.triangles
            .iter()
            .flatten()
            .filter_map(|&v| mesh.vertices.get(v as usize))
            .map(|v| Vector3::from(*v))
    };
    let Some(first) = used().next() else { return true };
    let farthest = |distance: &dyn Fn(Vector3<f64>) -> f64| {
        used().map(|v| v - first).max_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or_default()
    };
    let along = farthest(&|d| d.norm());
    let Some(axis) = along.try_normalize(0.0) else { return true };
    let Some(normal) = axis.cross(&farthest(&|d| axis.cross(&d).norm())).try_normalize(0.0) else {
        return true;
    };
    farthest(&|d| d.dot(&normal).abs()).dot(&normal).abs() <= ROUNDING * along.norm()
}
