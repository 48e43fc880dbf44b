//! Solids, surfaces and scenes that several modules' unit tests are written over.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_3;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

use crate::geometry::{
    Assembly, Mesh, Pose, Shape, Solidity, SourceAssembly, SourceMesh, SourcePart, Surface, heal,
};
use crate::plan::{Base, MotionKind, Plan, PlanKind, PlanStats, PlanStatus, PlanStep, StepEnd, Verifier};
use crate::scene::{CongruentPair, Scene};
use crate::sdf::Field;
use crate::termination::Termination;

pub(crate) use crate::bench::families::cells;

/// A box.
pub(crate) fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> SourceMesh {
    cells([&[lo[0], hi[0]], &[lo[1], hi[1]], &[lo[2], hi[2]]], |_| true)
}

/// A box without its upper face.
pub(crate) fn open_box(lo: [f64; 3], hi: [f64; 3]) -> SourceMesh {
    let mut mesh = cuboid(lo, hi);
    let SourceMesh { vertices, triangles } = &mut mesh;
    triangles.retain(|t| !t.iter().all(|&v| vertices[v as usize][2] == hi[2]));
    mesh
}

/// 2 × 2 × 1 without a quarter: the corner with x > 1 and y > 1 is missing.
pub(crate) fn l_shape() -> SourceMesh {
    cells([&[0.0, 1.0, 2.0], &[0.0, 1.0, 2.0], &[0.0, 1.0]], |c| c[0] + c[1] < 2)
}

/// A tube about z with `count` flat sides.
pub(crate) fn tube(inner: f64, outer: f64, z: [f64; 2], count: u32) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    for i in 0..count {
        let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / f64::from(count)).sin_cos();
        // Below and above at the outside, then the same at the inside.
        mesh.vertices.extend(
            [(outer, z[0]), (outer, z[1]), (inner, z[0]), (inner, z[1])].map(|(r, z)| [r * cos, r * sin, z]),
        );
        let (a, b) = (4 * i, 4 * ((i + 1) % count));
        for [s, t] in [[0, 1], [1, 3], [3, 2], [2, 0]] {
            mesh.triangles.extend([[a + s, b + s, b + t], [a + s, b + t, a + t]]);
        }
    }
    mesh
}

/// A rod about z with `count` flat sides.
pub(crate) fn rod(radius: f64, z: [f64; 2], count: u32) -> SourceMesh {
    let mut mesh = tube(0.0, radius, z, count);
    // The inner circle is one point below and one above.
    mesh.triangles.retain_mut(|t| {
        t.iter_mut().filter(|v| **v % 4 >= 2).for_each(|v| *v %= 4);
        t[0] != t[1] && t[1] != t[2] && t[2] != t[0]
    });
    mesh
}

/// Flat sides of what is round; a multiple of six.
const SECTORS: u32 = 48;

/// A ring around z.
#[derive(Clone, Copy)]
pub(crate) enum Ring {
    Round(f64),
    /// By the distance of its flats.
    Hexagon(f64),
}

impl Ring {
    fn radius(self, angle: f64) -> f64 {
        match self {
            Self::Round(radius) => radius,
            Self::Hexagon(across) => across / 2.0 / (angle.rem_euclid(FRAC_PI_3) - FRAC_PI_3 / 2.0).cos(),
        }
    }
}

/// A solid between rings, each at its height: counter-clockwise around the material if x leads outward and z up. Radii of 0
/// close it at the axis.
pub(crate) fn turned(profile: &[(Ring, f64)]) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    let count = profile.len() as u32;
    for sector in 0..SECTORS {
        let angle = f64::from(sector) * std::f64::consts::TAU / f64::from(SECTORS);
        for (ring, z) in profile {
            let radius = ring.radius(angle);
            mesh.vertices.push([radius * angle.cos(), radius * angle.sin(), *z]);
        }
        let (here, next) = (sector * count, (sector + 1) % SECTORS * count);
        for i in 0..count {
            let j = (i + 1) % count;
            mesh.triangles.extend([[here + i, next + i, next + j], [here + i, next + j, here + j]]);
        }
    }
    mesh
}

