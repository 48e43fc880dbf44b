//! The listener of a request: the display on the terminal, and the trace, if the user wants one.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use super::error::CliError;
use super::progress::ProgressDisplay;
use crate::plan::PlanStep;
use crate::search::{PlanSink, Progress, TraceEvent};

/// Shows progress and writes the trace.
pub(super) struct Listener {
    display: ProgressDisplay,
    trace: Option<TraceFile>,
}

struct TraceFile {
    path: PathBuf,
    file: BufWriter<File>,
    /// The first failure; nothing is written after it.
    failed: Option<std::io::Error>,
}

impl Listener {
    /// Writes the trace there, and shows progress with the names of the parts unless it is `quiet`.
    pub(super) fn new(
        trace: Option<&Path>,
        quiet: bool,
        names: impl Iterator<Item = String>,
    ) -> Result<Self, CliError> {
        let trace = match trace {
            None => None,
            Some(path) => {
                let file = File::create(path).map_err(|e| unwritable(path, &e))?;
                Some(TraceFile { path: path.to_owned(), file: BufWriter::new(file), failed: None })
            }
        };
        Ok(Self { display: ProgressDisplay::new(quiet, names), trace })
    }

    /// The plan comes again from its beginning: the trace so far is void.
    pub(super) fn begin_anew(&mut self) {
        if let Some(TraceFile { path, file, failed }) = &mut self.trace {
            match File::create(&*path) {
                // What the old one has not written yet is void, too.
                Ok(anew) => drop(std::mem::replace(file, BufWriter::new(anew)).into_parts()),
                Err(error) => *failed = failed.take().or(Some(error)),
            }
        }
    }

    /// A step was found: the search has begun.
    pub(super) fn step_found(&mut self) {
        self.display.step_found();
    }

    /// Ends the display and completes the trace.
    pub(super) fn finish(self) -> Result<(), CliError> {
        let Some(TraceFile { path, mut file, failed }) = self.trace else { return Ok(()) };
        match failed.map_or_else(|| file.flush(), Err) {
            Ok(()) => Ok(()),
            Err(e) => Err(unwritable(&path, &e)),
        }
    }
}

impl PlanSink for Listener {
    fn progress(&mut self, progress: Progress) {
        self.display.progress(progress);
    }

    fn step(&mut self, _: &PlanStep) {
        self.step_found();
    }

    fn traces(&self) -> bool {
        self.trace.is_some()
    }

    fn traced(&mut self, event: TraceEvent) {
        if let Some(TraceFile { file, failed, .. }) = &mut self.trace
            && failed.is_none()
        {
            let written = serde_json::to_writer(&mut *file, &event).map_err(Into::into);
            *failed = written.and_then(|()| file.write_all(b"\n")).err();
        }
    }
}

fn unwritable(path: &Path, error: &std::io::Error) -> CliError {
    CliError::Failed(format!("{}: {error}", path.display()))
}
