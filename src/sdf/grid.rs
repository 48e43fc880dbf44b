//! The sparse grid and its look-ups.

use nalgebra::{Point3, Vector3};

use crate::geometry::Bounds;

/// Cells along a brick's side.
pub(super) const CELLS: usize = 8;
/// Nodes along a brick's side; neighbouring bricks repeat their common nodes.
pub(super) const NODES: usize = CELLS + 1;
/// Nodes in a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// Half-width of the narrow band, in cells.
pub(super) const BAND: f64 = 3.0;
/// Marks a brick without nodes.
pub(super) const EMPTY: u32 = u32::MAX;
/// Marks a node outside the band: it knows no nearest triangle.
pub(super) const FAR_NODE: u32 = u32::MAX;

/// A distance field in its shape's frame.
#[derive(Debug, Clone)]
pub struct Field {
    pub(super) origin: Point3<f64>,
    pub(super) cell: f64,
    pub(super) dims: [usize; 3],
    /// Per brick: where its nodes are, or [`EMPTY`].
    pub(super) slots: Vec<u32>,
    /// Per brick without nodes: signed bound, |bound| ≤ distance anywhere in the brick.
    pub(super) far: Vec<f32>,
    /// Distances at nodes; outside the band they stand at ± the band's half-width.
    pub(super) values: Vec<f32>,
    /// Nearest triangle at nodes.
    pub(super) nearest: Vec<u32>,
    pub(super) bounds: Bounds,
}

/// What a field knows about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// No surface point is nearer than this where it is positive; negative means "maybe inside".
    pub lower_bound: f64,
    /// Interpolated signed distance (in far bricks: the bound).
    pub value: f64,
}

impl Field {
    /// Cell size, in the shape's units.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// How far an interpolated value in the band can be from the true distance: distances are
    /// 1-Lipschitz, so the weighted mean over a cell's corners is off by at most the distance from
    /// its centre to a corner.
    #[must_use]
    pub fn error_bound(&self) -> f64 {
        self.cell * 0.87
    }

    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        self.slots.len() * 8 + self.values.len() * 8
    }

    /// Bricks that hold nodes.
    #[must_use]
    pub fn bricks(&self) -> usize {
        self.values.len() / BRICK
    }

    /// A bound and an estimate of the signed distance at `p`.
    #[must_use]
    pub fn estimate(&self, p: &Point3<f64>) -> Estimate {
        let Some((brick, local)) = self.locate(p) else {
            let d = self.bounds.distance(p);
            return Estimate { lower_bound: d, value: d };
        };
        let slot = self.slots[brick];
        if slot == EMPTY {
            let d = f64::from(self.far[brick]);
            return Estimate { lower_bound: d, value: d };
        }
        let (base, f) = corner(&local, slot);
        let value = trilinear(&self.values[base..], &f);
        let boxed = self.bounds.distance(p);
        Estimate { lower_bound: (value - self.error_bound()).max(boxed), value }
    }

    /// A triangle that is likely to be the nearest to `p`, or nearly: that of a node around it;
    /// `None` outside the band.
    #[must_use]
    pub fn likely_nearest(&self, p: &Point3<f64>) -> Option<u32> {
        let (brick, local) = self.locate(p)?;
        let slot = self.slots[brick];
        if slot == EMPTY {
            return None;
        }
        let (base, f) = corner(&local, slot);
        let closest = usize::from(f.x > 0.5) | usize::from(f.y > 0.5) << 1 | usize::from(f.z > 0.5) << 2;
        // All corners, the closest first: a cell at the band's edge has nodes beyond it.
        let known = |k: usize| Some(self.nearest[base + CORNERS[closest ^ k]]).filter(|t| *t != FAR_NODE);
        (0..8).find_map(known)
    }

    /// Brick index and position inside the brick in cells.
    fn locate(&self, p: &Point3<f64>) -> Option<(usize, Vector3<f64>)> {
        let g = (p - self.origin) / (self.cell * CELLS as f64);
        let mut at = [0usize; 3];
        let mut local = Vector3::zeros();
        for a in 0..3 {
            if !(g[a] >= 0.0 && g[a] < self.dims[a] as f64) {
                return None;
            }
            at[a] = g[a] as usize;
            local[a] = (g[a] - at[a] as f64) * CELLS as f64;
        }
        Some(((at[2] * self.dims[1] + at[1]) * self.dims[0] + at[0], local))
    }
}

const CORNERS: [usize; 8] = [
    0,
    1,
    NODES,
    NODES + 1,
    NODES * NODES,
    NODES * NODES + 1,
    NODES * NODES + NODES,
    NODES * NODES + NODES + 1,
];

/// Index of the lowest corner of the cell, and the position inside it in 0..=1.
fn corner(local: &Vector3<f64>, slot: u32) -> (usize, Vector3<f64>) {
    let i = local.map(|x| (x as usize).min(CELLS - 1));
    let f = Vector3::new(local.x - i.x as f64, local.y - i.y as f64, local.z - i.z as f64);
    (slot as usize * BRICK + (i.z * NODES + i.y) * NODES + i.x, f)
}

fn trilinear(v: &[f32], f: &Vector3<f64>) -> f64 {
    let c = |k: usize| f64::from(v[CORNERS[k]]);
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let x0 = lerp(c(0), c(1), f.x);
    let x1 = lerp(c(2), c(3), f.x);
    let x2 = lerp(c(4), c(5), f.x);
    let x3 = lerp(c(6), c(7), f.x);
    lerp(lerp(x0, x1, f.y), lerp(x2, x3, f.y), f.z)
}
