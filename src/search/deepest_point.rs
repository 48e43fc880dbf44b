//! The deepest place in a solid or in a plane figure (branch and bound).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use nalgebra::{Point3, Vector3};

use crate::budgets::INSCRIBED_BALL_CELLS;
use crate::geometry::Bounds;
use crate::termination::{Interrupt, Poll};
use crate::tolerances::INSCRIBED_GAIN;

/// A place in a box, and its depth, that is deepest but for a share of the depth or what the budget leaves open; of
/// depth 0 if no place inside was found. `depth` changes no faster than the place. Where the box has no extent, the
/// place does not vary.
///
/// # Errors
/// The termination condition became true.
pub(super) fn deepest_point(
    bounds: &Bounds,
    depth: impl Fn(&Point3<f64>) -> f64,
    poll: &Poll<'_>,
) -> Result<(Point3<f64>, f64), Interrupt> {
    let mut best = (bounds.centre(), 0.0);
    // Of each open cell: the depth that none of its points exceeds, by which the most promising one is next; its
    // number, by which the older of two equal ones is next.
    let mut open = BinaryHeap::new();
    let mut cells: Vec<(Point3<f64>, Vector3<f64>)> = Vec::new();
    let mut new = vec![(bounds.centre(), bounds.extents() / 2.0)];
    loop {
        for (centre, half) in new.drain(..) {
            poll.check()?;
            let depth = depth(&centre);
            if depth > best.1 {
                best = (centre, depth);
            }
            let bound = depth + half.norm();
            if bound > 0.0 {
                open.push((bound.to_bits(), Reverse(cells.len())));
                cells.push((centre, half));
            }
        }
        let Some((bound, Reverse(cell))) = open.pop() else { return Ok(best) };
        if f64::from_bits(bound) <= best.1 * (1.0 + INSCRIBED_GAIN) || cells.len() >= INSCRIBED_BALL_CELLS {
            return Ok(best);
        }
        let (centre, half) = cells[cell];
        new.extend(octants(&centre, &half));
    }
}

/// The cells of half the size in a cell; fewer than eight where it has no extent.
pub(super) fn octants(
    centre: &Point3<f64>,
    half: &Vector3<f64>,
) -> impl Iterator<Item = (Point3<f64>, Vector3<f64>)> + use<> {
    let (centre, half) = (*centre, half / 2.0);
    let is_wide = move |i: &usize| (0..3).all(|axis| half[axis] > 0.0 || i >> axis & 1 == 0);
    let corner =
        move |i: usize| Vector3::from_fn(|axis, _| if i >> axis & 1 == 0 { -half[axis] } else { half[axis] });
    (0..8).filter(is_wide).map(move |i| (centre + corner(i), half))
}
