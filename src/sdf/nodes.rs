//! The nodes of a brick: how many there are, where they lie, and what is known at them.

use bytemuck::{Pod, Zeroable};
use nalgebra::{Point3, Vector3};

/// Cells along a brick's side.
pub(super) const CELLS: usize = 8;
/// Nodes along a brick's side; neighbouring bricks repeat their common nodes.
pub(super) const NODES: usize = CELLS + 1;
/// Nodes in a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// Half-width of the narrow band, in cells.
pub(super) const BAND: f64 = 3.0;
/// Marks a node outside the band: it knows no nearest triangle.
pub(super) const FAR_NODE: u32 = u32::MAX;

/// What is known at the nodes of a brick, in memory as in a file.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Nodes {
    /// Distances; outside the band they stand at ± the band's half-width.
    pub(super) values: [f32; BRICK],
    /// Nearest triangles.
    pub(super) nearest: [u32; BRICK],
}

/// Where the nodes of a brick lie.
pub(super) struct Lattice {
    /// The lowest node.
    pub(super) origin: Point3<f64>,
    /// The distance between neighbouring nodes.
    pub(super) cell: f64,
}

impl Lattice {
    pub(super) fn node_at(&self, i: usize) -> Point3<f64> {
        self.origin + place(i, NODES).map(|x| x as f64) * self.cell
    }
}

/// Place of the `i`th of a cube of `across`³ things.
pub(super) fn place(i: usize, across: usize) -> Vector3<usize> {
    Vector3::new(i % across, i / across % across, i / (across * across))
}

/// The nodes beside a node of a brick; the node itself where there is none.
#[inline]
pub(super) fn beside(i: usize) -> [usize; 6] {
    BESIDE[i].map(usize::from)
}

static BESIDE: [[u16; 6]; BRICK] = beside_all();

const fn beside_all() -> [[u16; 6]; BRICK] {
    const STRIDES: [usize; 3] = [1, NODES, NODES * NODES];
    let mut out = [[0; 6]; BRICK];
    let mut i = 0;
    while i < BRICK {
        let mut axis = 0;
        while axis < 3 {
            let (at, stride) = (i / STRIDES[axis] % NODES, STRIDES[axis]);
            out[i][2 * axis] = (if at > 0 { i - stride } else { i }) as u16;
            out[i][2 * axis + 1] = (if at + 1 < NODES { i + stride } else { i }) as u16;
            axis += 1;
        }
        i += 1;
    }
    out
}
