//! Steps per second of the engine `penalty` against the number of contact points:
//! `cargo bench --bench penalty`.
//!
//! A block is pushed into the plate that it stands on. All of its lower face is in contact, and the
//! motion ends after one planning time step, 100 steps: items are steps. The check of depths and of
//! exits at the waypoints is part of it, as it is in every plan.

use std::sync::Arc;

use divan::counter::ItemsCount;
use sbdp::geometry::{Assembly, SourceAssembly, SourceMesh, SourcePart};
use sbdp::scene::{Scene, StandingParts};
use sbdp::sdf::Field;
use sbdp::simulation::{Action, Axis, PenaltyEngine, PenaltyParameters, TransitionFunction};
use sbdp::termination::Termination;

fn main() {
    divan::main();
}

/// How close contact points are, named by how many there are.
struct Density {
    longest_edge: f64,
    points: usize,
}

impl std::fmt::Display for Density {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} points", self.points)
    }
}

fn densities() -> Vec<Density> {
    let scene = scene();
    let count = |longest_edge| {
        let engine = engine(longest_edge);
        let points = scene.bodies.iter().map(|b| engine.contact_points(&b.shape).points().len()).sum();
        Density { longest_edge, points }
    };
    [2.0, 1.0, 0.5, 0.25, 0.125, 0.0625].map(count).into()
}

fn engine(longest_edge: f64) -> PenaltyEngine {
    PenaltyEngine::new(PenaltyParameters { longest_edge, ..PenaltyParameters::default() })
}

fn cuboid(lo: [f64; 3], hi: [f64; 3]) -> SourceMesh {
    let corner = |i: usize| std::array::from_fn(|a| if i >> a & 1 == 0 { lo[a] } else { hi[a] });
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    SourceMesh {
        vertices: (0..8).map(corner).collect(),
        triangles: quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect(),
    }
}

/// A plate (part 0) and a block on it (part 1).
fn scene() -> Scene {
    let meshes = [cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]), cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0])];
    let part = |(i, mesh): (usize, _)| SourcePart { name: i.to_string(), origin: "benchmark".into(), mesh };
    let parts = meshes.into_iter().enumerate().map(part).collect();
    let source = SourceAssembly { name: "block on plate".into(), parts, ..SourceAssembly::default() };
    let assembly = Assembly::new(&source).expect("the meshes are sound");
    let field = |shape: &Arc<sbdp::geometry::Shape>| {
        Arc::new(Field::build(&shape.surface, &Termination::default()).expect("nobody cancels"))
    };
    Scene::assembled(&assembly, &assembly.shapes.iter().map(field).collect::<Vec<_>>())
}

fn pushed_down(bencher: divan::Bencher<'_, '_>, density: &Density, action: Action) {
    let (scene, engine) = (scene(), engine(density.longest_edge));
    let around = StandingParts::new(&scene, vec![0]);
    let start = scene.bodies[1].planning_from_shape;
    bencher
        .counter(ItemsCount::new(engine.parameters().block_steps()))
        .bench(|| engine.simulate(&scene, &around, 1, &start, action, &Termination::default()));
}

/// 3 unknowns.
#[divan::bench(args = densities())]
fn push(bencher: divan::Bencher<'_, '_>, density: &Density) {
    pushed_down(bencher, density, Action::Push(Axis::Z, false));
}

/// 6 unknowns.
#[divan::bench(args = densities())]
fn drag(bencher: divan::Bencher<'_, '_>, density: &Density) {
    pushed_down(bencher, density, Action::Drag(Axis::Z, false));
}
