//! `sbdp view`: a plan as a page.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use clap::CommandFactory;
use clap::parser::ValueSource;

use super::args::{Arguments, ViewArguments};
use super::error::CliError;
use super::subject::Subject;
use super::{interrupt, plan, print, written};
use crate::search::Termination;

pub(super) fn run(arguments: &ViewArguments) -> Result<ExitCode, CliError> {
    let file = &arguments.plan.input.assembly;
    let is_plan = file.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
    let (subject, code, termination) = if is_plan {
        refuse_options_of_planning()?;
        let termination = Termination::default();
        interrupt::cancel_on_interrupt(&termination.cancel_flag())?;
        (Subject::read(file, arguments.meshes.as_deref())?, ExitCode::SUCCESS, termination)
    } else {
        if arguments.meshes.is_some() {
            return Err(CliError::Refused("--meshes is for a PLAN.json; an assembly has its own".to_owned()));
        }
        let planned = plan::planned(&arguments.plan)?;
        plan::write_files(&arguments.plan, &planned)?;
        let code = super::error::exit_code(&planned.subject.plan);
        // The page is due also where planning was ended early.
        (planned.subject, code, Termination::default())
    };
    let html = subject.page(&termination)?;
    let output = arguments.output.clone().map_or_else(|| beside(file), Ok)?;
    written(&output, html.as_bytes())?;
    if !arguments.plan.quiet {
        print(&format!(
            "{}: {}, steps {}, {} kB\n",
            output.display(),
            subject.plan.status,
            subject.plan.steps.len(),
            html.len().div_ceil(1000)
        ))?;
    }
    if arguments.open {
        open(&output)?;
    }
    Ok(code)
}

/// The page of an assembly or plan, beside it: `gearbox.html` of `gearbox/`, `gearbox.json` or `gearbox.step`.
fn beside(file: &Path) -> Result<PathBuf, CliError> {
    // `.` and `..` have names only in full.
    let whole = file.canonicalize().map_err(|e| CliError::Refused(format!("{}: {e}", file.display())))?;
    let name = if whole.is_dir() { whole.file_name() } else { whole.file_stem() };
    let name = name.ok_or_else(|| CliError::Refused(format!("{}: give -o FILE", file.display())))?;
    let mut page = name.to_owned();
    page.push(".html");
    Ok(whole.with_file_name(page))
}

/// Opens a page in the user's browser.
fn open(page: &Path) -> Result<(), CliError> {
    let failed = |why: String| CliError::Failed(format!("--open: {why}; open {} yourself", page.display()));
    let status = Command::new("xdg-open").arg(page).stdin(Stdio::null()).status();
    match status {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(failed(format!("`xdg-open` ended with {status}"))),
        Err(error) => Err(failed(format!("`xdg-open` cannot be run: {error}"))),
    }
}

/// What is planned already is not planned otherwise: options that would be without effect are refused.
fn refuse_options_of_planning() -> Result<(), CliError> {
    let command = Arguments::command();
    let matches = command.clone().get_matches();
    let (Some(view), Some(given)) = (command.find_subcommand("view"), matches.subcommand_matches("view"))
    else {
        return Ok(());
    };
    let own = ["assembly", "output", "open", "quiet", "meshes", "help", "version"];
    let planning = view.get_arguments().filter(|a| !own.contains(&a.get_id().as_str()));
    let is_given = |a: &&clap::Arg| given.value_source(a.get_id().as_str()) == Some(ValueSource::CommandLine);
    match planning.filter(is_given).find_map(|a| a.get_long()) {
        None => Ok(()),
        Some(option) => Err(CliError::Refused(format!(
            "--{option} is for planning, but a PLAN.json is planned already; give the assembly instead"
        ))),
    }
}
