//! Solids made of the cells of a grid with uneven spacing: whatever has only right angles.

use super::solid::{Point, Solid};

/// An axis-aligned box.
pub(super) type Cuboid = [Point; 2];

/// The boxes `add` without the boxes `cut`. No two of the remaining cells may touch in an
/// edge or a corner alone.
pub(super) fn grid(add: &[Cuboid], cut: &[Cuboid]) -> Solid {
    let lines: [Vec<f64>; 3] = std::array::from_fn(|k| {
        let mut line: Vec<f64> = add.iter().chain(cut).flat_map(|[lo, hi]| [lo[k], hi[k]]).collect();
        line.sort_by(f64::total_cmp);
        line.dedup();
        line
    });
    let cells: [usize; 3] = std::array::from_fn(|k| lines[k].len() - 1);
    let filled = |cell: [isize; 3]| {
        if (0..3).any(|k| cell[k] < 0 || cell[k] as usize >= cells[k]) {
            return false;
        }
        let middle: Point =
            std::array::from_fn(|k| (lines[k][cell[k] as usize] + lines[k][cell[k] as usize + 1]) / 2.0);
        let within = |[lo, hi]: &Cuboid| (0..3).all(|k| lo[k] < middle[k] && middle[k] < hi[k]);
        add.iter().any(within) && !cut.iter().any(within)
    };
    let mut solid = Solid::default();
    for x in 0..cells[0] {
        for y in 0..cells[1] {
            for z in 0..cells[2] {
                let cell = [x as isize, y as isize, z as isize];
                if filled(cell) {
                    walls(&mut solid, &lines, cell, &filled);
                }
            }
        }
    }
    solid
}

/// The faces of a cell towards empty neighbours.
fn walls(solid: &mut Solid, lines: &[Vec<f64>; 3], cell: [isize; 3], filled: &impl Fn([isize; 3]) -> bool) {
    for axis in 0..3 {
        for up in [false, true] {
            let mut neighbour = cell;
            neighbour[axis] += if up { 1 } else { -1 };
            if filled(neighbour) {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let corner = |du: usize, dv: usize| {
                let mut p = [0.0; 3];
                p[axis] = lines[axis][cell[axis] as usize + usize::from(up)];
                p[u] = lines[u][cell[u] as usize + du];
                p[v] = lines[v][cell[v] as usize + dv];
                p
            };
            let mut outline = vec![corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            if !up {
                outline.reverse();
            }
            solid.face(&outline, &[]);
        }
    }
}
