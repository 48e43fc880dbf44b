//! The bytes of every message of the protocol, written down once. A change to one of them breaks clients that
//! are out there: a new layout needs a new version in the service names.

use std::num::NonZeroU32;

use sbdp_ipc::PROTOCOL;
use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::{Assembly, HandleResponse, Part, Vertices};
use sbdp_ipc::headers::{RequestHeader, RequestKind, ResponseHeader, ResponseKind};
use sbdp_ipc::layout;
use sbdp_ipc::plan::{
    Gravity, MovedPart, PenaltyRecord, PlanRequest, Reports, Staging, Steady, Step, StepEnd, StepsView,
    encode_steps,
};
use sbdp_ipc::progress::{ProgressSample, STAGE_SEARCH, TRIED_TURNS};
use sbdp_ipc::revision::Revision;
use sbdp_ipc::status::{Status, StatusHeader};
use sbdp_ipc::summary::report::{Clearance, Closest, Fastener, Report, Stability, Tool, Unstable};
use sbdp_ipc::summary::{NO_PART, OverlapRecord, Stats, SummaryParts, SummaryView};

/// Words of eight bytes in hexadecimal, one per line of eight; `*N` after a word repeats it.
fn words(bytes: &[u8]) -> String {
    assert!(bytes.len().is_multiple_of(8), "every section is padded");
    let words: Vec<String> =
        bytes.chunks(8).map(|word| word.iter().map(|b| format!("{b:02x}")).collect()).collect();
    let mut text = Vec::new();
    for run in words.chunk_by(|a, b| a == b) {
        text.push(if run.len() == 1 { run[0].clone() } else { format!("{}*{}", run[0], run.len()) });
    }
    text.join(" ")
}

fn check(what: &str, bytes: &[u8], expected: &str) {
    let expected: Vec<&str> = expected.split_whitespace().collect();
    assert_eq!(words(bytes), expected.join(" "), "{what}");
}

const POSE: [f64; 7] = [1.0, 2.0, -0.5, 1.0, 0.0, 0.0, 0.0];

#[test]
fn headers() {
    let request = RequestHeader {
        kind: RequestKind::Control as u32,
        flags: 1,
        request: 5,
        consumed: 3,
        listener: [0x1122, 0x33],
    };
    check(
        "request header",
        bytemuck::bytes_of(&request),
        "0200000001000000 0500000000000000 0300000000000000 2211000000000000 3300000000000000",
    );
    let response = ResponseHeader {
        kind: ResponseKind::Error as u32,
        retry_ms: 250,
        request: 5,
        sequence: 1,
        offset: 2,
        total: 3,
        admitted_ns: 4,
        started_ns: 5,
        sent_ns: 6,
    };
    check(
        "response header",
        bytemuck::bytes_of(&response),
        "\
         03000000fa000000 0500000000000000 0100000000000000 0200000000000000 0300000000000000 \
         0400000000000000 0500000000000000 0600000000000000",
    );
}

#[test]
fn numbers_of_kinds_and_codes_and_names_of_services() {
    let requests = [
        RequestKind::Plan,
        RequestKind::Control,
        RequestKind::Status,
        RequestKind::Have,
        RequestKind::Upload,
        RequestKind::Revise,
        RequestKind::Metrics,
    ];
    assert_eq!(requests.map(|k| k as u32), [1, 2, 3, 4, 5, 6, 7]);
    let responses = [
        ResponseKind::Steps,
        ResponseKind::Summary,
        ResponseKind::Error,
        ResponseKind::Status,
        ResponseKind::Handle,
        ResponseKind::Metrics,
    ];
    assert_eq!(responses.map(|k| k as u32), [1, 2, 3, 4, 5, 6]);
    let codes: Vec<u32> = (0..20).filter(|c| ErrorCode::from_wire(*c).is_some()).collect();
    assert_eq!(codes, (1..=12).collect::<Vec<u32>>());
    assert_eq!((ErrorCode::Busy as u32, ErrorCode::Cancelled as u32), (3, 12));
    assert_eq!(
        (PROTOCOL, layout::PLAN_SERVICE, layout::GEOMETRY_SERVICE),
        (11, "sbdp/v11/plan", "sbdp/v11/geometry")
    );
    assert_eq!(layout::PROGRESS_SERVICE, "sbdp/v11/progress");
    assert_eq!(
        (layout::WAKE_SERVER_SERVICE, layout::WAKE_CLIENT_SERVICE),
        ("sbdp/v11/wake/server", "sbdp/v11/wake/client")
    );
}

