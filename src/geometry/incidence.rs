//! Which triangles meet at an edge.

use super::mesh::directed_edges;

/// A triangle at an edge: its index, and whether it travels the edge upwards (from the
/// smaller vertex index to the larger).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::geometry) struct Side {
    pub(in crate::geometry) triangle: u32,
    pub(in crate::geometry) upwards: bool,
}

/// The sides of every edge. Sorted rather than hashed: they are asked for again and again, of every part.
#[derive(Debug)]
pub(in crate::geometry) struct Sides {
    /// Edges by their vertices, smaller index first, ascending; where their sides begin.
    edges: Vec<([u32; 2], u32)>,
    /// By edge, and of an edge by triangle.
    sides: Vec<Side>,
}

impl Sides {
    pub(in crate::geometry) fn of(triangles: &[[u32; 3]]) -> Self {
        let of_triangle = |(triangle, t): (u32, &[u32; 3])| {
            directed_edges(t).map(|[a, b]| ([a.min(b), a.max(b)], Side { triangle, upwards: a < b }))
        };
        let unsorted = || (0u32..).zip(triangles).flat_map(of_triangle);
        // By their smaller vertex first, of which each has a few: that is much quicker than to compare them all.
        let vertices = triangles.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        let mut ends = vec![0u32; vertices + 1];
        unsorted().for_each(|([a, _], _)| ends[a as usize + 1] += 1);
        (0..vertices).for_each(|v| ends[v + 1] += ends[v]);
        let none = ([0; 2], Side { triangle: 0, upwards: false });
        let mut sides = vec![none; 3 * triangles.len()];
        for side in unsorted() {
            let end = &mut ends[side.0[0] as usize];
            sides[*end as usize] = side;
            *end += 1;
        }
        let mut start = 0;
        for &end in &ends[..vertices] {
            sides[start..end as usize].sort_unstable_by_key(|([_, b], side)| (*b, side.triangle));
            start = end as usize;
        }
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(sides.len() / 2);
        for (i, (edge, _)) in (0u32..).zip(&sides) {
            if edges.last().is_none_or(|(last, _)| last != edge) {
                edges.push((*edge, i));
            }
        }
        Self { edges, sides: sides.into_iter().map(|(_, side)| side).collect() }
    }

    /// All edges, ascending, with the triangles at each, ascending.
    pub(in crate::geometry) fn iter(&self) -> impl Iterator<Item = ([u32; 2], &[Side])> {
        let ends = self.edges[1.min(self.edges.len())..].iter().map(|e| e.1 as usize);
        let ends = ends.chain([self.sides.len()]);
        self.edges.iter().zip(ends).map(|(&(edge, start), end)| (edge, &self.sides[start as usize..end]))
    }

    /// The triangles at the edge between two vertices, ascending.
    pub(in crate::geometry) fn at(&self, a: u32, b: u32) -> &[Side] {
        let Ok(i) = self.edges.binary_search_by_key(&[a.min(b), a.max(b)], |e| e.0) else { return &[] };
        let end = self.edges.get(i + 1).map_or(self.sides.len(), |next| next.1 as usize);
        &self.sides[self.edges[i].1 as usize..end]
    }
}

/// How many edges have an odd number of triangles: the border of a surface that is not closed.
pub(in crate::geometry) fn open_edges(triangles: &[[u32; 3]]) -> usize {
    Sides::of(triangles).iter().filter(|(_, s)| s.len() % 2 == 1).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_has_its_triangles() {
        let triangles = [[0, 1, 2], [2, 1, 3], [0, 1, 4]];
        let sides = Sides::of(&triangles);
        let side = |triangle, upwards| Side { triangle, upwards };
        assert_eq!(sides.at(1, 0), [side(0, true), side(2, true)]);
        assert_eq!(sides.at(1, 2), [side(0, true), side(1, false)]);
        assert_eq!(sides.at(0, 3), []);
        let all: Vec<_> = sides.iter().map(|(edge, s)| (edge, s.len())).collect();
        let counts =
            [([0, 1], 2), ([0, 2], 1), ([0, 4], 1), ([1, 2], 2), ([1, 3], 1), ([1, 4], 1), ([2, 3], 1)];
        assert_eq!(all, counts);
        assert!(all.iter().all(|(edge, _)| !sides.at(edge[0], edge[1]).is_empty()));
        assert_eq!(open_edges(&triangles), 5);
        assert_eq!(Sides::of(&[]).iter().count(), 0);
    }
}
