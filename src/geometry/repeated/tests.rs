use nalgebra::Vector3;

use super::*;
use crate::fixtures::{
    ball, block_on_plate, cells, cuboid, joined, l_shape, moved, open_box, peg_in_hole, rod, source, thread,
    tube,
};
use crate::geometry::{Assembly, Revision, SourceMesh, SourcePart};

fn found(meshes: impl IntoIterator<Item = SourceMesh>) -> Vec<Repetition> {
    Assembly::new(&source(meshes)).unwrap().repetitions
}

fn large(mesh: SourceMesh, factor: f64) -> SourceMesh {
    let vertices = mesh.vertices.iter().map(|v| v.map(|x| x * factor)).collect();
    SourceMesh { vertices, ..mesh }
}

/// The same surface in triangles half as large, in reverse order.
fn retriangulated(mesh: &SourceMesh) -> SourceMesh {
    let SourceMesh { mut vertices, triangles } = mesh.clone();
    vertices.reverse();
    let count = vertices.len() as u32;
    let mut middles = std::collections::HashMap::new();
    let mut middle = |vertices: &mut Vec<[f64; 3]>, a: u32, b: u32| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let [p, q] = [a, b].map(|v| Point3::from(vertices[v as usize]));
            vertices.push(nalgebra::center(&p, &q).into());
            vertices.len() as u32 - 1
        })
    };
    let split = |[a, b, c]: [u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| count - 1 - v);
        let [ab, bc, ca] =
            [middle(&mut vertices, a, b), middle(&mut vertices, b, c), middle(&mut vertices, c, a)];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    let triangles = triangles.into_iter().rev().flat_map(split).collect();
    SourceMesh { vertices, triangles }
}

fn plate_with_hole() -> SourceMesh {
    let across: &[f64] = &[-4.0, -1.0, 1.0, 4.0];
    cells([across, across, &[0.0, 1.0]], |c| c != [1, 1, 0])
}

/// Fills the hole of the plate, flush.
fn insert() -> SourceMesh {
    cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0])
}

#[test]
fn the_same_body_in_the_same_place_is_a_copy_whatever_its_mesh() {
    let turn = Pose::new(Vector3::new(0.1, 4.0, 1.0), Vector3::new(0.3, -0.2, 1.0));
    let quarter = Pose::rotation(Vector3::z() * std::f64::consts::FRAC_PI_2);
    let cube = || cuboid([-2.0; 3], [2.0; 3]);
    let shared: [(SourceMesh, SourceMesh); 7] = [
        (l_shape(), l_shape()),
        (l_shape(), retriangulated(&l_shape())),
        (cube(), moved(cube(), &quarter)),
        (rod(1.0, [-3.0, 3.0], 48), rod(1.0, [-3.0, 3.0], 36)),
        (tube(2.0, 2.5, [-1.0, 1.0], 48), retriangulated(&tube(2.0, 2.5, [-1.0, 1.0], 48))),
        (large(ball(4), 3.0), large(ball(3), 3.0)),
        (open_box([-1.0; 3], [1.0; 3]), retriangulated(&open_box([-1.0; 3], [1.0; 3]))),
    ];
    for (i, (one, other)) in shared.into_iter().enumerate() {
        let far = cuboid([-4.0, -4.0, 5.0], [4.0, 4.0, 6.0]);
        let meshes = [far, one, other].map(|mesh| moved(mesh, &turn));
        assert_eq!(found(meshes), [Repetition::Copies(vec![1, 2])], "pair {i}");
    }
}

#[test]
fn many_copies_are_one_group() {
    let block = || cuboid([0.0; 3], [1.0; 3]);
    let beside = || cuboid([1.0, 0.0, 0.0], [2.0, 1.0, 1.0]);
    let groups = found([block(), beside(), block(), retriangulated(&block()), beside()]);
    assert_eq!(groups, [Repetition::Copies(vec![0, 2, 3]), Repetition::Copies(vec![1, 4])]);
}

