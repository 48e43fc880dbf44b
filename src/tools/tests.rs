//! Pockets whose largest swing is known.

use std::collections::HashSet;

use nalgebra::Point3;

use super::shapes::ToolKind::{OpenEndWrench, RingSpanner, Socket};
use super::*;
use crate::fixtures::{cuboid, healed, nut, rod, shape_of, tube};
use crate::geometry::SourceMesh;

/// Half of the width of the ring's handle, in widths across flats.
const HALF_HANDLE: f64 = 0.28;

/// A nut of 1 across its flats, 0.8 high, on z = 0.
fn fastener() -> Fastener {
    Fastener::of(&shape_of(&healed(nut(1.0, 0.3, 0.8))).surface).unwrap()
}

fn rooms(around: impl IntoIterator<Item = SourceMesh>, pose: &Pose) -> Vec<ToolRoom> {
    let shapes: Vec<Shape> = around.into_iter().map(|mesh| shape_of(&healed(mesh))).collect();
    let obstacles: Vec<SurroundingPart<'_>> =
        shapes.iter().enumerate().map(|(part, shape)| SurroundingPart { part, shape, pose: *pose }).collect();
    let outward = Unit::new_normalize(pose.rotation * Vector3::z());
    tool_rooms(&fastener(), pose, &outward, &obstacles, &Termination::default()).unwrap()
}

fn room(found: &[ToolRoom], kind: ToolKind) -> &ToolRoom {
    found.iter().find(|room| room.kind == kind).unwrap()
}

/// A post about a line along z.
fn post(distance: f64, degrees: f64, radius: f64) -> SourceMesh {
    let mut mesh = rod(radius, [0.0, 3.0], 48);
    let (sin, cos) = degrees.to_radians().sin_cos();
    mesh.vertices.iter_mut().for_each(|v| {
        v[0] += distance * cos;
        v[1] += distance * sin;
    });
    mesh
}

fn plate() -> SourceMesh {
    cuboid([-20.0, -20.0, -1.0], [20.0, 20.0, 0.0])
}

#[test]
fn on_an_open_plate_everything_turns() {
    let bolt = rod(0.28, [0.0, 1.5], 48);
    for room in rooms([plate(), bolt], &Pose::new([3.0, 1.0, -2.0].into(), [0.4, 1.0, -0.3].into())) {
        assert!(room.swing == TAU && room.blocked_by.is_empty() && room.is_enough(), "{room:?}");
    }
}

#[test]
fn between_two_posts_a_handle_swings_by_the_angle_that_they_leave() {
    for [one, other] in [[0.0, 100.0], [20.0, 75.0], [-170.0, 40.0]] {
        let (distance, radius) = (6.0, 0.5);
        // The handle stops where its side is as far from the post's axis as its radius.
        let stopped = ((radius + HALF_HANDLE + TOOL_GAP) / distance).asin();
        let between = f64::to_radians(other - one);
        let expected = between.max(TAU - between) - 2.0 * stopped;
        let posts = [post(distance, one, radius), post(distance, other, radius)];
        let found = rooms([plate()].into_iter().chain(posts), &Pose::identity());
        let ring = room(&found, RingSpanner);
        assert!((ring.swing - expected).abs() < f64::to_radians(1.1), "{ring:?}, {expected}");
        assert_eq!(ring.blocked_by, [1, 2]);
        assert_eq!(room(&found, Socket).swing, TAU);
    }
}

#[test]
fn a_narrow_gap_between_posts_is_not_enough() {
    // Posts all around, 24° from each other.
    let posts = (0..15).map(|i| post(4.0, f64::from(i) * 24.0, 0.4));
    let found = rooms([plate()].into_iter().chain(posts), &Pose::identity());
    for kind in [RingSpanner, OpenEndWrench] {
        let room = room(&found, kind);
        assert!(room.swing < f64::to_radians(24.0) && !room.is_enough(), "{room:?}");
    }
    assert!(room(&found, Socket).is_enough());
}

#[test]
fn in_a_deep_bore_only_a_socket_reaches_if_the_bore_is_wide_enough() {
    for (radius, reaches) in [(0.7, false), (0.9, true)] {
        let found = rooms([plate(), tube(radius, 3.0, [0.0, 4.0], 48)], &Pose::identity());
        let socket = room(&found, Socket);
        assert_eq!(socket.is_enough(), reaches, "{radius}: {socket:?}");
        let ring = room(&found, RingSpanner);
        assert_eq!((ring.swing, &ring.blocked_by[..]), (0.0, &[1][..]));
    }
}

#[test]
fn under_a_lid_only_an_open_end_gets_to_the_nut() {
    let lid = cuboid([-2.0, -2.0, 1.0], [2.0, 2.0, 1.5]);
    let found = rooms([plate(), lid], &Pose::identity());
    for kind in [Socket, RingSpanner] {
        assert_eq!((room(&found, kind).swing, &room(&found, kind).blocked_by[..]), (0.0, &[1][..]));
    }
    assert!(room(&found, OpenEndWrench).is_enough());
}

#[test]
fn the_longest_run_goes_around_the_circle() {
    let arcs = [None, None, Some(3), None, Some(4), None];
    assert_eq!(longest_free(&arcs), Some((5, 3)));
    assert_eq!(longest_free(&[None; 4]), Some((0, 4)));
    assert_eq!(longest_free(&[Some(1); 4]), None);
}

#[test]
fn tools_are_closed_and_turn_outwards() {
    for kind in [Socket, RingSpanner, OpenEndWrench, ToolKind::HexKey] {
        let tool = Tool::new(kind, 2.0, 1.5, &Termination::default()).unwrap();
        let edges: HashSet<[u32; 2]> =
            tool.shape.surface.triangles().iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]).collect();
        assert!(edges.iter().all(|&[a, b]| edges.contains(&[b, a])), "{kind:?}");
        let volume = |t: u32| {
            let [a, b, c] = tool.shape.surface.corners(t).map(|p: Point3<f64>| p.coords);
            a.dot(&b.cross(&c)) / 6.0
        };
        let count = tool.shape.surface.triangles().len() as u32;
        assert!((0..count).map(volume).sum::<f64>() > 0.0, "{kind:?}");
    }
}
