//! The port thread: waits for requests, copies them, hands them to the dispatcher, and sends. It never plans.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::headers::RequestKind;
use sbdp_ipc::layout::{MAX_CLIENTS, PLAN_ACTIVE_REQUESTS, PLAN_REQUEST};
use sbdp_ipc::polling::Polling;
use sbdp_ipc::services::{Active, ServerPort};

use super::DaemonError;
use super::dispatcher::Dispatcher;
use super::events::{Event, Incoming};
use super::jobs::AdmitJob;
use super::lease::Lease;
use super::metrics::HostStatus;
use super::metrics_socket::MetricsSocket;
use super::place::DaemonPlace;
use super::planning::Planning;
use super::ports::{ActiveLink, Ports};
use super::prefetch::{self, CloseOnDrop};
use super::request_queue::Owner;
use super::resources::{SharedMemory, raise_file_limit, resident_memory};
use super::shared_queue::Queues;
use super::supervisor::Supervisor;
use super::thread_events::{Recently, ThreadEvent, reporter, watch_signals};
use super::uploads::ticket;
use super::watchdog::{Watchdog, give_up};
use super::workers::start;
use crate::cache::CacheStatistics;
use crate::config::{Config, seconds};
use crate::service::MemoryStatistics;

/// Requests taken from one port before workers' reports are read again. It is the number of requests that may be
/// active: iceoryx2 asks the clients' ports in the same order each time, and with fewer the last ones would starve.
const RECEIVE_AT_ONCE: usize = (MAX_CLIENTS + 1) * PLAN_ACTIVE_REQUESTS;

/// The time between two removals of files that clients of dead daemons left.
const SWEEP: Duration = Duration::from_secs(60);

/// Runs the daemon until SIGTERM or SIGINT.
///
/// # Errors
/// The place is taken, or shared memory cannot be set up.
pub fn run<P: Planning>(config: &Config, service: Arc<P>) -> Result<(), DaemonError> {
    run_reloading(
        config,
        service,
        Box::new(|| Err("there is no configuration file to read again".to_owned())),
    )
}

/// Reads the configuration again.
pub type Reload = Box<dyn Fn() -> Result<Config, String>>;

/// Runs the daemon until SIGTERM or SIGINT; at SIGHUP it takes over what `reload` gives.
///
/// # Errors
/// The place is taken, or shared memory cannot be set up.
pub fn run_reloading<P: Planning>(
    config: &Config,
    service: Arc<P>,
    reload: Reload,
) -> Result<(), DaemonError> {
    raise_file_limit();
    let mut shared_memory = SharedMemory::default();
    shared_memory.look();
    let place = DaemonPlace::of(&config.endpoint)?;
    let lease = Lease::take(place.clone())?;
    let queues = Queues::new(config);
    // The preparation begins first, so that it works while the ports are opened. A failure below ends it.
    let _closing = CloseOnDrop(Arc::clone(&queues.prefetch));
    if config.cache.prefetch {
        prefetch::start(&queues.prefetch, &service)
            .map_err(|source| DaemonError::System { what: "starting workers", source })?;
    }
    let watchdog = watch(config, &place)?;
    let ports = Ports::open(&lease.instance.iceoryx2_config()?)?;
    lease.instance.close_to_others()?;
    let (sender, thread_events) = channel();
    watch_signals(&ports, sender.clone())?;
    start(config.workers.count, &queues, &service, &reporter(&ports, sender))
        .map_err(|source| DaemonError::System { what: "starting workers", source })?;
    for path in &config.preload.assemblies {
        if queues.admissions.push(ticket(Owner::default(), 0), AdmitJob::Preload(path.clone())).is_err() {
            tracing::warn!(path = %path.display(), "not preloaded: the list is too long");
        }
    }
    let metrics =
        config.metrics.socket.as_ref().map(|path| MetricsSocket::serve(&place.runtime_dir.join(path)));
    let metrics = metrics
        .transpose()
        .map_err(|source| DaemonError::System { what: "opening the metrics socket", source })?;
    let remembered = service.remembered();
    let dispatcher = Dispatcher::new(service, queues, config);
    lease.publish()?;
    let supervisor = Supervisor::of_this_process();
    supervisor.ready();
    log_start(config, &place, &lease, remembered.as_ref());
    let limits = ReceiveLimits::of(config);
    let tick = seconds(config.times.tick_s);
    let polling = Polling::new(config.times.poll());
    let config = config.clone();
    let next_sweep = Instant::now() + SWEEP;
    let event_loop = EventLoop {
        ports,
        dispatcher,
        thread_events,
        recently: Recently::default(),
        tick,
        polling,
        limits,
        config,
        reload,
        metrics,
        supervisor,
        watchdog,
        shared_memory,
        lease: &lease,
        next_sweep,
    };
    event_loop.run();
    tracing::info!("all requests are answered; sbdpd ends");
    Ok(())
}

