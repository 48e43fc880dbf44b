//! One message of each kind with something in every section, taken apart as the document says.

use bytemuck::Zeroable;
use sbdp_ipc::bytes::Text;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::{Assembly, HandleResponse, Part, PartRecord, VERTICES_F32, VERTICES_F64, Vertices};
use sbdp_ipc::plan::{
    MovedPart, NO_STEP, PenaltyRecord, PlanRequest, Staging, Step, StepRecord, encode_steps,
};
use sbdp_ipc::revision::{ADDED, Revision};
use sbdp_ipc::status::{PreloadRecord, Status, StatusHeader};
use sbdp_ipc::summary::report::{
    Clearance, ClearanceRecord, Closest, FallRecord, Fastener, FastenerRecord, HoldRecord, Report, Stability,
    Tool, ToolRecord, Unstable, UnstableRecord,
};
use sbdp_ipc::summary::{
    BlockedRecord, GroupRecord, NO_PART, OverlapRecord, Stats, SummaryParts, WarningRecord,
};

use crate::layout::Layouts;
use crate::messages;
use crate::source::Source;

const POSE: [f64; 7] = [1.0, 2.0, -0.5, 1.0, 0.0, 0.0, 0.0];

fn moved(part: u32) -> MovedPart {
    MovedPart { part, reserved: 0, motion: POSE }
}

/// Walks a message and compares all sections.
fn check(name: &str, bytes: &[u8], expected: &[(&str, Vec<u8>)]) {
    let source = Source::read();
    let layouts = Layouts::new(&source);
    let found = messages::of(name).walk(&layouts, bytes);
    let names: Vec<&str> = found.iter().map(|f| f.name.as_str()).collect();
    for (section, bytes) in expected {
        let section =
            found.iter().find(|f| f.name == *section).unwrap_or_else(|| panic!("{section}: {names:?}"));
        assert_eq!(section.bytes, *bytes, "{name}: {}", section.name);
    }
    // The header's numbers are what the sections were found by.
    let compared = expected.iter().map(|(section, _)| *section);
    let compared: Vec<&str> = compared.chain(["header"]).collect();
    for section in &found {
        assert!(compared.contains(&section.name.as_str()), "{name}: {} is not compared", section.name);
        assert!(!section.bytes.is_empty(), "{name}: {} is empty", section.name);
    }
}

fn text(offset: u32, length: u32) -> Text {
    Text { offset, length }
}

fn raw<T: bytemuck::Pod>(values: &[T]) -> Vec<u8> {
    bytemuck::cast_slice(values).to_vec()
}

#[test]
fn a_plan_request_has_its_sections_in_order() {
    let penalty = PenaltyRecord { parameter: 2, reserved: 0, value: 0.5 };
    let request = PlanRequest {
        fixed: vec![1],
        removed: vec![2, 3],
        targets: Some(vec![4, 5, 6]),
        base: vec![7],
        keep: vec![16],
        keep_out: vec![17],
        groups: vec![vec![8, 9], vec![10, 11, 12]],
        moved: vec![moved(13)],
        assembly: Some(Staging::Beside(vec![moved(14), moved(15)])),
        penalty: vec![penalty],
        ..PlanRequest::default()
    };
    let expected: &[(&str, Vec<u8>)] = &[
        ("fixed", raw::<u32>(&[1])),
        ("removed", raw::<u32>(&[2, 3])),
        ("targets", raw::<u32>(&[4, 5, 6])),
        ("base", raw::<u32>(&[7])),
        ("keep", raw::<u32>(&[16])),
        ("keep_out", raw::<u32>(&[17])),
        ("sizes of groups", raw::<u32>(&[2, 3])),
        ("parts of groups", raw::<u32>(&[8, 9, 10, 11, 12])),
        ("moved", raw(&[moved(13)])),
        ("staged", raw(&[moved(14), moved(15)])),
        ("penalty", raw(&[penalty])),
    ];
    check("Plan", &request.encode(), expected);
    check("Have", &[7; 32], &[("handle", vec![7; 32])]);
}