#[test]
fn a_plan_request() {
    let request = PlanRequest {
        handle: [0xab; 32],
        planner: 1,
        engine: 1,
        actions: 1,
        static_analysis: 1,
        penalty: vec![PenaltyRecord { parameter: 2, reserved: 0, value: 0.5 }],
        sweeps: Some(true),
        trace: true,
        no_cache: true,
        batch: true,
        threads: 4,
        deadline_ns: Some(0x0102_0304),
        max_simulations: Some(9),
        path_timeout_ns: Some(10),
        planning_timeout_ns: Some(11),
        seed: 12,
        end_gap: Some(1.0),
        clearance: 0.25,
        up: Some([0.0, -1.0, 0.5]),
        fixed: vec![1, 2, 3],
        removed: vec![4],
        targets: Some(vec![5, 6]),
        base: vec![8],
        keep: vec![9, 10],
        keep_out: vec![12],
        groups: vec![vec![1, 2], vec![9, 10, 11]],
        moved: vec![MovedPart { part: 7, reserved: 0, motion: POSE }],
        assembly: None,
        reports: Reports { stability: true, clearance: true, tools: true },
        steady: Some(Steady { hands: NonZeroU32::new(2) }),
        gravity: Gravity { up: [0.0, 0.0, 2.0], friction: 0.25 },
    };
    check(
        "plan request",
        &request.encode(),
        "\
         abababababababab*4 0100000001000000 01000000973f0000 0400000003000000 0100000002000000 \
         0100000001000000 0000000001000000 0100000002000000 0200000002000000 0100000000000000 0403020100000000 0900000000000000 0a00000000000000 \
         0b00000000000000 0c00000000000000 000000000000f03f 0000000000000000 000000000000f0bf 000000000000e03f \
         000000000000d03f 0000000000000000*2 0000000000000040 000000000000d03f \
         0100000002000000 0300000000000000 0400000000000000 0500000006000000 0800000000000000 090000000a000000 0c00000000000000 \
         0200000003000000 0100000002000000 090000000a000000 0b00000000000000 0700000000000000 000000000000f03f 0000000000000040 000000000000e0bf 000000000000f03f \
         0000000000000000*3 0200000000000000 000000000000e03f",
    );
    assert_eq!(PlanRequest::decode(AlignedBytes::copy_of(&request.encode()).as_slice()), Ok(request));
    check(
        "plain plan request",
        &PlanRequest::default().encode(),
        "0000000000000000*14 ffffffffffffffff*3 0000000000000000*10",
    );
}

#[test]
fn a_request_for_an_assembly_plan() {
    let staged = vec![MovedPart { part: 7, reserved: 0, motion: POSE }];
    let request = PlanRequest { assembly: Some(Staging::Beside(staged)), ..PlanRequest::default() };
    check(
        "assembly plan request",
        &request.encode(),
        "\
         0000000000000000*5 0000000020000000 0000000000000000*3 0100000000000000 0000000000000000*4 \
         ffffffffffffffff*3 0000000000000000*10 0700000000000000 000000000000f03f 0000000000000040 \
         000000000000e0bf 000000000000f03f 0000000000000000*3",
    );
    let request = PlanRequest { assembly: Some(Staging::None), ..PlanRequest::default() };
    check(
        "assembly plan request without staging",
        &request.encode(),
        "0000000000000000*5 0000000060000000 0000000000000000*8 ffffffffffffffff*3 0000000000000000*10",
    );
}

