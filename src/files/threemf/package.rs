//! The ZIP archive of a 3MF file, by the crate `zip`.

use std::io::{Cursor, Read, Write};

use quick_xml::events::Event;
use quick_xml::{NsReader, XmlVersion};
use zip::result::ZipResult;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

use super::super::text::excerpt;
use super::AGAIN;

/// How much all that is read of an archive may be larger than the archive itself. Meshes as XML shrink to a fifth and up
/// to a fiftieth; a file of zeros to a thousandth. At half, regular meshes come near it; at double, a hostile file takes
/// twice the memory.
const MOST_GROWTH: usize = 200;
/// Bytes that any archive may hold: the growth of a few kilobytes says nothing.
const ALWAYS_GRANTED: usize = 16 << 20;

/// What the relationship to the main model is called.
const MODEL_RELATIONSHIP: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

/// Where an archive says what it holds.
pub(super) const RELATIONSHIPS_PATH: &str = "_rels/.rels";
/// Where the main model mostly is.
pub(super) const MODEL_PATH: &str = "3D/3dmodel.model";
/// The relationships of an archive with a main model alone.
pub(super) const RELATIONSHIPS: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r0" Target="/3D/3dmodel.model"
 Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>"#;

/// An archive with this main model.
pub(in crate::files) fn archive_of(model: &[u8]) -> ZipResult<Vec<u8>> {
    archive(&[(RELATIONSHIPS_PATH, RELATIONSHIPS.as_bytes()), (MODEL_PATH, model)])
}

/// An archive of files: their names and contents.
pub(super) fn archive(files: &[(&str, impl AsRef<[u8]>)]) -> ZipResult<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in files {
        zip.start_file(*name, SimpleFileOptions::default())?;
        zip.write_all(content.as_ref())?;
    }
    Ok(zip.finish()?.into_inner())
}

/// An opened archive.
pub(super) struct Package<'b> {
    archive: ZipArchive<Cursor<&'b [u8]>>,
    /// Bytes that may still be unpacked.
    granted: usize,
}

impl<'b> Package<'b> {
    pub(super) fn open(bytes: &'b [u8]) -> Result<Self, String> {
        let archive =
            ZipArchive::new(Cursor::new(bytes)).map_err(|e| format!("not a ZIP archive ({e}); {AGAIN}"))?;
        Ok(Self { archive, granted: bytes.len().saturating_mul(MOST_GROWTH).max(ALWAYS_GRANTED) })
    }

    /// The path of the main model.
    pub(super) fn main_model(&mut self) -> Result<String, String> {
        let text =
            self.read(RELATIONSHIPS_PATH).map_err(|_| format!("it does not name its main model; {AGAIN}"))?;
        let mut reader = NsReader::from_str(&text);
        loop {
            let event = reader.read_event().map_err(|e| format!("`{RELATIONSHIPS_PATH}`: {e}; {AGAIN}"))?;
            let (Event::Start(element) | Event::Empty(element)) = event else {
                if matches!(event, Event::Eof) {
                    return Err(format!("it does not name its main model; {AGAIN}"));
                }
                continue;
            };
            let attribute = |name: &str| {
                let found = element.try_get_attribute(name).ok().flatten();
                found.and_then(|a| a.normalized_value(XmlVersion::Implicit1_0).ok().map(|v| v.into_owned()))
            };
            if attribute("Type").as_deref() == Some(MODEL_RELATIONSHIP) {
                return attribute("Target")
                    .ok_or_else(|| format!("it does not name its main model; {AGAIN}"));
            }
        }
    }

    /// The text of a file in the archive. Names begin with a slash, and their case does not count.
    pub(super) fn read(&mut self, path: &str) -> Result<String, String> {
        let wanted = path.trim_start_matches('/');
        let names: Vec<String> =
            self.archive.file_names().filter_map(|name| Some(name.ok()?.into_owned())).collect();
        let found = names.iter().find(|name| name.trim_start_matches('/').eq_ignore_ascii_case(wanted));
        let shown = excerpt(path);
        let found = found.ok_or_else(|| format!("`{shown}` is not in the archive; {AGAIN}"))?;
        let file = self.archive.by_name(found).map_err(|e| format!("`{shown}`: {e}; {AGAIN}"))?;
        let mut bytes = Vec::new();
        let limit = self.granted as u64 + 1;
        file.take(limit).read_to_end(&mut bytes).map_err(|e| format!("`{shown}`: {e}; {AGAIN}"))?;
        if bytes.len() > self.granted {
            let advice = "if it is meant so, unpack it and export the parts as STL";
            return Err(format!(
                "its content is more than {MOST_GROWTH} times as large as the file; {advice}"
            ));
        }
        self.granted -= bytes.len();
        // The crate for XML skips a byte-order mark.
        String::from_utf8(bytes).map_err(|_| format!("`{shown}` is not UTF-8; {AGAIN}"))
    }

    /// Models in the archive.
    pub(super) fn models(&self) -> Vec<String> {
        let names = self.archive.file_names().filter_map(|name| Some(name.ok()?.into_owned()));
        names.filter(|name| name.to_ascii_lowercase().ends_with(".model")).collect()
    }

    /// Whether the archive holds what a slicer knows beyond the standard: names, and where one mesh is several parts.
    pub(super) fn slicer_settings(&self) -> Option<&'static str> {
        ["Metadata/Slic3r_PE_model.config", "Metadata/model_settings.config"]
            .into_iter()
            .find(|name| self.archive.index_for_name(name).is_some())
    }
}
