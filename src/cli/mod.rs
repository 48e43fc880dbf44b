//! The command line `sbdp`.
//!
//! `plan` asks the daemon if one runs, else a service in this process; `check` always works
//! here; `view`, `graph`, `steps`, `statics`, `schedule`, `precedence`, `clearance` and `tools` show; `cache` looks after the store on disk; `bench` runs `plan` in processes of its own. Results go to stdout; progress, warnings about the way there and errors to stderr.

mod args;
mod backend;
mod bench;
mod cache;
mod check;
mod clearance;
mod config;
mod daemon;
mod error;
mod explain;
mod figures;
mod graph;
mod interrupt;
mod listener;
mod manual;
mod part_names;
mod plan;
mod precedence;
mod progress;
mod report;
mod report_lines;
mod schedule;
mod staging;
mod standing;
mod statics;
mod status;
mod steps;
mod subject;
mod table;
mod tools;
mod view;

use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

use clap::Parser;

use args::{Arguments, Command};
use error::CliError;

/// The name of the file that is stdout.
const STDOUT: &str = "-";

/// Runs the command that the process was given.
#[must_use]
pub fn run() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Graph(arguments) => graph::run(&arguments),
        Command::Steps(arguments) => steps::run(&arguments),
        Command::Statics(arguments) => statics::run(&arguments),
        Command::Schedule(arguments) => schedule::run(&arguments),
        Command::Precedence(arguments) => precedence::run(&arguments),
        Command::Clearance(arguments) => clearance::run(&arguments),
        Command::Tools(arguments) => tools::run(&arguments),
        Command::Status(arguments) => status::run(&arguments),
        Command::Config(arguments) => config::run(&arguments),
        Command::Cache(arguments) => cache::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Completions(arguments) => manual::completions(&arguments),
        Command::Man(arguments) => manual::pages(&arguments),
    };
    result.unwrap_or_else(|error| {
        eprintln!("error: {error}");
        error.exit_code()
    })
}

/// Writes a result to stdout. A reader that has seen enough and closed the pipe is no error.
fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(CliError::Failed(format!("cannot write to stdout: {e}")))
        }
        _ => Ok(()),
    }
}

/// Writes a document as indented JSON to a file, or to stdout where the file is `-`. Returns whether it went to stdout.
fn written_as_json(file: &Path, document: &impl serde::Serialize, what: &str) -> Result<bool, CliError> {
    let text = serde_json::to_string_pretty(document)
        .map_err(|e| CliError::Failed(format!("cannot write the {what} as JSON: {e}")))?;
    let is_stdout = file == Path::new(STDOUT);
    if is_stdout {
        print(&format!("{text}\n"))?
    } else {
        written(file, text.as_bytes())?
    }
    Ok(is_stdout)
}

/// Writes a document as JSON if a file is named, and as text to stdout unless the JSON went there.
fn show(
    json: Option<&Path>,
    document: &impl serde::Serialize,
    what: &str,
    text: impl FnOnce() -> String,
) -> Result<(), CliError> {
    match json {
        Some(file) if written_as_json(file, document, what)? => Ok(()),
        _ => print(&text()),
    }
}

/// Writes a file whole.
fn written(file: &Path, bytes: &[u8]) -> Result<(), CliError> {
    std::fs::write(file, bytes).map_err(|e| CliError::Failed(format!("{}: {e}", file.display())))
}
