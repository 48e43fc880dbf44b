//! The daemon.

#[path = "../allocator.rs"]
mod allocator;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use clap::{CommandFactory, Parser};
use sbdp::cache::Cache;
use sbdp::config::Config;
use sbdp::service::{RECORD_KINDS, Service};
use sbdp::{daemon, telemetry};

/// Plans how assemblies come apart, for clients on this machine.
#[derive(Debug, Parser)]
#[command(name = "sbdpd", version = sbdp::BUILD)]
struct DaemonArguments {
    /// Configuration file; `config/default.toml` explains every key.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Prefix of all files in shared memory.
    #[arg(long)]
    prefix: Option<String>,
    /// Folder of iceoryx2's files.
    #[arg(long, value_name = "DIR")]
    root: Option<PathBuf>,
    /// Folder of the lock file and daemon.json.
    #[arg(long, value_name = "DIR")]
    runtime_dir: Option<PathBuf>,
    /// Check the configuration and leave.
    #[arg(long)]
    check_config: bool,
    /// Print the manual page and leave.
    #[arg(long, hide = true)]
    man: bool,
}

/// Refused usage or configuration.
const USAGE: u8 = 2;

fn main() -> ExitCode {
    let arguments = DaemonArguments::parse();
    if arguments.man {
        let page = clap_mangen::Man::new(DaemonArguments::command());
        return page.render(&mut std::io::stdout()).map_or(ExitCode::FAILURE, |()| ExitCode::SUCCESS);
    }
    let config = match configuration(&arguments) {
        Ok(config) => config,
        Err(message) => {
            eprintln!("sbdpd: {message}");
            return ExitCode::from(USAGE);
        }
    };
    if arguments.check_config {
        println!("the configuration is fine");
        return ExitCode::SUCCESS;
    }
    let cache = Arc::new(cache(&config));
    let service = Arc::new(Service::new(Arc::clone(&cache), config.cache.memory().all));
    if let Err(error) = service.start_threads(config.workers.threads_per_request) {
        tracing::warn!(%error, "the first request will start its threads itself");
    }
    let ended = daemon::run_reloading(&config, service, Box::new(move || read(&arguments)));
    // A worker that does not end in time still holds the service.
    cache.flush();
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("sbdpd: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The store on disk, or memory if that cannot be had: a daemon without is better than none.
fn cache(config: &Config) -> Cache {
    let settings = config.cache.settings();
    Cache::open(&settings, &RECORD_KINDS).unwrap_or_else(|error| {
        tracing::warn!(%error, "no cache on disk: nothing is remembered beyond this process");
        Cache::in_memory(settings.memory_bytes, &RECORD_KINDS)
    })
}

/// The file's values, then what the command line says; logging runs afterwards.
fn configuration(arguments: &DaemonArguments) -> Result<Config, String> {
    let config = read(arguments)?;
    telemetry::start(&config.log).map_err(|e| e.to_string())?;
    Ok(config)
}

fn read(arguments: &DaemonArguments) -> Result<Config, String> {
    let mut config = match &arguments.config {
        Some(path) => Config::load(path).map_err(|e| e.to_string())?,
        None => Config::default(),
    };
    let endpoint = &mut config.endpoint;
    endpoint.prefix = arguments.prefix.clone().or(endpoint.prefix.take());
    endpoint.root = arguments.root.clone().or(endpoint.root.take());
    endpoint.runtime_dir = arguments.runtime_dir.clone().or(endpoint.runtime_dir.take());
    daemon::check_place(endpoint).map_err(|e| e.to_string())?;
    Ok(config)
}
