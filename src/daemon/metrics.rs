//! The daemon's metrics: as JSON for `sbdp status --json`, and in the text format of Prometheus.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::time::Duration;

use sbdp_ipc::status::StatusHeader;
use serde::Serialize;

use super::prefetch::PrefetchMetrics;
use super::response_cache::ResponseCacheMetrics;
use crate::cache::KindStatistics;
use crate::service::MemoryStatistics;

/// The kinds of requests whose latencies are measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum LatencyKind {
    /// Plans made by a worker.
    Plan,
    /// Plans from the response cache.
    RememberedPlan,
    /// Uploads and revisions.
    Upload,
}

impl LatencyKind {
    fn name(self) -> &'static str {
        match self {
            Self::Plan => "plan",
            Self::RememberedPlan => "remembered_plan",
            Self::Upload => "upload",
        }
    }
}

/// Buckets for each power of two of microseconds. With eight, a percentile is off by an eighth at most.
const PER_OCTAVE: u32 = 8;
const BUCKETS: usize = 64 * PER_OCTAVE as usize;

/// A histogram of times from the reception of a request to its last byte.
#[derive(Debug, Clone)]
struct Histogram {
    counts: Vec<u64>,
    count: u64,
    sum: Duration,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; BUCKETS], count: 0, sum: Duration::ZERO }
    }
}

impl Histogram {
    fn add(&mut self, time: Duration) {
        let us = u64::try_from(time.as_micros()).unwrap_or(u64::MAX).max(1);
        let octave = us.ilog2();
        let within = ((us as f64 / 2_f64.powi(octave as i32) - 1.0) * f64::from(PER_OCTAVE)) as u32;
        let bucket = (octave * PER_OCTAVE + within.min(PER_OCTAVE - 1)) as usize;
        self.counts[bucket.min(BUCKETS - 1)] += 1;
        self.count += 1;
        self.sum = self.sum.saturating_add(time);
    }

    /// The upper end of the bucket that holds it, seconds.
    fn percentile(&self, share: f64) -> f64 {
        let wanted = (self.count as f64 * share).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (bucket, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= wanted {
                let (octave, within) = (bucket as u32 / PER_OCTAVE, bucket as u32 % PER_OCTAVE);
                let us = 2_f64.powi(octave as i32) * (1.0 + f64::from(within + 1) / f64::from(PER_OCTAVE));
                return us * 1e-6;
            }
        }
        0.0
    }
}

/// Times by kind of request, since the daemon started.
#[derive(Debug, Default)]
pub(crate) struct Latencies {
    by_kind: BTreeMap<LatencyKind, Histogram>,
}

impl Latencies {
    pub(crate) fn add(&mut self, kind: LatencyKind, time: Duration) {
        self.by_kind.entry(kind).or_default().add(time);
    }
}

/// Percentiles of one kind, seconds.
#[derive(Debug, Serialize)]
struct LatencySummary {
    count: u64,
    sum_s: f64,
    p50_s: f64,
    p90_s: f64,
    p99_s: f64,
}

/// The connections, the memory of this process, and the shared memory that is left.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct HostStatus {
    /// Connections of clients.
    pub(crate) connections: usize,
    /// Processes that these belong to.
    pub(crate) clients: usize,
    /// Bytes of memory that the process has; `None` where the system does not say.
    pub(crate) resident: Option<u64>,
    /// Bytes free in /dev/shm; `None` where it has no limit.
    pub(crate) shared_memory_free: Option<u64>,
}

/// All metrics, as `sbdp status --json` prints them.
#[derive(Debug, Serialize)]
pub(crate) struct Metrics {
    version: &'static str,
    pid: u32,
    protocol: u32,
    uptime_s: f64,
    workers: u32,
    running: u32,
    queued: u32,
    queue_limit: u32,
    /// Plan requests and uploads without an answer yet.
    open_requests: usize,
    /// Processes that are connected, and their connections.
    clients: usize,
    connections: usize,
    resident_bytes: Option<u64>,
    shared_memory_free_bytes: Option<u64>,
    requests: u64,
    done: u64,
    plans_remembered: u64,
    /// States whose blocking graphs were answered from memory.
    graphs_remembered: u64,
    cancelled: u64,
    expired: u64,
    refused: u64,
    failed: u64,
    uploads: u64,
    latency: BTreeMap<&'static str, LatencySummary>,
    preloaded: Vec<String>,
    #[serde(flatten)]
    cache: CacheMetrics,
}

/// The caches, and the preparation of likely requests.
#[derive(Debug, Default, Serialize)]
pub(crate) struct CacheMetrics {
    /// The response cache.
    pub(crate) answers: ResponseCacheMetrics,
    /// Assemblies and records in memory.
    pub(crate) remembered: Option<MemoryStatistics>,
    /// What is prepared while the workers are idle.
    pub(crate) ahead: PrefetchMetrics,
}