/// Logs what was started, and what is remembered from earlier.
fn log_start(config: &Config, place: &DaemonPlace, lease: &Lease, remembered: Option<&MemoryStatistics>) {
    let store = remembered.map(|remembered| &remembered.records).filter(|records| records.on_disk);
    let folder = store.and_then(|records| records.folder.as_ref());
    let mebibytes = |bytes: u64| format!("{:.1}", bytes as f64 / f64::from(1 << 20));
    tracing::info!(
        version = crate::BUILD,
        pid = std::process::id(),
        workers = config.workers.count,
        threads_per_request = config.workers.threads_per_request,
        cache = folder.map_or_else(|| "in memory".to_owned(), |folder| folder.display().to_string()),
        cache_mb = store.map(|records| mebibytes(records.file_bytes + records.field_file_bytes)),
        cache_records = store.map(CacheStatistics::disk_records),
        runtime_dir = %place.runtime_dir.display(),
        prefix = lease.instance.prefix,
        "sbdpd is ready"
    );
}

/// Watches the port thread, and ends this daemon if it stands still.
fn watch(config: &Config, place: &DaemonPlace) -> Result<Watchdog, DaemonError> {
    let limit = seconds(config.times.hang_s);
    let place = place.runtime_dir.display().to_string();
    Watchdog::start(limit, move || give_up(limit, &place))
        .map_err(|source| DaemonError::System { what: "starting the watchdog", source })
}

/// The longest payloads that are copied at all.
#[derive(Debug, Clone, Copy)]
struct ReceiveLimits {
    upload: u64,
}

impl ReceiveLimits {
    fn of(config: &Config) -> Self {
        Self { upload: config.requests.max_upload_mb.saturating_mul(1 << 20) }
    }
}

/// How many of the waiting requests were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Taken {
    /// There were none.
    Nothing,
    /// All.
    All,
    /// As many as are taken at once; there may be more.
    Batch,
}

struct EventLoop<'l, P> {
    lease: &'l Lease,
    next_sweep: Instant,
    watchdog: Watchdog,
    shared_memory: SharedMemory,
    ports: Ports,
    dispatcher: Dispatcher<ActiveLink, P>,
    thread_events: Receiver<ThreadEvent>,
    recently: Recently,
    tick: Duration,
    polling: Polling,
    limits: ReceiveLimits,
    config: Config,
    reload: Reload,
    metrics: Option<MetricsSocket>,
    supervisor: Supervisor,
}

