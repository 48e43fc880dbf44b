//! Puzzles with exactly known answers: random partitions of a box into polycubes.
//!
//! The pieces fill the box without play, so each moves along the axes by whole cells or not at all, and a search over
//! these shifts says whether a piece comes out of the others. Taking out whatever comes out is exact: a piece that is
//! gone is in nobody's way.

use std::collections::{BTreeSet, HashSet};

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use sbdp::geometry::{SourceAssembly, SourceMesh, SourcePart};
use sbdp::plan::PlanStatus;
use sbdp::search::{PlanRequest, PlanSink, Progress};
use sbdp::service::Service;
use sbdp::termination::Termination;

type Cell = [i32; 3];

/// Cells along each side of the box.
const SIDE: i32 = 3;

const STEPS: [Cell; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];

fn plus(a: Cell, b: Cell) -> Cell {
    std::array::from_fn(|i| a[i] + b[i])
}

/// Connected pieces that fill the box: each grows from a cell, and `choices` says which piece grows next and where to.
fn pieces(count: usize, choices: &[usize]) -> Vec<BTreeSet<Cell>> {
    let side = 0..SIDE;
    let mut free: Vec<Cell> =
        side.clone().flat_map(|x| (0..SIDE).flat_map(move |y| (0..SIDE).map(move |z| [x, y, z]))).collect();
    let mut choices = choices.iter().cycle().enumerate().map(|(i, choice)| choice.wrapping_add(i / 7));
    let mut chosen = |most: usize| choices.next().unwrap_or(0) % most;
    let mut pieces: Vec<BTreeSet<Cell>> = Vec::new();
    for _ in 0..count {
        pieces.push(BTreeSet::from([free.swap_remove(chosen(free.len()))]));
    }
    while !free.is_empty() {
        let piece = &mut pieces[chosen(count)];
        let beside = |cell: &&Cell| STEPS.iter().any(|&step| piece.contains(&plus(**cell, step)));
        let next: Vec<Cell> = free.iter().filter(beside).copied().collect();
        if !next.is_empty() {
            let cell = next[chosen(next.len())];
            free.retain(|c| *c != cell);
            piece.insert(cell);
        }
    }
    pieces
}

/// Whether a piece, shifted by whole cells, comes out of those that stand.
fn comes_out(piece: &BTreeSet<Cell>, standing: &HashSet<Cell>) -> bool {
    let (mut seen, mut open) = (HashSet::from([[0; 3]]), vec![[0; 3]]);
    while let Some(shift) = open.pop() {
        if shift.iter().any(|x: &i32| x.abs() >= SIDE) {
            return true;
        }
        for step in STEPS {
            let next = plus(shift, step);
            let is_free = piece.iter().all(|&cell| !standing.contains(&plus(cell, next)));
            if is_free && seen.insert(next) {
                open.push(next);
            }
        }
    }
    false
}

/// The pieces that stay when whatever comes out is taken out.
fn remaining(pieces: &[BTreeSet<Cell>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..pieces.len()).collect();
    let others = |left: &[usize], piece: usize| -> HashSet<Cell> {
        left.iter().filter(|&&p| p != piece).flat_map(|&p| pieces[p].iter().copied()).collect()
    };
    while left.len() > 1
        && let Some(out) = left.iter().position(|&p| comes_out(&pieces[p], &others(&left, p)))
    {
        left.remove(out);
    }
    left
}

/// Whether a surface around the cells is a manifold: around no corner of the grid two cells, or two gaps, touch along an
/// edge or in a point alone.
fn is_manifold(piece: &BTreeSet<Cell>) -> bool {
    let is_connected = |cells: &[Cell]| {
        let mut open: Vec<Cell> = cells.first().copied().into_iter().collect();
        let mut seen: HashSet<Cell> = open.iter().copied().collect();
        while let Some(cell) = open.pop() {
            open.extend(
                STEPS.map(|s| plus(cell, s)).into_iter().filter(|c| cells.contains(c) && seen.insert(*c)),
            );
        }
        seen.len() == cells.len()
    };
    let around = |corner: Cell| -> [Cell; 8] {
        std::array::from_fn(|i| std::array::from_fn(|axis| corner[axis] - (i >> axis & 1) as i32))
    };
    let corners = piece.iter().flat_map(|&cell| around(plus(cell, [1; 3])));
    corners.into_iter().all(|corner| {
        let (full, gaps): (Vec<Cell>, Vec<Cell>) = around(corner).iter().partition(|c| piece.contains(*c));
        is_connected(&full) && is_connected(&gaps)
    })
}

fn mesh(piece: &BTreeSet<Cell>) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    for &cell in piece {
        for step in STEPS.into_iter().filter(|&step| !piece.contains(&plus(cell, step))) {
            let axis = step.iter().position(|&x| x != 0).unwrap_or(0);
            let mut quad = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, w]| {
                let mut corner = cell;
                corner[axis] += i32::from(step[axis] > 0);
                corner[(axis + 1) % 3] += u;
                corner[(axis + 2) % 3] += w;
                corner.map(|x| f64::from(x) * 10.0)
            });
            if step[axis] < 0 {
                quad.reverse();
            }
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(quad);
            mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        }
    }
    mesh
}

struct Silent;

impl PlanSink for Silent {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &sbdp::plan::PlanStep) {}
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn puzzles_are_answered_as_the_exact_search_does(
        count in 2..6usize,
        choices in prop::collection::vec(0..1000usize, 60),
        angles in prop::array::uniform3(-3.0..3.0f64),
        is_turned: bool,
    ) {
        let pieces = pieces(count, &choices);
        prop_assume!(pieces.iter().all(is_manifold));
        let part = |(number, piece): (usize, &BTreeSet<Cell>)| SourcePart {
            name: number.to_string(),
            origin: "generated".to_owned(),
            mesh: mesh(piece),
        };
        let parts = pieces.iter().enumerate().map(part).collect();
        let mut assembly = SourceAssembly { name: "puzzle".to_owned(), parts, ..SourceAssembly::default() };
        if is_turned {
            assembly.rotate(&UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]));
        }
        let service = Service::default();
        let id = service.admit(&assembly).unwrap().id;
        let plan = service.plan(id, &PlanRequest::default(), &Termination::default(), &mut Silent).unwrap();
        let left = remaining(&pieces);
        prop_assert_eq!(plan.remaining.len(), left.len(), "{:?} of {:?}", plan.reason, pieces);
        prop_assert_eq!(plan.status == PlanStatus::Complete, left.len() == 1);
    }
}
