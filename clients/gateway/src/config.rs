//! The gateway's configuration. `clients/gateway/README.md` explains every key.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};

use sbdp::config::LogConfig;
use serde::Deserialize;

/// The port of gRPC's own examples, which people look for first.
const PORT: u16 = 50051;
/// The most plans under way that may be configured. The daemon takes 40 connections: the others are for uploads, short
/// questions, and clients on the daemon's machine. At double, they are refused by the daemon; at half nothing breaks.
const MOST_PLANS: usize = 32;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It is not valid: syntax, an unknown key, or a value of the wrong type.
    #[error("{path}: {source}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and key.
        source: Box<toml::de::Error>,
    },
    /// A value is out of range.
    #[error("`{key}` is {value}, but must be {range}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Its value.
        value: usize,
        /// What it may be.
        range: &'static str,
    },
    /// Other machines could reach the address, and everyone between could read and change what is sent.
    #[error(
        "{0} can be reached from other machines, and there is no TLS: name a certificate and a key in the section `[tls]` of \
         the configuration, listen on a loopback address (127.0.0.1), or give `--allow-plaintext` if something else protects \
         the connection"
    )]
    Plaintext(SocketAddr),
}

/// The whole configuration.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The address to listen on.
    pub listen: SocketAddr,
    /// The daemon's runtime folder; by default as for every client.
    pub runtime_dir: Option<PathBuf>,
    /// Certificates; without them, connections are not encrypted.
    pub tls: Option<TlsFiles>,
    /// What callers may use.
    pub limits: Limits,
    /// What is logged.
    pub log: LogConfig,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: (Ipv4Addr::LOCALHOST, PORT).into(),
            runtime_dir: None,
            tls: None,
            limits: Limits::default(),
            log: LogConfig::default(),
        }
    }
}

/// PEM files. Relative paths are relative to the configuration file.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsFiles {
    /// The gateway's certificate, with those that lead to the authority's.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// The authority of the clients' certificates: a client without one is refused then.
    pub client_ca: Option<PathBuf>,
}

/// What callers may use.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Limits {
    /// Megabytes of one message, as a piece of an upload. At half, clients with the usual pieces are refused.
    pub message_mb: usize,
    /// Plans under way.
    pub plans: usize,
    /// Megabytes of all uploads under way. They are in the gateway's memory until the daemon has them.
    pub uploads_mb: usize,
    /// Megabytes of the uploads under way from one address.
    pub uploads_mb_per_client: usize,
    /// Milliseconds by which the daemon answers before the deadline of a call, for the way back. The daemon stops within
    /// 10 ms of a deadline; at half, some answers are late, at double, plans get less time for nothing.
    pub answer_margin_ms: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { message_mb: 4, plans: 16, uploads_mb: 2048, uploads_mb_per_client: 1024, answer_margin_ms: 20 }
    }
}

impl Config {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, is not valid, or has a value out of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Unreadable { path: path.to_owned(), source })?;
        let mut config: Self = toml::from_str(&text)
            .map_err(|e| ConfigError::Invalid { path: path.to_owned(), source: Box::new(e) })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        if let Some(tls) = &mut config.tls {
            for file in [&mut tls.certificate, &mut tls.key].into_iter().chain(&mut tls.client_ca) {
                *file = folder.join(&*file);
            }
        }
        Ok(config)
    }

    /// Checks what no type does.
    ///
    /// # Errors
    /// A value is out of range, or the address is open to other machines without TLS and without `allow_plaintext`.
    pub fn check(&self, allow_plaintext: bool) -> Result<(), ConfigError> {
        let Limits { message_mb, plans, uploads_mb, uploads_mb_per_client, .. } = self.limits;
        let ranges = [
            ("limits.message_mb", message_mb, 1..=1024, "from 1 to 1024"),
            ("limits.plans", plans, 1..=MOST_PLANS, "from 1 to 32"),
            ("limits.uploads_mb", uploads_mb, 1..=1 << 20, "from 1 to 1048576"),
            (
                "limits.uploads_mb_per_client",
                uploads_mb_per_client,
                1..=uploads_mb,
                "from 1 to `limits.uploads_mb`",
            ),
        ];
        for (key, value, allowed, range) in ranges {
            if !allowed.contains(&value) {
                return Err(ConfigError::OutOfRange { key, value, range });
            }
        }
        if self.tls.is_none() && !allow_plaintext && !self.listen.ip().is_loopback() {
            return Err(ConfigError::Plaintext(self.listen));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_other_machines_need_tls_or_the_flag() {
        let at = |listen: &str| Config { listen: listen.parse().unwrap(), ..Config::default() };
        for open in ["0.0.0.0:1", "[::]:1", "192.168.1.2:50051"] {
            let refused = at(open).check(false).unwrap_err().to_string();
            assert!(refused.contains(open) && refused.contains("--allow-plaintext"), "{refused}");
            at(open).check(true).unwrap();
        }
        for own in ["127.0.0.1:1", "127.1.2.3:1", "[::1]:1"] {
            at(own).check(false).unwrap();
        }
        let file = || PathBuf::from("x.pem");
        let tls = TlsFiles { certificate: file(), key: file(), client_ca: None };
        Config { tls: Some(tls), ..at("0.0.0.0:1") }.check(false).unwrap();
    }

    #[test]
    fn limits_are_checked() {
        let limits = Limits { uploads_mb_per_client: 4096, ..Limits::default() };
        let refused = Config { limits, ..Config::default() }.check(false).unwrap_err();
        assert!(refused.to_string().contains("`limits.uploads_mb_per_client` is 4096"), "{refused}");
        let limits = Limits { plans: 0, ..Limits::default() };
        assert!(Config { limits, ..Config::default() }.check(false).is_err());
    }

    #[test]
    fn files_are_relative_to_the_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("gateway.toml");
        let text =
            "listen = \"0.0.0.0:7\"\n[tls]\ncertificate = \"a.pem\"\nkey = \"/b.pem\"\n[limits]\nplans = 3\n";
        std::fs::write(&path, text).unwrap();
        let config = Config::load(&path).unwrap();
        let tls = config.tls.unwrap();
        assert_eq!((tls.certificate, tls.key), (folder.path().join("a.pem"), PathBuf::from("/b.pem")));
        assert_eq!((config.limits.plans, config.limits.message_mb), (3, 4));
        std::fs::write(&path, "[limits]\nplan = 3\n").unwrap();
        let refused = Config::load(&path).unwrap_err().to_string();
        assert!(refused.contains("gateway.toml") && refused.contains("plan"), "{refused}");
    }
}
