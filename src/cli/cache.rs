//! `sbdp cache`: looks after the store on disk.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use clap::{Args, Subcommand};
use serde::Serialize;

use super::daemon::Daemon;
use super::error::CliError;
use super::figures::DaemonFigures;
use super::print;
use super::table::TextTable;
use crate::cache::{Cache, CacheSettings, CacheStatistics, DiskError};
use crate::files::forget_converted;
use crate::service::RECORD_KINDS;

/// Arguments of `sbdp cache`.
#[derive(Debug, Args)]
pub(super) struct CacheArguments {
    /// The folder [default: $SBDP_CACHE_DIR, else $XDG_CACHE_HOME/sbdp, else ~/.cache/sbdp]
    #[arg(long, value_name = "DIR", global = true)]
    pub(super) cache_dir: Option<PathBuf>,
    #[command(subcommand)]
    pub(super) command: CacheCommand,
}

/// What to do with the store.
#[derive(Debug, Subcommand)]
pub(super) enum CacheCommand {
    /// List all records and distance fields: kind, key, bytes, and the transaction of the last use
    Ls,
    /// Count records and bytes by kind; asks the daemon if it holds the cache
    Stats {
        /// Write all statistics to a file as JSON; `-` for stdout
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
    },
    /// Check all files and records, and remove damaged ones; the exit code is 1 if there were any
    Verify,
    /// Remove the records, distance fields and converted STEP files that were used least recently
    Evict {
        /// Megabytes to keep of each: of the records and fields, and of the converted STEP files
        #[arg(long, value_name = "MB")]
        to_mb: u64,
    },
    /// Remove everything
    Clear,
}

/// Megabytes as the command line and the configuration have them.
const MEGABYTE: u64 = 1 << 20;

/// The cache for planning in this process: in memory, with a message, where the store on disk cannot be opened.
pub(super) fn embedded(folder: Option<&Path>) -> Arc<Cache> {
    let settings = settings(folder);
    let cache = Cache::open(&settings, &RECORD_KINDS).unwrap_or_else(|error| {
        let why = match error {
            DiskError::InUse(_) => "note",
            DiskError::Unusable { .. } => "warning",
        };
        eprintln!("{why}: cache {error}; nothing is remembered beyond this process");
        Cache::in_memory(settings.memory_bytes, &RECORD_KINDS)
    });
    Arc::new(cache)
}

fn settings(folder: Option<&Path>) -> CacheSettings {
    let settings = CacheSettings::default();
    CacheSettings { folder: folder.map(Path::to_owned).or_else(|| settings.folder.clone()), ..settings }
}

