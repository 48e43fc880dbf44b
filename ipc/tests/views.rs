//! Messages come back as they were written, and no byte string makes a view panic.

use proptest::prelude::*;
use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::geometry::{Assembly, Part, Vertices};
use sbdp_ipc::plan::{
    MovedPart, NO_STEP, PLAN_ASSEMBLY, PenaltyRecord, PlanRequest, Staging, Step, StepEnd, StepRecord,
    StepsHeader, StepsView, encode_steps,
};
use sbdp_ipc::revision::Revision;
use sbdp_ipc::status::{Status, StatusHeader};
use sbdp_ipc::summary::report::{Clearance, Closest, Fastener, Report, Stability, Tool, Unstable};
use sbdp_ipc::summary::{NO_PART, OverlapRecord, Stats, SummaryParts, SummaryView};

/// Reads everything that a view offers.
fn read_everything(bytes: &[u8]) {
    let bytes = AlignedBytes::copy_of(bytes);
    let bytes = bytes.as_slice();
    let _ = PlanRequest::decode(bytes);
    let _ = WireError::decode(bytes);
    let _ = Status::decode(bytes);
    if let Ok(steps) = StepsView::new(bytes) {
        for step in steps.iter() {
            let _ = (step.path.len(), step.requires.len(), step.parts.len());
        }
    }
    if let Ok(view) = SummaryView::new(bytes) {
        let _ = (view.part_names().count(), view.blocked().count(), view.warnings().count());
        let _ = view.kept_together().chain(view.free_together().map(|g| g.parts)).flatten().count();
        let _ = (view.reason(), view.units(), view.planner(), view.engine(), view.status());
    }
    if let Ok(revision) = Revision::decode(bytes) {
        let _ = revision.added.iter().map(|p| p.vertices.iter().count()).sum::<usize>();
    }
    if let Ok(assembly) = Assembly::decode(bytes) {
        let _ = assembly.parts.iter().map(|p| p.vertices.iter().count()).sum::<usize>();
    }
}

fn two_steps() -> Vec<Step> {
    let first = Step {
        parts: vec![1, 2],
        path: vec![[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 5.0, 1.0, 0.0, 0.0, 0.0]],
        verified_depth: 0.001,
        ..Step::default()
    };
    let (parts, path) = (vec![2], vec![[0.5; 7]; 3]);
    let of = Some(0);
    let second =
        Step { parts, of, ends: StepEnd::Aside, rotates: true, requires: vec![1], path, ..first.clone() };
    vec![first, second]
}

fn summary() -> Vec<u8> {
    SummaryParts {
        assembly: true,
        status: 2,
        steps: 2,
        reason: Some("exhausted"),
        planner: "sbdp-star",
        engine: "sliding",
        units: Some("mm"),
        parts: vec!["0", "1", "größer"],
        overlaps: vec![OverlapRecord { parts: [0, 1], depth: 0.25 }],
        blocked: vec![(2, vec![0, 1], "+x"), (2, vec![], "-rz")],
        warnings: vec![(NO_PART, "whole"), (1, "one")],
        removed: vec![0],
        targets: Some(vec![]),
        fixed: vec![1],
        keep: vec![2],
        base: (vec![1], Some("it is the largest")),
        remaining: vec![1, 2],
        kept_together: vec![vec![0, 2], vec![1, 2]],
        free_together: vec![(vec![0, 1], [0.0, 0.6, 0.8])],
        poses: vec![moved_part()],
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
        stats: Stats { simulations: 7, total_time_s: 1.5, plan_hit: 1, ..Stats::default() },
    }
    .encode()
}

fn assembly_bytes() -> Vec<u8> {
    let wide = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
    let narrow = [[0.5_f32, 1.0, 2.0]];
    let assembly = Assembly {
        name: "demo",
        units: Some("mm"),
        parts: vec![
            Part { name: "a", vertices: Vertices::F64(&wide), triangles: &[[0, 1, 2]] },
            Part { name: "b", vertices: Vertices::F32(&narrow), triangles: &[] },
        ],
        fixed: vec!["b"],
    };
    let mut bytes = vec![0; assembly.encoded_len()];
    assert!(assembly.encode_into(&mut bytes));
    assert!(!assembly.encode_into(&mut vec![0; assembly.encoded_len() - 8]));
    let aligned = AlignedBytes::copy_of(&bytes);
    assert_eq!(Assembly::decode(aligned.as_slice()).unwrap(), assembly);
    bytes
}

fn moved_part() -> MovedPart {
    MovedPart { part: 2, reserved: 0, motion: [0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0] }
}

fn revision_bytes() -> Vec<u8> {
    let wide = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];
    let part = |name| Part { name, vertices: Vertices::F64(&wide), triangles: &[[0, 1, 2], [0, 2, 1]] };
    let narrow = [[0.5_f32, 1.0, 2.0]];
    let revision = Revision {
        base: [3; 32],
        replaced: vec![(4, part("")), (1, part(""))],
        added: vec![Part { name: "größer", vertices: Vertices::F32(&narrow), triangles: &[] }],
        moved: vec![moved_part()],
    };
    let mut bytes = vec![0; revision.encoded_len()];
    assert!(revision.encode_into(&mut bytes));
    let aligned = AlignedBytes::copy_of(&bytes);
    assert_eq!(Revision::decode(aligned.as_slice()).unwrap(), revision);
    bytes
}

