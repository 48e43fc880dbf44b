//! The daemon's iceoryx2 ports. Only the port thread holds them.

use std::collections::{BTreeSet, HashMap};
use std::sync::Arc;

use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::{BackpressureAction, BackpressureInfo, SendError};
use iceoryx2::prelude::{CallbackProgression, Config, PortFactory};
use sbdp_ipc::Transport;
use sbdp_ipc::headers::ResponseHeader;
use sbdp_ipc::layout::{self, WAKE_CLIENT_SERVICE, WAKE_SERVER_SERVICE};
use sbdp_ipc::progress::ProgressSample;
use sbdp_ipc::services::{self, Active, ExchangeService, ServerPort, SetupError};

use super::request_queue::Owner;
use super::session::{Link, Undelivered};

/// All ports of the daemon.
#[derive(Debug)]
pub(crate) struct Ports {
    pub(crate) plan: ServerPort,
    pub(crate) geometry: ServerPort,
    pub(crate) progress: Publisher<Transport, ProgressSample, ()>,
    pub(crate) listener: Listener<Transport>,
    /// Wakes this daemon; shared with workers and the signal thread.
    pub(crate) wake_self: Arc<Notifier<Transport>>,
    wake_clients: Notifier<Transport>,
    services: [ExchangeService; 2],
    /// By client port, what was asked of the services before.
    owners: HashMap<u128, Owner>,
    pub(crate) node: Node<Transport>,
}

impl Ports {
    pub(crate) fn open(config: &Config) -> Result<Self, SetupError> {
        let node = services::node(config)?;
        let plan = services::plan(&node)?.open_or_create().map_err(SetupError::at("opening `plan`"))?;
        let geometry =
            services::geometry(&node)?.open_or_create().map_err(SetupError::at("opening `geometry`"))?;
        let progress =
            services::progress(&node)?.open_or_create().map_err(SetupError::at("opening `progress`"))?;
        let wake_server = services::wake(&node, WAKE_SERVER_SERVICE)?
            .open_or_create()
            .map_err(SetupError::at("opening `wake/server`"))?;
        let wake_client = services::wake(&node, WAKE_CLIENT_SERVICE)?
            .open_or_create()
            .map_err(SetupError::at("opening `wake/client`"))?;
        Ok(Self {
            plan: server_port(&plan, layout::PLAN_CHUNK)?,
            geometry: server_port(&geometry, layout::GEOMETRY_RESPONSE)?,
            progress: progress
                .publisher_builder()
                .create()
                .map_err(SetupError::at("creating the progress publisher"))?,
            listener: wake_server
                .listener_builder()
                .create()
                .map_err(SetupError::at("creating the listener"))?,
            wake_self: Arc::new(
                wake_server
                    .notifier_builder()
                    .create()
                    .map_err(SetupError::at("creating the own notifier"))?,
            ),
            wake_clients: wake_client
                .notifier_builder()
                .create()
                .map_err(SetupError::at("creating the clients' notifier"))?,
            services: [plan, geometry],
            owners: HashMap::new(),
            node,
        })
    }

    /// The owner of a port: the process that opened it, or the port itself where that is unknown.
    pub(crate) fn owner_of(&mut self, client: u128, geometry: bool) -> Owner {
        if let Some(owner) = self.owners.get(&client) {
            return *owner;
        }
        let mut owner = Owner(client as u64 ^ (client >> 64) as u64);
        self.services[usize::from(geometry)].dynamic_config().list_clients(|details| {
            if details.client_id.value() != client {
                return CallbackProgression::Continue;
            }
            if let Ok(pid) = details.node_id.pid::<Transport>() {
                owner = Owner(pid.value() as u64);
            }
            CallbackProgression::Stop
        });
        self.owners.insert(client, owner);
        owner
    }

    /// Connections of clients, and the processes that they belong to.
    pub(crate) fn clients(&self) -> (usize, usize) {
        let (mut connections, mut processes) = (0, BTreeSet::new());
        self.services[0].dynamic_config().list_clients(|details| {
            connections += 1;
            processes.extend(details.node_id.pid::<Transport>().ok().map(|pid| pid.value()));
            CallbackProgression::Continue
        });
        (connections, processes.len())
    }

    /// Those that are still there are asked again.
    pub(crate) fn forget_owners(&mut self) {
        self.owners.clear();
    }

    /// Wakes the clients with these listener ids, each given once, and no others.
    pub(crate) fn wake(&self, listeners: &[u128]) {
        if listeners.is_empty() {
            return;
        }
        let mut left = listeners.len();
        self.wake_clients.for_each_listener(|monofier, details| {
            if listeners.contains(&details.listener_id.value()) {
                // A client that cannot be woken looks by itself a moment later.
                let _ = monofier.notify();
                left -= 1;
            }
            if left == 0 { CallbackProgression::Stop } else { CallbackProgression::Continue }
        });
    }
}

/// A server that never waits for a client: what does not fit is an error at once, and the
/// segment never grows.
fn server_port(service: &ExchangeService, longest: usize) -> Result<ServerPort, SetupError> {
    service
        .server_builder()
        .initial_max_slice_len(longest)
        .max_loaned_responses_per_request(1)
        .set_backpressure_handler(|_: &BackpressureInfo| BackpressureAction::DiscardDataAndFail)
        .create()
        .map_err(SetupError::at("creating a server port (does another daemon run here?)"))
}

/// A request in shared memory; dropping it tells the client that nothing more comes.
#[derive(Debug)]
pub(crate) struct ActiveLink(pub(crate) Active);

impl Link for ActiveLink {
    fn send(&self, header: ResponseHeader, payload: &[u8]) -> Result<(), Undelivered> {
        let loan = self.0.loan_slice_uninit(payload.len()).map_err(|error| {
            tracing::debug!(%error, "no chunk for a response");
            Undelivered::Full
        })?;
        let mut response = loan.write_from_slice(payload);
        *response.user_header_mut() = header;
        match response.send() {
            Ok(()) => Ok(()),
            Err(SendError::UnableToDeliver) => Err(Undelivered::Full),
            Err(error) => {
                tracing::debug!(%error, "response not sent");
                Err(Undelivered::Broken)
            }
        }
    }

    fn is_connected(&self) -> bool {
        self.0.is_connected()
    }
}
