//! What cannot be used is refused by name, and nothing that comes through the network ends the gateway.

mod common;

use std::io::{Read, Write};
use std::net::TcpStream;

use common::{Daemon, Gateway, Lattice, code, pieces, request, status, to_end, upload};
use sbdp_gateway::proto::upload_request::Piece;
use sbdp_gateway::proto::{self, HaveRequest, PlanRequest, UploadRequest};
use tonic::{Code, Status};

#[test]
fn acts_as_the_daemon() {
    common::act_as_the_daemon();
}

fn assert_names(refused: &Status, name: &str, what: &str) {
    assert_eq!(refused.code(), Code::InvalidArgument, "{what}: {refused}");
    assert!(refused.message().contains(name), "{what}: {refused}");
    code(refused);
}

/// Two boxes, with the second one changed.
fn changed(change: impl Fn(&mut proto::Mesh)) -> Vec<UploadRequest> {
    let boxes = Lattice::new(2);
    let mut messages = pieces(&boxes.assembly(), 1000);
    for message in &mut messages {
        if let Some(Piece::Mesh(mesh)) = &mut message.piece
            && mesh.name == "5"
        {
            change(mesh);
        }
    }
    messages
}

#[tokio::test]
async fn uploads_that_make_no_sense_name_the_part() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let vertices = |mesh: &mut proto::Mesh, change: fn(&mut Vec<u8>)| {
        if !mesh.vertices_f64.is_empty() {
            let mut bytes = mesh.vertices_f64.to_vec();
            change(&mut bytes);
            mesh.vertices_f64 = bytes.into();
        }
    };
    let triangles = |mesh: &mut proto::Mesh, change: fn(&mut Vec<u8>)| {
        if !mesh.triangles.is_empty() {
            let mut bytes = mesh.triangles.to_vec();
            change(&mut bytes);
            mesh.triangles = bytes.into();
        }
    };
    let uploads: [(&str, Vec<UploadRequest>); 8] = [
        (
            "an index out of range",
            changed(|mesh| triangles(mesh, |b| b[..4].copy_from_slice(&8u32.to_le_bytes()))),
        ),
        (
            "a vertex that is no number",
            changed(|mesh| vertices(mesh, |b| b[..8].copy_from_slice(&f64::NAN.to_le_bytes()))),
        ),
        (
            "an infinite vertex",
            changed(|mesh| vertices(mesh, |b| b[..8].copy_from_slice(&f64::INFINITY.to_le_bytes()))),
        ),
        ("half a vertex", changed(|mesh| vertices(mesh, |b| b.truncate(b.len() - 4)))),
        ("half a triangle", changed(|mesh| triangles(mesh, |b| b.truncate(b.len() - 4)))),
        ("no vertices", changed(|mesh| mesh.vertices_f64 = Vec::new().into())),
        ("no triangles", changed(|mesh| mesh.triangles = Vec::new().into())),
        ("both kinds of vertices", changed(|mesh| mesh.vertices_f32 = vec![0; 12].into())),
    ];
    for (what, messages) in uploads {
        let refused = caller.upload(tokio_stream::iter(messages)).await.unwrap_err();
        assert_names(&refused, "5", what);
    }
    let mut twice = changed(|_| {});
    twice.extend(changed(|_| {}).split_off(1));
    let refused = caller.upload(tokio_stream::iter(twice)).await.unwrap_err();
    assert_names(&refused, "part `0`", "a name that comes twice");
    let nothing: Vec<UploadRequest> = Vec::new();
    let refused = caller.upload(tokio_stream::iter(nothing)).await.unwrap_err();
    assert_names(&refused, "assembly", "no message");
    upload(&mut caller, &Lattice::new(2).assembly()).await;
}

