//! Where parts wait, as the user says it.

use std::collections::BTreeMap;
use std::path::Path;

use super::args::placed;
use super::error::CliError;
use super::part_names::part_named;
use crate::geometry::{Pose, SourceAssembly, waypoint_from_pose};
use crate::search::Staging;

/// What `--staging` means: `auto` (where the assembly's files say, else beside it), `none` or a file.
///
/// # Errors
/// The file cannot be read, is no object of poses, or names a part that there is not.
pub(super) fn staging(assembly: &SourceAssembly, given: &Path) -> Result<Staging, CliError> {
    match given.to_str() {
        Some("auto") => {
            let place = |(name, pose): &(String, Pose)| {
                Ok((part_named(assembly, "--staging", name)?, waypoint_from_pose(pose)))
            };
            Ok(Staging::Beside(assembly.waiting.iter().map(place).collect::<Result<_, CliError>>()?))
        }
        Some("none") => Ok(Staging::None),
        _ => from_file(assembly, given),
    }
}

fn from_file(assembly: &SourceAssembly, file: &Path) -> Result<Staging, CliError> {
    let refused = |what: String| CliError::Refused(format!("--staging: {}: {what}", file.display()));
    let text = std::fs::read_to_string(file)
        .map_err(|e| refused(format!("{e} (give `auto`, `none` or a JSON file)")))?;
    let poses: BTreeMap<String, Vec<f64>> =
        serde_json::from_str(&text).map_err(|e| refused(format!("not an object of poses by part: {e}")))?;
    let place = |(name, numbers): (&String, &Vec<f64>)| {
        let part = part_named(assembly, "--staging", name)?;
        let wrong = || refused(format!("`{name}` has no pose [x, y, z] or [x, y, z, qw, qx, qy, qz]"));
        Ok((part, placed(numbers).ok_or_else(wrong)?))
    };
    Ok(Staging::Beside(poses.iter().map(place).collect::<Result<_, CliError>>()?))
}
