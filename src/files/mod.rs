//! Assemblies from files: folders with one mesh file per part, one file with a whole assembly,
//! the layouts of public data sets.
//!
//! A reader turns bytes into a `content::Content`: surfaces with the names that the file gives to them and their
//! pieces. `split.rs` decides which of these is a part. What is not read, or decided without a request, is a note of
//! the assembly ([`SourceAssembly::notes`]): nothing is left out without one.

mod content;
mod description;
mod doubts;
mod folder;
mod format;
mod fusion;
mod gltf;
mod names;
mod natural_order;
mod obj;
mod off;
mod options;
mod ply;
mod polygon;
mod poses;
mod split;
mod step;
mod stl;
mod text;
mod threemf;
mod units;

#[cfg(test)]
mod tests;

use std::path::Path;

use self::content::Content;
use self::format::Format;
use self::split::{FileNames, FileParts, parts_of};
use crate::geometry::{GeometryError, SourceAssembly, bodies};

pub use self::natural_order::natural_order;
pub use self::options::{IgnorePattern, LoadOptions, Split};
pub use self::step::StepSettings;
pub(crate) use self::step::forget as forget_converted;
pub(crate) use self::units::metres;

/// The direction up by the custom of an assembly's files: +y of glTF scenes, else +z.
#[must_use]
pub fn customary_up(assembly: &SourceAssembly) -> [f64; 3] {
    let is_scene = |origin: &str| {
        let extension = Path::new(origin).extension().and_then(|e| e.to_str()).unwrap_or_default();
        ["gltf", "glb"].iter().any(|e| extension.eq_ignore_ascii_case(e))
    };
    let are_scenes = assembly.parts.iter().all(|p| is_scene(&p.origin));
    if are_scenes { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] }
}

/// Reads an assembly with default options; see [`load`].
///
/// # Errors
/// As [`load`].
pub fn load_assembly(path: &Path) -> Result<SourceAssembly, GeometryError> {
    load(path, &LoadOptions::default())
}

/// Reads an assembly: a folder of mesh files in assembled pose (with an optional `assembly.json` or `assembly.toml`,
/// and `translation.json` or `config.json`), or one file. Meshes are as given; [`heal`](crate::geometry::heal) makes
/// them usable.
///
/// # Errors
/// A file cannot be read, is damaged or not what its name says, or the description does not
/// fit the files. The error names the file, the part and the reason.
pub fn load(path: &Path, options: &LoadOptions) -> Result<SourceAssembly, GeometryError> {
    let mut assembly = if path.is_dir() {
        folder::load(path, options)?
    } else if path.exists() {
        single_file(path, options)?
    } else {
        return Err(assembly_error(path, "there is no such file or folder"));
    };
    assembly.parts.sort_by(|a, b| natural_order(&a.name, &b.name));
    let doubts = doubts::doubts(&assembly);
    assembly.notes.extend(doubts);
    if let [part] = &assembly.parts[..] {
        // Of a surface that cannot be healed it is said later.
        let advice = match bodies(part).map_or(1, |bodies| bodies.len()) {
            1 => String::new(),
            count => format!("; it has {count} separate bodies, and `--split bodies` makes a part of each"),
        };
        assembly
            .notes
            .push(format!("one part only (`{}`): there is nothing to take apart{advice}", part.name));
    }
    Ok(assembly)
}

/// A file that holds a whole assembly.
fn single_file(path: &Path, options: &LoadOptions) -> Result<SourceAssembly, GeometryError> {
    let content = read_file(path, options.step.as_ref())?;
    let mut assembly = whole(content, path, options.split)?;
    ignore(&mut assembly, &options.ignore, &[])?;
    Ok(assembly)
}

/// The assembly in a file that holds all of it, or in a folder that one file describes.
fn whole(mut content: Content, path: &Path, split: Option<Split>) -> Result<SourceAssembly, GeometryError> {
    let (name, origin) = (stem(path), shown(path));
    let (units, resolution) = (content.units.take(), content.resolution);
    let FileParts { parts, groups, notes } =
        parts_of(content, &FileNames { stem: &name, origin: &origin, is_whole: true }, split)?;
    let notes = notes_on(path, notes);
    Ok(SourceAssembly { name, units, parts, groups, notes, resolution, ..SourceAssembly::default() })
}

fn notes_on(path: &Path, notes: Vec<String>) -> Vec<String> {
    let file = path.file_name().map_or_else(String::new, |n| text::printable(&n.to_string_lossy()));
    notes.into_iter().map(|note| format!("{file}: {note}")).collect()
}

