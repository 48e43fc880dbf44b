//! STEP files: a converter, a program of its own, makes a GLB of them.
//!
//! Kernels that read STEP crash, hang and fill the memory on strangers' files, so none is linked in: `converter.rs` finds
//! the program, `process.rs` runs it with limits, `report.rs` reads what it says, and `remembered.rs` keeps its output by
//! content, so that the same file is converted once. The contract is in `clients/step/README.md`. Only the command line
//! converts: the daemon opens no file that a client names.

mod converter;
mod process;
mod remembered;
mod report;

#[cfg(test)]
mod tests;

use std::ffi::OsString;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use self::converter::Converter;
use self::process::{Limits, TemporaryFolder};
use self::remembered::Remembered;
use self::report::Report;
use crate::budgets::{
    STEP_CACHE_BYTES, STEP_CONVERSION_SECONDS, STEP_FILE_BYTES, STEP_MEMORY_BYTES, STEP_OUTPUT_BYTES,
};
use crate::tolerances::{STEP_ANGLE, STEP_DEFLECTION};

pub(crate) use remembered::forget;

/// How STEP files are converted.
#[derive(Debug, Clone, PartialEq)]
pub struct StepSettings {
    /// The converter; if there is none, `$SBDP_STEP`, or the program `sbdp-step` beside this one or on `$PATH`.
    pub converter: Option<PathBuf>,
    /// mm: how far triangles may be from the surface.
    pub deflection: f64,
    /// The folder of all that is remembered, in which outputs have one of their own; without it nothing is.
    pub cache_folder: Option<PathBuf>,
    /// After this time the converter is killed.
    pub deadline: Duration,
    /// Bytes of data, per process of the converter.
    pub memory_bytes: u64,
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            converter: None,
            deflection: STEP_DEFLECTION,
            cache_folder: None,
            deadline: Duration::from_secs(STEP_CONVERSION_SECONDS),
            memory_bytes: STEP_MEMORY_BYTES,
        }
    }
}

/// What a converter made of a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ConvertedStep {
    /// A GLB scene: metres, the frame of the file, its unit in `extras`.
    pub(crate) glb: Vec<u8>,
    /// The file's unit of length.
    pub(crate) unit: String,
    /// The largest deviation of triangles from the surface, in that unit.
    pub(crate) resolution: f64,
    /// What was left out or is in doubt, in sentences that name the product.
    pub(crate) warnings: Vec<String>,
}

/// Converts the bytes of a STEP file, or finds what was made of them before.
///
/// # Errors
/// No converter; a file that is too large, or that the converter refuses; a converter that does not end in time, needs too
/// much memory, crashes, or does not keep the contract. The sentence says what to do; it does not name the file.
pub(crate) fn convert(bytes: &[u8], settings: &StepSettings) -> Result<ConvertedStep, String> {
    if bytes.len() as u64 > STEP_FILE_BYTES {
        return Err(format!(
            "the file has {} MB, and STEP files are converted up to {} MB; export parts of the assembly",
            bytes.len() >> 20,
            STEP_FILE_BYTES >> 20
        ));
    }
    let converter = Converter::find(settings.converter.as_deref())?;
    let version = converter.version(settings)?;
    let remembered = settings.cache_folder.as_deref().map(|folder| {
        Remembered::new(folder, bytes, &version, settings.deflection, STEP_ANGLE, STEP_CACHE_BYTES)
    });
    if let Some(known) = remembered.as_ref().and_then(Remembered::load) {
        return Ok(known);
    }
    let converted = run(&converter, bytes, settings)?;
    if let Some(remembered) = remembered {
        remembered.save(&converted);
    }
    Ok(converted)
}

/// Reads what a converter writes to stdout, as for a scene without nodes.
pub(super) fn parse_report(stdout: &[u8]) -> Result<(), String> {
    Report::parse(stdout)?.into_converted(Vec::new()).map(drop)
}

/// Has the converter convert a copy of the file: it sees no other file, and what was hashed is what is converted.
fn run(converter: &Converter, bytes: &[u8], settings: &StepSettings) -> Result<ConvertedStep, String> {
    let unusable =
        |e: std::io::Error| format!("no temporary files for the converter: {e}; is the disk full?");
    let folder = TemporaryFolder::new().map_err(unusable)?;
    let (input, output) = (folder.path().join("input.step"), folder.path().join("output.glb"));
    fs::write(&input, bytes).map_err(unusable)?;
    let arguments: [OsString; 6] = [
        input.into(),
        output.clone().into(),
        "--deflection".into(),
        settings.deflection.to_string().into(),
        "--angle".into(),
        STEP_ANGLE.to_string().into(),
    ];
    let limits = Limits {
        deadline: settings.deadline,
        memory_bytes: settings.memory_bytes,
        file_bytes: STEP_OUTPUT_BYTES,
    };
    let finished = process::run(converter.program(), &arguments, folder.path(), &limits);
    let stdout = converter.outcome(finished, &limits)?;
    let broken = |what: &str| format!("the converter {} {what}", converter.shown());
    let report = Report::parse(&stdout).map_err(|reason| broken(&reason))?;
    let glb = fs::read(&output).map_err(|_| broken("ended well and wrote no file"))?;
    if !glb.starts_with(b"glTF") {
        return Err(broken("wrote something else than a GLB file"));
    }
    report.into_converted(glb).map_err(|reason| broken(&reason))
}
