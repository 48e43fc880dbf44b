//! The ports to one daemon process.

use std::ops::Deref;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use iceoryx2::node::Node;
use iceoryx2::port::listener::{Listener, ListenerCreateError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::{BackpressureAction, BackpressureInfo};
use iceoryx2::service::port_factory::client::ClientCreateError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use sbdp_ipc::Transport;
use sbdp_ipc::endpoint::Endpoint;
use sbdp_ipc::layout::{self, WAKE_CLIENT_SERVICE, WAKE_SERVER_SERVICE};
use sbdp_ipc::polling::Polling;
use sbdp_ipc::progress::ProgressSample;
use sbdp_ipc::services::{self, ClientPort, ExchangeService, Pending, SetupError};

use crate::error::ClientError;

/// Longest sleep between two polls of the port: a lost wake-up costs at most this.
pub(crate) const SLICE: Duration = Duration::from_millis(200);
/// The same where the caller may interrupt: Ctrl-C must take effect within 100 ms.
pub(crate) const INTERRUPTIBLE: Duration = Duration::from_millis(50);
/// Bytes of the longest request through the port of short questions: a part with another mesh is mostly smaller, and
/// to make a port takes as long as to take in such a mesh. Of memory that was never written to, there is none.
pub(crate) const ASKED: usize = 256 * 1024;
/// Pause before a failed attempt is repeated.
pub(crate) const RETRY: Duration = Duration::from_millis(2);

/// A daemon process whose end can be detected with one system call.
#[derive(Debug)]
struct Watched {
    endpoint: Endpoint,
    /// Readable once the process has ended; `None` where the system does not support it.
    process: Option<OwnedFd>,
}

impl Watched {
    fn new(endpoint: Endpoint) -> Self {
        let pid = i32::try_from(endpoint.pid).ok().and_then(Pid::from_raw);
        let process = pid.and_then(|pid| pidfd_open(pid, PidfdFlags::empty()).ok());
        Self { endpoint, process }
    }

    fn is_alive(&self) -> bool {
        let Some(process) = &self.process else { return self.endpoint.is_alive() };
        match poll(&mut [PollFd::new(process, PollFlags::IN)], Some(&Timespec::default())) {
            Ok(ended) => ended == 0,
            Err(_) => self.endpoint.is_alive(),
        }
    }
}

/// All ports to one daemon process. Each daemon has shared memory of its own, also one that was restarted at
/// the same place: whatever came through these ports came from this process, and when it has ended nothing
/// more comes.
#[derive(Debug)]
pub(crate) struct Connection {
    daemon: Watched,
    polling: Mutex<Polling>,
    pub(crate) plan: ClientPort,
    ask: ClientPort,
    /// Held while a request is written to a port that stays: one may be loaned at a time.
    writing: Mutex<()>,
    geometry: ExchangeService,
    pub(crate) progress: Subscriber<Transport, ProgressSample, ()>,
    listener: Listener<Transport>,
    sleepers: Mutex<Sleepers>,
    woken: Condvar,
    notifier: Notifier<Transport>,
    _node: Node<Transport>,
}

/// The threads that wait for the daemon. One of them sleeps on the listener and, when woken, wakes all others, because
/// what the daemon sent may be for any of them.
#[derive(Debug, Default)]
struct Sleepers {
    is_watched: bool,
    wakes: u64,
}

/// Which port a request goes through.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Through {
    /// The one of plans.
    Plan,
    /// The one of short questions and small meshes.
    Ask,
    /// For so many bytes of meshes. If they are many, one of its own, whose memory goes back to the system when the
    /// request is over.
    Upload(usize),
}

/// A port that is there, or was made for one request.
#[derive(Debug)]
pub(crate) enum Port<'c> {
    Kept(&'c ClientPort),
    Own(ClientPort),
}

impl Deref for Port<'_> {
    type Target = ClientPort;

    fn deref(&self) -> &ClientPort {
        match self {
            Self::Kept(port) => port,
            Self::Own(port) => port,
        }
    }
}

impl Connection {
    /// Opens the ports to the daemon that is published in a folder.
    ///
    /// # Errors
    /// There is no daemon, it ended meanwhile, it speaks another version, or it has too many clients.
    pub(crate) fn open(runtime_dir: &Path, poll: Duration) -> Result<Self, ClientError> {
        let endpoint = Endpoint::find(runtime_dir)?;
        let pid = endpoint.pid;
        Self::to(endpoint.clone(), poll).map_err(|error| {
            // A daemon that leaves takes its files along, at any moment of this.
            let is_there = Endpoint::find(runtime_dir).is_ok_and(|found| found == endpoint);
            if is_there { error } else { ClientError::DaemonDied { pid } }
        })
    }

