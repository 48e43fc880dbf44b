//! `sbdp bench churn`: many different assemblies, one after the other, through a daemon with small budgets:
//! whether it keeps them, and refuses nothing for them.

use std::path::Path;

use sbdp_client::PlanOptions;
use serde::Serialize;

use super::super::families::Family;
use super::BenchError;
use super::asking::summary;
use super::load::footprint;
use super::server::{Place, Server};
use crate::exchange::wire_assembly;
use crate::geometry::{SourceAssembly, SourcePart};

/// What to do.
#[derive(Debug, Clone, Copy)]
pub struct ChurnRequest {
    /// Assemblies.
    pub assemblies: usize,
    /// The daemon's budget of memory, megabytes.
    pub memory_mb: u64,
    /// Its budget on disk, megabytes.
    pub disk_mb: u64,
}

/// What the daemon takes after so many assemblies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChurnSample {
    /// Assemblies so far.
    pub assemblies: usize,
    /// Anonymous memory, megabytes.
    pub private_mb: f64,
    /// All resident memory, mapped files and shared memory included, megabytes.
    pub resident_mb: f64,
    /// Open files.
    pub descriptors: u64,
    /// Bytes in the folder of the store, megabytes.
    pub disk_mb: f64,
}

/// What came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Churn {
    /// Assemblies that were uploaded and planned.
    pub answered: usize,
    /// Assemblies whose upload or plan was refused.
    pub refused: usize,
    /// The first reasons.
    pub reasons: Vec<String>,
    /// Along the way.
    pub samples: Vec<ChurnSample>,
}

/// A sample is taken after so many assemblies.
const SAMPLE: usize = 25;
const REASONS: usize = 10;

/// Uploads and plans one assembly after the other.
///
/// # Errors
/// The daemon cannot be started, or is gone.
pub fn churn(request: &ChurnRequest, mut told: impl FnMut(&ChurnSample)) -> Result<Churn, BenchError> {
    let config = format!("[cache]\nmemory_mb = {}\ndisk_mb = {}\n", request.memory_mb, request.disk_mb);
    let daemon = Server::daemon_with(Place::new("churn")?, &config)?;
    let client = daemon.connect()?;
    let mut churn = Churn { answered: 0, refused: 0, reasons: Vec::new(), samples: Vec::new() };
    for i in 0..request.assemblies {
        let assembly = different(i);
        let planned = client
            .upload(&wire_assembly(&assembly))
            .map_err(BenchError::failed)
            .and_then(|handle| summary(&client, handle, &PlanOptions::default()));
        match planned {
            Ok(_) => churn.answered += 1,
            Err(error) => {
                churn.refused += 1;
                if churn.reasons.len() < REASONS {
                    churn.reasons.push(format!("{i}: {error}"));
                }
            }
        }
        if (i + 1) % SAMPLE == 0 || i + 1 == request.assemblies {
            let held = footprint(daemon.pid(), 0);
            let sample = ChurnSample {
                assemblies: i + 1,
                private_mb: held.private_kib as f64 / 1024.0,
                resident_mb: held.resident_kib as f64 / 1024.0,
                descriptors: held.descriptors,
                disk_mb: bytes_in(&daemon.place().cache()) as f64 / f64::from(1 << 20),
            };
            told(&sample);
            churn.samples.push(sample);
        }
    }
    Ok(churn)
}

/// Assemblies of all families and of 8 to 40 parts, no two of which have a shape in common.
fn different(i: usize) -> SourceAssembly {
    let family = Family::ALL[i % Family::ALL.len()];
    let grown = 1.0 + i as f64 / 1024.0;
    let part = |(name, mut mesh): (String, crate::geometry::SourceMesh)| {
        mesh.vertices.iter_mut().for_each(|v| *v = v.map(|x| x * grown));
        SourcePart { name, origin: "benchmark".to_owned(), mesh }
    };
    SourceAssembly {
        name: format!("{}-{i}", family.name()),
        units: Some("mm".to_owned()),
        parts: family.member(Family::LEAST + i * 7 % 33).into_iter().map(part).collect(),
        ..SourceAssembly::default()
    }
}

fn bytes_in(folder: &Path) -> u64 {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let bytes = |entry: std::fs::DirEntry| match entry.metadata() {
        Ok(found) if found.is_dir() => bytes_in(&entry.path()),
        found => found.map_or(0, |found| found.len()),
    };
    entries.map(bytes).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Assembly;

    #[test]
    fn no_two_assemblies_have_a_shape_in_common() {
        let shapes = |i| {
            let assembly = Assembly::new(&different(i)).unwrap();
            assembly.shapes.iter().map(|shape| *shape.content()).collect::<Vec<_>>()
        };
        let mut all: Vec<_> = [0, 3, 33, 36].into_iter().flat_map(shapes).collect();
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert!(count > 12 && all.len() == count);
    }
}
