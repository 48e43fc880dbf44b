//! The daemon's configuration. `config/default.toml` explains every key.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sbdp_ipc::polling;
use serde::Deserialize;

use crate::cache::CacheSettings;

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
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
    /// A value is out of range, and where.
    #[error("{path}, line {line}: {source}")]
    AtLine {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong there.
        source: Box<ConfigError>,
    },
    /// A value is out of range.
    #[error("`{key}` is {value}, but must be {range}")]
    OutOfRange {
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// What it may be.
        range: &'static str,
    },
}

/// The whole configuration.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Where clients find the daemon.
    pub endpoint: EndpointConfig,
    /// The workers.
    pub workers: WorkersConfig,
    /// Limits of requests.
    pub requests: RequestsConfig,
    /// Housekeeping and shutting down.
    pub times: TimesConfig,
    /// The cache.
    pub cache: CacheConfig,
    /// Assemblies to load at start.
    pub preload: PreloadConfig,
    /// Logging.
    pub log: LogConfig,
    /// Where metrics are published.
    pub metrics: MetricsConfig,
}

/// Where clients find the daemon.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EndpointConfig {
    /// Folder of the lock file and `daemon.json`.
    pub runtime_dir: Option<PathBuf>,
    /// Prefix of all files in shared memory.
    pub prefix: Option<String>,
    /// Folder of iceoryx2's files.
    pub root: Option<PathBuf>,
}

/// The workers.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorkersConfig {
    /// Requests planned at the same time.
    pub count: usize,
    /// Threads that one request may use; 0 for all cores.
    pub threads_per_request: usize,
}

/// Limits of requests.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RequestsConfig {
    /// Plan requests that may wait for a worker.
    pub queue: usize,
    /// Those of one client (a process).
    pub waiting_per_client: usize,
    /// Plans of one client that are worked on at once; 0 for all workers but one.
    pub working_per_client: usize,
    /// Seconds of workers' time per minute that one client may have; 0 for no limit.
    pub work_s_per_client: f64,
    /// Megabytes that one upload may have.
    pub max_upload_mb: u64,
    /// Megabytes of uploads that may wait for admission.
    pub uploads_mb: u64,
    /// Those of one client.
    pub uploads_mb_per_client: u64,
    /// Megabytes of a plan that may wait for a client to read.
    pub outbox_mb: u64,
    /// Seconds that a client may leave a waiting plan unread.
    pub slow_reader_s: f64,
}

/// Housekeeping and shutting down.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimesConfig {
    /// Seconds between two checks for dead clients.
    pub tick_s: f64,
    /// Seconds that running requests get at SIGTERM before they are cancelled.
    pub grace_s: f64,
    /// Seconds that cancelled requests then get to be answered.
    pub drain_s: f64,
    /// Seconds after which a daemon that stands still ends itself.
    pub hang_s: f64,
    /// Microseconds for which the daemon polls for the next request before it sleeps; 0 for none.
    pub poll_us: u64,
}

/// The cache.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CacheConfig {
    /// Whether there is a store on disk.
    pub disk: bool,
    /// Its folder.
    pub dir: Option<PathBuf>,
    /// Megabytes that its file may have.
    pub disk_mb: u64,
    /// Megabytes of memory for all that is remembered; see [`CacheConfig::memory`].
    pub memory_mb: u64,
    /// Whether likely requests are prepared while the workers are idle.
    pub prefetch: bool,
    /// Seconds of idle time for planning likely requests after each plan.
    pub speculation_s: u64,
}

/// How the memory is divided, in bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryBudget {
    /// All that is remembered. Assemblies, with their distance fields and what else is derived from them, have
    /// what the others leave.
    pub all: usize,
    /// Of these, at most for records: pairs, motions, verified paths, plans.
    pub records: usize,
    /// Of these, at most for answers, as they were sent.
    pub answers: usize,
}

/// Assemblies to load at start.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PreloadConfig {
    /// Folders and files, as `sbdp plan` takes them.
    pub assemblies: Vec<PathBuf>,
}

/// Logging.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// The format of a line.
    pub format: LogFormat,
    /// Which lines; the environment variable `SBDP_LOG` takes precedence.
    pub filter: String,
}

/// Where metrics are published.
#[derive(Debug, Clone, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MetricsConfig {
    /// A Unix socket for Prometheus; relative to the runtime folder. None for none.
    pub socket: Option<PathBuf>,
}

/// The format of a log line.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// Text for people.
    #[default]
    Text,
    /// One JSON object per line.
    Json,
}

impl Default for WorkersConfig {
    fn default() -> Self {
        Self { count: 2, threads_per_request: 0 }
    }
}