/// A nut about z, by the distance of its flats and the radius of its hole.
pub(crate) fn nut(across: f64, hole: f64, height: f64) -> SourceMesh {
    use Ring::{Hexagon, Round};
    turned(&[(Round(hole), 0.0), (Hexagon(across), 0.0), (Hexagon(across), height), (Round(hole), height)])
}

/// A bearing about z with a slot towards +x, and in it a shaft of radius 1 with two flats, turned from where they are
/// along the slot by an angle. It is `excess` wider across its flats than the slot where that is narrowest, has play
/// otherwise, and a head at each end.
pub(crate) fn flats_in_slot(turned: f64, play: f64, excess: f64) -> [SourceMesh; 2] {
    // Half of the angle of the slot, in radians; and the flat sides around all but the slot.
    const SLOT: f64 = 0.6;
    const SIDES: u32 = 48;
    let mut bearing = tube(1.0 + play, 3.0, [-1.0, 2.0], SIDES);
    // All but the slot: the last side is left out, and the others share its angle.
    let turn = |(i, v): (usize, &mut [f64; 3])| {
        let angle = SLOT + (std::f64::consts::TAU - 2.0 * SLOT) * (i / 4) as f64 / f64::from(SIDES - 1);
        let radius = v[0].hypot(v[1]);
        (v[0], v[1]) = (radius * angle.cos(), radius * angle.sin());
    };
    bearing.vertices.iter_mut().enumerate().for_each(turn);
    let last = 4 * (SIDES - 1);
    bearing.triangles.retain(|t| !(t.iter().any(|v| *v < 4) && t.iter().any(|v| *v >= last)));
    bearing.triangles.extend([[2, 0, 1], [2, 1, 3], [last, last + 2, last + 3], [last, last + 3, last + 1]]);

    let flat = ((1.0 + play) * SLOT.sin() + excess / 2.0).asin();
    let arc = |from: f64| (0..=8).map(move |k| from - flat + 2.0 * flat * f64::from(k) / 8.0 + turned);
    let outline: Vec<f64> = arc(0.0).chain(arc(std::f64::consts::PI)).collect();
    let count = outline.len() as u32;
    let mut shaft = SourceMesh::default();
    for angle in outline {
        shaft.vertices.extend([-1.2, 2.2].map(|z| [angle.cos(), angle.sin(), z]));
    }
    for i in 0..count {
        let (a, b) = (2 * i, 2 * ((i + 1) % count));
        shaft.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
    }
    for i in 1..count - 1 {
        shaft.triangles.extend([[0, 2 * i + 2, 2 * i], [1, 2 * i + 1, 2 * i + 3]]);
    }
    [bearing, joined([shaft, rod(1.4, [2.1, 2.8], 24), rod(1.4, [-1.8, -1.1], 24)])]
}

/// A bolt along z with a rounded thread over its whole length of 6, and a nut of height 1 that has
/// so many turns to go before it is off: right-handed, with a play of 0.03 everywhere.
pub(crate) fn thread(turns: f64, pitch: f64) -> [SourceMesh; 2] {
    const LENGTH: f64 = 6.0;
    const PLAY: f64 = 0.03;
    let wave = |angle: f64, z: f64| 1.0 + 0.1 * (std::f64::consts::TAU * z / pitch - angle).sin();
    let bolt = revolved([0.0, LENGTH], pitch / 8.0, &[&|_, _| 0.0, &wave]);
    let low = LENGTH - turns * pitch;
    let nut = revolved([low, low + 1.0], pitch / 8.0, &[&|a, z| wave(a, z) + PLAY, &|_, _| 1.8]);
    [bolt, nut]
}

