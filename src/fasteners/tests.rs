//! Fasteners by the sizes of their standards, and what looks like them.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::*;
use crate::fixtures::{Ring, cuboid, joined, moved, nut, rod, surface, tube, turned};
use crate::geometry::SourceMesh;

/// With its head below.
fn hexagon_screw(across: f64, shank: f64, head: f64, length: f64) -> SourceMesh {
    use Ring::{Hexagon, Round};
    turned(&[
        (Round(0.0), 0.0),
        (Hexagon(across), 0.0),
        (Hexagon(across), head),
        (Round(shank), head),
        (Round(shank), head + length),
        (Round(0.0), head + length),
    ])
}

/// With its head below, which is as wide as the shank for a set screw.
fn socket_screw(across: f64, shank: f64, [head, height]: [f64; 2], length: f64) -> SourceMesh {
    use Ring::{Hexagon, Round};
    turned(&[
        (Round(0.0), height / 2.0),
        (Hexagon(across), height / 2.0),
        (Hexagon(across), 0.0),
        (Round(head), 0.0),
        (Round(head), height),
        (Round(shank), height),
        (Round(shank), height + length),
        (Round(0.0), height + length),
    ])
}

fn tilted() -> Pose {
    Pose::new([30.0, -7.0, 2.0].into(), [0.4, -1.1, 0.7].into())
}

fn fastener(mesh: SourceMesh) -> Option<Fastener> {
    Fastener::of(&surface(mesh))
}

#[track_caller]
fn is(found: Option<&Fastener>, kind: FastenerKind, drive: Drive, across_flats: f64, diameter: f64) {
    let found = found.unwrap();
    assert_eq!((found.kind, found.drive), (kind, drive));
    assert!((found.across_flats / across_flats - 1.0).abs() < 1e-6, "{found:?}");
    // Between its facets' corners and middles.
    assert!((found.diameter() / diameter - 1.0).abs() < 3e-3, "{found:?}");
}

#[test]
fn nuts_and_screws_have_the_sizes_of_their_standards_wherever_they_stand() {
    for pose in [Pose::identity(), tilted()] {
        let of = |mesh| fastener(moved(mesh, &pose));
        // M8 by ISO 4032, 4014, 4762 and 4026; M3 and M36.
        is(of(nut(13.0, 4.2, 6.8)).as_ref(), FastenerKind::Nut, Drive::Hexagon, 13.0, 8.4);
        is(of(nut(5.5, 1.5, 2.4)).as_ref(), FastenerKind::Nut, Drive::Hexagon, 5.5, 3.0);
        let flange = turned(&[
            (Ring::Round(4.2), 0.0),
            (Ring::Round(8.9), 0.0),
            (Ring::Round(8.9), 2.0),
            (Ring::Hexagon(13.0), 2.0),
            (Ring::Hexagon(13.0), 8.0),
            (Ring::Round(4.2), 8.0),
        ]);
        is(of(flange).as_ref(), FastenerKind::Nut, Drive::Hexagon, 13.0, 8.4);
        is(of(nut(55.0, 18.0, 31.0)).as_ref(), FastenerKind::Nut, Drive::Hexagon, 55.0, 36.0);
        let screw = of(hexagon_screw(13.0, 4.0, 5.3, 40.0));
        is(screw.as_ref(), FastenerKind::Screw, Drive::Hexagon, 13.0, 8.0);
        let socket = |length| of(socket_screw(6.0, 4.0, [6.5, 8.0], length));
        is(socket(40.0).as_ref(), FastenerKind::Screw, Drive::HexagonSocket, 6.0, 8.0);
        is(socket(6.0).as_ref(), FastenerKind::Screw, Drive::HexagonSocket, 6.0, 8.0);
        let set = of(socket_screw(4.0, 4.0, [4.0, 5.0], 5.0));
        is(set.as_ref(), FastenerKind::Screw, Drive::HexagonSocket, 4.0, 8.0);
    }
}

#[test]
fn what_has_no_hexagon_of_the_size_of_a_thread_is_no_fastener() {
    use Ring::{Hexagon, Round};
    let teeth = joined((0..24).map(|tooth| {
        let turn = Pose::new([0.0; 3].into(), Vector3::z() * (f64::from(tooth) * TAU / 24.0));
        moved(cuboid([18.0, -1.0, 0.0], [22.0, 1.0, 10.0]), &turn)
    }));
    let others = [
        cuboid([0.0; 3], [1.0, 2.0, 3.0]),
        tube(4.2, 8.0, [0.0, 1.6], 32),
        rod(4.0, [0.0, 40.0], 36),
        // A hexagonal bar, a spacer with a wide hole, a plate with a small one, a bush for a hexagonal bar.
        turned(&[(Round(0.0), 0.0), (Hexagon(13.0), 0.0), (Hexagon(13.0), 50.0), (Round(0.0), 50.0)]),
        nut(13.0, 6.0, 6.8),
        nut(100.0, 4.0, 6.8),
        // A flange with a hexagonal boss.
        turned(&[
            (Round(4.2), 0.0),
            (Round(20.0), 0.0),
            (Round(20.0), 5.0),
            (Hexagon(13.0), 5.0),
            (Hexagon(13.0), 12.0),
            (Round(4.2), 12.0),
        ]),
        turned(&[(Hexagon(13.0), 0.0), (Round(20.0), 0.0), (Round(20.0), 5.0), (Hexagon(13.0), 5.0)]),
        teeth,
    ];
    for mesh in others {
        assert_eq!(fastener(mesh), None);
    }
}

#[test]
fn nuts_are_screwed_on_rods_in_them_and_screws_into_holes_without_play() {
    let at = |z: f64| Pose::translation(0.0, 0.0, z);
    let is_screwed = |fastener: SourceMesh, other: SourceMesh, pose: &Pose| {
        Fastener::of(&surface(moved(fastener, &tilted())))
            .unwrap()
            .is_screwed_to(&surface(other), &(pose * tilted().inverse()))
    };
    let on_rod = |radius, z| is_screwed(nut(13.0, 4.2, 6.8), rod(radius, [0.0, 50.0], 40), &at(z));
    assert!(on_rod(4.0, 20.0), "with play");
    assert!(on_rod(4.2, 20.0), "without");
    assert!(on_rod(4.0, 48.0), "at the end of the rod, with a quarter of the nut");
    assert!(!on_rod(4.0, 49.5), "with less than a pitch");
    assert!(!on_rod(4.0, -10.0), "beside it");
    assert!(!on_rod(3.0, 20.0), "a rod that passes through it");
    let aside = Pose::translation(1.0, 0.0, 20.0);
    assert!(!is_screwed(nut(13.0, 4.2, 6.8), rod(4.0, [0.0, 50.0], 40), &aside), "on another line");
    let screw = || hexagon_screw(13.0, 4.0, 5.3, 40.0);
    let in_hole = |radius, z| is_screwed(screw(), tube(radius, 12.0, [0.0, 20.0], 40), &at(z));
    assert!(in_hole(4.0, -5.3) && in_hole(3.3, -5.3), "the thread's own hole, and that of its core");
    assert!(!in_hole(4.2, -5.3), "a hole that it passes through");
    assert!(!in_hole(4.0, -50.0), "not yet in");
    assert!(!is_screwed(nut(13.0, 4.2, 6.8), tube(4.2, 12.0, [0.0, 20.0], 40), &at(5.0)), "a washer");
}
