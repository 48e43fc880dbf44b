//! Changes of a known assembly, asked of the real daemon.

mod common;

use common::{Boxes, Daemon, plan};
use sbdp_client::{Change, Client, ErrorCode, Handle, Part, PlanOptions, PlanStatus, Vertices};

#[test]
fn acts_as_a_client_process() {
    common::act_as_client();
}

fn uploaded(daemon: &Daemon) -> (Client, Handle) {
    let client = daemon.connect();
    let handle = client.upload(&Boxes::two().assembly()).unwrap();
    (client, handle)
}

fn shift(x: f64, y: f64, z: f64) -> [f64; 7] {
    [x, y, z, 1.0, 0.0, 0.0, 0.0]
}

/// The overlap of the two boxes as the daemon measured it.
fn overlap(client: &Client, handle: Handle, options: &PlanOptions) -> f64 {
    let (parts, summary) = plan(client, handle, options);
    assert_eq!((summary.status, parts.len()), (PlanStatus::Complete, 1), "one may stay");
    summary.overlaps.iter().map(|o| o.depth).sum()
}

#[test]
fn a_part_that_was_moved_is_planned_where_it_is() {
    let daemon = Daemon::start();
    let (client, handle) = uploaded(&daemon);
    let moved = |z: f64| PlanOptions { moved: vec![(1, shift(0.0, 0.0, z))], ..PlanOptions::default() };
    assert_eq!(overlap(&client, handle, &PlanOptions::default()), 0.0);
    assert_eq!(overlap(&client, handle, &moved(0.5)), 0.0);
    let depth = overlap(&client, handle, &moved(-0.125));
    assert!((depth - 0.125).abs() < 1e-3, "{depth}");
    assert_eq!(overlap(&client, handle, &PlanOptions::default()), 0.0, "the base is as it was");
}

#[test]
fn a_revision_is_an_assembly_like_any_other() {
    let daemon = Daemon::start();
    let (client, handle) = uploaded(&daemon);
    let boxes = Boxes::lattice(2);
    let assembly = boxes.assembly();
    let part = Part { name: "lid", ..assembly.parts[0] };
    let change = Change {
        replaced: vec![(1, assembly.parts[1])],
        added: vec![part],
        moved: vec![(0, shift(4.0, 0.0, 0.0))],
    };
    let revised = client.revise(handle, &change).unwrap();
    assert!(revised != handle && client.knows(revised).unwrap() && client.knows(handle).unwrap());
    assert_eq!(client.revise(handle, &change).unwrap(), revised, "the same change has the same handle");
    let (parts, summary) = plan(&client, revised, &PlanOptions::default());
    assert_eq!((summary.status, parts.len()), (PlanStatus::Complete, 2), "one may stay");
    assert_eq!(summary.parts, ["0", "1", "lid"], "a replaced part keeps its name");
    let again =
        client.revise(revised, &Change { moved: vec![(2, shift(0.0, 0.0, 0.25))], ..Change::default() });
    assert!(client.knows(again.unwrap()).unwrap(), "revisions can be revised");
}

#[test]
fn what_cannot_be_changed_is_refused_with_the_reason() {
    let daemon = Daemon::start();
    let (client, handle) = uploaded(&daemon);
    let refusal = |base: Handle, change: &Change<'_>| client.revise(base, change).unwrap_err();
    let nothing = refusal(Handle([9; 32]), &Change::default());
    assert_eq!(nothing.code(), Some(ErrorCode::UnknownHandle), "{nothing}");
    let none = refusal(handle, &Change { moved: vec![(7, shift(1.0, 0.0, 0.0))], ..Change::default() });
    assert!(
        none.code() == Some(ErrorCode::NoSuchPart) && none.to_string().contains("part 7 in `moved`"),
        "{none}"
    );
    let empty = Part { name: "", vertices: Vertices::F64(&[]), triangles: &[] };
    let empty = refusal(handle, &Change { replaced: vec![(1, empty)], ..Change::default() });
    assert!(empty.code() == Some(ErrorCode::Geometry) && empty.to_string().contains("`1`"), "{empty}");
    let options = PlanOptions { moved: vec![(1, [f64::NAN; 7])], ..PlanOptions::default() };
    let mut stream = client.plan(handle, &options).unwrap();
    let error = loop {
        match common::next_event(&mut stream) {
            Ok(Some(_)) => {}
            Ok(None) => panic!("answered"),
            Err(error) => break error,
        }
    };
    assert!(error.to_string().contains("not finite"), "{error}");
}