impl Default for RequestsConfig {
    fn default() -> Self {
        Self {
            queue: 64,
            waiting_per_client: 8,
            working_per_client: 0,
            work_s_per_client: 0.0,
            max_upload_mb: 1024,
            uploads_mb: 2048,
            uploads_mb_per_client: 1024,
            outbox_mb: 64,
            slow_reader_s: 60.0,
        }
    }
}

impl Default for TimesConfig {
    fn default() -> Self {
        Self {
            tick_s: 1.0,
            grace_s: 2.0,
            drain_s: 10.0,
            hang_s: 30.0,
            poll_us: polling::USUAL.as_micros() as u64,
        }
    }
}

impl TimesConfig {
    /// How long the daemon polls for the next request before it sleeps.
    #[must_use]
    pub fn poll(&self) -> Duration {
        Duration::from_micros(self.poll_us)
    }
}

impl Default for CacheConfig {
    fn default() -> Self {
        Self { disk: true, dir: None, disk_mb: 1024, memory_mb: 256, prefetch: true, speculation_s: 10 }
    }
}

impl CacheConfig {
    /// Of the memory, half is for what is remembered: at most two sixteenths for records and one for answers,
    /// what these leave for assemblies, which come back from disk most easily. The rest is for requests under
    /// way, for the pages of the store, and for what the allocator cannot give back.
    #[must_use]
    pub fn memory(&self) -> MemoryBudget {
        let all = usize::try_from(self.memory_mb.saturating_mul(1 << 20)).unwrap_or(usize::MAX);
        MemoryBudget { all: all / 2, records: all / 16 * 2, answers: all / 16 }
    }

    /// The idle time for planning likely requests after a plan.
    #[must_use]
    pub fn speculation(&self) -> Duration {
        Duration::from_secs(if self.prefetch { self.speculation_s } else { 0 })
    }

    /// The limits of the cache.
    #[must_use]
    pub fn settings(&self) -> CacheSettings {
        let folder = self.dir.clone().or_else(CacheSettings::default_folder).filter(|_| self.disk);
        CacheSettings {
            folder,
            memory_bytes: self.memory().records,
            disk_bytes: self.disk_mb.saturating_mul(1 << 20),
        }
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { format: LogFormat::Text, filter: "info".to_owned() }
    }
}

impl Config {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// It cannot be read, has an unknown key or a value out of range.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ConfigError::Unreadable { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads and checks a text; `path` is where it came from.
    ///
    /// # Errors
    /// It has an unknown key or a value out of range.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let config: Self = toml::from_str(text)
            .map_err(|e| ConfigError::Invalid { path: path.to_owned(), source: Box::new(e) })?;
        config.check().map_err(|error| at_line(error, text, path))?;
        Ok(config)
    }

    /// The first level of keys whose values only a restart changes, of those that differ.
    #[must_use]
    pub fn restart_needed(&self, other: &Self) -> Vec<&'static str> {
        let same = [
            ("endpoint", self.endpoint == other.endpoint),
            ("workers", self.workers == other.workers),
            ("cache", self.cache == other.cache),
            ("preload", self.preload == other.preload),
            ("log", self.log == other.log),
            ("metrics", self.metrics == other.metrics),
        ];
        same.into_iter().filter(|(_, same)| !same).map(|(key, _)| key).collect()
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// A value is out of range.
    pub fn check(&self) -> Result<(), ConfigError> {
        within("workers.count", self.workers.count, 1..=256, "1 to 256")?;
        within("workers.threads_per_request", self.workers.threads_per_request, 0..=1024, "0 to 1024")?;
        within("requests.queue", self.requests.queue, 1..=4096, "1 to 4096")?;
        within("requests.waiting_per_client", self.requests.waiting_per_client, 1..=4096, "1 to 4096")?;
        within("requests.working_per_client", self.requests.working_per_client, 0..=256, "0 to 256")?;
        within("requests.work_s_per_client", self.requests.work_s_per_client, 0.0..=86_400.0, "0 to 86400")?;
        within("requests.uploads_mb", self.requests.uploads_mb, 1..=65_536, "1 to 65536")?;
        let own = self.requests.uploads_mb_per_client;
        within("requests.uploads_mb_per_client", own, 1..=65_536, "1 to 65536")?;
        within("requests.max_upload_mb", self.requests.max_upload_mb, 1..=65_536, "1 to 65536")?;
        within("requests.outbox_mb", self.requests.outbox_mb, 1..=65_536, "1 to 65536")?;
        within("requests.slow_reader_s", self.requests.slow_reader_s, 0.1..=86_400.0, "0.1 to 86400")?;
        within("cache.disk_mb", self.cache.disk_mb, 16..=1_048_576, "16 to 1048576")?;
        within("cache.memory_mb", self.cache.memory_mb, 0..=1_048_576, "0 to 1048576")?;
        within("cache.speculation_s", self.cache.speculation_s, 0..=86_400, "0 to 86400")?;
        within("times.tick_s", self.times.tick_s, 0.05..=60.0, "0.05 to 60")?;
        within("times.grace_s", self.times.grace_s, 0.0..=3600.0, "0 to 3600")?;
        within("times.drain_s", self.times.drain_s, 0.1..=3600.0, "0.1 to 3600")?;
        within("times.poll_us", self.times.poll_us, 0..=10_000, "0 to 10000")?;
        within("times.hang_s", self.times.hang_s, 1.0..=3600.0, "1 to 3600")?;
        let least = 2.0 * self.times.tick_s;
        within("times.hang_s", self.times.hang_s, least..=f64::MAX, "at least twice `times.tick_s`")
    }
}

