//! Cases whose answers are in textbooks.

use nalgebra::Vector3;

use super::*;
use crate::fixtures::{cuboid, joined, moved, source};
use crate::geometry::{Pose, Shape, SourceMesh};
use crate::sdf::Field;

struct Case {
    scene: Scene,
    assembly: Assembly,
}

/// Parts as they stand, of which the first one stays.
fn case(meshes: impl IntoIterator<Item = SourceMesh>) -> Case {
    let assembly = Assembly::new(&source(meshes)).unwrap();
    let field = |shape: &Arc<Shape>| Arc::new(Field::build(&shape.surface, &Termination::default()).unwrap());
    let fields: Vec<_> = assembly.shapes.iter().map(field).collect();
    Case { scene: Scene::assembled(&assembly, &fields), assembly }
}

impl Case {
    fn with(&self, friction: f64) -> Stability {
        self.with_staying(friction, &[0])
    }

    fn with_staying(&self, friction: f64, stays: &[usize]) -> Stability {
        let options = StaticsOptions { friction, margin: true, ..StaticsOptions::default() };
        let termination = Termination::default();
        let mut statics =
            Statics::of(&self.scene, &self.assembly, &options, BTreeSet::new(), &termination).unwrap();
        let standing: Vec<usize> = (0..self.scene.bodies.len()).collect();
        statics.stability(&standing, stays, &termination).unwrap()
    }
}

fn ground() -> SourceMesh {
    cuboid([-5.0, -5.0, -1.0], [5.0, 5.0, 0.0])
}

fn turned(mesh: SourceMesh, about: [f64; 3], by: f64, to: [f64; 3]) -> SourceMesh {
    moved(mesh, &Pose::new(to.into(), Vector3::from(about) * by))
}

#[track_caller]
fn near(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected, "{found}, not {expected}");
}

#[test]
fn a_block_on_the_ground_stands_and_withstands_what_its_width_and_friction_allow() {
    let case = case([ground(), cuboid([-0.5, -0.5, 0.0], [0.5, 0.5, 4.0])]);
    let found = case.with(0.5);
    assert_eq!((found.needs_friction, found.stands(), found.hands()), (0.0, true, 0));
    // It tips over an edge, half a unit from its middle, which is two units high.
    near(found.margin.unwrap(), 0.25, 0.02);
    near(case.with(0.1).margin.unwrap(), 0.1, 0.02);
}

#[test]
fn a_stack_overhangs_by_harmonic_sums_and_no_further() {
    // Blocks of length 2: from the top, each may overhang the next by 1, 1/2, 1/3, 1/4.
    for (beyond, stands) in [(-1e-3, true), (2e-3, false)] {
        let mut right = 0.0;
        let block = |i: u32| {
            right += 1.0 / f64::from(i) + if i == 3 { beyond } else { 0.0 };
            (f64::from(4 - i), 2.0 - right)
        };
        let mut places: Vec<(f64, f64)> = (1..=4).map(block).collect();
        // The top block's right end is at 2; the ground ends where the lowest block's overhang begins.
        let ground_end = places.pop().unwrap().1;
        let mut meshes = vec![cuboid([ground_end - 3.0, -1.0, -1.0], [ground_end, 1.0, 0.0])];
        let ends = std::iter::once(2.0).chain(places.iter().map(|(_, end)| *end));
        meshes.extend(ends.zip(0..4).map(|(end, i)| {
            let height = f64::from(3 - i);
            cuboid([end - 2.0, -1.0, height], [end, 1.0, height + 1.0])
        }));
        let found = case(meshes).with(0.5);
        assert_eq!(found.stands(), stands, "{found:?}");
        if stands {
            assert!(found.margin.unwrap() < 0.01, "at the limit nothing is left: {found:?}");
        } else {
            assert!(found.unstable[0].falls.iter().all(|fall| fall.direction[2] < 0.0));
        }
    }
}