/// A helical tube about z, and a wire in it that is as long: 2.5 turns, right-handed, 2.5 high a turn, with a play of 0.03
/// everywhere.
pub(crate) fn wire_in_tube() -> [SourceMesh; 2] {
    const TURNS: f64 = 2.5;
    let coiled = |radii: &[&dyn Fn(f64, f64) -> f64; 2]| {
        let mut straight = revolved([0.0, TURNS], 1.0 / 48.0, radii);
        for vertex in &mut straight.vertices {
            let [x, y, turns] = *vertex;
            let (sin, cos) = (std::f64::consts::TAU * turns).sin_cos();
            *vertex = [(1.0 + x) * cos - y * sin, (1.0 + x) * sin + y * cos, 2.5 * turns];
        }
        straight
    };
    [coiled(&[&|_, _| 0.33, &|_, _| 0.5]), coiled(&[&|_, _| 0.0, &|_, _| 0.3])]
}

/// The solid about z between an inner and an outer radius that depend on angle and height, in
/// rows of a given height; an inner radius of zero means none.
fn revolved(z: [f64; 2], row: f64, radii: &[&dyn Fn(f64, f64) -> f64; 2]) -> SourceMesh {
    const SIDES: u32 = 24;
    let rows = ((z[1] - z[0]) / row).round() as u32;
    let mut mesh = SourceMesh::default();
    for j in 0..=rows {
        let height = z[0] + (z[1] - z[0]) * f64::from(j) / f64::from(rows);
        for i in 0..SIDES {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(SIDES);
            let at = radii.map(|r| r(angle, height));
            mesh.vertices.extend(at.map(|r| [r * angle.cos(), r * angle.sin(), height]));
        }
    }
    let vertex = |i: u32, j: u32, side: u32| 2 * (j * SIDES + i % SIDES) + side;
    for i in 0..SIDES {
        let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
        for j in 0..rows {
            quad([vertex(i, j, 1), vertex(i + 1, j, 1), vertex(i + 1, j + 1, 1), vertex(i, j + 1, 1)]);
            quad([vertex(i, j, 0), vertex(i, j + 1, 0), vertex(i + 1, j + 1, 0), vertex(i + 1, j, 0)]);
        }
        quad([vertex(i, 0, 0), vertex(i + 1, 0, 0), vertex(i + 1, 0, 1), vertex(i, 0, 1)]);
        quad([vertex(i, rows, 1), vertex(i + 1, rows, 1), vertex(i + 1, rows, 0), vertex(i, rows, 0)]);
    }
    mesh
}

/// A ball of radius 1, its octahedron's faces split `rounds` times.
pub(crate) fn ball(rounds: u32) -> SourceMesh {
    let mut vertices: Vec<[f64; 3]> = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..rounds {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [p, q] = [a, b].map(|v| Point3::from(vertices[v as usize]).coords);
                vertices.push((p + q).normalize().into());
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    SourceMesh { vertices, triangles }
}

/// Some meshes as one part.
pub(crate) fn joined(meshes: impl IntoIterator<Item = SourceMesh>) -> SourceMesh {
    let mut all = SourceMesh::default();
    for mesh in meshes {
        let base = all.vertices.len() as u32;
        all.vertices.extend(mesh.vertices);
        all.triangles.extend(mesh.triangles.into_iter().map(|t| t.map(|v| v + base)));
    }
    all
}

/// A mesh elsewhere.
pub(crate) fn moved(mut mesh: SourceMesh, pose: &Pose) -> SourceMesh {
    for v in &mut mesh.vertices {
        *v = (pose * Point3::from(*v)).into();
    }
    mesh
}

/// A mesh, healed.
pub(crate) fn healed(mesh: SourceMesh) -> Mesh {
    heal(&SourcePart { name: "part".into(), origin: "test".into(), mesh }).unwrap().mesh
}

/// The shape of a healed mesh.
pub(crate) fn shape_of(mesh: &Mesh) -> Shape {
    Shape::of(mesh.clone(), &Termination::default()).unwrap()
}

/// Vectors of no more than some size along each axis.
pub(crate) fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

/// A mesh, healed and prepared.
pub(crate) fn surface(mesh: SourceMesh) -> Surface {
    Surface::new(&healed(mesh))
}

/// A mesh, healed and prepared, whose sign is asked of the winding number.
pub(crate) fn winding_surface(mesh: SourceMesh) -> Surface {
    Surface::new(&Mesh { solidity: Solidity::Winding, ..healed(mesh) })
}

/// An assembly of meshes, named by their places: "0", "1" …
pub(crate) fn source(meshes: impl IntoIterator<Item = SourceMesh>) -> SourceAssembly {
    let part =
        |(i, mesh): (usize, SourceMesh)| SourcePart { name: i.to_string(), origin: "test".into(), mesh };
    let parts = meshes.into_iter().enumerate().map(part).collect();
    SourceAssembly { name: "test".into(), parts, ..SourceAssembly::default() }
}

/// Depth at which verification refuses a path in a [`scene`].
pub(crate) const LIMIT: f64 = 4e-3;

/// Bodies at their assembled poses with their overlaps allowed, and the check on the triangles.
/// The longest side must be in (5, 10], so that nothing is scaled.
pub(crate) fn scene(meshes: impl IntoIterator<Item = SourceMesh>) -> (Scene, Verifier) {
    let assembly = Assembly::new(&source(meshes)).unwrap();
    assert_eq!(assembly.scale, 1.0, "fixtures are made in the planning frame");
    let fields: Vec<_> = assembly
        .shapes
        .iter()
        .map(|s| Arc::new(Field::build(&s.surface, &Termination::default()).unwrap()))
        .collect();
    let count = assembly.parts.len();
    let mut scene = Scene::assembled(&assembly, &fields);
    let shape_of = assembly.parts.iter().map(|p| p.shape).collect();
    let verifier = Verifier::new(&assembly.shapes, shape_of, LIMIT);
    for (a, b) in (0..count).flat_map(|a| (a + 1..count).map(move |b| (a, b))) {
        let depth = verifier
            .assembled_depth(&scene, &CongruentPair::turned(&scene, a, b), &Termination::default())
            .unwrap();
        if depth > 1e-6 * scene.longest_side {
            scene.allowed.allow(a, b, depth);
        }
    }
    (scene, verifier)
}

/// A plate (part 0) with a block on it (part 1).
pub(crate) fn block_on_plate() -> [SourceMesh; 2] {
    [cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]), cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0])]
}