/// An error about a key, with the line where the key is.
fn at_line(error: ConfigError, text: &str, path: &Path) -> ConfigError {
    let line = match &error {
        ConfigError::OutOfRange { key, .. } => line_of(text, key),
        _ => None,
    };
    match line {
        Some(line) => ConfigError::AtLine { path: path.to_owned(), line, source: Box::new(error) },
        None => error,
    }
}

/// The line, from 1, where a file gives `table.key`, in whichever way.
fn line_of(text: &str, wanted: &str) -> Option<usize> {
    let (wanted_table, wanted_key) = wanted.split_once('.')?;
    let mut table = String::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if let Some(name) = line.strip_prefix('[') {
            table = name.split(']').next().unwrap_or_default().trim().to_owned();
            continue;
        }
        let Some((key, value)) = line.split_once('=') else { continue };
        let key: String = key.chars().filter(|c| !c.is_whitespace() && *c != '"').collect();
        let inline = table.is_empty() && key == wanted_table && value.contains(wanted_key);
        if inline || (table == wanted_table && key == wanted_key) || (table.is_empty() && key == wanted) {
            return Some(number + 1);
        }
    }
    None
}

fn within<T: PartialOrd + ToString>(
    key: &'static str,
    value: T,
    allowed: std::ops::RangeInclusive<T>,
    range: &'static str,
) -> Result<(), ConfigError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(ConfigError::OutOfRange { key, value: value.to_string(), range })
}

/// Seconds of the configuration, which `check` has found to be in range.
#[must_use]
pub fn seconds(value: f64) -> Duration {
    Duration::try_from_secs_f64(value).unwrap_or(Duration::from_secs(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_explained_defaults_are_the_defaults() {
        let explained: Config = toml::from_str(include_str!("../config/default.toml")).unwrap();
        assert_eq!(explained, Config::default());
        explained.check().unwrap();
    }

    #[test]
    fn the_memory_is_shared_out_with_some_to_spare() {
        let MemoryBudget { all, records, answers } = CacheConfig::default().memory();
        assert_eq!([all, records, answers].map(|bytes| bytes >> 20), [128, 32, 16]);
    }

    #[test]
    fn an_unknown_key_is_named() {
        let error = toml::from_str::<Config>("[workers]\ncuont = 3\n").unwrap_err();
        assert!(error.to_string().contains("cuont"), "{error}");
    }

    #[test]
    fn a_value_out_of_range_is_found_in_its_line() {
        for (text, line) in [
            ("# a\n[times]\ntick_s = 0.0\n", 3),
            ("times.tick_s = 99\n", 1),
            ("\n\ntimes = { tick_s = 99 }\n", 3),
            ("[workers]\ncount = 1\n[times]\n\n  tick_s=-1\n", 5),
        ] {
            let error = Config::parse(text, Path::new("a.toml")).unwrap_err().to_string();
            assert!(error.contains(&format!("a.toml, line {line}: `times.tick_s`")), "{error}");
        }
        let error = Config::parse("[workers]\ncuont = 1\n", Path::new("a.toml")).unwrap_err().to_string();
        assert!(error.contains("line 2"), "{error}");
    }

    #[test]
    fn what_needs_a_restart_is_told() {
        let mut other = Config::default();
        other.requests.queue = 1;
        other.times.tick_s = 2.0;
        assert!(Config::default().restart_needed(&other).is_empty());
        other.workers.count = 7;
        assert_eq!(Config::default().restart_needed(&other), ["workers"]);
    }

    #[test]
    fn a_value_out_of_range_is_named() {
        let config: Config = toml::from_str("[times]\ntick_s = nan\n").unwrap();
        assert!(config.check().unwrap_err().to_string().contains("times.tick_s"));
    }
}