#[test]
fn meshes_have_their_sections_in_order() {
    let (wide, narrow) = ([[1.0, 2.0, 3.0]], [[0.5_f32, 1.0, 2.0]]);
    let parts = vec![
        Part { name: "one", vertices: Vertices::F64(&wide), triangles: &[[0, 1, 2]] },
        Part { name: "two", vertices: Vertices::F32(&narrow), triangles: &[[3, 4, 5], [6, 7, 8]] },
    ];
    let meshes: [(&str, Vec<u8>); 4] = [
        ("vertices of part 0", raw(&wide)),
        ("triangles of part 0", raw::<u32>(&[0, 1, 2])),
        ("vertices of part 1", raw(&narrow)),
        ("triangles of part 1", raw::<u32>(&[3, 4, 5, 6, 7, 8])),
    ];
    let revision = Revision {
        base: [7; 32],
        replaced: vec![(4, parts[0])],
        added: vec![parts[1]],
        moved: vec![moved(3)],
    };
    let mut bytes = vec![0; revision.encoded_len()];
    assert!(revision.encode_into(&mut bytes));
    let records = |places: [u32; 2]| {
        let one = PartRecord {
            name: text(0, 3),
            vertex_kind: VERTICES_F64,
            place: places[0],
            vertices: 1,
            triangles: 1,
        };
        let two = PartRecord {
            name: text(3, 3),
            vertex_kind: VERTICES_F32,
            place: places[1],
            vertices: 1,
            triangles: 2,
        };
        [one, two]
    };
    let revised = records([4, ADDED]);
    let others: [(&str, Vec<u8>); 3] =
        [("parts", raw(&revised)), ("moved", raw(&[moved(3)])), ("texts", raw(b"onetwo"))];
    check("Revise", &bytes, &[&others[..], &meshes].concat());

    let assembly = Assembly { name: "demo", units: Some("mm"), parts, fixed: vec!["fix"] };
    let mut bytes = vec![0; assembly.encoded_len()];
    assert!(assembly.encode_into(&mut bytes));
    let (uploaded, fixed) = (records([0, 0]), text(6, 3));
    let others: [(&str, Vec<u8>); 3] =
        [("parts", raw(&uploaded)), ("fixed names", raw(&[fixed])), ("texts", raw(b"onetwofixdemomm"))];
    check("Upload", &bytes, &[&others[..], &meshes].concat());
}

#[test]
fn steps_have_their_sections_in_order() {
    let step = Step { parts: vec![3, 5], path: vec![POSE; 2], requires: vec![1], ..Step::default() };
    let record = StepRecord {
        first_part: 0,
        parts: 2,
        of: NO_STEP,
        ends: 0,
        motion: 0,
        first_waypoint: 0,
        waypoints: 2,
        first_requirement: 0,
        requirements: 1,
        wave: 0,
        verified_depth: 0.0,
        direction: [0.0; 3],
    };
    let expected: &[(&str, Vec<u8>)] = &[
        ("steps", raw(&[record])),
        ("waypoints", raw(&[POSE; 2])),
        ("requirements", raw::<u32>(&[1])),
        ("parts", raw::<u32>(&[3, 5])),
    ];
    check("Steps", &encode_steps(7, [&step]), expected);
}

