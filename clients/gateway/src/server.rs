//! The gateway as it runs: sockets, TLS, health, and its end.

use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::time::Duration;

use sbdp_ipc::endpoint::{Endpoint, default_runtime_dir};
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval, timeout};
use tonic::server::NamedService;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Certificate, Identity, ServerTlsConfig};
use tonic_health::ServingStatus;
use tonic_health::server::{HealthReporter, health_reporter};

use crate::config::{Config, ConfigError, TlsFiles};
use crate::proto::planner_service_server::PlannerServiceServer;
use crate::routes::Routes;
use crate::service::Gateway;

type Planner = PlannerServiceServer<Gateway>;

/// Time between two looks for the daemon, for the health service.
const HEALTH: Duration = Duration::from_secs(1);
/// Silence after which a connection is asked whether it is still there, and the time that it has to answer: what a client
/// had whose machine is gone is free again after both.
const KEEPALIVE: Duration = Duration::from_secs(20);
/// Time in which calls under way come to their end when the gateway ends: a cancelled plan takes the daemon 10 ms, and
/// slow connections take longer to carry it.
const GRACE: Duration = Duration::from_secs(10);
/// Calls under way on one connection, plans and others: four times the plans that may be configured. Further ones wait in
/// the client.
const STREAMS: u32 = 128;

/// Why the gateway cannot serve.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The configuration is refused.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file of certificates or keys cannot be read.
    #[error("`tls.{key}`: {path}: {source}")]
    TlsFile {
        /// The key of the configuration.
        key: &'static str,
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The certificates cannot be used.
    #[error("the certificates of the section `[tls]` cannot be used: {0}")]
    Tls(String),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// What the system said.
        source: std::io::Error,
    },
    /// Connections cannot be accepted any more.
    #[error("cannot serve: {0}")]
    Transport(String),
}

/// A gateway that listens.
pub struct Server {
    config: Config,
    listener: TcpListener,
    transport: tonic::transport::Server,
}

/// What went wrong, with all that led to it.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text
}

impl Server {
    /// Checks the configuration, reads the certificates, and listens. `allow_plaintext` allows addresses that other
    /// machines can reach without TLS.
    ///
    /// # Errors
    /// See [`ServeError`].
    pub fn bind(config: Config, allow_plaintext: bool) -> Result<Self, ServeError> {
        config.check(allow_plaintext)?;
        let mut transport = tonic::transport::Server::builder()
            .http2_keepalive_interval(Some(KEEPALIVE))
            .http2_keepalive_timeout(Some(KEEPALIVE))
            .max_concurrent_streams(STREAMS);
        if let Some(files) = &config.tls {
            transport = transport.tls_config(tls(files)?).map_err(|error| ServeError::Tls(chain(&error)))?;
        }
        let address = config.listen;
        let listening = |source| ServeError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listening)?;
        listener.set_nonblocking(true).map_err(listening)?;
        Ok(Self { config, listener, transport })
    }

    /// The address as clients write it; the port is the real one where 0 was configured.
    ///
    /// # Errors
    /// The system does not say.
    pub fn address(&self) -> Result<String, ServeError> {
        let address = self.listener.local_addr();
        let address = address.map_err(|source| ServeError::Listen { address: self.config.listen, source })?;
        Ok(format!("{}://{address}", if self.config.tls.is_some() { "https" } else { "http" }))
    }

    /// Serves until `end` comes. Then plans under way are cancelled, and their callers get what there is.
    ///
    /// # Errors
    /// Connections cannot be accepted.
    pub async fn serve(self, end: impl Future<Output = ()>) -> Result<(), ServeError> {
        let failed = |error| ServeError::Transport(chain(&error));
        let (ending, shutdown) = watch::channel(false);
        let message = self.config.limits.message_mb << 20;
        let planner = PlannerServiceServer::new(Gateway::new(&self.config, shutdown.clone()))
            .max_decoding_message_size(message);
        let (reporter, health) = health_reporter();
        let runtime_dir = self.config.runtime_dir.clone().unwrap_or_else(default_runtime_dir);
        let watching = tokio::spawn(report_health(reporter, runtime_dir, shutdown.clone()));

        let listen = self.config.listen;
        let listener = tokio::net::TcpListener::from_std(self.listener)
            .map_err(|source| ServeError::Listen { address: listen, source })?;
        // An event is to leave at once, not with the next one.
        let incoming = TcpIncoming::from(listener).with_nodelay(Some(true));
        let mut of_server = shutdown.clone();
        let ended = async move {
            let _ = of_server.wait_for(|ends| *ends).await;
        };
        let serving =
            self.transport.serve_with_incoming_shutdown(Routes { planner, health }, incoming, ended);
        tokio::pin!(serving);
        tokio::select! {
            served = &mut serving => return served.map_err(failed),
            () = end => {}
        }
        tracing::info!("ending: plans under way are cancelled");
        let _ = ending.send(true);
        match timeout(GRACE, serving).await {
            Ok(served) => served.map_err(failed)?,
            Err(_) => tracing::warn!("some calls did not end within {GRACE:?}"),
        }
        watching.abort();
        Ok(())
    }
}

/// The certificates and keys that are configured.
fn tls(files: &TlsFiles) -> Result<ServerTlsConfig, ServeError> {
    let read = |key: &'static str, path: &Path| {
        std::fs::read(path).map_err(|source| ServeError::TlsFile { key, path: path.to_owned(), source })
    };
    let identity = Identity::from_pem(read("certificate", &files.certificate)?, read("key", &files.key)?);
    let config = ServerTlsConfig::new().identity(identity);
    Ok(match &files.client_ca {
        Some(path) => config.client_ca_root(Certificate::from_pem(read("client_ca", path)?)),
        None => config,
    })
}

/// Keeps the health service up to date: the planner serves as long as a daemon does.
async fn report_health(
    mut reporter: HealthReporter,
    runtime_dir: PathBuf,
    mut shutdown: watch::Receiver<bool>,
) {
    let mut ticks = interval(HEALTH);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            _ = ticks.tick() => {}
            _ = shutdown.wait_for(|ends| *ends) => break,
        }
        let folder = runtime_dir.clone();
        let found = tokio::task::spawn_blocking(move || Endpoint::find(&folder).is_ok()).await;
        match found {
            Ok(true) => reporter.set_serving::<Planner>().await,
            _ => reporter.set_not_serving::<Planner>().await,
        }
    }
    for service in [Planner::NAME, ""] {
        reporter.set_service_status(service, ServingStatus::NotServing).await;
        // Callers that watch it get their end.
        reporter.clear_service_status(service).await;
    }
}