#[tokio::test]
async fn uploads_that_are_too_long_are_refused() {
    let daemon = Daemon::start();
    let limits = "[limits]\nmessage_mb = 1\nuploads_mb = 2\nuploads_mb_per_client = 2\n";
    let gateway = Gateway::start_with(&daemon, limits);
    let mut caller = gateway.connect().await;
    let piece = |bytes: usize| {
        let mesh = proto::Mesh {
            name: "part".to_owned(),
            vertices_f64: vec![0; bytes].into(),
            ..proto::Mesh::default()
        };
        UploadRequest { piece: Some(Piece::Mesh(mesh)) }
    };
    let begin = UploadRequest { piece: Some(Piece::Assembly(proto::Assembly::default())) };
    let long_message = vec![begin.clone(), piece(24), piece(24 * 50_000)];
    let refused = caller.upload(tokio_stream::iter(long_message)).await.unwrap_err();
    assert_names(&refused, "part `part` has more than 1 MB", "a long message");
    assert_eq!(code(&refused), 11);
    let long_upload = vec![begin.clone(), piece(24 * 40_000), piece(24 * 40_000), piece(24 * 40_000)];
    let refused = caller.upload(tokio_stream::iter(long_upload)).await.unwrap_err();
    assert_names(&refused, "limits.uploads_mb_per_client", "a long upload");
    assert_eq!(code(&refused), 11);
    upload(&mut caller, &Lattice::new(2).assembly()).await;
}

#[tokio::test]
async fn requests_that_make_no_sense_name_the_field_or_part() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let mut caller = gateway.connect().await;
    let handle = upload(&mut caller, &Lattice::new(2).assembly()).await;
    let known = || request(&handle);
    let moved = |x: f64, qw: f64| {
        let motion = proto::Motion { x, qw, ..proto::Motion::default() };
        vec![proto::MovedPart { part: 1, motion: Some(motion) }]
    };
    for (name, wanted) in [
        ("planner", PlanRequest { planner: 99, ..known() }),
        ("timeout_s", PlanRequest { timeout_s: Some(-1.0), ..known() }),
        ("handle", PlanRequest { handle: vec![1].into(), ..known() }),
        ("cancel_key", PlanRequest { cancel_key: "x".repeat(1000), ..known() }),
        ("8", PlanRequest { fixed: vec![8], ..known() }),
        ("9", PlanRequest { targets: Some(proto::PartList { parts: vec![9] }), ..known() }),
        ("8", PlanRequest { removed: vec![8], ..known() }),
        ("8", PlanRequest { groups: vec![proto::PartList { parts: vec![0, 8] }], ..known() }),
        ("end_gap", PlanRequest { end_gap: Some(f64::NAN), ..known() }),
        ("clearance", PlanRequest { clearance: -1.0, ..known() }),
        ("up", PlanRequest { up: Some(proto::Vector::default()), ..known() }),
        ("stiffness", PlanRequest { penalty: [("stiffness".to_owned(), f64::NAN)].into(), ..known() }),
        ("1", PlanRequest { moved: moved(f64::NAN, 1.0), ..known() }),
        ("1", PlanRequest { moved: moved(0.0, 0.0), ..known() }),
    ] {
        let refused = match caller.plan(wanted).await {
            Err(refused) => refused,
            Ok(events) => to_end(events.into_inner()).await.unwrap_err(),
        };
        assert_names(&refused, name, name);
    }
    let unknown = to_end(caller.plan(request(&[7; 32])).await.unwrap().into_inner()).await.unwrap_err();
    assert_eq!((unknown.code(), code(&unknown)), (Code::NotFound, 2), "{unknown}");
    assert!(unknown.message().contains("upload"), "{unknown}");
    let short = caller.have(HaveRequest { handle: vec![0; 31].into() }).await.unwrap_err();
    assert_names(&short, "31 bytes", "a short handle");
    to_end(caller.plan(known()).await.unwrap().into_inner()).await.unwrap();
}

#[tokio::test]
async fn garbage_ends_its_own_connection_only() {
    let daemon = Daemon::start();
    let gateway = Gateway::start(&daemon);
    let address = gateway.address.strip_prefix("http://").unwrap().to_owned();
    let mut caller = gateway.connect().await;
    let preface = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    let mut settings_then_noise = preface.clone();
    settings_then_noise.extend([0, 0, 0, 4, 0, 0, 0, 0, 0]);
    settings_then_noise.extend((0..=255u8).cycle().take(10_000));
    for bytes in [b"GET / HTTP/1.1\r\n\r\n".to_vec(), vec![0; 10_000], preface, settings_then_noise] {
        let mut stream = TcpStream::connect(&address).unwrap();
        // The gateway may hang up before it has read all.
        let _ = stream.write_all(&bytes);
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let _ = stream.read_to_end(&mut Vec::new());
        status(&mut caller).await;
    }
    let unknown = gateway.call_unknown_service().await;
    assert_eq!(unknown.code(), Code::Unimplemented);
    assert!(unknown.message().contains("sbdp.v1.PlannerService"), "{unknown}");
}