impl Metrics {
    pub(crate) fn of(
        n: &StatusHeader,
        open_requests: usize,
        host: HostStatus,
        latencies: &Latencies,
        preloaded: &[(String, [u8; 32])],
        cache: CacheMetrics,
    ) -> Self {
        let latency = |(kind, h): (&LatencyKind, &Histogram)| {
            let figures = LatencySummary {
                count: h.count,
                sum_s: h.sum.as_secs_f64(),
                p50_s: h.percentile(0.5),
                p90_s: h.percentile(0.9),
                p99_s: h.percentile(0.99),
            };
            (kind.name(), figures)
        };
        Self {
            version: crate::BUILD,
            pid: n.pid,
            protocol: n.protocol,
            uptime_s: n.uptime_ns as f64 * 1e-9,
            workers: n.workers,
            running: n.running,
            queued: n.queued,
            queue_limit: n.queue_limit,
            open_requests,
            clients: host.clients,
            connections: host.connections,
            resident_bytes: host.resident,
            shared_memory_free_bytes: host.shared_memory_free,
            requests: n.requests,
            done: n.done,
            plans_remembered: n.remembered,
            graphs_remembered: n.graphs_remembered,
            cancelled: n.cancelled,
            expired: n.expired,
            refused: n.refused,
            failed: n.failed,
            uploads: n.uploads,
            latency: latencies.by_kind.iter().map(latency).collect(),
            preloaded: preloaded.iter().map(|(name, _)| name.clone()).collect(),
            cache,
        }
    }

