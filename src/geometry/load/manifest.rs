//! What an assembly's folder says about itself: `assembly.json` or `assembly.toml`, and the
//! offsets of `translation.json`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::geometry::GeometryError;

/// The optional description of an assembly. Keys that are not known here are left alone:
/// people keep notes of their own there.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub(super) struct Manifest {
    /// A name for people.
    pub(super) name: Option<String>,
    /// The unit of length.
    pub(super) units: Option<String>,
    /// Parts that may not move, by name.
    #[serde(default)]
    pub(super) fixed: Vec<String>,
    /// Parts that stay as long as others leave, by name.
    #[serde(default)]
    pub(super) base: Vec<String>,
    /// Mass per volume, by part name. Checked, but no engine uses masses yet: motion without
    /// inertia depends on the shape alone.
    #[serde(default)]
    pub(super) densities: BTreeMap<String, f64>,
    /// The files that make up the assembly; all in the folder if absent.
    pub(super) parts: Option<Vec<ListedPart>>,
}

/// One entry of the list of parts.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub(super) enum ListedPart {
    /// The file's name.
    File(String),
    /// The file's name among other notes.
    Entry {
        /// The file's name.
        file: String,
    },
}

impl ListedPart {
    pub(super) fn file(&self) -> &str {
        match self {
            Self::File(file) | Self::Entry { file } => file,
        }
    }
}

/// Reads `assembly.json` or `assembly.toml`, if there is one.
pub(super) fn read_manifest(folder: &Path) -> Result<Option<(String, Manifest)>, GeometryError> {
    let (json, toml) = (folder.join("assembly.json"), folder.join("assembly.toml"));
    let (path, manifest) = match (json.exists(), toml.exists()) {
        (true, true) => {
            let reason = "both assembly.json and assembly.toml are there; keep one".to_owned();
            return Err(GeometryError::Assembly { origin: folder.display().to_string(), reason });
        }
        (true, false) => {
            let manifest = parse_json(&super::read_text(&json)?);
            (json, manifest)
        }
        (false, true) => {
            let manifest = parse_toml(&super::read_text(&toml)?);
            (toml, manifest)
        }
        (false, false) => return Ok(None),
    };
    let origin = path.display().to_string();
    let manifest = manifest.and_then(|m| check(&m).map(|()| m));
    let manifest = manifest.map_err(|reason| GeometryError::Assembly { origin: origin.clone(), reason })?;
    Ok(Some((origin, manifest)))
}

fn parse_json(text: &str) -> Result<Manifest, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

fn parse_toml(text: &str) -> Result<Manifest, String> {
    toml::from_str(text).map_err(|e| e.to_string().trim().to_owned())
}

/// Reads a text as each of the descriptions that a folder may hold; what came of it, in words.
pub(crate) fn parse_notes(text: &str) -> String {
    let manifest = |read: Result<Manifest, String>| read.and_then(|m| check(&m)).err().unwrap_or_default();
    let translations = parse_translations(text).map(drop).err().unwrap_or_default();
    format!("{}; {}; {translations}", manifest(parse_json(text)), manifest(parse_toml(text)))
}

fn check(manifest: &Manifest) -> Result<(), String> {
    if manifest.parts.as_ref().is_some_and(Vec::is_empty) {
        return Err("the list `parts` is empty; name the mesh files there, or leave it out".into());
    }
    match manifest.densities.iter().find(|(_, d)| !(d.is_finite() && **d > 0.0)) {
        Some((part, density)) => Err(format!("the density {density} of part `{part}` is not positive")),
        None => Ok(()),
    }
}

/// Offsets by part name, or one per part in their order.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum Translations {
    ByName(BTreeMap<String, [f64; 3]>),
    InOrder(Vec<[f64; 3]>),
}

/// Reads `translation.json`, if there is one: an offset for each of the given parts.
pub(super) fn read_translations(
    folder: &Path,
    names: &[String],
) -> Result<Option<Vec<[f64; 3]>>, GeometryError> {
    let path = folder.join("translation.json");
    if !path.exists() {
        return Ok(None);
    }
    let refused = |reason: String| GeometryError::Assembly { origin: path.display().to_string(), reason };
    let text = super::read_text(&path)?;
    match parse_translations(&text).map_err(refused)? {
        Translations::InOrder(offsets) if offsets.len() == names.len() => Ok(Some(offsets)),
        Translations::InOrder(offsets) => {
            Err(refused(format!("{} offsets for {} parts", offsets.len(), names.len())))
        }
        Translations::ByName(by_name) => by_part(by_name, names).map(Some).map_err(refused),
    }
}

fn parse_translations(text: &str) -> Result<Translations, String> {
    // First as plain JSON: of a broken untagged value serde only says that nothing fitted.
    let value: serde_json::Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
    Translations::deserialize(value)
        .map_err(|_| r#"expected {"part": [x, y, z], …} or [[x, y, z], …]"#.into())
}

fn by_part(by_name: BTreeMap<String, [f64; 3]>, names: &[String]) -> Result<Vec<[f64; 3]>, String> {
    let mut offsets = vec![[0.0; 3]; names.len()];
    for (key, offset) in by_name {
        let stem = Path::new(&key).file_stem().and_then(|s| s.to_str()).unwrap_or(&key);
        let at = names.iter().position(|n| *n == key || n == stem);
        offsets[at.ok_or_else(|| format!("there is no part `{key}`"))?] = offset;
    }
    Ok(offsets)
}
