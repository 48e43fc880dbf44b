//! One exchange, byte for byte: two cubes are uploaded, and a plan is asked for and answered. The values are those of a real
//! exchange; `.ci/protocol` has the same one with a daemon and compares.

use bytemuck::bytes_of;
use sbdp_ipc::geometry::{Assembly, HandleResponse, Part, Vertices};
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseHeader, ResponseKind};
use sbdp_ipc::plan::{PlanRequest, Step, encode_steps};
use sbdp_ipc::summary::{Stats, SummaryParts};

use crate::layout::Layouts;
use crate::messages::{dump, dump_header, of};

/// Twelve triangles, counter-clockwise from outside.
const TRIANGLES: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];
const HANDLE: &str = "4932375aa0a0a9cc5799ba13013c0a79521a3d60cf2b1d9a6799ee88918fce39";
/// The index of `extended` in the names of action sets.
const EXTENDED: u32 = 1;
const LISTENER: [u64; 2] = [0x07ad_bd9c_0000_215a, 0x3_0000_67b7];

/// Corners of the unit cube whose lowest corner is (0, 0, `bottom`).
fn corners(bottom: f64) -> [[f64; 3]; 8] {
    std::array::from_fn(|i| {
        [f64::from(i as u32 & 1), f64::from(i as u32 >> 1 & 1), bottom + f64::from(i as u32 >> 2)]
    })
}

fn handle() -> [u8; 32] {
    std::array::from_fn(|i| u8::from_str_radix(&HANDLE[2 * i..2 * i + 2], 16).unwrap())
}

fn upload() -> Vec<u8> {
    let (low, high) = (corners(0.0), corners(1.0));
    // Single precision is widened: the handle is the same.
    let high = high.map(|corner| corner.map(|x| x as f32));
    let part = |name, vertices| Part { name, vertices, triangles: &TRIANGLES };
    let parts = vec![part("low", Vertices::F64(&low)), part("high", Vertices::F32(&high))];
    let assembly = Assembly { name: "cubes", units: Some("mm"), parts, fixed: vec![] };
    let mut bytes = vec![0; assembly.encoded_len()];
    assert!(assembly.encode_into(&mut bytes));
    bytes
}

fn steps() -> Vec<u8> {
    let step = Step {
        parts: vec![1],
        path: vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 1.01, 0.0, 1.0, 0.0, 0.0, 0.0]],
        direction: Some([0.0, 1.0, 0.0]),
        ..Step::default()
    };
    encode_steps(0, [&step])
}

fn summary() -> Vec<u8> {
    let summary = SummaryParts {
        steps: 1,
        planner: "sbdp-star",
        engine: "sliding",
        units: Some("mm"),
        parts: vec!["low", "high"],
        base: (vec![0], Some("it is the largest, no other lies lower, it touches 1 other")),
        remaining: vec![0],
        stats: Stats {
            sweeps: 1,
            states: 2,
            sdf_time_s: 1.6e-7,
            static_analysis_time_s: 9.3829e-5,
            path_time_s: 3.1296e-5,
            verify_time_s: 3.2909e-5,
            total_time_s: 0.000863229,
            ..Stats::default()
        },
        ..SummaryParts::default()
    };
    summary.encode()
}

/// The texts of its marker.
pub(crate) fn dumps(layouts: &Layouts<'_>) -> Vec<(String, String)> {
    let request = |kind, request| RequestHeader {
        kind: kind as u32,
        request,
        listener: LISTENER,
        ..RequestHeader::default()
    };
    let response = |kind, request, sequence, bytes: &[u8], times: [u64; 3]| ResponseHeader {
        kind: kind as u32,
        request,
        sequence,
        total: bytes.len() as u64,
        admitted_ns: times[0],
        started_ns: times[1],
        sent_ns: times[2],
        ..ResponseHeader::default()
    };
    let asked = |title: &str, header: RequestHeader, message: &str, bytes: &[u8]| {
        let header = dump_header(layouts, "RequestHeader", bytes_of(&header));
        part(title, "RequestHeader", &header, message, &dump(layouts, &of(message), bytes))
    };
    let answered = |title: &str, header: ResponseHeader, message: &str, bytes: &[u8]| {
        let header = dump_header(layouts, "ResponseHeader", bytes_of(&header));
        part(title, "ResponseHeader", &header, message, &dump(layouts, &of(message), bytes))
    };
    let known = HandleResponse { handle: handle(), known: 1, reserved: 0 };
    let known = bytes_of(&known);
    let plan = PlanRequest { handle: handle(), actions: EXTENDED, ..PlanRequest::default() }.encode();
    let times = |sent| [8_538_138_841_442, 8_538_139_136_327, sent];
    let (upload, steps, summary) = (upload(), steps(), summary());
    let text = [
        asked("A request on `geometry`", request(RequestKind::Upload, 0), "Upload", &upload),
        answered(
            "Its response",
            response(ResponseKind::Handle, 0, 0, known, [0, 0, 8_538_138_053_771]),
            "Handle",
            known,
        ),
        asked("A request on `plan`", request(RequestKind::Plan, 1), "Plan", &plan),
        answered(
            "Its first response",
            response(ResponseKind::Steps, 1, 0, &steps, times(8_538_140_151_723)),
            "Steps",
            &steps,
        ),
        answered(
            "Its last response",
            response(ResponseKind::Summary, 1, 1, &summary, times(8_538_140_156_571)),
            "Summary",
            &summary,
        ),
    ];
    vec![("exchange".to_owned(), text.concat())]
}

fn part(title: &str, header_name: &str, header: &str, message: &str, payload: &str) -> String {
    format!(
        "### {title}: {message}\nUser header `{header_name}`:\n\n```text\n{header}```\n\nPayload `{message}`:\n\n```text\n{payload}```\n\n"
    )
}
