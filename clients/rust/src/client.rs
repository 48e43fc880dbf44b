//! A connection to the daemon.

use std::cell::{Cell, RefCell};
use std::os::fd::OwnedFd;
use std::path::PathBuf;

use iceoryx2::node::Node;
use iceoryx2::port::listener::{Listener, ListenerCreateError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::port::{BackpressureAction, BackpressureInfo};
use iceoryx2::service::port_factory::client::ClientCreateError;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use sbdp_ipc::endpoint::{Endpoint, default_runtime_dir};
use sbdp_ipc::headers::RequestKind;
use sbdp_ipc::layout::{self, WAKE_CLIENT_SERVICE, WAKE_SERVER_SERVICE};
use sbdp_ipc::progress::ProgressSample;
use sbdp_ipc::services::{self, ClientPort, ExchangeService, SetupError};
use sbdp_ipc::status::Status;
use sbdp_ipc::{Transport, bytes};

use crate::error::ClientError;
use crate::options::ConnectOptions;

/// A daemon process whose end is seen at the cost of one call to the system.
#[derive(Debug)]
struct Watched {
    endpoint: Endpoint,
    /// Readable once the process has ended; none where the system has no such thing.
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

/// A connection to the daemon. It may move between threads but is used by one at a time.
#[derive(Debug)]
pub struct Client {
    pub(crate) options: ConnectOptions,
    pub(crate) runtime_dir: PathBuf,
    daemon: RefCell<Watched>,
    pub(crate) planning: Cell<bool>,
    restarts: Cell<u32>,
    next_request: Cell<u64>,
    pub(crate) plan_port: ClientPort,
    pub(crate) ask_port: ClientPort,
    pub(crate) geometry: ExchangeService,
    pub(crate) progress: Subscriber<Transport, ProgressSample, ()>,
    pub(crate) listener: Listener<Transport>,
    pub(crate) notifier: Notifier<Transport>,
    pub(crate) node: Node<Transport>,
}

impl Client {
    /// Connects to the daemon of the default runtime folder.
    ///
    /// # Errors
    /// No daemon runs, it speaks another version, or it serves too many clients.
    pub fn connect() -> Result<Self, ClientError> {
        Self::connect_with(ConnectOptions::default())
    }

    /// Connects as told.
    ///
    /// # Errors
    /// No daemon runs, it speaks another version, or it serves too many clients.
    pub fn connect_with(options: ConnectOptions) -> Result<Self, ClientError> {
        let runtime_dir = options.runtime_dir.clone().unwrap_or_else(default_runtime_dir);
        let endpoint = Endpoint::find(&runtime_dir)?;
        let config = layout::iceoryx2_config(&endpoint.prefix, &endpoint.root)?;
        let node = services::node(&config)?;

        let wake_client = services::wake(&node, WAKE_CLIENT_SERVICE)?;
        let wake_server = services::wake(&node, WAKE_SERVER_SERVICE)?;
        let plan = services::plan(&node)?.open().map_err(SetupError::at("opening `plan`"))?;
        let geometry = services::geometry(&node)?.open().map_err(SetupError::at("opening `geometry`"))?;
        let progress = services::progress(&node)?.open().map_err(SetupError::at("opening `progress`"))?;
        let wake_client = wake_client.open().map_err(SetupError::at("opening `wake/client`"))?;
        let wake_server = wake_server.open().map_err(SetupError::at("opening `wake/server`"))?;

        Ok(Self {
            plan_port: client_port(&plan, layout::PLAN_REQUEST)?,
            ask_port: client_port(&geometry, 64)?,
            geometry,
            progress: progress.subscriber_builder().create().map_err(|e| match e {
                SubscriberCreateError::ExceedsMaxSupportedSubscribers => ClientError::TooManyClients,
                e => SetupError::at("subscribing to progress")(e).into(),
            })?,
            listener: wake_client.listener_builder().create().map_err(|e| match e {
                ListenerCreateError::ExceedsMaxSupportedListeners => ClientError::TooManyClients,
                e => SetupError::at("creating the listener")(e).into(),
            })?,
            notifier: wake_server
                .notifier_builder()
                .create()
                .map_err(SetupError::at("creating the notifier"))?,
            options,
            runtime_dir,
            daemon: RefCell::new(Watched::new(endpoint)),
            planning: Cell::new(false),
            restarts: Cell::new(0),
            next_request: Cell::new(1),
            node,
        })
    }

    /// How the daemon is.
    ///
    /// # Errors
    /// The daemon is gone or gives no answer.
    pub fn status(&self) -> Result<Status, ClientError> {
        let header = self.header(RequestKind::Status, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("status", &self.plan_port, header, length, |_| {}, self.options.timeout)?;
        Ok(Status::decode(answer.as_slice())?)
    }

    /// How the daemon is, in all figures that it offers: a JSON object, to which fields may be added.
    ///
    /// # Errors
    /// The daemon is gone, gives no answer, or is older than this request.
    pub fn figures(&self) -> Result<String, ClientError> {
        let header = self.header(RequestKind::Figures, self.new_request());
        let length = bytes::ALIGNMENT;
        let answer = self.ask("figures", &self.plan_port, header, length, |_| {}, self.options.timeout)?;
        let wrong = |_| ClientError::Protocol("its figures are no text".to_owned());
        String::from_utf8(answer.as_slice().to_vec()).map_err(wrong)
    }

    /// The daemon's process id.
    #[must_use]
    pub fn pid(&self) -> u32 {
        self.daemon.borrow().endpoint.pid
    }

    /// How often this client has followed a daemon that was restarted at the same place.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts.get()
    }

    pub(crate) fn new_request(&self) -> u64 {
        self.next_request.replace(self.next_request.get() + 1)
    }

    /// Fails if the daemon that holds our request is gone.
    pub(crate) fn check_alive(&self) -> Result<(), ClientError> {
        if self.daemon.borrow().is_alive() {
            return Ok(());
        }
        // Let iceoryx2 see the death as well, so that a new daemon finds a clean house.
        let _ = self.node.try_cleanup_dead_nodes();
        Err(ClientError::DaemonDied { pid: self.pid() })
    }

    /// Before a new request: follows a daemon that was restarted at the same place.
    pub(crate) fn refresh_endpoint(&self) -> Result<(), ClientError> {
        if self.daemon.borrow().is_alive() {
            return Ok(());
        }
        let found = Endpoint::find(&self.runtime_dir)?;
        let mut known = self.daemon.borrow_mut();
        let Endpoint { pid, prefix, root, .. } = &known.endpoint;
        if (&found.prefix, &found.root) != (prefix, root) {
            return Err(ClientError::DaemonDied { pid: *pid });
        }
        *known = Watched::new(found);
        self.restarts.set(self.restarts.get() + 1);
        Ok(())
    }
}

/// A client port of a fixed segment that never waits for room at the daemon by itself.
pub(crate) fn client_port(service: &ExchangeService, longest: usize) -> Result<ClientPort, ClientError> {
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

#[cfg(test)]
mod tests {
    use super::Client;

    #[test]
    fn a_client_may_move_between_threads() {
        fn moves<T: Send>() {}
        moves::<Client>();
    }
}
