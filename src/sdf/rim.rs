//! Signs at the nodes of a brick where the surface is open, with few winding numbers: a node's holds for all
//! that are reached from it without meeting the surface, as long as the number cannot have come near one half
//! ([`Rim`]).

use std::collections::VecDeque;

use crate::geometry::{Rim, RimEdge, Surface, WINDING_DOUBT};

use super::nodes::{BRICK, CELLS, Lattice, beside};

/// With more edges of openings beside a brick, the winding number of each node is computed.
const MOST_EDGES: usize = 256;

/// Gives distances at the nodes of a brick their signs.
pub(super) fn sign(rim: &Rim, surface: &Surface, lattice: &Lattice, values: &mut [f32; BRICK]) {
    let radius = lattice.cell * (CELLS / 2) as f64 * 3f64.sqrt();
    let middle = lattice.node_at(BRICK / 2);
    let (beyond, near): (Vec<&RimEdge>, Vec<&RimEdge>) =
        rim.edges().iter().partition(|e| e.distance(&middle) > 2.0 * radius);
    let common: f64 = beyond.iter().map(|e| e.slope(&middle, radius)).sum();
    let slope = |i: usize| {
        let p = lattice.node_at(i);
        let sum: f64 = near.iter().map(|e| e.slope(&p, lattice.cell)).sum();
        sum + common
    };
    let mut known: [Option<bool>; BRICK] = [None; BRICK];
    let alone = near.len() > MOST_EDGES;
    for seed in 0..BRICK {
        if known[seed].is_some() {
            continue;
        }
        let winding = surface.winding(&lattice.node_at(seed)).unwrap_or(0.0);
        known[seed] = Some(winding > 0.5);
        let margin = (winding - 0.5).abs() - WINDING_DOUBT;
        if !alone {
            pass_on(seed, margin, lattice.cell, values, &slope, &mut known);
        }
    }
    for (v, inside) in values.iter_mut().zip(known) {
        *v = if inside == Some(true) { -*v } else { *v };
    }
}

/// Passes a node's sign on to those beside it, and so on, while the winding number cannot have
/// changed by more than `margin` on the way.
fn pass_on(
    seed: usize,
    margin: f64,
    cell: f64,
    distances: &[f32; BRICK],
    slope: &impl Fn(usize) -> f64,
    known: &mut [Option<bool>; BRICK],
) {
    let mut queue = VecDeque::from([(seed, 0.0)]);
    while let Some((i, change)) = queue.pop_front() {
        let change = change + cell * slope(i);
        if change > margin {
            continue;
        }
        for j in beside(i) {
            // Balls without surface around both cover the way between them.
            let clear = f64::from(distances[i]) + f64::from(distances[j]) > cell * (1.0 + 1e-6);
            if clear && known[j].is_none() {
                known[j] = known[seed];
                queue.push_back((j, change));
            }
        }
    }
}
