//! The services as iceoryx2 describes them once they are made.

use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};
use sbdp_ipc::layout::{self, WAKE_CLIENT_SERVICE, WAKE_SERVER_SERVICE};
use sbdp_ipc::services::{self, ExchangeBuilder};

/// The prefix of what is made in shared memory. iceoryx2 leaves a segment behind.
struct Place(String);

impl Drop for Place {
    fn drop(&mut self) {
        for file in layout::shared_memory_files(&self.0).unwrap_or_default() {
            let _ = std::fs::remove_file(file);
        }
    }
}

/// One row per setting of every service.
pub(crate) fn table() -> String {
    let folder = tempfile::tempdir().unwrap();
    let place = Place(format!("sbdp_doc{}_", std::process::id()));
    let node = services::node(&layout::iceoryx2_config(&place.0, folder.path()).unwrap()).unwrap();
    let mut text = exchange(layout::PLAN_SERVICE, services::plan(&node).unwrap());
    text += &exchange(layout::GEOMETRY_SERVICE, services::geometry(&node).unwrap());

    let service = services::progress(&node).unwrap().create().unwrap();
    let settings = service.static_config();
    let types = settings.message_type_details();
    text += &setting_table(
        &format!("`{}`, publish-subscribe", layout::PROGRESS_SERVICE),
        &[
            ("payload", shown(&types.payload)),
            ("user header", shown(&types.user_header)),
            ("publishers", settings.max_publishers().to_string()),
            ("subscribers", settings.max_subscribers().to_string()),
            ("nodes", settings.max_nodes().to_string()),
            ("samples buffered for a subscriber", settings.subscriber_max_buffer_size().to_string()),
            ("samples borrowed by a subscriber", settings.subscriber_max_borrowed_samples().to_string()),
            ("history", settings.history_size().to_string()),
            ("overflow", yes(settings.has_safe_overflow())),
        ],
    );
    for name in [WAKE_SERVER_SERVICE, WAKE_CLIENT_SERVICE] {
        let service = services::wake(&node, name).unwrap().create().unwrap();
        let settings = service.static_config();
        text += &setting_table(
            &format!("`{name}`, event"),
            &[
                ("listeners", settings.max_listeners().to_string()),
                ("notifiers", settings.max_notifiers().to_string()),
                ("nodes", settings.max_nodes().to_string()),
                ("largest event id", settings.event_id_max_value().to_string()),
                ("deadline", settings.deadline().map_or("none".to_owned(), |d| format!("{d:?}"))),
            ],
        );
    }
    text.trim_start().to_owned()
}

fn exchange(name: &str, builder: ExchangeBuilder) -> String {
    let service = builder.create().unwrap();
    let settings = service.static_config();
    let (request, response) =
        (settings.request_message_type_details(), settings.response_message_type_details());
    setting_table(
        &format!("`{name}`, request-response"),
        &[
            ("request payload", shown(&request.payload)),
            ("request user header", shown(&request.user_header)),
            ("response payload", shown(&response.payload)),
            ("response user header", shown(&response.user_header)),
            ("servers", settings.max_servers().to_string()),
            ("client ports", settings.max_clients().to_string()),
            ("nodes", settings.max_nodes().to_string()),
            ("active requests of a client port", settings.max_active_requests_per_client().to_string()),
            ("loaned requests", settings.max_loaned_requests().to_string()),
            ("responses buffered for a request", settings.max_response_buffer_size().to_string()),
            (
                "responses borrowed of a request",
                settings.max_borrowed_responses_per_pending_response().to_string(),
            ),
            ("overflow of requests", yes(settings.has_safe_overflow_for_requests())),
            ("overflow of responses", yes(settings.has_safe_overflow_for_responses())),
            ("fire and forget", yes(settings.does_support_fire_and_forget_requests())),
        ],
    )
}

fn setting_table(title: &str, rows: &[(&str, String)]) -> String {
    let rows: String = rows.iter().map(|(name, value)| format!("| {name} | {value} |\n")).collect();
    format!("\n| {title} | |\n|---|---|\n{rows}")
}

fn shown(detail: &TypeDetail) -> String {
    let (name, size, alignment) = (detail.type_name(), detail.size(), detail.alignment());
    match detail.variant() {
        TypeVariant::Dynamic => format!("slice of `{name}`, elements of {size}, aligned to {alignment}"),
        TypeVariant::FixedSize => format!("`{name}`, {size} bytes, aligned to {alignment}"),
    }
}

fn yes(is: bool) -> String {
    if is { "on" } else { "off" }.to_owned()
}
