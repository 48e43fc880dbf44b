//! Which triangles meet at an edge.

use std::collections::HashMap;

use crate::geometry::mesh::directed_edges;

/// A triangle at an edge: its index, and whether it travels the edge upwards (from the
/// smaller vertex index to the larger).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Side {
    pub(super) triangle: u32,
    pub(super) upwards: bool,
}

/// The sides of every edge, keyed by its vertices, smaller index first.
pub(super) fn sides_by_edge(triangles: &[[u32; 3]]) -> HashMap<[u32; 2], Vec<Side>> {
    let mut sides: HashMap<[u32; 2], Vec<Side>> = HashMap::with_capacity(triangles.len() * 2);
    for (triangle, t) in (0u32..).zip(triangles) {
        for [a, b] in directed_edges(t) {
            sides.entry([a.min(b), a.max(b)]).or_default().push(Side { triangle, upwards: a < b });
        }
    }
    sides
}

/// How many edges have an odd number of triangles: the border of a surface that is not closed.
pub(super) fn open_edges(triangles: &[[u32; 3]]) -> usize {
    sides_by_edge(triangles).values().filter(|s| s.len() % 2 == 1).count()
}
