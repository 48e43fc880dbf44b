use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use super::{Healed, heal};
use crate::fixtures::joined;
use crate::geometry::{Solidity, SourceMesh, SourcePart};

fn part(mesh: SourceMesh) -> SourcePart {
    SourcePart { name: "p".into(), origin: "p.obj".into(), mesh }
}

fn healed(mesh: SourceMesh) -> Healed {
    heal(&part(mesh)).unwrap()
}

fn refusal(mesh: SourceMesh) -> String {
    heal(&part(mesh)).unwrap_err().to_string()
}

/// An axis-aligned box, outward.
fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> SourceMesh {
    let vertices =
        (0..8).map(|i| std::array::from_fn(|k| if i >> k & 1 == 0 { lo[k] } else { hi[k] })).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
    SourceMesh { vertices, triangles }
}

fn cube() -> SourceMesh {
    cuboid([0.0; 3], [1.0; 3])
}

fn inverted(mut mesh: SourceMesh) -> SourceMesh {
    mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    mesh
}

/// Every triangle with three vertices of its own.
fn soup(mesh: &SourceMesh) -> SourceMesh {
    let vertices: Vec<[f64; 3]> =
        mesh.triangles.iter().flatten().map(|&v| mesh.vertices[v as usize]).collect();
    let triangles = (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    SourceMesh { vertices, triangles }
}

fn says(healed: &Healed, what: &str) {
    assert!(healed.findings.iter().any(|f| f.contains(what)), "{what}: {:?}", healed.findings);
}

fn closed(healed: &Healed, volume: f64) {
    assert_eq!(healed.mesh.solidity, Solidity::Closed, "{:?}", healed.findings);
    let got = healed.mesh.volume();
    assert!((got - volume).abs() <= 1e-6 * volume.abs(), "{got} instead of {volume}: {:?}", healed.findings);
    assert!(healed.mesh.edges().iter().all(|e| e.triangles.len() == 2));
}

#[test]
fn a_clean_cube_is_left_as_it_is() {
    let result = healed(cube());
    closed(&result, 1.0);
    assert_eq!(result.findings, [""; 0]);
    assert_eq!(result.mesh.bounds(), (Point3::origin(), Point3::new(1.0, 1.0, 1.0)));
    assert_eq!(result.mesh.edges().len(), 18);
}

#[test]
fn a_soup_of_triangles_is_welded() {
    let result = healed(soup(&cube()));
    closed(&result, 1.0);
    assert_eq!(result.mesh.vertices.len(), 8);
    says(&result, "28 duplicate vertices merged");
}

#[test]
fn a_soup_with_rounding_noise_is_welded_too() {
    let mut mesh = soup(&cuboid([1000.0; 3], [1001.0; 3]));
    for (i, vertex) in mesh.vertices.iter_mut().enumerate() {
        vertex[i % 3] += 1e-7 * ((i % 5) as f64 - 2.0);
    }
    closed(&healed(mesh), 1.0);
}

#[test]
fn small_features_survive_welding() {
    let mesh = joined([soup(&cube()), soup(&cuboid([2.0, 0.0, 0.0], [2.0 + 1e-5, 1e-5, 1e-5]))]);
    let result = healed(mesh);
    closed(&result, 1.0);
    assert_eq!(result.mesh.vertices.len(), 16);
}

#[test]
fn an_inverted_cube_is_turned() {
    let result = healed(inverted(cube()));
    closed(&result, 1.0);
    says(&result, "1 shell turned");
}

#[test]
fn a_void_stays_a_void_however_it_is_given() {
    let inner = cuboid([0.25; 3], [0.75; 3]);
    for inner in [inner.clone(), inverted(inner)] {
        let result = healed(joined([cube(), inner]));
        closed(&result, 1.0 - 0.125);
        says(&result, "1 inner shell taken as a void");
    }
}

#[test]
fn a_body_in_a_void_is_solid_again() {
    let shells = [cube(), cuboid([0.2; 3], [0.8; 3]), cuboid([0.4; 3], [0.6; 3]), cuboid([2.0; 3], [3.0; 3])];
    closed(&healed(joined(shells)), 1.0 - 0.216 + 0.008 + 1.0);
}

#[test]
fn a_missing_face_is_told() {
    let mut mesh = cube();
    mesh.triangles.truncate(10);
    for mesh in [mesh.clone(), inverted(mesh)] {
        let result = healed(mesh);
        assert_eq!(result.mesh.solidity, Solidity::Wall);
        says(&result, "4 edges without neighbour: not closed");
        assert!(result.mesh.volume() > 0.0);
    }
}

#[test]
fn shells_that_cross_or_touch_are_signed_by_winding_number() {
    for other in [
        cuboid([0.5; 3], [1.5; 3]),
        cuboid([1.0, 0.1, 0.1], [2.0, 0.9, 0.9]),
        cuboid([0.25, 0.25, -1.0], [0.75, 0.75, 2.0]),
    ] {
        let result = healed(joined([cube(), other]));
        assert_eq!(result.mesh.solidity, Solidity::Winding);
        says(&result, "2 shells that cross or touch");
    }
}

#[test]
fn a_shell_that_crosses_itself_is_signed_by_winding_number() {
    // A bar bent back through itself: a fold of the top pulled down through the bottom.
    let mut mesh = joined([cube()]);
    let tip = mesh.vertices.len() as u32;
    mesh.vertices.push([0.6, 0.5, -0.5]);
    let top = mesh.triangles.iter().position(|t| t.iter().all(|&v| v >= 4)).unwrap();
    let [a, b, c] = mesh.triangles[top];
    mesh.triangles[top] = [a, b, tip];
    mesh.triangles.extend([[b, c, tip], [c, a, tip]]);
    let result = healed(mesh);
    assert_eq!(result.mesh.solidity, Solidity::Winding);
    says(&result, "1 shell crosses itself");
}

#[test]
fn bodies_that_share_a_wall_become_one() {
    let result = healed(joined([cube(), cuboid([1.0, 0.0, 0.0], [2.0, 1.0, 1.0])]));
    if result.mesh.solidity == Solidity::Closed {
        closed(&result, 2.0);
        says(&result, "4 duplicate triangles dropped");
    }
}

#[test]
fn a_body_that_touches_itself_along_an_edge_is_closed() {
    // Two cubes that meet in an edge, joined by a bridge of two more: one shell.
    let unit = |x: f64, y: f64, z: f64| cuboid([x, y, z], [x + 1.0, y + 1.0, z + 1.0]);
    let mesh =
        joined([unit(0., 0., 0.), unit(1., 1., 0.), unit(0., 0., 1.), unit(1., 0., 1.), unit(1., 1., 1.)]);
    // Equal diagonals on shared walls: made so by listing both.
    let result = healed(mesh);
    if result.mesh.solidity == Solidity::Closed {
        closed(&result, 5.0);
    }
    assert!((result.mesh.volume() - 5.0).abs() < 1e-9, "{:?}", result.findings);
}

#[test]
fn degenerate_and_repeated_triangles_are_dropped() {
    let mut mesh = cube();
    mesh.vertices.extend([[0.5, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    mesh.triangles.extend([[0, 0, 1], [0, 8, 1], [0, 9, 1], [0, 1, 3]]);
    let twice = mesh.triangles[4];
    mesh.triangles.push(twice);
    mesh.triangles.push([twice[1], twice[0], twice[2]]);
    let result = healed(mesh);
    closed(&result, 1.0);
    says(&result, "degenerate triangles dropped");
    says(&result, "duplicate triangles dropped");
}

#[test]
fn a_sliver_that_belongs_to_the_surface_leaves_no_gap() {
    let mut mesh = cube();
    // The middle of an edge, used on one side only, the gap filled by a flat triangle.
    let [a, b] = [0u32, 1u32];
    mesh.vertices.push([0.5, 0.0, 0.0]);
    let at = mesh.triangles.iter().position(|t| t.contains(&a) && t.contains(&b)).unwrap();
    let t = mesh.triangles[at];
    let swap = |from: u32| t.map(|v| if v == from { 8 } else { v });
    mesh.triangles[at] = swap(a);
    mesh.triangles.push(swap(b));
    let unfilled = mesh.clone();
    let (first, second) =
        if t.iter().position(|v| *v == a) < t.iter().position(|v| *v == b) { (b, a) } else { (a, b) };
    mesh.triangles.push([second, 8, first]);
    for (mesh, word) in [(mesh, "degenerate"), (unfilled, "split where a vertex")] {
        let result = healed(mesh);
        closed(&result, 1.0);
        says(&result, word);
    }
}

#[test]
fn what_has_no_volume_is_refused() {
    let mut flat = cube();
    flat.vertices.iter_mut().for_each(|v| v[2] = v[0]);
    let mut line = cube();
    line.vertices.iter_mut().for_each(|v| *v = [v[0], 2.0 * v[0], 0.0]);
    let mut point = cube();
    point.vertices.iter_mut().for_each(|v| *v = [1.0; 3]);
    let mut bad_index = cube();
    bad_index.triangles[3][1] = 8;
    let with = |value: f64| {
        let mut mesh = cube();
        mesh.vertices[3][1] = value;
        mesh
    };
    let cases = [
        (SourceMesh::default(), "no vertices"),
        (SourceMesh { triangles: vec![], ..cube() }, "no triangles"),
        (flat, "one plane"),
        (line, "one line"),
        (point, "one place"),
        (bad_index, "triangle 3 uses vertex 8"),
        (with(f64::NAN), "not finite"),
        (with(f64::INFINITY), "not finite"),
        (with(1e300), "1e90"),
    ];
    for (mesh, expected) in cases {
        let error = refusal(mesh);
        assert!(error.contains(expected) && error.contains("p.obj: part `p`"), "{error}");
    }
}

#[test]
fn unused_vertices_count_for_nothing() {
    let mut mesh = cube();
    mesh.vertices.push([1e9, f64::NAN, 0.0]);
    let result = healed(mesh);
    closed(&result, 1.0);
    says(&result, "1 vertex that no triangle uses dropped");
    assert_eq!(result.mesh.bounds().1, Point3::new(1.0, 1.0, 1.0));
}

#[test]
fn scale_does_not_matter() {
    for scale in [1e-30, 1e-7, 1e7, 1e30] {
        let mesh = joined([cuboid([0.0; 3], [scale; 3]), cuboid([0.25 * scale; 3], [0.75 * scale; 3])]);
        closed(&healed(mesh), 0.875 * scale.powi(3));
    }
}

proptest! {
    #[test]
    fn any_mess_of_a_box_heals(
        seed in proptest::collection::vec(any::<u8>(), 12),
        lo in proptest::array::uniform3(-100.0f64..100.0),
        size in proptest::array::uniform3(0.01f64..100.0),
    ) {
        let hi = std::array::from_fn(|k| lo[k] + size[k]);
        let mut mesh = cuboid(lo, hi);
        for (triangle, byte) in mesh.triangles.iter_mut().zip(&seed) {
            triangle.rotate_left(usize::from(byte % 3));
            if byte & 4 != 0 { triangle.swap(0, 1); }
        }
        for byte in &seed {
            if byte & 8 != 0 {
                let again = mesh.triangles[usize::from(byte >> 4) % 12];
                mesh.triangles.push(again);
            }
        }
        let volume = Vector3::from(size).product();
        closed(&healed(mesh.clone()), volume);
        closed(&healed(soup(&mesh)), volume);
    }

    #[test]
    fn no_mesh_makes_it_panic(
        points in proptest::collection::vec(-3i8..4, 3..40),
        corners in proptest::collection::vec(0u32..12, 3..60),
    ) {
        let vertices = points.chunks_exact(3).map(|p| [p[0], p[1], p[2]].map(f64::from)).collect();
        let triangles = corners.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
        if let Ok(result) = heal(&part(SourceMesh { vertices, triangles })) {
            let count = result.mesh.vertices.len();
            prop_assert!(result.mesh.triangles.iter().flatten().all(|&v| (v as usize) < count));
            if result.mesh.solidity == Solidity::Closed {
                prop_assert!(result.mesh.edges().iter().all(|e| e.triangles.len() == 2));
            }
        }
    }
}
