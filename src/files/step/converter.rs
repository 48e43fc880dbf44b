//! Which program converts, and what its end means.

use std::collections::HashMap;
use std::env;
use std::ffi::OsStr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::Duration;

use super::StepSettings;
use super::process::{self, Finished, Limits, Stopped, TemporaryFolder};
use crate::budgets::{STEP_OUTPUT_BYTES, STEP_VERSION_SECONDS};
use crate::files::text::printable;

/// The program that is looked for where none is named.
const PROGRAM: &str = "sbdp-step";

/// Exit code by which a converter refuses the file.
const REFUSED: i32 = 3;

/// The longest reason of a converter that is shown, in characters.
const LONGEST_REASON: usize = 600;

/// A program that keeps the contract of converters, as far as is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Converter(PathBuf);

impl Converter {
    /// The one that is named, else that of `$SBDP_STEP`, else `sbdp-step` beside this program, else on `$PATH`. What is
    /// named must be there: another one could read the file differently.
    pub(super) fn find(named: Option<&Path>) -> Result<Self, String> {
        let variable = env::var_os("SBDP_STEP").filter(|v| !v.is_empty()).map(PathBuf::from);
        let path = env::var_os("PATH").unwrap_or_default();
        if let Some(named) = named {
            return Self::named(named, "--converter", &path);
        }
        if let Some(named) = variable {
            return Self::named(&named, "SBDP_STEP", &path);
        }
        let beside = env::current_exe().ok().and_then(|exe| Some(exe.parent()?.join(PROGRAM)));
        let found =
            beside.into_iter().filter(|file| is_program(file)).chain(on_path(PROGRAM.as_ref(), &path)).next();
        found.map(Self).ok_or_else(|| {
            "STEP files need a converter: install one with `pip install \"clients/step[ocp]\"` in sbdp's sources, or \
             name one with --converter; or export the assembly from the CAD program as GLB"
                .to_owned()
        })
    }

    /// A path, or a name on `$PATH`.
    fn named(named: &Path, by: &str, path: &OsStr) -> Result<Self, String> {
        let is_name =
            named.components().count() == 1 && !named.as_os_str().as_encoded_bytes().contains(&b'/');
        let found = if is_program(named) {
            // The program is started in another folder.
            std::path::absolute(named).ok()
        } else if is_name {
            on_path(named.as_os_str(), path).next()
        } else {
            None
        };
        let shown = printable(&named.display().to_string());
        found.map(Self).ok_or_else(|| format!("{by}: `{shown}` is not there or no program that can be run"))
    }

    pub(super) fn program(&self) -> &Path {
        &self.0
    }

    /// Its path, for messages.
    pub(super) fn shown(&self) -> String {
        printable(&self.0.display().to_string())
    }

    /// What the output depends on beside the file: the line of `--version`. Each program is asked once in a process.
    pub(super) fn version(&self, settings: &StepSettings) -> Result<String, String> {
        static KNOWN: LazyLock<Mutex<HashMap<PathBuf, Result<String, String>>>> =
            LazyLock::new(Mutex::default);
        // Held while the program is asked: files of a folder are read at the same time.
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        known.entry(self.0.clone()).or_insert_with(|| self.ask_version(settings)).clone()
    }

    fn ask_version(&self, settings: &StepSettings) -> Result<String, String> {
        let folder =
            TemporaryFolder::new().map_err(|e| format!("no temporary files for the converter: {e}"))?;
        let limits = Limits {
            deadline: settings.deadline.min(Duration::from_secs(STEP_VERSION_SECONDS)),
            memory_bytes: settings.memory_bytes,
            file_bytes: STEP_OUTPUT_BYTES,
        };
        let finished = process::run(&self.0, &["--version".into()], folder.path(), &limits);
        let stdout = self.outcome(finished, &limits)?;
        let text = String::from_utf8_lossy(&stdout).trim().to_owned();
        if text.is_empty() || text.lines().count() != 1 {
            return Err(format!("the converter {} does not answer `--version` with one line", self.shown()));
        }
        Ok(text)
    }

    /// What it wrote to stdout, if it ended well; else what went wrong and what to do.
    pub(super) fn outcome(
        &self,
        finished: Result<Finished, Stopped>,
        limits: &Limits,
    ) -> Result<Vec<u8>, String> {
        let program = self.shown();
        let finished = finished.map_err(|stopped| match stopped {
            Stopped::NotStarted(e) => format!("the converter {program} cannot be started: {e}"),
            Stopped::Late => format!(
                "the converter {program} did not end within {} s and was stopped; {}",
                limits.deadline.as_secs_f64(),
                "export parts of the assembly, or give a larger --deflection"
            ),
            Stopped::Flooded(stream) => format!(
                "the converter {program} wrote without end to {stream} and was stopped; it does not keep the contract"
            ),
        })?;
        if finished.code == Some(0) {
            return Ok(finished.stdout);
        }
        let reason = shortened(&printable(&finished.complaint));
        Err(match (finished.code, finished.signal) {
            (Some(REFUSED), _) if !reason.is_empty() => format!("the converter refuses it: {reason}"),
            (Some(code), _) => {
                format!("the converter {program} failed with exit code {code}{}", after(&reason))
            }
            (None, signal) => format!(
                "the converter {program} crashed (signal {}); it may use {} MB of memory, and this file may need more, \
                 or it is damaged: export parts of the assembly, or give a larger --deflection{}",
                signal.unwrap_or_default(),
                limits.memory_bytes >> 20,
                after(&reason)
            ),
        })
    }
}

fn after(reason: &str) -> String {
    if reason.is_empty() { String::new() } else { format!(": {reason}") }
}

fn shortened(reason: &str) -> String {
    match reason.char_indices().nth(LONGEST_REASON) {
        Some((end, _)) => format!("{}…", &reason[..end]),
        None => reason.to_owned(),
    }
}

fn is_program(file: &Path) -> bool {
    file.metadata().is_ok_and(|m| m.is_file() && m.permissions().mode() & 0o111 != 0)
}

/// The programs of a name in the folders of `$PATH`.
fn on_path(name: &OsStr, path: &OsStr) -> impl Iterator<Item = PathBuf> {
    env::split_paths(path)
        .filter(|folder| folder.is_absolute())
        .map(move |folder| folder.join(name))
        .filter(|f| is_program(f))
}