fn report() -> Report {
    let unstable = Unstable {
        falls: vec![(0, [0.0, 0.0, -1.0])],
        hold: vec![vec![0], vec![0, 1]],
        needs_clamping: true,
    };
    let state = Stability { unstable: vec![unstable], unknown: vec![1], ..Stability::default() };
    let closest = Closest {
        moving: 0,
        standing: 1,
        distance: 0.5,
        at_least: 0.25,
        assembled: 2.0,
        segment: 3,
        share: 0.5,
        points: Some([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    };
    let tool = Tool { tool: 2, swing: 60.0, needs: 30.0, fits: true, blocked_by: vec![1] };
    Report {
        stability: Some(vec![Stability::default(), state, Stability::default()]),
        clearance: Some(vec![Clearance { touching: vec![1], closest: Some(closest) }, Clearance::default()]),
        tools: Some(vec![None, Some(Fastener { size: 13.0, tools: vec![tool] })]),
    }
}

#[test]
fn a_summary_has_its_sections_in_order() {
    let overlap = OverlapRecord { parts: [0, 1], depth: 0.25 };
    let summary = SummaryParts {
        assembly: true,
        status: 2,
        steps: 2,
        reason: Some("why"),
        planner: "planner",
        engine: "engine",
        units: Some("mm"),
        parts: vec!["a", "bc"],
        overlaps: vec![overlap],
        blocked: vec![(1, vec![11, 12], "+x")],
        warnings: vec![(0, "warning")],
        removed: vec![1],
        targets: Some(vec![2, 3]),
        fixed: vec![4],
        keep: vec![16],
        base: (vec![5], Some("big")),
        remaining: vec![6, 7],
        kept_together: vec![vec![21, 22]],
        free_together: vec![(vec![23], [0.0, 0.0, 1.0])],
        poses: vec![moved(1)],
        report: Some(report()),
        stats: Stats::default(),
    };
    let blocked = BlockedRecord { part: 1, first_blocker: 0, blockers: 2, action: text(3, 2) };
    let warning = WarningRecord { part: 0, message: text(5, 7) };
    let kept = GroupRecord { first_part: 0, parts: 2, direction: [0.0; 3] };
    let free = GroupRecord { first_part: 2, parts: 1, direction: [0.0, 0.0, 1.0] };
    let passing = ClearanceRecord {
        flags: 3,
        moving: 0,
        standing: 1,
        segment: 3,
        first_touching: 4,
        touching: 1,
        distance: 0.5,
        at_least: 0.25,
        assembled: 2.0,
        share: 0.5,
        moving_point: [1.0, 2.0, 3.0],
        standing_point: [4.0, 5.0, 6.0],
    };
    let alone = ClearanceRecord {
        moving: NO_PART,
        standing: NO_PART,
        first_touching: 5,
        ..ClearanceRecord::zeroed()
    };
    let without = FastenerRecord { first_tool: 0, tools: 0, size: 0.0 };
    let fastener = FastenerRecord { first_tool: 0, tools: 1, size: 13.0 };
    let tool = ToolRecord { tool: 2, flags: 1, first_blocker: 5, blockers: 1, swing: 60.0, needs: 30.0 };
    let expected: &[(&str, Vec<u8>)] = &[
        ("part names", raw(&[text(0, 1), text(1, 2)])),
        ("blocked", raw(&[blocked])),
        ("warnings", raw(&[warning])),
        ("kept together", raw(&[kept])),
        ("free together", raw(&[free])),
        ("overlaps", raw(&[overlap])),
        ("removed", raw::<u32>(&[1])),
        ("targets", raw::<u32>(&[2, 3])),
        ("fixed", raw::<u32>(&[4])),
        ("keep", raw::<u32>(&[16])),
        ("base", raw::<u32>(&[5])),
        ("remaining", raw::<u32>(&[6, 7])),
        ("blockers", raw::<u32>(&[11, 12])),
        ("poses", raw(&[moved(1)])),
        ("parts of groups", raw::<u32>(&[21, 22, 23])),
        ("states", raw(&[[0_u32; 6], [0, 0, 0, 1, 3, 1], [0, 0, 1, 0, 4, 0]])),
        (
            "unstable",
            raw(&[UnstableRecord {
                first_fall: 0,
                falls: 1,
                first_hold: 0,
                holds: 2,
                flags: 1,
                reserved: 0,
            }]),
        ),
        ("falls", raw(&[FallRecord { part: 0, reserved: 0, direction: [0.0, 0.0, -1.0] }])),
        ("holds", raw(&[HoldRecord { first_part: 0, parts: 1 }, HoldRecord { first_part: 1, parts: 2 }])),
        ("clearances", raw(&[passing, alone])),
        ("fasteners", raw(&[without, fastener])),
        ("tools", raw(&[tool])),
        ("parts of the report", raw::<u32>(&[0, 0, 1, 1, 1, 1])),
        ("texts", raw(b"abc+xwarningwhyplannerenginemmbig")),
    ];
    check("Summary", &summary.encode(), expected);
}

#[test]
fn short_answers_have_their_sections_in_order() {
    check("Error", &WireError::new(ErrorCode::Busy, "busy!").encode(), &[("text", raw(b"busy!"))]);
    let handle = HandleResponse { handle: [9; 32], known: 1, reserved: 0 };
    check("Handle", bytemuck::bytes_of(&handle), &[]);
    let status = Status {
        numbers: StatusHeader::default(),
        version: "0.1.0".to_owned(),
        preloaded: vec![("frame".to_owned(), [3; 32])],
    };
    let preloaded = PreloadRecord { handle: [3; 32], name: text(5, 5) };
    let expected: &[(&str, Vec<u8>)] = &[("preloaded", raw(&[preloaded])), ("texts", raw(b"0.1.0frame"))];
    check("Status", &status.encode(), expected);
}
