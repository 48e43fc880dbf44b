//! Signs at the nodes of a brick where the surface is open, with few winding numbers.
//!
//! Away from triangles the winding number changes only with the view of the openings: its gradient
//! is ∮ r×dl/|r|³ / 4π around them (the law of Biot and Savart for the solid angle), so at most
//! Σ length/(4π·distance²) over their edges. From a node whose winding number is asked for, its
//! sign therefore holds for all nodes that are reached without meeting the surface, as long as the
//! number cannot have come near one half.

use std::collections::VecDeque;

use nalgebra::Point3;

use crate::geometry::Surface;

use super::brick::{Brick, beside};
use super::grid::{BRICK, CELLS};

/// Winding numbers nearer to one half are not passed on: twice what those of
/// [`Surface::winding`] are off by.
const DOUBT: f64 = 0.1;
/// With more edges of openings beside a brick, each node is asked for itself.
const MOST_EDGES: usize = 256;

/// The edges at which a surface is open.
#[derive(Debug, Clone)]
pub(super) struct Rim {
    edges: Vec<Edge>,
}

#[derive(Debug, Clone)]
struct Edge {
    middle: Point3<f64>,
    length: f64,
    /// Length times how many triangles more use it in one direction than in the other.
    weight: f64,
}

impl Edge {
    /// How quickly the winding number may change within `radius` of `p` by this edge.
    fn slope(&self, p: &Point3<f64>, radius: f64) -> f64 {
        let gap = (self.middle - p).norm() - self.length / 2.0 - radius;
        if gap > 0.0 { self.weight / (4.0 * std::f64::consts::PI * gap * gap) } else { f64::INFINITY }
    }
}

impl Rim {
    /// The rim of a surface: edges that its triangles do not use as often in one direction as in
    /// the other.
    pub(super) fn of(surface: &Surface) -> Self {
        let sides = surface.triangles().iter().flat_map(|t| {
            [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]]
                .map(|[a, b]| if a < b { ([a, b], 1i32) } else { ([b, a], -1) })
        });
        let mut sides: Vec<_> = sides.collect();
        sides.sort_unstable();
        let edge = |group: &[([u32; 2], i32)]| {
            let excess = group.iter().map(|s| s.1).sum::<i32>().unsigned_abs();
            let [a, b] = group[0].0.map(|i| surface.vertices()[i as usize]);
            let length = (b - a).norm();
            let weight = length * f64::from(excess);
            (excess > 0).then(|| Edge { middle: nalgebra::center(&a, &b), length, weight })
        };
        Self { edges: sides.chunk_by(|a, b| a.0 == b.0).filter_map(edge).collect() }
    }

    /// Gives distances at the nodes of a brick their signs.
    pub(super) fn sign(&self, brick: &Brick<'_>, values: &mut [f32; BRICK]) {
        let radius = brick.cell * (CELLS / 2) as f64 * 3f64.sqrt();
        let middle = brick.node_at(BRICK / 2);
        let (beyond, near): (Vec<&Edge>, Vec<&Edge>) =
            self.edges.iter().partition(|e| (e.middle - middle).norm() - e.length / 2.0 > 2.0 * radius);
        let common: f64 = beyond.iter().map(|e| e.slope(&middle, radius)).sum();
        let slope = |i: usize| {
            let p = brick.node_at(i);
            let sum: f64 = near.iter().map(|e| e.slope(&p, brick.cell)).sum();
            sum + common
        };
        let mut known: [Option<bool>; BRICK] = [None; BRICK];
        let alone = near.len() > MOST_EDGES;
        for seed in 0..BRICK {
            if known[seed].is_some() {
                continue;
            }
            let winding = brick.surface.winding(&brick.node_at(seed)).unwrap_or(0.0);
            known[seed] = Some(winding > 0.5);
            let margin = (winding - 0.5).abs() - DOUBT;
            if !alone {
                pass_on(seed, margin, brick.cell, values, &slope, &mut known);
            }
        }
        for (v, inside) in values.iter_mut().zip(known) {
            *v = if inside == Some(true) { -*v } else { *v };
        }
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
