//! Folders: which files are parts, which are not read, and which belong to none.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::content::Content;
use super::description::{self, Described};
use super::format::{self, Format};
use super::options::{IgnorePattern, LoadOptions};
use super::split::{FileNames, FileParts, listed, parts_of};
use super::step::StepSettings;
use super::text::printable;
use super::{assembly_error, fusion, ignore, notes_on, poses, read_file, shown, stem, unreadable, whole};
use crate::geometry::{GeometryError, SourceAssembly};

pub(super) fn load(folder: &Path, options: &LoadOptions) -> Result<SourceAssembly, GeometryError> {
    if let Some(content) = fusion::read(folder)? {
        let mut assembly = whole(content, folder, options.split)?;
        ignore(&mut assembly, &options.ignore, &[])?;
        return Ok(assembly);
    }
    let described = description::read(folder)?;
    let split = options.split.or(described.as_ref().and_then(|d| d.split));
    let patterns: Vec<IgnorePattern> =
        options.ignore.iter().chain(described.iter().flat_map(|d| &d.ignore)).cloned().collect();
    let listing = Listing::of(folder, &patterns)?;
    listing.check(folder, described.as_ref())?;
    let mut notes = listing.notes(folder);
    let mut assembly = match &listing.meshes[..] {
        [file] => {
            let content = read_file(file, options.step.as_ref());
            let mut assembly = whole(content.map_err(|e| listing.with_advice(e))?, file, split)?;
            assembly.name = stem(folder);
            assembly
        }
        files => several(folder, files, split, options.step.as_ref())?,
    };
    poses::place(folder, &mut assembly, &mut notes)?;
    assembly.notes.extend(notes);
    ignore(&mut assembly, &patterns, &listing.ignored)?;
    if let Some(described) = described {
        described.apply(&mut assembly)?;
    }
    Ok(assembly)
}

/// An assembly of a file for each part.
fn several(
    folder: &Path,
    files: &[PathBuf],
    split: Option<super::Split>,
    step: Option<&StepSettings>,
) -> Result<SourceAssembly, GeometryError> {
    // Of several that cannot be read always the first is named.
    let contents: Vec<Result<Content, GeometryError>> =
        files.par_iter().map(|file| read_file(file, step)).collect();
    // What lies beside meshes and cannot be converted may be the source of them: it is left out with a note. Alone it is
    // what the user means.
    let has_mesh = files.iter().any(|file| Format::of(file) != Some(Format::Step));
    let mut assembly = SourceAssembly { name: stem(folder), ..SourceAssembly::default() };
    let mut unit_of: Option<(String, &Path)> = None;
    let mut silent: Option<&Path> = None;
    for (file, content) in files.iter().zip(contents) {
        let content = match content {
            Err(e) if has_mesh && Format::of(file) == Some(Format::Step) => {
                let reason = reason(e);
                assembly.notes.push(format!("{} is not read: {reason}", printable(&name(file))));
                continue;
            }
            content => content?,
        };
        if let Some(length) = content.resolution {
            assembly.resolution = Some(assembly.resolution.map_or(length, |known| known.max(length)));
        }
        if let Some(unit) = &content.units {
            match &unit_of {
                Some((first, named)) if first != unit => {
                    let [a, b] = [named, file.as_path()]
                        .map(|f| printable(&f.file_name().unwrap_or_default().to_string_lossy()));
                    let reason = format!("{a} is in {first} and {b} in {unit}; export all parts in one unit");
                    return Err(assembly_error(folder, &reason));
                }
                _ => unit_of = Some((unit.clone(), file)),
            }
        } else {
            silent.get_or_insert(file.as_path());
        }
        let names = FileNames { stem: &stem(file), origin: &shown(file), is_whole: false };
        let FileParts { parts, groups, notes } = parts_of(content, &names, split)?;
        assembly.parts.extend(parts);
        assembly.groups.extend(groups);
        assembly.notes.extend(notes_on(file, notes));
    }
    assembly.parts.sort_by(|a, b| super::natural_order(&a.name, &b.name));
    if let (Some((unit, named)), Some(silent)) = (&unit_of, silent) {
        let [a, b] = [*named, silent].map(|f| printable(&name(f)));
        assembly.notes.push(format!("{a} is in {unit}; {b} names no unit and is taken to be in {unit}, too"));
    }
    assembly.units = unit_of.map(|(unit, _)| unit);
    Ok(assembly)
}

/// What is in a folder.
#[derive(Default)]
struct Listing {
    /// Mesh files that are read, by name.
    meshes: Vec<PathBuf>,
    /// Names of mesh files that are left out because of a pattern.
    ignored: Vec<String>,
    /// Files that are not read and may hold geometry.
    unread: Vec<PathBuf>,
    /// Folders with mesh files in them, and their names.
    below: Vec<(String, Vec<String>)>,
}

/// Files that a folder of meshes may have for sbdp.
const DESCRIPTIONS: [&str; 4] = ["assembly.json", "assembly.toml", "translation.json", "config.json"];

