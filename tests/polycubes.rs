//! Puzzles with exactly known answers: random partitions of a box into polycubes.
//!
//! The pieces fill the box without play, so they move along the axes by whole cells or not at all (of a way by parts of a
//! cell, the coordinates rounded down are one as well), and a search over the shifts of all pieces says which come apart.
//! Only turns are beyond it.

use std::collections::{BTreeSet, HashSet};

use nalgebra::UnitQuaternion;
use proptest::prelude::*;
use sbdp::geometry::{SourceAssembly, SourceMesh, SourcePart};
use sbdp::plan::{MotionKind, Plan, PlanStatus};
use sbdp::search::PlanRequest;
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

/// Where pieces stand: how far each was shifted.
type Shifts = Vec<Cell>;

/// Whether some of the pieces (the bits of `moved`) overlap others that stand.
fn overlap(pieces: &[&BTreeSet<Cell>], shifts: &Shifts, moved: usize) -> bool {
    let cells = |is_moved: usize| {
        let numbers = (0..pieces.len()).filter(move |n| moved >> n & 1 == is_moved);
        numbers.flat_map(|n| pieces[n].iter().map(move |&cell| plus(cell, shifts[n])))
    };
    let standing: HashSet<Cell> = cells(0).collect();
    cells(1).any(|cell| standing.contains(&cell))
}

/// Two groups that pieces come apart into, by any shifts of any groups of them one after the other, as the bits of one
/// group; 0 if they never do.
fn separated(pieces: &[&BTreeSet<Cell>]) -> usize {
    let start = vec![[0; 3]; pieces.len()];
    let (mut seen, mut open) = (HashSet::from([start.clone()]), vec![start]);
    while let Some(shifts) = open.pop() {
        // The last piece stays: of two groups that part, it does not matter which moves.
        for (moved, step) in (1..1 << (pieces.len() - 1)).flat_map(|moved| STEPS.map(|step| (moved, step))) {
            let shifted = |by: i32| -> Shifts {
                let shift = |(n, &at): (usize, &Cell)| {
                    if moved >> n & 1 == 1 { plus(at, step.map(|x| x * by)) } else { at }
                };
                shifts.iter().enumerate().map(shift).collect()
            };
            // In the box, everything is within its side of everything; outside, pieces stay within reach of each other.
            let reach = 2 * SIDE * pieces.len() as i32;
            let free = (1..=reach).take_while(|&by| !overlap(pieces, &shifted(by), moved)).count() as i32;
            if free == reach {
                return moved;
            }
            if free > 0 && seen.insert(shifted(1)) {
                open.push(shifted(1));
            }
        }
    }
    0
}

/// The pieces in groups that do not come apart. Where one way apart ends does not depend on the way: pieces that never
/// part among themselves do not part among more.
fn inseparable(pieces: &[BTreeSet<Cell>]) -> Vec<Vec<usize>> {
    let (mut open, mut found) = (vec![(0..pieces.len()).collect::<Vec<_>>()], Vec::new());
    while let Some(group) = open.pop() {
        let bits = separated(&group.iter().map(|&n| &pieces[n]).collect::<Vec<_>>());
        if bits == 0 {
            found.push(group);
            continue;
        }
        let side = |side: usize| {
            group.iter().enumerate().filter(|(i, _)| bits >> i & 1 == side).map(|(_, &n)| n).collect()
        };
        open.extend([side(0), side(1)]);
    }
    found.sort();
    found
}

/// The groups that a plan leaves together, single parts among them.
fn left_together(plan: &Plan) -> Vec<Vec<usize>> {
    let together: Vec<&Vec<usize>> = plan.kept_together.iter().chain([&plan.remaining]).collect();
    let alone = (0..plan.parts.len()).filter(|n| !together.iter().any(|group| group.contains(n)));
    let mut groups: Vec<Vec<usize>> = alone.map(|n| vec![n]).collect();
    groups.extend(together.into_iter().cloned());
    groups.sort();
    groups
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
        let plan = service.plan(id, &PlanRequest::default(), &Termination::default(), &mut ()).unwrap();
        let (left, exact) = (left_together(&plan), inseparable(&pieces));
        prop_assert_eq!(plan.status == PlanStatus::Complete, left.len() == pieces.len());
        let is_within = |group: &Vec<usize>| exact.iter().any(|g| group.iter().all(|n| g.contains(n)));
        prop_assert!(left.iter().all(is_within), "{:?}, not {:?}: {:?} of {:?}", left, exact, plan.reason, pieces);
        if plan.steps.iter().all(|step| step.motion == MotionKind::Translation) {
            prop_assert_eq!(left, exact, "{:?}", pieces);
        }
    }
}
