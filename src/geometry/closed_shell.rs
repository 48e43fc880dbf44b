//! Whether a point lies within a closed shell: a connected piece of a surface that has no edges at holes.
//!
//! The winding number of a closed shell around a point changes only where the point crosses the shell, and it is 0
//! far away. A point around which it is another number cannot get away without crossing the shell.

use std::f64::consts::TAU;

use nalgebra::Point3;

use super::solid_angle::SolidAngle;
use super::surface::{NO_TRIANGLE, Surface};

/// How far a winding number of a closed shell may be from an integer by rounding. A piece that is farther is no
/// closed shell.
const ROUNDING: f64 = 1e-6;

/// Whether some closed shell of a surface winds around a point. Of a block with a closed void, the outer surface is
/// one shell and the surface of the void another one. False for a point on the surface.
#[must_use]
pub fn is_within_closed_shell(surface: &Surface, p: &Point3<f64>) -> bool {
    let count = surface.triangles().len() as u32;
    let mut seen = vec![false; count as usize];
    let mut todo = Vec::new();
    for first in 0..count {
        if std::mem::replace(&mut seen[first as usize], true) {
            continue;
        }
        todo.push(first);
        let (mut angle, mut is_closed) = (SolidAngle::default(), true);
        while let Some(triangle) = todo.pop() {
            angle.add_triangle(p, &surface.corners(triangle));
            for edge in 0..3 {
                match surface.neighbour(triangle, edge) {
                    NO_TRIANGLE => is_closed = false,
                    other if !std::mem::replace(&mut seen[other as usize], true) => todo.push(other),
                    _ => {}
                }
            }
        }
        let winding = angle.sum() / (2.0 * TAU);
        if is_closed && winding.round() != 0.0 && (winding - winding.round()).abs() < ROUNDING {
            return true;
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cells, cuboid, joined, open_box, surface};

    #[test]
    fn a_void_is_within_a_closed_shell_and_an_open_box_has_none() {
        let lines: &[f64] = &[-3.0, -1.0, 1.0, 3.0];
        let hollow = surface(cells([lines, lines, lines], |c| c != [1, 1, 1]));
        assert!(is_within_closed_shell(&hollow, &Point3::origin()));
        assert!(is_within_closed_shell(&hollow, &Point3::new(2.0, 2.0, 2.0)), "in the solid");
        assert!(!is_within_closed_shell(&hollow, &Point3::new(4.0, 0.0, 0.0)));
        let cup = surface(open_box([-3.0; 3], [3.0; 3]));
        assert!(!is_within_closed_shell(&cup, &Point3::origin()));
        let beside = surface(joined([cuboid([-3.0; 3], [-1.0; 3]), cuboid([1.0; 3], [3.0; 3])]));
        assert!(!is_within_closed_shell(&beside, &Point3::origin()));
        assert!(is_within_closed_shell(&beside, &Point3::new(2.0, 2.0, 2.0)));
    }
}