#[test]
fn a_block_on_a_slope_needs_the_tangent_of_its_angle() {
    let slope = 0.3;
    let block = |mesh| turned(mesh, [0.0, 1.0, 0.0], slope, [0.0; 3]);
    let case = case([block(ground()), block(cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 0.5]))]);
    let found = case.with(0.5);
    assert!(found.stands());
    near(found.needs_friction, slope.tan(), 0.005);
    let found = case.with(0.25);
    let [Unstable { falls, hold, needs_clamping: false }] = &found.unstable[..] else { panic!("{found:?}") };
    assert_eq!((falls[0].part, &hold[..]), (1, &[vec![1]][..]));
    let along = Vector3::new(slope.cos(), 0.0, -slope.sin());
    assert!(Vector3::from(falls[0].direction).dot(&along) > 1.0 - 1e-6, "{falls:?}");
}

#[test]
fn a_ladder_needs_friction_by_its_angle() {
    // At equal friction at both ends it slips where tan(angle from the ground) = (1 - μ²) / 2μ: where μ is the tangent of
    // half the angle from the wall.
    for lean in [0.4f64, 0.9] {
        let ladder = cuboid([-0.005, -0.5, 0.0], [0.005, 0.5, 5.0]);
        // Its upper end touches the wall at x = 0; its lower end touches the ground.
        let (sine, cosine) = lean.sin_cos();
        let ladder = turned(ladder, [0.0, 1.0, 0.0], lean, [-5.0 * sine - 0.005 * cosine, 0.0, 0.005 * sine]);
        let room = cuboid([-6.0, -2.0, -1.0], [0.0, 2.0, 0.0]);
        let wall = cuboid([0.0, -2.0, -1.0], [1.0, 2.0, 6.0]);
        let found = case([room, wall, ladder]).with_staying(0.8, &[0, 1]);
        assert!(found.stands(), "{found:?}");
        near(found.needs_friction, (lean / 2.0).tan(), 0.02);
    }
}

#[test]
fn a_bar_in_a_groove_stands_and_a_block_between_walls_has_nothing_to_stand_on() {
    let quarter = std::f64::consts::FRAC_PI_4;
    let lean = |mesh, side: f64| turned(mesh, [0.0, side, 0.0], quarter, [0.0; 3]);
    let groove = joined([
        lean(cuboid([0.0, -2.0, -1.0], [4.0, 2.0, 0.0]), -1.0),
        lean(cuboid([-4.0, -2.0, -1.0], [0.0, 2.0, 0.0]), 1.0),
    ]);
    let bar = lean(cuboid([0.0, -1.0, 0.0], [1.0, 1.0, 1.0]), -1.0);
    let found = case([groove, bar]).with(0.3);
    assert_eq!((found.stands(), found.needs_friction), (true, 0.0), "{found:?}");
    let walls =
        joined([-1.0f64, 1.0].map(|x| cuboid([x.min(x * 3.0), -2.0, -2.0], [x.max(x * 3.0), 2.0, 3.0])));
    let found = case([walls, cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0])]).with(0.6);
    let [Unstable { falls, hold, needs_clamping: true }] = &found.unstable[..] else { panic!("{found:?}") };
    assert!(falls[0].direction[2] < -0.99 && hold == &[vec![1]], "{found:?}");
}

/// A prism along y over a quadrilateral in the plane of x and z, counter-clockwise as seen from −y.
fn prism(corners: [[f64; 2]; 4], half_width: f64) -> SourceMesh {
    let mut mesh = cuboid([0.0; 3], [1.0; 3]);
    for vertex in &mut mesh.vertices {
        let corner = match (vertex[0] > 0.5, vertex[2] > 0.5) {
            (false, false) => 0,
            (true, false) => 1,
            (true, true) => 2,
            (false, true) => 3,
        };
        let [x, z] = corners[corner];
        *vertex = [x, (2.0 * vertex[1] - 1.0) * half_width, z];
    }
    mesh
}