impl<P: Planning> EventLoop<'_, P> {
    fn run(mut self) {
        let mut next_tick = Instant::now() + self.tick;
        loop {
            let received = self.receive_all();
            self.read_thread_events();
            self.dispatcher.settle(Instant::now());
            self.deliver();
            self.supervisor.alive();
            self.watchdog.beat();
            if self.dispatcher.is_closed() {
                return;
            }
            if Instant::now() >= next_tick {
                self.tick();
                let tick = self.supervisor.patience().map_or(self.tick, |p| p.min(self.tick));
                next_tick = Instant::now() + tick;
                continue;
            }
            match received {
                Taken::Nothing => self.wait(next_tick),
                // A client that was answered may send its next request at once.
                Taken::All if !self.is_asked_again() => self.wait(next_tick),
                Taken::All | Taken::Batch => {}
            }
        }
    }

    fn tick(&mut self) {
        // Only this notices a killed client and frees its memory.
        let _ = self.ports.node.try_cleanup_dead_nodes();
        self.ports.forget_owners();
        if Instant::now() >= self.next_sweep {
            self.next_sweep = Instant::now() + SWEEP;
            self.lease.sweep();
        }
        self.look_around();
        if let Some(metrics) = &self.metrics {
            metrics.update(self.dispatcher.metrics().prometheus());
        }
    }

    /// Updates the host's figures in the dispatcher.
    fn look_around(&mut self) {
        let (connections, clients) = self.ports.clients();
        let shared_memory_free = self.shared_memory.look();
        let resident = resident_memory();
        self.dispatcher.host = HostStatus { connections, clients, resident, shared_memory_free };
    }

    /// Polls for the next request for a moment.
    fn is_asked_again(&mut self) -> bool {
        // A broken port reports its error when the request is received.
        self.polling.look(|| self.ports.plan.has_requests().unwrap_or(true))
    }

    fn wait(&self, next_tick: Instant) {
        let now = Instant::now();
        let until = self.dispatcher.next_deadline(now).map_or(next_tick, |d| d.min(next_tick));
        let timeout = self.recently.patience(now, until.saturating_duration_since(now));
        if let Err(error) = self.ports.listener.timed_wait(|_| {}, timeout) {
            // A signal, or a broken listener: the pause keeps the loop from spinning.
            tracing::debug!(%error, "waiting was interrupted");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    fn read_thread_events(&mut self) {
        while let Ok(event) = self.thread_events.try_recv() {
            let event = match event {
                ThreadEvent::Worker(event) => {
                    self.recently.heard(Instant::now());
                    Event::Worker(event)
                }
                ThreadEvent::Terminate => {
                    self.supervisor.stopping();
                    Event::Terminate
                }
                ThreadEvent::Reload => {
                    self.reload();
                    continue;
                }
            };
            self.dispatcher.handle(event, Instant::now());
        }
    }

    fn reload(&mut self) {
        self.supervisor.reloading(false);
        match (self.reload)() {
            Ok(config) => {
                for key in self.config.restart_needed(&config) {
                    tracing::warn!(key, "changed in the configuration, which only a restart puts in force");
                }
                self.dispatcher.reload(&config);
                self.tick = seconds(config.times.tick_s);
                self.polling = Polling::new(config.times.poll());
                self.limits = ReceiveLimits::of(&config);
                tracing::info!("the configuration was read again");
            }
            Err(error) => tracing::warn!(error, "the configuration stays as it was"),
        }
        self.supervisor.reloading(true);
    }

    fn receive_all(&mut self) -> Taken {
        let mut received = Taken::Nothing;
        for geometry in [false, true] {
            let port = if geometry { &self.ports.geometry } else { &self.ports.plan };
            // The requests that are here now come before the next ones of clients that are answered first.
            let taken: Vec<Active> = std::iter::from_fn(|| receive(port)).take(RECEIVE_AT_ONCE).collect();
            received = received.max(match taken.len() {
                0 => Taken::Nothing,
                RECEIVE_AT_ONCE => Taken::Batch,
                _ => Taken::All,
            });
            for active in taken {
                let owner = self.ports.owner_of(active.origin().value(), geometry);
                let refuse = |length| self.dispatcher.uploads.refusal(owner, length);
                let event = read(active, owner, geometry, self.limits, refuse);
                if matches!(event, Event::Metrics(_)) {
                    self.look_around();
                }
                self.dispatcher.handle(event, Instant::now());
                // A response does not wait for the requests behind it.
                self.deliver();
            }
        }
        received
    }

    fn deliver(&mut self) {
        for sample in self.dispatcher.outgoing.samples.drain(..) {
            if let Err(error) = self.ports.progress.send_copy(sample) {
                tracing::debug!(%error, "progress lost");
            }
        }
        self.dispatcher.outgoing.wakes.sort_unstable();
        self.dispatcher.outgoing.wakes.dedup();
        self.ports.wake(&self.dispatcher.outgoing.wakes);
        self.dispatcher.outgoing.wakes.clear();
    }
}

fn receive(port: &ServerPort) -> Option<Active> {
    port.receive().unwrap_or_else(|error| {
        tracing::warn!(%error, "a request could not be received");
        None
    })
}

/// Copies a request out of shared memory: the client may change it after sending. `refuse` is asked about an upload
/// of that many bytes before they are copied, so that refused uploads take no memory.
fn read(
    active: Active,
    owner: Owner,
    geometry: bool,
    limits: ReceiveLimits,
    refuse: impl FnOnce(usize) -> Option<WireError>,
) -> Event<ActiveLink> {
    let header = *active.user_header();
    let length = active.payload().len();
    let limit = if geometry { limits.upload } else { PLAN_REQUEST as u64 };
    let kind = RequestKind::from_wire(header.kind);
    let error = if length as u64 > limit {
        let message = format!("{length} bytes are more than the {limit} that this daemon takes");
        Some(WireError::new(ErrorCode::TooLarge, message))
    } else if geometry && matches!(kind, Some(RequestKind::Upload | RequestKind::Revise)) {
        refuse(length)
    } else {
        None
    };
    let payload =
        if error.is_none() { AlignedBytes::copy_of(active.payload()) } else { AlignedBytes::default() };
    let client = active.origin().value();
    let incoming = Incoming { link: ActiveLink(active), client, owner, header, payload };
    if let Some(error) = error {
        return Event::Unusable(incoming, error);
    }
    match (geometry, kind) {
        (false, Some(RequestKind::Plan)) => Event::Plan(incoming),
        (false, Some(RequestKind::Control)) => Event::Control(incoming),
        (false, Some(RequestKind::Status)) => Event::Status(incoming),
        (false, Some(RequestKind::Metrics)) => Event::Metrics(incoming),
        (true, Some(RequestKind::Have)) => Event::Have(incoming),
        (true, Some(RequestKind::Upload)) => Event::Upload(incoming),
        (true, Some(RequestKind::Revise)) => Event::Revise(incoming),
        _ => {
            let message = format!("no request of kind {} is known here", header.kind);
            Event::Unusable(incoming, WireError::new(ErrorCode::Malformed, message))
        }
    }
}