#[test]
fn steps_come_back_in_place() {
    let bytes = AlignedBytes::copy_of(&encode_steps(4, &two_steps()));
    let view = StepsView::new(bytes.as_slice()).unwrap();
    let steps: Vec<_> = view.iter().collect();
    assert_eq!(steps.len(), 2);
    assert_eq!((steps[0].number, steps[0].parts, steps[0].rotates), (4, &[1, 2][..], false));
    assert_eq!((steps[0].of, steps[0].ends), (None, StepEnd::Out));
    assert_eq!((steps[1].parts, steps[1].of, steps[1].ends), (&[2][..], Some(0), StepEnd::Aside));
    assert_eq!(steps[0].path, two_steps()[0].path);
    assert_eq!((steps[1].number, steps[1].rotates, steps[1].requires), (5, true, &[1][..]));
    assert_eq!(steps[1].path, two_steps()[1].path);
}

/// Of a steps message, a number in the record of its second step.
fn with_number_in_second_record(offset: usize, number: u32) -> Vec<u8> {
    let mut bytes = encode_steps(4, &two_steps());
    let at = size_of::<StepsHeader>() + size_of::<StepRecord>() + offset;
    bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
    bytes
}

#[test]
fn steps_that_contradict_themselves_are_refused() {
    use std::mem::offset_of;
    let read = |offset: usize, number: u32| {
        let bytes = AlignedBytes::copy_of(&with_number_in_second_record(offset, number));
        StepsView::new(bytes.as_slice()).map(|view| view.get(1).unwrap().of).map_err(|e| e.to_string())
    };
    let (of, ends) = (offset_of!(StepRecord, of), offset_of!(StepRecord, ends));
    assert_eq!(read(of, NO_STEP), Ok(None));
    assert_eq!(
        (read(of, 4), read(of, 6)),
        (Ok(Some(4)), Ok(Some(6))),
        "of an assembly plan it is a later step"
    );
    assert_eq!(read(ends, StepEnd::In as u32), Ok(Some(0)));
    let refused = |offset: usize, number: u32, field: &str| {
        let error = read(offset, number).unwrap_err();
        assert!(error.contains(field), "{error}");
    };
    refused(of, 5, "`of` has the illegal value 5");
    refused(ends, 3, "`ends` has the illegal value 3");
    refused(offset_of!(StepRecord, parts), 0, "`parts of a step` has the illegal value 0");
    refused(offset_of!(StepRecord, parts), 2, "`step parts` ends at byte 4");
    refused(offset_of!(StepRecord, first_part), u32::MAX, "`step parts`");
}

#[test]
fn a_summary_carries_everything_of_a_plan_but_its_steps() {
    let bytes = AlignedBytes::copy_of(&summary());
    let view = SummaryView::new(bytes.as_slice()).unwrap();
    assert_eq!((view.status(), view.steps(), view.reason()), ("infeasible", 2, Some("exhausted")));
    assert_eq!((view.planner(), view.engine(), view.units()), ("sbdp-star", "sliding", Some("mm")));
    assert_eq!(view.part_names().collect::<Vec<_>>(), ["0", "1", "größer"]);
    assert_eq!((view.removed(), view.targets(), view.fixed()), (&[0][..], Some(&[][..]), &[1][..]));
    assert_eq!(view.keep(), [2]);
    assert_eq!((view.base(), view.base_reason()), (&[1][..], Some("it is the largest")));
    assert_eq!((view.remaining(), view.overlaps()[0].depth), (&[1, 2][..], 0.25));
    let blocked: Vec<_> = view.blocked().collect();
    assert_eq!((blocked[0].part, blocked[0].by, blocked[0].action), (2, &[0, 1][..], "+x"));
    assert_eq!(blocked[1].action, "-rz");
    assert_eq!(view.warnings().collect::<Vec<_>>(), [(None, "whole"), (Some(1), "one")]);
    assert_eq!((view.stats().simulations, view.stats().plan_hit), (7, 1));
    assert_eq!(view.kept_together().collect::<Vec<_>>(), [[0, 2], [1, 2]]);
    let free: Vec<_> = view.free_together().map(|g| (g.parts, g.direction)).collect();
    assert_eq!(free, [(&[0, 1][..], [0.0, 0.6, 0.8])]);
}