#[test]
fn a_wedge_drives_blocks_apart_unless_both_its_faces_and_the_ground_rub_enough() {
    // Faces at 45 degrees: each is pressed by N and rubs by μN upwards, so 2 N (1 + μ) / √2 is the wedge's weight, and the
    // ground rubs at each block by N (1 − μ) / √2.
    let block = [[0.5, 0.0], [4.0, 0.0], [4.0, 2.0], [2.5, 2.0]];
    let other = [[-4.0, 0.0], [-0.5, 0.0], [-2.5, 2.0], [-4.0, 2.0]];
    let wedge = [[-1.0, 0.5], [1.0, 0.5], [2.0, 1.5], [-2.0, 1.5]];
    let (of_block, of_wedge) = (5.0, 3.0);
    let floor = cuboid([-5.0, -2.0, -1.0], [5.0, 2.0, 0.0]);
    let case = case([floor, prism(block, 1.0), prism(other, 1.0), prism(wedge, 1.0)]);
    let needed = |friction: f64| {
        of_wedge / 2.0 * (1.0 - friction) - friction * (1.0 + friction) * (of_block + of_wedge / 2.0)
    };
    let found = case.with(0.25);
    assert!(found.stands(), "{found:?}");
    assert!(
        needed(found.needs_friction * 0.99) > 0.0 && needed(found.needs_friction * 1.01) < 0.0,
        "{found:?}"
    );
    assert!(!case.with(0.15).stands());
}

#[test]
fn an_arch_stands_if_it_is_thick_enough_for_a_line_of_thrust() {
    // J. Heyman, "The safety of masonry arches", 1969: a semicircular arch needs a thickness of 0.106 of its middle radius.
    // Of few stones it needs a little less.
    for (thickness, stands) in [(0.14, true), (0.07, false)] {
        let stone = |i: u32| {
            let at = |radius: f64, i: u32| {
                let (sine, cosine) = (f64::from(i) * std::f64::consts::PI / 12.0).sin_cos();
                [radius * cosine, radius * sine]
            };
            let [inner, outer] = [-1.0, 1.0].map(|side| 4.0 * (1.0 + side * thickness / 2.0));
            prism([at(inner, i), at(outer, i), at(outer, i + 1), at(inner, i + 1)], 0.5)
        };
        let found = case(std::iter::once(ground()).chain((0..12).map(stone))).with(0.7);
        assert_eq!(found.stands(), stands, "{found:?}");
        assert!(found.unknown.is_empty(), "{found:?}");
    }
}

#[test]
fn what_nothing_is_under_falls_and_one_hand_is_enough_for_what_it_carries() {
    // A beam in the air with a block on it.
    let case = case([
        ground(),
        cuboid([-2.0, -0.5, 1.0], [2.0, 0.5, 1.5]),
        cuboid([-0.5, -0.5, 1.5], [0.5, 0.5, 2.0]),
    ]);
    let found = case.with(0.3);
    let [Unstable { falls, hold, .. }] = &found.unstable[..] else { panic!("{found:?}") };
    assert_eq!(falls.iter().map(|fall| fall.part).collect::<Vec<_>>(), [1, 2]);
    assert_eq!(hold, &[vec![1]]);
    assert_eq!((found.hands(), found.margin), (1, None));
}

#[test]
fn what_lies_on_edges_of_others_stands_where_edges_cross() {
    // Two rails on the ground, with an edge up; a bar lies across both, with an edge down: all contacts of the bar are
    // crossings of edges.
    let quarter = std::f64::consts::FRAC_PI_4;
    let rail =
        |x: f64| turned(cuboid([0.0, -2.0, 0.0], [1.0, 2.0, 1.0]), [0.0, 1.0, 0.0], -quarter, [x, 0.0, 0.0]);
    let bar = |length: f64| {
        let bar = cuboid([-length, 0.0, 0.0], [length, 1.0, 1.0]);
        turned(bar, [1.0, 0.0, 0.0], quarter, [0.0, 0.0, std::f64::consts::SQRT_2])
    };
    let with = |x: f64| case([rail(-2.0), rail(x), bar(3.0)]).with_staying(0.2, &[0, 1]);
    let found = with(2.0);
    assert_eq!((found.stands(), found.needs_friction), (true, 0.0), "{found:?}");
    assert!(found.margin.unwrap() < 0.01, "it rolls over its edge: {found:?}");
    let found = with(-1.0);
    assert_eq!(found.unstable.len(), 1, "its middle is beside both: {found:?}");
}
