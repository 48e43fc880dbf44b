//! The services with their limits, as both sides open them, and the names of their types.

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::node::Node;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{Alignment, Config, NodeBuilder, ServiceName, SignalHandlingMode};
use iceoryx2::response::Response;
use iceoryx2::service::builder::{event, publish_subscribe, request_response};

use crate::Transport;
use crate::headers::{RequestHeader, ResponseHeader};
use crate::layout;
use crate::progress::ProgressSample;

/// A port that sends requests.
pub type ClientPort = Client<Transport, [u8], RequestHeader, [u8], ResponseHeader>;
/// A port that sends responses.
pub type ServerPort = Server<Transport, [u8], RequestHeader, [u8], ResponseHeader>;
/// A request, on the client's side.
pub type Pending = PendingResponse<Transport, [u8], RequestHeader, [u8], ResponseHeader>;
/// A request, on the daemon's side.
pub type Active = ActiveRequest<Transport, [u8], RequestHeader, [u8], ResponseHeader>;
/// A received response.
pub type Answer = Response<Transport, [u8], ResponseHeader>;
/// Opens or creates a request-response service.
pub type ExchangeBuilder = request_response::Builder<[u8], RequestHeader, [u8], ResponseHeader, Transport>;
/// An open request-response service.
pub type ExchangeService = iceoryx2::service::port_factory::request_response::PortFactory<
    Transport,
    [u8],
    RequestHeader,
    [u8],
    ResponseHeader,
>;
/// Opens or creates the progress service.
pub type ProgressBuilder = publish_subscribe::Builder<ProgressSample, (), Transport>;
/// Opens or creates a wake service.
pub type WakeBuilder = event::Builder<Transport>;

/// A step of setting up the transport that failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what}: {reason}")]
pub struct SetupError {
    /// What was tried.
    pub what: &'static str,
    /// iceoryx2's error.
    pub reason: String,
}

impl SetupError {
    /// Names what was tried.
    pub fn at<E: std::fmt::Display>(what: &'static str) -> impl FnOnce(E) -> Self {
        move |e| Self { what, reason: e.to_string() }
    }
}

/// A node whose signals belong to the process, not to iceoryx2.
///
/// # Errors
/// iceoryx2 cannot create it.
pub fn node(config: &Config) -> Result<Node<Transport>, SetupError> {
    iceoryx2::prelude::set_log_level_from_env_or(iceoryx2::prelude::LogLevel::Fatal);
    NodeBuilder::new()
        .config(config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Transport>()
        .map_err(SetupError::at("creating the iceoryx2 node"))
}

fn name(service: &'static str) -> Result<ServiceName, SetupError> {
    ServiceName::new(service).map_err(SetupError::at(service))
}

/// `sbdp/v11/plan`.
///
/// # Errors
/// Never in practice: the name is valid.
pub fn plan(node: &Node<Transport>) -> Result<ExchangeBuilder, SetupError> {
    Ok(exchange(node, layout::PLAN_SERVICE)?
        .max_clients(layout::MAX_CLIENTS)
        .max_active_requests_per_client(layout::PLAN_ACTIVE_REQUESTS)
        .max_response_buffer_size(layout::RESPONSE_BUFFER)
        .max_borrowed_responses_per_pending_response(layout::BORROWED_RESPONSES))
}

/// `sbdp/v11/geometry`.
///
/// # Errors
/// Never in practice: the name is valid.
pub fn geometry(node: &Node<Transport>) -> Result<ExchangeBuilder, SetupError> {
    Ok(exchange(node, layout::GEOMETRY_SERVICE)?
        .max_clients(layout::MAX_GEOMETRY_CLIENTS)
        .max_active_requests_per_client(1)
        .max_response_buffer_size(1)
        .max_borrowed_responses_per_pending_response(1))
}

/// What both request-response services share: nothing is ever dropped silently, and nothing is
/// aligned to more than 8 (a growing segment of 16-aligned chunks loses one at every growth).
fn exchange(node: &Node<Transport>, service: &'static str) -> Result<ExchangeBuilder, SetupError> {
    let alignment = Alignment::new(crate::bytes::ALIGNMENT)
        .ok_or(SetupError { what: service, reason: "alignment".to_owned() })?;
    Ok(node
        .service_builder(&name(service)?)
        .request_response::<[u8], [u8]>()
        .request_user_header::<RequestHeader>()
        .response_user_header::<ResponseHeader>()
        .request_payload_alignment(alignment)
        .response_payload_alignment(alignment)
        .max_servers(1)
        .max_nodes(layout::MAX_NODES)
        .max_loaned_requests(1)
        .enable_safe_overflow_for_requests(false)
        .enable_safe_overflow_for_responses(false)
        .enable_fire_and_forget_requests(false))
}

/// `sbdp/v11/progress`.
///
/// # Errors
/// Never in practice: the name is valid.
pub fn progress(node: &Node<Transport>) -> Result<ProgressBuilder, SetupError> {
    Ok(node
        .service_builder(&name(layout::PROGRESS_SERVICE)?)
        .publish_subscribe::<ProgressSample>()
        .max_publishers(1)
        .max_subscribers(layout::MAX_CLIENTS)
        .max_nodes(layout::MAX_NODES)
        .subscriber_max_buffer_size(layout::PROGRESS_BUFFER)
        .enable_safe_overflow(true))
}

/// A wake service: [`layout::WAKE_SERVER_SERVICE`] or [`layout::WAKE_CLIENT_SERVICE`].
///
/// # Errors
/// Never in practice: the names are valid.
pub fn wake(node: &Node<Transport>, service: &'static str) -> Result<WakeBuilder, SetupError> {
    Ok(node
        .service_builder(&name(service)?)
        .event()
        .max_listeners(layout::MAX_EVENT_PORTS)
        .max_notifiers(layout::MAX_EVENT_PORTS)
        .max_nodes(layout::MAX_NODES))
}