#[test]
fn a_whole_beside_its_bodies_is_told() {
    let apart = [cuboid([-4.0, -4.0, 0.0], [4.0, 4.0, 1.0]), cuboid([-1.0, -1.0, 2.0], [1.0, 1.0, 3.0])];
    let touching = [plate_with_hole(), insert()];
    let whole = |bodies, part| Repetition::Whole { part, bodies, is_all: true };
    for [a, b] in [apart, touching] {
        let all = joined([a.clone(), retriangulated(&b)]);
        assert_eq!(found([a.clone(), b.clone(), all.clone()]), [whole(vec![0, 1], 2)]);
        assert_eq!(found([all, a, b]), [whole(vec![1, 2], 0)]);
    }
}

#[test]
fn a_whole_that_is_one_solid_is_told_too() {
    // The plate and what stands on it, without the surface between them.
    let steps: [&[f64]; 3] = [&[-4.0, -1.0, 1.0, 4.0], &[-4.0, -1.0, 1.0, 4.0], &[-1.0, 0.0, 2.0]];
    let all = cells(steps, |c| c[2] == 0 || (c[0] == 1 && c[1] == 1));
    let [plate, block] = block_on_plate();
    let whole = Repetition::Whole { part: 2, bodies: vec![0, 1], is_all: true };
    assert_eq!(found([plate, block, all]), [whole]);
}

#[test]
fn a_part_with_some_bodies_of_others_is_told() {
    let [plate, block] = block_on_plate();
    let more = cuboid([2.0, 2.0, 1.0], [4.0, 4.0, 5.0]);
    let both = joined([block.clone(), more]);
    assert_eq!(found([plate, block, both]), [Repetition::Whole { part: 2, bodies: vec![1], is_all: false }]);
}

#[test]
fn copies_of_a_whole_and_of_its_bodies_are_all_told() {
    let [plate, block] = block_on_plate();
    let all = || joined(block_on_plate());
    let whole = |part| Repetition::Whole { part, bodies: vec![0, 1, 2], is_all: true };
    assert_eq!(
        found([plate, block.clone(), block, all(), all()]),
        [Repetition::Copies(vec![1, 2]), Repetition::Copies(vec![3, 4]), whole(3), whole(4)]
    );
}

#[test]
fn parts_that_fit_into_each_other_are_not_told() {
    let none: Vec<Repetition> = Vec::new();
    assert_eq!(found(block_on_plate()), none);
    assert_eq!(found([plate_with_hole(), insert()]), none, "a flush insert");
    for excess in [-0.01, 0.0, 0.001, 0.05] {
        let [block, peg] = peg_in_hole(excess);
        assert_eq!(found([block.clone(), peg]), none, "a peg wider by {excess}");
        let w = 1.0 + excess;
        assert_eq!(found([block, cuboid([-w, -w, -2.0], [w, w, 0.0])]), none, "a flush peg");
    }
    assert_eq!(found([tube(1.0, 3.0, [-1.0, 1.0], 48), rod(1.0, [-1.0, 1.0], 40)]), none, "a pin");
    assert_eq!(found([rod(1.0, [-1.0, 1.0], 48), tube(1.0, 1.01, [-1.0, 1.0], 48)]), none, "a thin sleeve");
    let cup = |t: f64| {
        let steps: &[f64] = &[-3.0, t - 3.0, 3.0 - t, 3.0];
        cells([steps; 3], |c| c != [1, 1, 1] && c != [1, 1, 2])
    };
    let inner = cuboid([-2.9; 3], [2.9, 2.9, 3.0]);
    assert_eq!(found([cup(0.1), inner]), none, "what fills a thin cup");
    let nested = moved(cup(0.1), &Pose::translation(0.0, 0.0, 0.1));
    assert_eq!(found([cup(0.1), large(nested, 2.9 / 3.0)]), none, "a cup in a cup");
    assert_eq!(found(thread(4.0, 0.6)), none);
    let block = cuboid([-3.0; 3], [3.0; 3]);
    let mut sheet = moved(block.clone(), &Pose::translation(-0.002, 0.0, -0.002));
    sheet.triangles.retain(|t| {
        let on = |axis: usize| t.iter().all(|&v| sheet.vertices[v as usize][axis] == -3.002);
        on(0) || on(2)
    });
    assert_eq!(found([block, sheet]), none, "an angle drawn as a surface");
}