impl Listing {
    fn of(folder: &Path, patterns: &[IgnorePattern]) -> Result<Self, GeometryError> {
        let mut listing = Self::default();
        let mut buffers = Vec::new();
        for path in entries(folder)? {
            let name = name(&path);
            let is_ignored = patterns.iter().any(|p| p.matches(&name) || p.matches(&stem(&path)));
            if path.is_dir() {
                let meshes =
                    entries(&path).unwrap_or_default().into_iter().filter(|p| Format::of(p).is_some());
                let meshes: Vec<String> = meshes.map(|p| self::name(&p)).collect();
                if !meshes.is_empty() && !is_ignored {
                    listing.below.push((printable(&name), meshes));
                }
            } else if Format::of(&path).is_some() {
                if is_ignored { listing.ignored.push(printable(&name)) } else { listing.meshes.push(path) }
            } else if format::extension(&path) == "bin" {
                buffers.push(path);
            } else if !DESCRIPTIONS.contains(&name.as_str()) && !format::is_companion(&path) && !is_ignored {
                listing.unread.push(path);
            }
        }
        // Buffers of glTF scenes.
        if !listing.meshes.iter().any(|mesh| format::extension(mesh) == "gltf") {
            listing.unread.extend(buffers);
        }
        Ok(listing)
    }

    /// Refuses a folder without parts, with files that do not fit its list, or with two files of one name.
    fn check(&self, folder: &Path, described: Option<&Described>) -> Result<(), GeometryError> {
        if let Some((described, files)) = described.and_then(|d| Some((d, d.files.as_ref()?))) {
            self.check_list(described, files)?;
        }
        if self.meshes.is_empty() {
            return Err(assembly_error(folder, &self.nothing()));
        }
        let is_scene = |f: &&PathBuf| Format::of(f) == Some(Format::Gltf);
        let scenes = self.meshes.iter().filter(is_scene).count();
        if scenes > 0 && scenes < self.meshes.len() {
            // In metres, and in a unit that nobody knows.
            let reason = "a glTF scene beside other meshes; give the scene or the folder of its parts";
            return Err(assembly_error(folder, reason));
        }
        let mut by_stem: HashMap<String, &PathBuf> = HashMap::new();
        for file in &self.meshes {
            if let Some(other) = by_stem.insert(stem(file), file) {
                let [a, b] = [other, file].map(|f| printable(&name(f)));
                return Err(assembly_error(
                    folder,
                    &format!("{a} and {b} would both be part `{}`", stem(file)),
                ));
            }
        }
        Ok(())
    }

    /// The files must be those in the list: to guess which of the two is right could plan without a part.
    fn check_list(&self, described: &Described, files: &[String]) -> Result<(), GeometryError> {
        let is_there = |file: &String| self.meshes.iter().any(|p| name(p) == *file);
        for (at, file) in files.iter().enumerate() {
            if !is_there(file) && !self.ignored.contains(file) {
                return Err(described.refused(format!("`parts` names {file}, which is not in the folder")));
            }
            if files[..at].contains(file) {
                return Err(described.refused(format!("`parts` names {file} twice")));
            }
        }
        match self.meshes.iter().find(|p| !files.contains(&name(p))) {
            Some(stray) => Err(described.refused(format!(
                "{} is in the folder but not in `parts`; add it there or take it away",
                printable(&name(stray))
            ))),
            None => Ok(()),
        }
    }

    /// Why there is no part.
    fn nothing(&self) -> String {
        let mut reason =
            "the folder holds no .obj, .stl, .gltf, .glb, .3mf, .ply, .off or .step file".to_owned();
        if !self.ignored.is_empty() {
            reason.push_str(" that is not ignored");
        }
        reason.push_str(&self.advice());
        if let Some((first, _)) = self.below.first() {
            let count = self.below.len();
            reason.push_str(&format!("; {count} folders in it do: give one of them, as {first}"));
        }
        reason
    }

    /// What to do with the files that are not read.
    fn advice(&self) -> String {
        let advised = self.unread.iter().filter_map(|file| Some((file, format::advice(file)?)));
        advised.map(|(file, advice)| format!("; {}: {advice}", printable(&name(file)))).collect()
    }

    /// An error of the only file, with what to do with those beside it.
    fn with_advice(&self, error: GeometryError) -> GeometryError {
        match error {
            GeometryError::Assembly { origin, reason } => {
                GeometryError::Assembly { origin, reason: reason + &self.advice() }
            }
            other => other,
        }
    }

    fn notes(&self, folder: &Path) -> Vec<String> {
        let mut notes = Vec::new();
        let folder = printable(&name(folder));
        for file in &self.unread {
            let advice = format::advice(file).unwrap_or("not a file that sbdp knows");
            notes.push(format!("{} is not read: {advice}", printable(&name(file))));
        }
        for (below, meshes) in &self.below {
            let advice = format!("put all parts of the assembly into {folder} itself");
            notes.push(format!("the folder {below} is not read, with {}; {advice}", listed(meshes)));
        }
        notes
    }
}

/// Why a file was refused, without its path.
fn reason(error: GeometryError) -> String {
    match error {
        GeometryError::Assembly { reason, .. } => reason,
        other => other.to_string(),
    }
}

/// What is in a folder, by name, but for hidden files.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, GeometryError> {
    let unreadable = |e: std::io::Error| unreadable(folder, &e);
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        let is_hidden = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"."));
        if !is_hidden {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

fn name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}