#[test]
fn a_summary_that_names_a_part_out_of_range_is_refused() {
    let is_refused = |summary: SummaryParts<'_>| {
        let bytes = SummaryParts { parts: vec!["0"], ..summary }.encode();
        SummaryView::new(AlignedBytes::copy_of(&bytes).as_slice()).is_err()
    };
    assert!(!is_refused(SummaryParts { kept_together: vec![vec![0]], ..SummaryParts::default() }));
    assert!(is_refused(SummaryParts { remaining: vec![1], ..SummaryParts::default() }));
    assert!(is_refused(SummaryParts { base: (vec![1], None), ..SummaryParts::default() }));
    assert!(is_refused(SummaryParts { keep: vec![1], ..SummaryParts::default() }));
    assert!(is_refused(SummaryParts { kept_together: vec![vec![0], vec![1]], ..SummaryParts::default() }));
    assert!(is_refused(SummaryParts { free_together: vec![(vec![1], [0.0; 3])], ..SummaryParts::default() }));
}

#[test]
fn requests_errors_and_status_come_back() {
    let request = PlanRequest {
        handle: [7; 32],
        no_cache: true,
        deadline_ns: Some(12),
        max_simulations: Some(0),
        fixed: vec![1, 2, 3],
        base: vec![4],
        keep: vec![8],
        groups: vec![vec![], vec![5, 6], vec![7]],
        up: Some([0.0, 0.0, 2.0]),
        targets: Some(vec![]),
        moved: vec![moved_part()],
        static_analysis: 1,
        penalty: vec![PenaltyRecord { parameter: 11, reserved: 0, value: f64::INFINITY }],
        path_timeout_ns: Some(0),
        planning_timeout_ns: Some(5),
        trace: true,
        ..PlanRequest::default()
    };
    for sweeps in [None, Some(false), Some(true)] {
        let request = PlanRequest { sweeps, ..request.clone() };
        let bytes = AlignedBytes::copy_of(&request.encode());
        assert_eq!(PlanRequest::decode(bytes.as_slice()).unwrap(), request);
    }
    for staging in [Staging::None, Staging::Beside(vec![]), Staging::Beside(vec![moved_part()])] {
        let request = PlanRequest { assembly: Some(staging), ..request.clone() };
        let bytes = AlignedBytes::copy_of(&request.encode());
        assert_eq!(PlanRequest::decode(bytes.as_slice()).unwrap(), request);
        // Places to wait at are for assembly plans.
        let mut stray = request.encode();
        stray[44] &= !(PLAN_ASSEMBLY as u8);
        let stray = PlanRequest::decode(AlignedBytes::copy_of(&stray).as_slice());
        assert_eq!(stray.is_err(), request.assembly != Some(Staging::Beside(vec![])), "{stray:?}");
    }

    let error = WireError::new(ErrorCode::Busy, "ü".repeat(100_000));
    let bytes = AlignedBytes::copy_of(&error.encode());
    let back = WireError::decode(bytes.as_slice()).unwrap();
    assert_eq!(back.code, ErrorCode::Busy);
    assert_eq!(back.message.len(), 16 * 1024);

    let status = Status {
        numbers: StatusHeader { pid: 9, ..StatusHeader::default() },
        version: "0.1.0".into(),
        preloaded: vec![("a".into(), [1; 32]), ("b".into(), [2; 32])],
    };
    let bytes = AlignedBytes::copy_of(&status.encode());
    let back = Status::decode(bytes.as_slice()).unwrap();
    assert_eq!((back.numbers.pid, &back.version, &back.preloaded), (9, &status.version, &status.preloaded));
}

/// A valid message of each kind, to be damaged.
fn messages() -> Vec<Vec<u8>> {
    let request = PlanRequest {
        fixed: vec![1, 2],
        base: vec![4],
        keep: vec![8],
        groups: vec![vec![5, 6], vec![7]],
        penalty: vec![PenaltyRecord { parameter: 0, reserved: 0, value: 1.0 }],
        targets: Some(vec![3]),
        moved: vec![moved_part()],
        assembly: Some(Staging::Beside(vec![moved_part()])),
        ..PlanRequest::default()
    };
    let status = Status {
        numbers: StatusHeader::default(),
        version: "1".into(),
        preloaded: vec![("a".into(), [1; 32])],
    };
    vec![
        encode_steps(0, &two_steps()),
        summary(),
        assembly_bytes(),
        revision_bytes(),
        request.encode(),
        status.encode(),
        WireError::new(ErrorCode::Failed, "text").encode(),
    ]
}

#[test]
fn a_truncated_message_is_an_error_and_no_panic() {
    for message in messages() {
        for length in 0..message.len() {
            read_everything(&message[..length]);
        }
    }
}

proptest! {
    #[test]
    fn no_bytes_make_a_view_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        read_everything(&bytes);
    }

    #[test]
    fn no_damage_makes_a_view_panic(
        which in 0_usize..7,
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
    ) {
        let mut message = messages().swap_remove(which);
        for (index, byte) in damage {
            let at = index.index(message.len());
            message[at] = byte;
        }
        read_everything(&message);
    }

    #[test]
    fn small_numbers_in_headers_make_no_view_panic(
        words in proptest::collection::vec(prop_oneof![0_u32..4, any::<u32>()], 0..80),
    ) {
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        read_everything(&bytes);
    }
}