#[test]
fn what_is_sunk_into_a_part_without_a_hole_is_an_overlap_and_no_body_of_it() {
    let block = cuboid([-3.0; 3], [3.0; 3]);
    let deep = cuboid([-1.0; 3], [1.0; 3]);
    let flush = cuboid([-2.0, -2.0, 2.0], [2.0, 2.0, 3.0]);
    assert_eq!(found([block, deep, flush]), []);
    // The same outside, but one is hollow.
    let void = SourceMesh {
        triangles: deep_void().triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect(),
        ..deep_void()
    };
    let hollow = joined([cuboid([-3.0; 3], [3.0; 3]), void]);
    assert!(!found([cuboid([-3.0; 3], [3.0; 3]), hollow]).iter().any(|r| matches!(r, Repetition::Copies(_))));
}

fn deep_void() -> SourceMesh {
    cuboid([-2.0; 3], [2.0; 3])
}

#[test]
fn messages_name_the_parts_and_what_to_do() {
    let name = |part: usize| ["a", "b", "c", "whole"][part];
    for (repetition, message) in [
        (
            Repetition::Copies(vec![0, 1]),
            "a and b are the same body in the same place: leave one of them out (--removed b)",
        ),
        (
            Repetition::Copies(vec![0, 1, 2]),
            "a, b and c are the same body in the same place: leave all but one of them out (--removed b --removed c)",
        ),
        (
            Repetition::Whole { part: 3, bodies: vec![0, 1, 2], is_all: true },
            "whole holds a, b and c: it seems to be the whole assembly beside its bodies; leave it out (--removed whole)",
        ),
        (
            Repetition::Whole { part: 3, bodies: vec![1], is_all: false },
            "whole holds b with the same surface: leave out whole or what it holds",
        ),
    ] {
        assert_eq!(repetition.message(name), message);
    }
    let many = Repetition::Copies((0..20).collect());
    let many = many.message(|_| "x");
    assert!(many.contains(" and 12 others are") && many.ends_with("--removed x …)"), "{many}");
}

#[test]
fn what_is_left_out_is_told_no_more() {
    let copies = Repetition::Copies(vec![0, 1, 2]);
    assert_eq!(copies.without(|p| p == 1), Some(Repetition::Copies(vec![0, 2])));
    assert_eq!(copies.without(|p| p < 2), None);
    let whole = |bodies| Repetition::Whole { part: 3, bodies, is_all: true };
    assert_eq!(whole(vec![0, 1]).without(|p| p == 3), None);
    assert_eq!(whole(vec![0, 1]).without(|p| p == 0), Some(whole(vec![1])));
    assert_eq!(whole(vec![0, 1]).without(|p| p < 2), None);
    assert_eq!(whole(vec![0, 1]).parts().collect::<Vec<_>>(), [3, 0, 1]);
}

#[test]
fn a_change_gives_what_the_changed_assembly_would() {
    let [plate, block] = block_on_plate();
    let meshes = [plate.clone(), block.clone(), retriangulated(&block), joined(block_on_plate()), l_shape()];
    let source = source(meshes);
    let base = Assembly::new(&source).unwrap();
    assert_eq!(base.repetitions.len(), 2, "{:?}", base.repetitions);
    let away = Pose::translation(0.0, 0.0, 4.0);
    let moved = |parts: &[usize]| Revision {
        moved: parts.iter().map(|part| (*part, away)).collect(),
        ..Revision::default()
    };
    let added = |mesh| SourcePart { name: "more".into(), origin: "test".into(), mesh };
    let revisions = [
        moved(&[0]),
        moved(&[1]),
        moved(&[1, 2]),
        moved(&[3]),
        moved(&[4]),
        moved(&[0, 1, 2, 3]),
        Revision { replaced: vec![(1, l_shape())], ..Revision::default() },
        Revision { replaced: vec![(3, block)], ..Revision::default() },
        Revision { added: vec![added(plate)], ..Revision::default() },
    ];
    let mut differing = 0;
    for revision in &revisions {
        let revised = base.revised(revision).unwrap().repetitions;
        assert_eq!(revised, Assembly::new(&source.revised(revision)).unwrap().repetitions, "{revision:?}");
        differing += usize::from(revised != base.repetitions);
    }
    assert!(differing >= 7, "{differing}");
}