    fn to(endpoint: Endpoint, poll: Duration) -> Result<Self, ClientError> {
        let mut config = layout::iceoryx2_config(&endpoint.prefix, &endpoint.root)?;
        // The daemon looks after the dead; what a dead one left in a bad state is not to stop a client.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        let node = services::node(&config)?;

        let wake_client = services::wake(&node, WAKE_CLIENT_SERVICE)?;
        let wake_server = services::wake(&node, WAKE_SERVER_SERVICE)?;
        let plan = services::plan(&node)?.open().map_err(SetupError::at("opening `plan`"))?;
        let geometry = services::geometry(&node)?.open().map_err(SetupError::at("opening `geometry`"))?;
        let progress = services::progress(&node)?.open().map_err(SetupError::at("opening `progress`"))?;
        let wake_client = wake_client.open().map_err(SetupError::at("opening `wake/client`"))?;
        let wake_server = wake_server.open().map_err(SetupError::at("opening `wake/server`"))?;

        Ok(Self {
            plan: client_port(&plan, layout::PLAN_REQUEST)?,
            ask: client_port(&geometry, ASKED)?,
            writing: Mutex::new(()),
            geometry,
            progress: progress.subscriber_builder().create().map_err(|e| match e {
                SubscriberCreateError::ExceedsMaxSupportedSubscribers => ClientError::TooManyClients,
                e => SetupError::at("subscribing to progress")(e).into(),
            })?,
            listener: wake_client.listener_builder().create().map_err(|e| match e {
                ListenerCreateError::ExceedsMaxSupportedListeners => ClientError::TooManyClients,
                e => SetupError::at("creating the listener")(e).into(),
            })?,
            sleepers: Mutex::new(Sleepers::default()),
            woken: Condvar::new(),
            notifier: wake_server
                .notifier_builder()
                .create()
                .map_err(SetupError::at("creating the notifier"))?,
            daemon: Watched::new(endpoint),
            polling: Mutex::new(Polling::new(poll)),
            _node: node,
        })
    }

    pub(crate) fn pid(&self) -> u32 {
        self.daemon.endpoint.pid
    }

    pub(crate) fn is_alive(&self) -> bool {
        self.daemon.is_alive()
    }

    /// Fails if the daemon is gone: then nothing will be answered any more.
    pub(crate) fn check_alive(&self) -> Result<(), ClientError> {
        if self.is_alive() { Ok(()) } else { Err(self.died()) }
    }

    pub(crate) fn died(&self) -> ClientError {
        ClientError::DaemonDied { pid: self.pid() }
    }

    /// The listener by which the daemon wakes this client.
    pub(crate) fn listener_id(&self) -> u128 {
        self.listener.id().value()
    }

    pub(crate) fn port(&self, through: Through) -> Result<Port<'_>, ClientError> {
        Ok(match through {
            Through::Plan => Port::Kept(&self.plan),
            Through::Ask => Port::Kept(&self.ask),
            Through::Upload(length) if length <= ASKED => Port::Kept(&self.ask),
            Through::Upload(length) => Port::Own(client_port(&self.geometry, length)?),
        })
    }

    pub(crate) fn wake_daemon(&self) {
        // A failed wake-up costs one tick of the daemon, no more.
        let _ = self.notifier.notify();
    }

    /// Whether the answer to what was asked just now comes within the moment that it is looked for.
    pub(crate) fn comes_at_once(&self, pending: &Pending) -> bool {
        // Of two threads that wait, one looks.
        self.polling.try_lock().is_ok_and(|mut polling| polling.look(|| pending.has_response()))
    }

    /// One request is written at a time through the ports that stay.
    pub(crate) fn begin_writing(&self) -> MutexGuard<'_, ()> {
        self.writing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How often this client was woken. A thread reads this number before it looks for data, and then sleeps only if
    /// the number is still the same.
    pub(crate) fn wakes(&self) -> u64 {
        self.sleepers().wakes
    }

    /// Sleeps until the daemon wakes this client, at most until `until` and for one slice; not at all if it was woken
    /// after `seen`.
    pub(crate) fn sleep(&self, until: Instant, seen: u64, slice: Duration) {
        let left = until.saturating_duration_since(Instant::now()).min(slice);
        let mut sleepers = self.sleepers();
        if sleepers.wakes != seen {
            return;
        }
        if sleepers.is_watched {
            let waited = self.woken.wait_timeout(sleepers, left);
            drop(waited.unwrap_or_else(PoisonError::into_inner));
            return;
        }
        sleepers.is_watched = true;
        drop(sleepers);
        if self.listener.timed_wait(|_| {}, left).is_err() {
            // Interrupted by a signal, or broken: either way the caller looks again.
            std::thread::sleep(RETRY);
        }
        let mut sleepers = self.sleepers();
        sleepers.is_watched = false;
        sleepers.wakes += 1;
        self.woken.notify_all();
    }

    fn sleepers(&self) -> MutexGuard<'_, Sleepers> {
        self.sleepers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A client port of a fixed segment that never waits for room at the daemon by itself.
fn client_port(service: &ExchangeService, longest: usize) -> Result<ClientPort, ClientError> {
    service
        .client_builder()
        .initial_max_slice_len(longest)
        .set_backpressure_handler(|_: &BackpressureInfo| BackpressureAction::DiscardDataAndFail)
        .create()
        .map_err(|e| match e {
            ClientCreateError::ExceedsMaxSupportedClients => ClientError::TooManyClients,
            e => SetupError::at("creating the client port")(e).into(),
        })
}
