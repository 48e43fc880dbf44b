//! The document of a plan, with what is known about its files.

use std::path::Path;

use super::{GroupDocument, PlanDocument, SourceDocument, WarningDocument};
use crate::files::{IgnorePattern, Split};
use crate::geometry::{Revision, SourceAssembly, SourceGroup};

/// The document of a plan of an assembly from files: with its groups, and what was found while the files were read, before
/// the plan's own warnings.
#[must_use]
pub fn with_files(
    mut document: PlanDocument,
    assembly: &SourceAssembly,
    source: SourceDocument,
) -> PlanDocument {
    let group = |g: &SourceGroup| GroupDocument { name: g.name.clone(), parts: g.parts.clone() };
    document.groups = assembly.groups.iter().map(group).collect();
    let notes = assembly.notes.iter().map(|note| WarningDocument { part: None, message: note.clone() });
    document.warnings.splice(0..0, notes);
    document.source = Some(source);
    document
}

/// Where the meshes are, and how they were read; `deflection` only if it was given.
#[must_use]
pub fn source(
    path: &Path,
    content: String,
    split: Option<Split>,
    ignore: &[IgnorePattern],
    deflection: Option<f64>,
) -> SourceDocument {
    SourceDocument {
        assembly: absolute(path),
        content,
        split: split.map(|split| split.to_string()),
        ignore: ignore.iter().map(|pattern| pattern.as_str().to_owned()).collect(),
        deflection,
        ..SourceDocument::default()
    }
}

/// A path that means the same in every folder.
#[must_use]
pub fn absolute(path: &Path) -> String {
    path.canonicalize().unwrap_or_else(|_| path.to_owned()).display().to_string()
}

/// A hash of an assembly as it was read (whose own hash is given), with the meshes that differ.
#[must_use]
pub fn content_of(base: &[u8; 32], revision: &Revision) -> String {
    let Revision { replaced, added, .. } = revision.clone();
    let meshes = Revision { replaced, added, ..Revision::default() };
    let hash = if meshes.is_empty() { *base } else { meshes.content_hash(base) };
    blake3::Hash::from_bytes(hash).to_hex().to_string()
}