    /// One JSON object.
    pub(crate) fn json(&self) -> String {
        // Numbers and texts can always be written.
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// The text format of Prometheus, version 0.0.4.
    pub(crate) fn prometheus(&self) -> String {
        let mut text = String::new();
        let gauges = [
            ("uptime_seconds", self.uptime_s),
            ("workers", f64::from(self.workers)),
            ("workers_busy", f64::from(self.running)),
            ("requests_waiting", f64::from(self.queued)),
            ("requests_waiting_limit", f64::from(self.queue_limit)),
            ("requests_open", self.open_requests as f64),
            ("clients", self.clients as f64),
            ("connections", self.connections as f64),
            ("ahead_assemblies", self.cache.ahead.assemblies as f64),
            ("ahead_questions", self.cache.ahead.questions as f64),
        ];
        let told = [
            ("resident_bytes", self.resident_bytes),
            ("shared_memory_free_bytes", self.shared_memory_free_bytes),
        ];
        let told = told.into_iter().filter_map(|(name, bytes)| Some((name, bytes? as f64)));
        for (name, value) in gauges.into_iter().chain(told) {
            let _ = writeln!(text, "# TYPE sbdp_{name} gauge\nsbdp_{name} {value}");
        }
        let _ = writeln!(text, "# TYPE sbdp_plan_requests_total counter");
        let _ = writeln!(text, "sbdp_plan_requests_total {}", self.requests);
        let _ = writeln!(text, "# TYPE sbdp_plan_requests_ended_total counter");
        let ends = [
            ("done", self.done),
            ("cancelled", self.cancelled),
            ("expired", self.expired),
            ("refused", self.refused),
            ("failed", self.failed),
        ];
        for (end, count) in ends {
            let _ = writeln!(text, "sbdp_plan_requests_ended_total{{end=\"{end}\"}} {count}");
        }
        let (remembered, speculated) = (self.plans_remembered, self.cache.ahead.speculated);
        for (name, count) in [
            ("plans_remembered", remembered),
            ("graphs_remembered", self.graphs_remembered),
            ("questions_speculated", speculated),
            ("uploads", self.uploads),
        ] {
            let _ = writeln!(text, "# TYPE sbdp_{name}_total counter\nsbdp_{name}_total {count}");
        }
        let _ = writeln!(text, "# TYPE sbdp_request_seconds summary");
        for (kind, l) in &self.latency {
            for (quantile, value) in [("0.5", l.p50_s), ("0.9", l.p90_s), ("0.99", l.p99_s)] {
                let labels = format!("kind=\"{kind}\",quantile=\"{quantile}\"");
                let _ = writeln!(text, "sbdp_request_seconds{{{labels}}} {value}");
            }
            let _ = writeln!(text, "sbdp_request_seconds_sum{{kind=\"{kind}\"}} {}", l.sum_s);
            let _ = writeln!(text, "sbdp_request_seconds_count{{kind=\"{kind}\"}} {}", l.count);
        }
        let _ = writeln!(
            text,
            "# TYPE sbdp_answers_bytes gauge\nsbdp_answers_bytes {}",
            self.cache.answers.bytes
        );
        self.cache.remembered.iter().for_each(|remembered| cache_metrics(&mut text, remembered));
        text
    }
}

fn cache_metrics(text: &mut String, MemoryStatistics { assemblies, records }: &MemoryStatistics) {
    let gauges = [
        ("assemblies", assemblies.assemblies),
        ("assemblies_bytes", assemblies.bytes),
        ("cache_memory_bytes", records.memory_bytes),
        ("cache_file_bytes", records.file_bytes),
        ("cache_field_file_bytes", records.field_file_bytes),
        ("cache_mapped_bytes", records.mapped_bytes),
    ];
    for (name, value) in gauges {
        let _ = writeln!(text, "# TYPE sbdp_{name} gauge\nsbdp_{name} {value}");
    }
    let _ = writeln!(text, "# TYPE sbdp_cache_disk_records gauge");
    for kind in &records.kinds {
        let _ = writeln!(text, "sbdp_cache_disk_records{{kind=\"{}\"}} {}", kind.kind, kind.disk_entries);
    }
    let _ = writeln!(text, "# TYPE sbdp_assemblies_evicted_total counter");
    let _ = writeln!(text, "sbdp_assemblies_evicted_total {}", assemblies.evictions);
    let mut counter = |name: &str, value: &dyn Fn(&KindStatistics) -> u64| {
        let _ = writeln!(text, "# TYPE sbdp_cache_{name}_total counter");
        for kind in &records.kinds {
            let _ = writeln!(text, "sbdp_cache_{name}_total{{kind=\"{}\"}} {}", kind.kind, value(kind));
        }
    };
    counter("hits", &|k| k.hits);
    counter("misses", &|k| k.misses);
    counter("evictions", &|k| k.evictions);
    counter("disk_evictions", &|k| k.disk_evictions);
    counter("damaged", &|k| k.damaged);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::Service;

    #[test]
    fn percentiles_are_off_by_an_eighth_at_most() {
        let mut histogram = Histogram::default();
        (1..=10_000_u64).for_each(|us| histogram.add(Duration::from_micros(us)));
        for share in [0.5, 0.9, 0.99] {
            let (exact, found) = (share * 1e-2, histogram.percentile(share));
            assert!(found >= exact && found <= exact * 1.126, "{share}: {found} for {exact}");
        }
        histogram.add(Duration::MAX);
        histogram.add(Duration::ZERO);
        assert_eq!(histogram.count, 10_002);
        assert_eq!(Histogram::default().percentile(0.5), 0.0);
    }

    #[test]
    fn figures_are_told_as_json_and_as_prometheus_wants_them() {
        let mut latencies = Latencies::default();
        latencies.add(LatencyKind::Plan, Duration::from_millis(3));
        let numbers = StatusHeader {
            pid: 7,
            requests: 5,
            done: 4,
            refused: 1,
            graphs_remembered: 12,
            ..StatusHeader::default()
        };
        let figures = Metrics::of(
            &numbers,
            2,
            HostStatus {
                connections: 3,
                clients: 2,
                resident: Some(3 << 20),
                shared_memory_free: Some(1 << 20),
            },
            &latencies,
            &[("frame".to_owned(), [0; 32])],
            CacheMetrics {
                remembered: Some(Service::default().remembered()),
                ahead: PrefetchMetrics { assemblies: 1, questions: 3, speculated: 8 },
                ..CacheMetrics::default()
            },
        );
        let json: serde_json::Value = serde_json::from_str(&figures.json()).unwrap();
        assert_eq!((json["pid"].as_u64(), json["latency"]["plan"]["count"].as_u64()), (Some(7), Some(1)));
        assert_eq!(json["preloaded"][0], "frame");
        assert_eq!(json["ahead"]["questions"], 3);
        let text = figures.prometheus();
        for line in [
            "sbdp_plan_requests_total 5",
            "sbdp_graphs_remembered_total 12",
            "sbdp_plan_requests_ended_total{end=\"refused\"} 1",
            "sbdp_request_seconds_count{kind=\"plan\"} 1",
            "sbdp_cache_hits_total{kind=\"motion\"} 0",
            "sbdp_assemblies 0",
            "sbdp_clients 2",
            "sbdp_ahead_questions 3",
            "sbdp_questions_speculated_total 8",
            "sbdp_cache_mapped_bytes 0",
            "sbdp_resident_bytes 3145728",
            "sbdp_shared_memory_free_bytes 1048576",
            "sbdp_cache_disk_records{kind=\"motion\"} 0",
        ] {
            assert!(text.lines().any(|l| l == line), "{line} in\n{text}");
        }
        for line in text.lines().filter(|l| !l.starts_with('#')) {
            let (_, value) = line.rsplit_once(' ').unwrap();
            assert!(value.parse::<f64>().is_ok(), "{line}");
        }
    }
}