pub(super) fn run(arguments: &CacheArguments) -> Result<ExitCode, CliError> {
    let settings = settings(arguments.cache_dir.as_deref());
    let Some(folder) = &settings.folder else {
        return Err(CliError::Refused(
            "there is no folder for a cache: give one with --cache-dir".to_owned(),
        ));
    };
    // Looking must not make one.
    if !folder.is_dir() {
        return Err(CliError::Refused(format!("{}: there is no cache", folder.display())));
    }
    let opened = Cache::open(&settings, &RECORD_KINDS);
    if let (Err(DiskError::InUse(file)), CacheCommand::Stats { json }) = (&opened, &arguments.command) {
        stats(&of_daemon(folder, file)?, json.as_deref())?;
        return Ok(ExitCode::SUCCESS);
    }
    let cache = opened.map_err(|error| match error {
        DiskError::InUse(_) => CliError::Failed(format!("{error}; if that is the daemon, stop it first")),
        DiskError::Unusable { .. } => CliError::Failed(error.to_string()),
    })?;
    match &arguments.command {
        CacheCommand::Ls => print(&listed(&cache))?,
        CacheCommand::Stats { json } => {
            stats(
                &CountedCache { from: "files", pid: None, statistics: cache.statistics() },
                json.as_deref(),
            )?;
        }
        CacheCommand::Verify => return verify(&cache),
        CacheCommand::Evict { to_mb } => evict(&cache, folder, to_mb.saturating_mul(MEGABYTE))?,
        CacheCommand::Clear => evict(&cache, folder, 0)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn listed(cache: &Cache) -> String {
    let mut table = TextTable::new(&["kind", "key", "bytes", "used"]);
    for record in cache.list() {
        let hash: String = record.key.hash().iter().map(|b| format!("{b:02x}")).collect();
        let kind = record.key.kind().name.to_owned();
        table.row([kind, hash, record.bytes.to_string(), record.used.to_string()]);
    }
    table.render()
}

/// The statistics of a cache, and who counted.
#[derive(Debug, Serialize)]
struct CountedCache {
    /// `files`, or `daemon` if it holds the files.
    from: &'static str,
    /// The daemon's process id.
    #[serde(skip_serializing_if = "Option::is_none")]
    pid: Option<u32>,
    #[serde(flatten)]
    statistics: CacheStatistics,
}

/// The statistics of a folder whose file another process has locked: no one else can read it meanwhile, so the daemon
/// is asked, if it is the one.
fn of_daemon(folder: &Path, file: &Path) -> Result<CountedCache, CliError> {
    let failed =
        |why: String| CliError::Failed(format!("{}: in use by another process, and {why}", file.display()));
    let daemon = Daemon::connect().map_err(|e| failed(e.to_string()))?;
    let DaemonFigures { pid, remembered, .. } =
        DaemonFigures::of(&daemon).map_err(|e| failed(e.to_string()))?;
    let statistics = remembered.map(|remembered| remembered.records).filter(|records| records.on_disk);
    let its_folder = statistics.as_ref().and_then(|s| s.folder.as_ref()?.canonicalize().ok());
    match (statistics, its_folder) {
        (Some(statistics), Some(its)) if folder.canonicalize().is_ok_and(|here| here == its) => {
            Ok(CountedCache { from: "daemon", pid: Some(pid), statistics })
        }
        (_, Some(its)) => Err(failed(format!("the daemon (pid {pid}) uses {}", its.display()))),
        (_, None) => Err(failed(format!("the daemon (pid {pid}) has no cache on disk"))),
    }
}

fn stats(counted: &CountedCache, json: Option<&Path>) -> Result<(), CliError> {
    let Some(file) = json else { return print(&described(counted)) };
    let mut text = serde_json::to_string_pretty(counted)
        .map_err(|e| CliError::Failed(format!("cannot write the statistics as JSON: {e}")))?;
    text.push('\n');
    if file == Path::new("-") {
        return print(&text);
    }
    std::fs::write(file, text).map_err(|e| CliError::Failed(format!("{}: {e}", file.display())))
}

fn described(CountedCache { pid, statistics, .. }: &CountedCache) -> String {
    let mut table = TextTable::new(&["kind", "records", "bytes"]);
    for kind in &statistics.kinds {
        table.row([kind.kind.to_string(), kind.disk_entries.to_string(), kind.disk_bytes.to_string()]);
    }
    let CacheStatistics { file_bytes, field_file_bytes, folder, .. } = statistics;
    let folder = folder.as_ref().map_or_else(String::new, |folder| folder.display().to_string());
    let counted = pid.map_or_else(
        || "counted in the files".to_owned(),
        |pid| format!("as counted by the daemon that holds it (pid {pid})"),
    );
    let mut below = TextTable::default();
    below.row(["file".to_owned(), format!("{file_bytes} bytes")]);
    below.row(["fields".to_owned(), format!("{field_file_bytes} bytes")]);
    below.row(["folder".to_owned(), format!("{folder}, {counted}")]);
    format!("{}\n{}", table.render(), below.render())
}

fn verify(cache: &Cache) -> Result<ExitCode, CliError> {
    let verified = cache.verify();
    let file = if verified.clean {
        "the file is as it was left"
    } else {
        "the file was damaged and was mended or set aside"
    };
    print(&format!(
        "{} records, {} damaged or of another version and taken out; {file}\n",
        verified.records, verified.damaged
    ))?;
    let fine = verified.clean && verified.damaged == 0 && cache.statistics().set_aside == 0;
    Ok(if fine { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn evict(cache: &Cache, folder: &Path, bytes: u64) -> Result<(), CliError> {
    let evicted = cache.evict(bytes);
    let converted = forget_converted(folder, bytes);
    let CacheStatistics { file_bytes, field_file_bytes, .. } = cache.statistics();
    print(&format!(
        "{evicted} records taken out; the file has {file_bytes} bytes, distance fields {field_file_bytes}, converted STEP \
         files {converted}\n"
    ))
}
