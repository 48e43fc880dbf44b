//! Outputs of converters, remembered by content.
//!
//! A plain folder, `step` in the folder of all that is remembered, with a file for each output: it is not part of the
//! store in `crate::cache`, which only one process may hold, while assemblies are also read where a daemon plans. A file
//! is named by the hash of all that the output depends on, and has
//!
//! | offset | bytes | |
//! |---|---|---|
//! | 0 | 8 | `SBDPSTEP` |
//! | 8 | 32 | BLAKE3 of all that follows |
//! | 40 | 4 | length of the description, little-endian |
//! | 44 | … | the description: JSON with the unit, the resolution and the warnings |
//! | … | … | the GLB |
//!
//! It is written beside and renamed, so that no half of one is ever read; one that is damaged is a miss. When the files
//! together exceed their bound, those used least recently are removed: a use sets the time of modification.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use super::ConvertedStep;

const MAGIC: &[u8; 8] = b"SBDPSTEP";
/// The version of the format; it also changes with the arguments of converters.
const FORMAT: u32 = 1;
const HASH: usize = 32;
const HEADER: usize = MAGIC.len() + HASH + 4;
const EXTENSION: &str = "converted";

/// The place of one output.
#[derive(Debug)]
pub(super) struct Remembered {
    folder: PathBuf,
    file: PathBuf,
    most_bytes: u64,
}

#[derive(Debug, Serialize, Deserialize)]
struct Description {
    unit: String,
    resolution: f64,
    warnings: Vec<String>,
}

impl Remembered {
    /// Of a file with these bytes, converted by a program of this version, in the folder of all that is remembered.
    pub(super) fn new(
        cache_folder: &Path,
        bytes: &[u8],
        version: &str,
        deflection: f64,
        angle: f64,
        most_bytes: u64,
    ) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&FORMAT.to_le_bytes());
        hasher.update(&deflection.to_le_bytes());
        hasher.update(&angle.to_le_bytes());
        hasher.update(&(version.len() as u64).to_le_bytes());
        hasher.update(version.as_bytes());
        hasher.update(bytes);
        let folder = place(cache_folder);
        let file = folder.join(format!("{}.{EXTENSION}", hasher.finalize().to_hex()));
        Self { folder, file, most_bytes }
    }

    /// The output, if it is there and whole.
    pub(super) fn load(&self) -> Option<ConvertedStep> {
        let bytes = fs::read(&self.file).ok()?;
        let converted = parse(&bytes)?;
        // Where the time cannot be set, it is evicted sooner.
        let _ = File::options().append(true).open(&self.file).and_then(|f| f.set_modified(SystemTime::now()));
        Some(converted)
    }

    /// Keeps an output. Where that fails (a full disk), it is converted again next time.
    pub(super) fn save(&self, converted: &ConvertedStep) {
        let _ = self.write(converted).and_then(|()| evict(&self.folder, self.most_bytes));
    }

    fn write(&self, converted: &ConvertedStep) -> io::Result<()> {
        let ConvertedStep { glb, unit, resolution, warnings } = converted;
        let description =
            Description { unit: unit.clone(), resolution: *resolution, warnings: warnings.clone() };
        let description = serde_json::to_vec(&description)?;
        let length = u32::try_from(description.len()).map_err(io::Error::other)?.to_le_bytes();
        let hash = blake3::Hasher::new().update(&length).update(&description).update(glb).finalize();
        fs::create_dir_all(&self.folder)?;
        let unfinished = self.file.with_extension(format!("{}.unfinished", std::process::id()));
        let mut file = File::create(&unfinished)?;
        let written = [&MAGIC[..], hash.as_bytes(), &length, &description, glb]
            .iter()
            .try_for_each(|bytes| file.write_all(bytes))
            .and_then(|()| fs::rename(&unfinished, &self.file));
        written.inspect_err(|_| drop(fs::remove_file(&unfinished)))
    }
}

fn place(cache_folder: &Path) -> PathBuf {
    cache_folder.join("step")
}

fn parse(bytes: &[u8]) -> Option<ConvertedStep> {
    let hashed = bytes.strip_prefix(MAGIC)?.get(HASH..)?;
    if blake3::hash(hashed).as_bytes()[..] != bytes[MAGIC.len()..MAGIC.len() + HASH] {
        return None;
    }
    let length = u32::from_le_bytes(hashed.get(..4)?.try_into().ok()?) as usize;
    let description: Description = serde_json::from_slice(hashed.get(4..4 + length)?).ok()?;
    let Description { unit, resolution, warnings } = description;
    Some(ConvertedStep { glb: bytes[HEADER + length..].to_vec(), unit, resolution, warnings })
}

/// The files in the folder with their last use and bytes; also those that a killed process left.
fn files(folder: &Path) -> io::Result<Vec<(SystemTime, u64, PathBuf)>> {
    let entries = fs::read_dir(folder)?.filter_map(Result::ok);
    let described = entries.filter_map(|entry| {
        let metadata = entry.metadata().ok().filter(fs::Metadata::is_file)?;
        Some((metadata.modified().ok()?, metadata.len(), entry.path()))
    });
    Ok(described.collect())
}

fn evict(folder: &Path, most_bytes: u64) -> io::Result<()> {
    let mut files = files(folder)?;
    files.sort();
    let mut bytes: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
    for (_, length, path) in files {
        if bytes <= most_bytes {
            break;
        }
        // Another process may have removed it.
        let _ = fs::remove_file(path);
        bytes -= length;
    }
    Ok(())
}

/// Removes outputs, those used least recently first, until no more than these bytes are left. Returns the bytes left.
pub(crate) fn forget(cache_folder: &Path, to_bytes: u64) -> u64 {
    let folder = place(cache_folder);
    // Without a folder there is nothing.
    let _ = evict(&folder, to_bytes);
    files(&folder).map_or(0, |files| files.iter().map(|(_, bytes, _)| bytes).sum())
}
