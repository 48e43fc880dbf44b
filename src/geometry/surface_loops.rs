//! Loops that generate all closed curves on a surface.
//!
//! Source: tree-cotree decomposition (D. Eppstein, "Dynamic generators of topologically embedded
//! graphs", 2003). Of a closed surface, the edges in neither a spanning tree of the vertices nor a
//! spanning tree of the triangles across other edges close 2g loops per shell of genus g, and every
//! closed curve on the surface is homologous to a sum of them.

use std::collections::VecDeque;

use nalgebra::Point3;

use super::Surface;
use super::mesh::directed_edges;

/// No vertex.
const NONE: u32 = u32::MAX;

/// The loops of a closed surface, each a closed polygon in the surface's frame. `None` if the
/// surface is not closed, or of more loops than `most`.
#[must_use]
pub fn surface_loops(surface: &Surface, most: usize) -> Option<Vec<Vec<Point3<f64>>>> {
    if surface.is_open() {
        return None;
    }
    let tree = VertexTree::of(surface);
    if loop_count(surface, &tree)? > most {
        return None;
    }
    let crossed = crossed_by_cotree(surface, &tree);
    let mut loops = Vec::new();
    for (triangle, corners) in (0u32..).zip(surface.triangles()) {
        for (edge, [a, b]) in (0u8..).zip(directed_edges(corners)) {
            let once = surface.neighbour(triangle, edge) > triangle;
            if once && !tree.has_edge(a, b) && !crossed[triangle as usize][edge as usize] {
                loops
                    .push(tree.closed_by(a, b).into_iter().map(|v| surface.vertices()[v as usize]).collect());
            }
        }
    }
    Some(loops)
}

/// Twice the genus, summed over shells: by Euler's formula, shells · 2 − (V − E + F).
fn loop_count(surface: &Surface, tree: &VertexTree) -> Option<usize> {
    let (v, f) = (surface.vertices().len(), surface.triangles().len());
    (tree.shells() * 2 + f * 3 / 2).checked_sub(v + f)
}

/// A spanning tree of each shell's vertices, breadth first so that loops are short.
struct VertexTree {
    /// Roots are their own.
    parent: Vec<u32>,
    depth: Vec<u32>,
}

impl VertexTree {
    fn of(surface: &Surface) -> Self {
        let count = surface.vertices().len();
        let mut tree = Self { parent: vec![NONE; count], depth: vec![0; count] };
        let mut queue = VecDeque::new();
        for root in 0..count as u32 {
            if tree.parent[root as usize] != NONE {
                continue;
            }
            tree.parent[root as usize] = root;
            queue.push_back(root);
            while let Some(v) = queue.pop_front() {
                for &t in surface.fan(v) {
                    for w in surface.triangles()[t as usize] {
                        if tree.parent[w as usize] == NONE {
                            tree.parent[w as usize] = v;
                            tree.depth[w as usize] = tree.depth[v as usize] + 1;
                            queue.push_back(w);
                        }
                    }
                }
            }
        }
        tree
    }

    /// How many roots there are.
    fn shells(&self) -> usize {
        self.parent.iter().zip(0..).filter(|(p, v)| **p == *v).count()
    }

    fn has_edge(&self, a: u32, b: u32) -> bool {
        self.parent[a as usize] == b || self.parent[b as usize] == a
    }

    /// The loop that an edge closes: from where the ways to its ends part, out and back.
    fn closed_by(&self, a: u32, b: u32) -> Vec<u32> {
        let (mut out, mut back) = (vec![a], vec![b]);
        let (mut a, mut b) = (a, b);
        while a != b {
            if self.depth[a as usize] >= self.depth[b as usize] {
                a = self.parent[a as usize];
                out.push(a);
            } else {
                b = self.parent[b as usize];
                back.push(b);
            }
        }
        // Both ways end at the same vertex.
        back.pop();
        out.reverse();
        out.extend(back);
        out
    }
}

/// Per triangle and edge: whether a spanning tree of the triangles, which crosses no edge of the
/// vertices' tree, crosses it.
fn crossed_by_cotree(surface: &Surface, tree: &VertexTree) -> Vec<[bool; 3]> {
    let count = surface.triangles().len();
    let mut crossed = vec![[false; 3]; count];
    let mut reached = vec![false; count];
    let mut queue = VecDeque::new();
    for root in 0..count as u32 {
        if std::mem::replace(&mut reached[root as usize], true) {
            continue;
        }
        queue.push_back(root);
        while let Some(t) = queue.pop_front() {
            for (edge, [a, b]) in (0u8..).zip(directed_edges(&surface.triangles()[t as usize])) {
                let other = surface.neighbour(t, edge);
                if tree.has_edge(a, b) || std::mem::replace(&mut reached[other as usize], true) {
                    continue;
                }
                crossed[t as usize][edge as usize] = true;
                let back =
                    (0..3u8).find(|&e| surface.neighbour(other, e) == t && same(surface, other, e, a, b));
                if let Some(back) = back {
                    crossed[other as usize][back as usize] = true;
                }
                queue.push_back(other);
            }
        }
    }
    crossed
}

/// Whether an edge of a triangle is the one between two vertices.
fn same(surface: &Surface, triangle: u32, edge: u8, a: u32, b: u32) -> bool {
    let [c, d] = directed_edges(&surface.triangles()[triangle as usize])[edge as usize];
    (c, d) == (b, a) || (c, d) == (a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, open_box, surface, tube};

    #[test]
    fn a_surface_has_two_loops_per_hole() {
        for mesh in [ball(2), cuboid([0.0; 3], [1.0, 2.0, 3.0])] {
            assert_eq!(surface_loops(&surface(mesh), 9), Some(Vec::new()));
        }
        let tube = surface(tube(1.0, 2.0, [0.0, 1.0], 12));
        let loops = surface_loops(&tube, 2).unwrap();
        assert_eq!(loops.len(), 2);
        assert!(loops.iter().all(|l| l.len() >= 3), "{loops:?}");
        assert_eq!(surface_loops(&tube, 1), None, "more than asked for");
        assert_eq!(surface_loops(&surface(open_box([0.0; 3], [1.0; 3])), 9), None);
    }

    #[test]
    fn loops_run_along_edges_and_close() {
        let tube = surface(tube(1.0, 2.0, [0.0, 1.0], 12));
        let is_edge = |a: &Point3<f64>, b: &Point3<f64>| {
            let on = |t: u32, p: &Point3<f64>| tube.corners(t).contains(p);
            (0..tube.triangles().len() as u32).any(|t| on(t, a) && on(t, b))
        };
        for polygon in surface_loops(&tube, 2).unwrap() {
            let next = polygon.iter().cycle().skip(1);
            assert!(polygon.iter().zip(next).all(|(a, b)| a != b && is_edge(a, b)), "{polygon:?}");
        }
    }
}