#[test]
fn steps() {
    let first = Step {
        parts: vec![3, 5],
        of: Some(6),
        ends: StepEnd::Aside,
        path: vec![POSE],
        requires: vec![1],
        wave: 2,
        direction: Some([0.0, 0.0, 1.0]),
        verified_depth: 0.5,
        rotates: true,
    };
    let second = Step { parts: vec![2], ..Step::default() };
    let bytes = encode_steps(7, [&first, &second]);
    check(
        "steps",
        &bytes,
        "\
         0200000007000000 0100000001000000 0300000000000000 \
         0000000002000000 0600000001000000 0100000000000000*2 0100000002000000 000000000000e03f \
         0000000000000000*2 000000000000f03f \
         0200000001000000 ffffffff00000000 0000000001000000*2 0000000000000000*5 000000000000f03f 0000000000000040 \
         000000000000e0bf 000000000000f03f 0000000000000000*3 0100000000000000 0300000005000000 0200000000000000",
    );
    assert_eq!(StepsView::new(AlignedBytes::copy_of(&bytes).as_slice()).unwrap().len(), 2);
}

#[test]
fn a_summary() {
    let summary = SummaryParts {
        assembly: true,
        status: 2,
        steps: 2,
        reason: Some("why"),
        planner: "p",
        engine: "e",
        units: Some("mm"),
        parts: vec!["a", "bc"],
        overlaps: vec![OverlapRecord { parts: [0, 1], depth: 0.25 }],
        blocked: vec![(1, vec![0], "+x")],
        warnings: vec![(NO_PART, "w")],
        removed: vec![0],
        targets: Some(vec![1]),
        fixed: vec![],
        keep: vec![1],
        base: (vec![0], Some("big")),
        remaining: vec![1],
        kept_together: vec![vec![0, 1]],
        free_together: vec![(vec![1], [0.0, 0.0, 1.0])],
        poses: vec![MovedPart { part: 1, reserved: 0, motion: POSE }],
        report: Some(Report {
            stability: Some(vec![
                Stability { needs_friction: 0.25, ..Stability::default() },
                Stability {
                    unstable: vec![Unstable {
                        falls: vec![(0, [0.0, 0.0, -1.0])],
                        hold: vec![vec![0], vec![0, 1]],
                        needs_clamping: true,
                    }],
                    unknown: vec![1],
                    ..Stability::default()
                },
                Stability::default(),
            ]),
            clearance: Some(vec![
                Clearance {
                    touching: vec![1],
                    closest: Some(Closest {
                        moving: 0,
                        standing: 1,
                        distance: 0.5,
                        at_least: 0.25,
                        assembled: 2.0,
                        segment: 3,
                        share: 0.5,
                        points: Some([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
                    }),
                },
                Clearance::default(),
            ]),
            tools: Some(vec![
                None,
                Some(Fastener {
                    size: 13.0,
                    tools: vec![Tool { tool: 2, swing: 60.0, needs: 30.0, fits: true, blocked_by: vec![1] }],
                }),
            ]),
        }),
        stats: Stats {
            simulations: 1,
            simulations_run: 2,
            sweeps: 3,
            states: 4,
            sdf_time_s: 0.5,
            static_analysis_time_s: 0.5,
            path_time_s: 0.5,
            verify_time_s: 0.5,
            total_time_s: 0.5,
            sdf_hits: 5,
            blocking_hits: 6,
            graph_hits: 8,
            motion_hits: 7,
            plan_hit: 1,
        },
    };
    let bytes = summary.encode();
    check(
        "summary",
        &bytes,
        "\
         02000000ff000000 0200000002000000 0100000001000000*2 0100000000000000 0100000001000000 \
         1000000001000000 0100000001000000 0100000003000000*2 0100000001000000 0200000002000000 0200000001000000 \
         0600000000000000 0600000003000000 0900000001000000 0a00000001000000 0b00000002000000 0d00000003000000 \
         0100000000000000 0200000000000000 0300000000000000 0400000000000000 000000000000e03f*5 \
         0500000000000000 0600000000000000 0800000000000000 0700000000000000 0100000000000000 \
         0000000001000000 \
         0100000002000000 0000000001000000 000000000000d03f 0100000000000000 0100000003000000 \
         0200000000000000 ffffffff05000000 0100000000000000 0000000000000000 0100000000000000*2 \
         0000000000000000 0100000000000000 0000000000000000 0100000000000000 000000000000f03f 0000000000000040 000000000000e0bf \
         000000000000f03f 0000000000000000*3 \
         0000000002000000 0000000000000000*3 0200000001000000 0000000000000000*2 000000000000f03f \
         0000000001000000 0100000000000000 \
         000000000000d03f 0000000000000000*3 0000000001000000 0300000001000000 0000000000000000 0100000000000000 0400000000000000 \
         0000000001000000 0000000002000000 0100000000000000 0000000000000000*3 000000000000f0bf 0000000001000000 0100000002000000 \
         0300000000000000 0100000003000000 0400000001000000 000000000000e03f 000000000000d03f 0000000000000040 000000000000e03f \
         000000000000f03f 0000000000000040 0000000000000840 0000000000001040 0000000000001440 0000000000001840 \
         00000000ffffffff ffffffff00000000 0500000000000000 0000000000000000*12 0000000001000000 0000000000002a40 \
         0200000001000000 0500000001000000 0000000000004e40 0000000000003e40 0000000000000000 0100000001000000*2 \
         6162632b78777768 7970656d6d626967",
    );
    assert_eq!(SummaryView::new(AlignedBytes::copy_of(&bytes).as_slice()).unwrap().reason(), Some("why"));
}

#[test]
fn an_error() {
    let error = WireError::new(ErrorCode::Busy, "busy!");
    check("error", &error.encode(), "0300000005000000 6275737921000000");
}

#[test]
fn meshes() {
    let wide = [[1.0, 2.0, 3.0]];
    let narrow = [[0.5_f32, 1.0, 2.0]];
    let parts = vec![
        Part { name: "a", vertices: Vertices::F64(&wide), triangles: &[[0, 1, 2]] },
        Part { name: "b", vertices: Vertices::F32(&narrow), triangles: &[] },
    ];
    let moved = vec![MovedPart { part: 0, reserved: 0, motion: POSE }];
    let revision = Revision { base: [7; 32], replaced: vec![(4, parts[0])], added: vec![parts[1]], moved };
    let assembly = Assembly { name: "demo", units: Some("mm"), parts, fixed: vec!["b"] };
    let mut bytes = vec![0; assembly.encoded_len()];
    assert!(assembly.encode_into(&mut bytes));
    check(
        "upload",
        &bytes,
        "\
         0200000001000000 0100000009000000 0300000004000000 0700000002000000 0000000001000000 \
         0000000000000000 0100000000000000*2 0100000001000000 0100000000000000*2 0000000000000000 \
         0200000001000000 61626264656d6f6d 6d00000000000000 000000000000f03f 0000000000000040 \
         0000000000000840 0000000001000000 0200000000000000 0000003f0000803f 0000004000000000",
    );
    let mut bytes = vec![0; revision.encoded_len()];
    assert!(revision.encode_into(&mut bytes));
    check(
        "revision",
        &bytes,
        "\
         0707070707070707*4 0200000001000000 0200000000000000 0000000001000000 0000000004000000 \
         0100000000000000*2 0100000001000000 01000000ffffffff 0100000000000000 0000000000000000*2 \
         000000000000f03f 0000000000000040 000000000000e0bf 000000000000f03f 0000000000000000*3 \
         6162000000000000 000000000000f03f 0000000000000040 0000000000000840 0000000001000000 \
         0200000000000000 0000003f0000803f 0000004000000000",
    );
    let handle = HandleResponse { handle: [9; 32], known: 1, reserved: 0 };
    check("handle", bytemuck::bytes_of(&handle), "0909090909090909*4 0100000000000000");
}

#[test]
fn status_and_progress() {
    let status = Status {
        numbers: StatusHeader { pid: 1, protocol: 1, uptime_ns: 2, requests: 3, ..StatusHeader::default() },
        version: "0.1.0".to_owned(),
        preloaded: vec![("frame".to_owned(), [3; 32])],
    };
    check(
        "status",
        &status.encode(),
        "\
         0100000001000000 0200000000000000 0000000000000000*2 0300000000000000 0000000000000000*8 \
         010000000a000000 0000000005000000 0303030303030303*4 0500000005000000 302e312e30667261 \
         6d65000000000000",
    );
    let sample = ProgressSample {
        client: [1, 2],
        request: 3,
        simulations: 4,
        stage: STAGE_SEARCH,
        done: 5,
        total: 6,
        tried: 8 | TRIED_TURNS,
    };
    check(
        "progress",
        bytemuck::bytes_of(&sample),
        "\
         0100000000000000 0200000000000000 0300000000000000 0400000000000000 0200000005000000 \
         0600000008000080",
    );
}