/// A block (part 0) with a blind square hole from above and a peg in it (part 1) that is wider than
/// the hole by `excess` on each side.
pub(crate) fn peg_in_hole(excess: f64) -> [SourceMesh; 2] {
    let across: &[f64] = &[-3.0, -1.0, 1.0, 3.0];
    let block = cells([across, across, &[-4.0, -2.0, 0.0]], |c| c != [1, 1, 1]);
    let w = 1.0 + excess;
    [block, cuboid([-w, -w, -2.0], [w, w, 1.0])]
}

/// `count` points spread over a box (R₃ sequence of M. Roberts 2018): no two runs differ.
pub(crate) fn spread(lo: [f64; 3], hi: [f64; 3], count: usize) -> impl Iterator<Item = Point3<f64>> {
    const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_5];
    (1..=count).map(move |i| {
        Point3::from(std::array::from_fn::<_, 3, _>(|a| {
            lo[a] + (hi[a] - lo[a]) * (i as f64 * STEPS[a]).fract()
        }))
    })
}

/// A plan of a single part as a scripted planner answers it.
pub(crate) fn plan_of(status: PlanStatus, steps: Vec<PlanStep>) -> Plan {
    Plan {
        kind: PlanKind::default(),
        status,
        reason: None,
        planner: "sbdp-star".into(),
        engine: "sliding".into(),
        units: None,
        parts: vec!["0".into()],
        removed: vec![],
        poses: vec![],
        targets: None,
        fixed: vec![],
        keep: vec![],
        base: Base::default(),
        steps,
        remaining: vec![],
        kept_together: vec![],
        free_together: vec![],
        blocked: vec![],
        overlaps: vec![],
        warnings: vec![],
        stats: PlanStats::default(),
    }
}

/// A step of such a plan.
pub(crate) fn step_of(part: usize) -> PlanStep {
    PlanStep {
        parts: vec![part],
        of: None,
        ends: StepEnd::Out,
        motion: MotionKind::Translation,
        path: vec![[0.0; 7]],
        verified_depth: 0.0,
        requires: vec![],
        wave: 0,
        direction: None,
    }
}
