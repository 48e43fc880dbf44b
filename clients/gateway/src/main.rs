//! The gateway.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use sbdp::telemetry;
use sbdp_gateway::{Config, Server};
use tokio::signal::unix::{SignalKind, signal};

/// Serves the planner of this machine's daemon, `sbdpd`, to clients on other machines, by gRPC.
#[derive(Debug, Parser)]
#[command(name = "sbdp-gateway", version)]
struct Arguments {
    /// Address and port to listen on [default: 127.0.0.1:50051]; port 0 for a free one.
    #[arg(long, value_name = "IP:PORT")]
    listen: Option<SocketAddr>,
    /// Configuration file, for TLS and limits; clients/gateway/README.md explains every key.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// The daemon's runtime folder, with its file daemon.json.
    #[arg(long, value_name = "DIR")]
    runtime_dir: Option<PathBuf>,
    /// Listen without TLS on an address that other machines can reach: they, and all between, can read and change
    /// everything.
    #[arg(long)]
    allow_plaintext: bool,
}

/// Refused usage or configuration.
const USAGE: u8 = 2;
/// Time for threads that wait for the daemon to end, when nobody waits for them any more.
const LEFT_OVER: Duration = Duration::from_secs(1);

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match server(&arguments) {
        Ok(server) => match run(server) {
            Ok(()) => ExitCode::SUCCESS,
            Err(message) => failed(&message, ExitCode::FAILURE),
        },
        Err(message) => failed(&message, ExitCode::from(USAGE)),
    }
}

fn failed(message: &str, code: ExitCode) -> ExitCode {
    eprintln!("sbdp-gateway: {message}");
    code
}

/// The file's values, then what the command line says; logging runs afterwards.
fn server(arguments: &Arguments) -> Result<Server, String> {
    let mut config = match &arguments.config {
        Some(path) => Config::load(path).map_err(|error| error.to_string())?,
        None => Config::default(),
    };
    config.listen = arguments.listen.unwrap_or(config.listen);
    config.runtime_dir = arguments.runtime_dir.clone().or(config.runtime_dir);
    telemetry::start(&config.log).map_err(|error| error.to_string())?;
    Server::bind(config, arguments.allow_plaintext).map_err(|error| error.to_string())
}

fn run(server: Server) -> Result<(), String> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("cannot start its threads: {error}"))?;
    let served = runtime.block_on(async {
        let signals = (signal(SignalKind::terminate()), signal(SignalKind::interrupt()));
        let (Ok(mut terminate), Ok(mut interrupt)) = signals else {
            return Err("cannot listen for signals".to_owned());
        };
        // A program that starts this with port 0 reads the port here.
        println!("sbdp-gateway: serving on {}", server.address().map_err(|error| error.to_string())?);
        let end = async {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
        };
        server.serve(end).await.map_err(|error| error.to_string())
    });
    runtime.shutdown_timeout(LEFT_OVER);
    served
}
