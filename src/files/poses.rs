//! Where parts stand, beside their meshes: `translation.json` (an offset for each part) and the `config.json` of the
//! ASAP data set (a state for each part, assembled and before).

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Point3, Translation3, UnitQuaternion};
use serde::Deserialize;

use super::split::listed;
use super::{assembly_error, read_text};
use crate::geometry::{GeometryError, Pose, SourceAssembly, SourceMesh, SourcePart};

/// Offsets by part name, or one per part in their order.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Offsets {
    ByName(BTreeMap<String, [f64; 3]>),
    InOrder(Vec<[f64; 3]>),
}

/// Where a part of the ASAP data set stands: a shift, and angles (radians) about the fixed axes x, y and z, in this order.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Configured {
    /// Assembled.
    final_state: Vec<f64>,
    /// Before it is put in.
    initial_state: Option<Vec<f64>>,
}

/// Where a part stands, and where it waits before.
type Placement = (Pose, Option<Pose>);

/// Places the parts of a folder as its files of poses say, and notes what these leave out.
///
/// # Errors
/// A file is damaged, names a part that there is not, or there are two.
pub(super) fn place(
    folder: &Path,
    assembly: &mut SourceAssembly,
    notes: &mut Vec<String>,
) -> Result<(), GeometryError> {
    let parts = &mut assembly.parts;
    let (offsets, config) = (folder.join("translation.json"), folder.join("config.json"));
    let (path, poses) = match (offsets.exists(), config.exists()) {
        (false, false) => return Ok(()),
        (true, true) => {
            let reason = "both translation.json and config.json say where parts stand; keep one";
            return Err(assembly_error(folder, reason));
        }
        (true, false) => {
            let poses = parse_offsets(&read_text(&offsets)?).and_then(|o| by_part(o, parts));
            (offsets, poses)
        }
        (false, true) => {
            let Some(states) = parse_config(&read_text(&config)?).map_err(|e| assembly_error(&config, &e))?
            else {
                notes.push("config.json not read: it has no `final_state` of parts".to_owned());
                return Ok(());
            };
            let poses =
                states.into_iter().map(|(name, pose)| find(&name, parts).map(|part| (part, pose))).collect();
            (config, poses)
        }
    };
    let poses: Vec<(usize, Placement)> = poses.map_err(|reason| assembly_error(&path, &reason))?;
    let mut is_placed = vec![false; parts.len()];
    for (part, (pose, waiting)) in poses {
        is_placed[part] = true;
        moved(&mut parts[part].mesh, &pose);
        if let Some(waiting) = waiting {
            assembly.waiting.push((parts[part].name.clone(), waiting * pose.inverse()));
        }
    }
    let left: Vec<String> = parts
        .iter()
        .zip(&is_placed)
        .filter(|(_, placed)| !**placed)
        .map(|(part, _)| part.name.clone())
        .collect();
    if !left.is_empty() {
        let file = path.file_name().unwrap_or_default().display();
        notes.push(format!("{file} does not name {}: taken where the mesh stands", listed(&left)));
    }
    Ok(())
}

fn moved(mesh: &mut SourceMesh, pose: &Pose) {
    if pose.rotation == UnitQuaternion::identity() {
        let shift = pose.translation.vector;
        mesh.vertices.iter_mut().for_each(|v| v.iter_mut().zip(&shift).for_each(|(x, s)| *x += s));
    } else {
        mesh.vertices.iter_mut().for_each(|v| *v = (pose * Point3::from(*v)).into());
    }
}

fn parse_offsets(text: &str) -> Result<Offsets, String> {
    // First as plain JSON: of a broken untagged value serde only says that nothing fitted.
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    Offsets::deserialize(value).map_err(|_| r#"expected {"part": [x, y, z], …} or [[x, y, z], …]"#.into())
}

fn by_part(offsets: Offsets, parts: &[SourcePart]) -> Result<Vec<(usize, Placement)>, String> {
    let pose = |[x, y, z]: [f64; 3]| (Pose::translation(x, y, z), None);
    match offsets {
        Offsets::InOrder(offsets) if offsets.len() == parts.len() => {
            Ok(offsets.into_iter().map(pose).enumerate().collect())
        }
        Offsets::InOrder(offsets) => Err(format!("{} offsets for {} parts", offsets.len(), parts.len())),
        Offsets::ByName(by_name) => {
            by_name.into_iter().map(|(name, offset)| Ok((find(&name, parts)?, pose(offset)))).collect()
        }
    }
}

/// The poses by part; none if the file is a configuration of something else.
fn parse_config(text: &str) -> Result<Option<BTreeMap<String, Placement>>, String> {
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    let is_state = |value: &serde_json::Value| value.get("final_state").is_some();
    if !value.as_object().is_some_and(|parts| parts.values().any(is_state)) {
        return Ok(None);
    }
    let expected = r#"expected {"part": {"final_state": [x, y, z] or [x, y, z, rx, ry, rz]}, …}"#;
    let parts = BTreeMap::<String, Configured>::deserialize(value).map_err(|e| format!("{e}; {expected}"))?;
    let placement = |(name, part): (String, Configured)| {
        let pose = |state: &Vec<f64>| match state[..] {
            [x, y, z] => Ok(Pose::translation(x, y, z)),
            [x, y, z, rx, ry, rz] => Ok(Pose::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::from_euler_angles(rx, ry, rz),
            )),
            _ => Err(format!("`{name}` has {} numbers; {expected}", state.len())),
        };
        let placement = (pose(&part.final_state)?, part.initial_state.as_ref().map(pose).transpose()?);
        Ok((name, placement))
    };
    parts.into_iter().map(placement).collect::<Result<_, String>>().map(Some)
}

fn find(name: &str, parts: &[SourcePart]) -> Result<usize, String> {
    let stem = Path::new(name).file_stem().and_then(|s| s.to_str()).unwrap_or(name);
    let found = parts.iter().position(|p| p.name == name || p.name == stem);
    found.ok_or_else(|| format!("there is no part `{name}`"))
}

/// Reads a text as each kind of poses; what came of it, in words.
pub(super) fn parse(text: &str) -> String {
    let words = |e: Option<String>| e.unwrap_or_else(|| "fine".to_owned());
    format!("{}; {}", words(parse_offsets(text).err()), words(parse_config(text).err()))
}