/// Leaves out the parts whose names fit a pattern, and notes which; `files` were left out already.
fn ignore(
    assembly: &mut SourceAssembly,
    patterns: &[IgnorePattern],
    files: &[String],
) -> Result<(), GeometryError> {
    let is_ignored = |name: &str| patterns.iter().any(|pattern| pattern.matches(name));
    let mut left: Vec<String> = files.to_vec();
    left.extend(assembly.parts.extract_if(.., |part| is_ignored(&part.name)).map(|part| part.name));
    for pattern in patterns {
        if !left.iter().any(|name| pattern.matches(name)) {
            assembly.notes.push(format!("`{}` is to be ignored and fits no part", pattern.as_str()));
        }
    }
    if assembly.parts.is_empty() {
        let reason = "all parts are ignored; leave out a pattern".to_owned();
        return Err(GeometryError::Assembly { origin: assembly.name.clone(), reason });
    }
    if !left.is_empty() {
        assembly.notes.push(format!("{} ignored, as asked", split::listed(&left)));
        for group in &mut assembly.groups {
            group.parts.retain(|part| !left.contains(part));
        }
        assembly.groups.retain(|group| group.parts.len() > 1);
        assembly.waiting.retain(|(part, _)| !left.contains(part));
    }
    Ok(())
}

/// What a file of this name with these bytes holds; what is wrong with it, without its name. `folder` is where files
/// beside it are looked for, and `step` how STEP files are converted, if they are.
fn parse(name: &Path, bytes: &[u8], folder: &Path, step: Option<&StepSettings>) -> Result<Content, String> {
    let Some(format) = Format::of(name) else {
        let advice = format::advice(name)
            .unwrap_or("give a folder, or an .obj, .stl, .gltf, .glb, .3mf, .ply, .off or .step file");
        return Err(format!("not a mesh that can be read; {advice}"));
    };
    if let Some(reason) = format::mismatch(format, bytes) {
        return Err(reason);
    }
    match format {
        Format::Obj => obj::parse_obj(bytes),
        Format::Stl => stl::parse_stl(bytes),
        Format::Gltf => gltf::parse_gltf(bytes, folder),
        Format::Ply => ply::parse_ply(bytes),
        Format::Off => off::parse_off(bytes),
        Format::ThreeMf => threemf::parse_threemf(bytes),
        Format::Step => parse_step(bytes, step),
    }
}

/// A STEP file, by the scene that a converter makes of it.
fn parse_step(bytes: &[u8], settings: Option<&StepSettings>) -> Result<Content, String> {
    let settings = settings.ok_or(
        "STEP files are converted by a program of their own, which is not run here; convert it to GLB before",
    )?;
    let step::ConvertedStep { glb, unit, resolution, warnings } = step::convert(bytes, settings)?;
    let scene = gltf::parse_gltf(&glb, Path::new("/nowhere"));
    let mut content =
        scene.map_err(|reason| format!("the converter wrote a scene that cannot be read: {reason}"))?;
    if content.units.as_ref() != Some(&unit) {
        let other = content.units.as_deref().unwrap_or_default();
        return Err(format!("the converter says that the unit is {unit}, and its scene that it is {other}"));
    }
    content.resolution = Some(resolution);
    content.notes.extend(warnings);
    Ok(content)
}

/// Whether a file's triangles stand for other surfaces.
pub(crate) fn is_tessellated(origin: &str) -> bool {
    Format::of(Path::new(origin)) == Some(Format::Step)
}

fn read_file(path: &Path, step: Option<&StepSettings>) -> Result<Content, GeometryError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    parse(path, &read_bytes(path)?, folder, step).map_err(|reason| assembly_error(path, &reason))
}

/// Reads bytes as a file of this name, and takes all of it apart; what came of it, in words. No files are beside it.
pub(crate) fn parse_file(name: &str, bytes: &[u8], split: Option<Split>) -> Result<SourceAssembly, String> {
    let path = Path::new(name);
    let content = parse(path, bytes, Path::new("/nowhere"), None)?;
    whole(content, path, split).map_err(|e| e.to_string())
}

/// A 3MF file with this as its main model.
pub(crate) fn threemf_archive(model: &[u8]) -> Result<Vec<u8>, String> {
    threemf::archive_of(model).map_err(|e| e.to_string())
}

/// Reads what a converter of STEP files writes to stdout.
pub(crate) fn parse_step_report(stdout: &[u8]) -> Result<(), String> {
    step::parse_report(stdout)
}

/// Reads a text as each of the descriptions that a folder may hold; what came of it, in words.
pub(crate) fn parse_notes(text: &str) -> String {
    format!("{}; {}; {}", description::parse(text), poses::parse(text), fusion::parse(text))
}

fn stem(path: &Path) -> String {
    let name = if path.is_dir() { path.file_name() } else { path.file_stem() };
    match name {
        Some(name) => text::printable(&name.to_string_lossy()),
        // `.` and `..` have a name all the same.
        None => path.canonicalize().ok().filter(|p| p != path).map_or_else(String::new, |p| stem(&p)),
    }
}

/// A path for messages.
fn shown(path: &Path) -> String {
    text::printable(&path.display().to_string())
}

fn read_bytes(path: &Path) -> Result<Vec<u8>, GeometryError> {
    std::fs::read(path).map_err(|e| unreadable(path, &e))
}

fn read_text(path: &Path) -> Result<String, GeometryError> {
    read_bytes(path).map(|bytes| text::decoded(&bytes).into_owned())
}

fn unreadable(path: &Path, error: &std::io::Error) -> GeometryError {
    GeometryError::Unreadable { path: shown(path), reason: error.to_string() }
}

fn assembly_error(path: &Path, reason: &str) -> GeometryError {
    GeometryError::Assembly { origin: shown(path), reason: reason.to_owned() }
}
