//! What an assembly's folder says about itself: `assembly.json` or `assembly.toml`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::options::{IgnorePattern, Split};
use super::text::printable;
use super::{assembly_error, read_text, shown};
use crate::geometry::{GeometryError, SourceAssembly, SourceGroup};

/// The optional description of an assembly. Keys that are not known here are left alone:
/// people keep notes of their own there.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub(super) struct Description {
    /// A name for people.
    name: Option<String>,
    /// The unit of length.
    units: Option<String>,
    /// Parts that may not move, by name.
    #[serde(default)]
    fixed: Vec<String>,
    /// Parts that stay as long as others leave, by name.
    #[serde(default)]
    base: Vec<String>,
    /// Parts that stay unless others cannot leave otherwise, by name.
    #[serde(default)]
    keep: Vec<String>,
    /// Parts that are in the way and do not come apart, by name.
    #[serde(default)]
    keep_out: Vec<String>,
    /// Parts that belong together, by the group's name.
    #[serde(default)]
    groups: BTreeMap<String, Vec<String>>,
    /// Mass per volume, by part name. Checked, but no engine uses masses yet: motion without
    /// inertia depends on the shape alone.
    #[serde(default)]
    densities: BTreeMap<String, f64>,
    /// The files that make up the assembly; all in the folder if absent.
    parts: Option<Vec<ListedPart>>,
    /// What is a part in a file that holds several.
    split: Option<String>,
    /// Patterns of file and part names that are left out.
    #[serde(default)]
    ignore: Vec<String>,
}

/// One entry of the list of parts.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum ListedPart {
    /// The file's name.
    File(String),
    /// The file's name among other notes.
    Entry {
        /// The file's name.
        file: String,
    },
    /// Anything else, to be named in the refusal.
    Other(serde_json::Value),
}

/// A description that was checked, and its file.
pub(super) struct Described {
    origin: String,
    description: Description,
    /// The files that make up the assembly, if it lists them.
    pub(super) files: Option<Vec<String>>,
    pub(super) split: Option<Split>,
    pub(super) ignore: Vec<IgnorePattern>,
}

/// Reads `assembly.json` or `assembly.toml`, if there is one.
pub(super) fn read(folder: &Path) -> Result<Option<Described>, GeometryError> {
    let (json, toml) = (folder.join("assembly.json"), folder.join("assembly.toml"));
    let (path, description) = match (json.exists(), toml.exists()) {
        (true, true) => {
            return Err(assembly_error(folder, "both assembly.json and assembly.toml are there; keep one"));
        }
        (true, false) => {
            let description = parse_json(&read_text(&json)?);
            (json, description)
        }
        (false, true) => {
            let description = parse_toml(&read_text(&toml)?);
            (toml, description)
        }
        (false, false) => return Ok(None),
    };
    let described = description.and_then(|d| checked(d, shown(&path)));
    described.map(Some).map_err(|reason| assembly_error(&path, &reason))
}

fn parse_json(text: &str) -> Result<Description, String> {
    serde_json::from_str(text).map_err(|e| e.to_string())
}

fn parse_toml(text: &str) -> Result<Description, String> {
    toml::from_str(text).map_err(|e| e.to_string().trim().to_owned())
}

/// Reads a text as a description of each kind; what came of it, in words.
pub(super) fn parse(text: &str) -> String {
    let words = |read: Result<Description, String>| {
        read.and_then(|d| checked(d, String::new())).map_or_else(|reason| reason, |_| "fine".to_owned())
    };
    format!("{}; {}", words(parse_json(text)), words(parse_toml(text)))
}

fn checked(description: Description, origin: String) -> Result<Described, String> {
    let form = r#"give a file's name, as "pin.obj", or {"file": "pin.obj"}"#;
    let file = |(number, part): (usize, &ListedPart)| match part {
        ListedPart::File(file) | ListedPart::Entry { file } => Ok(file.clone()),
        ListedPart::Other(other) => {
            let found = super::text::excerpt(&other.to_string());
            Err(format!("entry {number} of `parts` has no key `file`: {found}; {form}"))
        }
    };
    let files = description.parts.as_ref().map(|parts| (1..).zip(parts).map(file).collect()).transpose()?;
    if files.as_ref().is_some_and(Vec::is_empty) {
        return Err("the list `parts` is empty; name the mesh files there, or leave it out".into());
    }
    if let Some((part, density)) = description.densities.iter().find(|(_, d)| !(d.is_finite() && **d > 0.0)) {
        return Err(format!("the density {density} of part `{part}` is not positive"));
    }
    let split =
        description.split.as_deref().map(str::parse).transpose().map_err(|e| format!("`split`: {e}"))?;
    let pattern = |text: &String| text.parse().map_err(|e| format!("`ignore`: {e}"));
    let ignore = description.ignore.iter().map(pattern).collect::<Result<_, String>>()?;
    Ok(Described { origin, description, files, split, ignore })
}

impl Described {
    /// A refusal of what the description says.
    pub(super) fn refused(&self, reason: String) -> GeometryError {
        GeometryError::Assembly { origin: self.origin.clone(), reason }
    }

    /// Adds what the description says; parts may be named by stem or by file.
    ///
    /// # Errors
    /// It names a part that there is not.
    pub(super) fn apply(&self, assembly: &mut SourceAssembly) -> Result<(), GeometryError> {
        let description = &self.description;
        let resolve = |name: &String| {
            let stem = Path::new(name).file_stem().and_then(|s| s.to_str());
            let found = assembly.parts.iter().find(|p| p.name == *name || Some(p.name.as_str()) == stem);
            found.map(|p| p.name.clone()).ok_or_else(|| self.refused(format!("there is no part `{name}`")))
        };
        let all = |names: &Vec<String>| names.iter().map(resolve).collect::<Result<Vec<_>, _>>();
        let Description { fixed, base, keep, keep_out, .. } = description;
        let [fixed, base, keep, keep_out] = [all(fixed)?, all(base)?, all(keep)?, all(keep_out)?];
        description.densities.keys().try_for_each(|n| resolve(n).map(drop))?;
        let group = |(name, parts): (&String, &Vec<String>)| {
            Ok(SourceGroup { name: printable(name), parts: all(parts)? })
        };
        let groups = description.groups.iter().map(group).collect::<Result<Vec<_>, GeometryError>>()?;
        (assembly.fixed, assembly.base, assembly.keep, assembly.keep_out) = (fixed, base, keep, keep_out);
        assembly.groups.extend(groups);
        if let Some(name) = &description.name {
            assembly.name.clone_from(name);
        }
        if description.units.is_some() {
            assembly.units.clone_from(&description.units);
        }
        Ok(())
    }
}
