//! Which triangles meet at an edge.

use super::mesh::directed_edges;

/// A triangle at an edge, in one number so that sides sort quickly: the edge's larger vertex, the triangle, and whether
/// it travels the edge upwards (from the smaller vertex index to the larger).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(in crate::geometry) struct Side(u64);

impl Side {
    fn new(larger: u32, triangle: u32, upwards: bool) -> Self {
        Self(u64::from(larger) << 32 | u64::from(triangle) << 1 | u64::from(upwards))
    }

    fn larger(self) -> u32 {
        (self.0 >> 32) as u32
    }

    pub(in crate::geometry) fn triangle(self) -> u32 {
        self.0 as u32 >> 1
    }

    pub(in crate::geometry) fn upwards(self) -> bool {
        self.0 & 1 == 1
    }
}

/// The sides of every edge. Sorted rather than hashed: they are asked for again and again, of every part.
#[derive(Debug)]
pub(in crate::geometry) struct Sides {
    /// Where the sides of edges with this smaller vertex begin, and where the last one's end.
    starts: Vec<u32>,
    /// By edge, and of an edge by triangle.
    sides: Vec<Side>,
}

impl Sides {
    /// The most triangles of a mesh: sides are numbered by 32 bits. Healing refuses more.
    pub(in crate::geometry) const MOST_TRIANGLES: usize = 1 << 30;

    pub(in crate::geometry) fn of(triangles: &[[u32; 3]]) -> Self {
        let of_triangle = |(triangle, t): (u32, &[u32; 3])| {
            directed_edges(t).map(|[a, b]| (a.min(b), Side::new(a.max(b), triangle, a < b)))
        };
        let unsorted = || (0u32..).zip(triangles).flat_map(of_triangle);
        // By their smaller vertex first, of which each has a few: that is much quicker than to compare them all.
        let vertices = triangles.iter().flatten().max().map_or(0, |&v| v as usize + 1);
        // One place further on, so that each is where its successor begins once all sides are placed.
        let mut starts = vec![0u32; vertices + 2];
        unsorted().for_each(|(a, _)| starts[a as usize + 2] += 1);
        (2..vertices + 2).for_each(|v| starts[v] += starts[v - 1]);
        let mut sides = vec![Side(0); 3 * triangles.len()];
        for (a, side) in unsorted() {
            let end = &mut starts[a as usize + 1];
            sides[*end as usize] = side;
            *end += 1;
        }
        starts.truncate(vertices + 1);
        starts.windows(2).for_each(|w| sides[w[0] as usize..w[1] as usize].sort_unstable());
        Self { starts, sides }
    }

    /// All edges, ascending, with the triangles at each, ascending.
    pub(in crate::geometry) fn iter(&self) -> impl Iterator<Item = ([u32; 2], &[Side])> {
        (0..self.starts.len() as u32 - 1).flat_map(|a| {
            let edges = self.above(a).chunk_by(|s, t| s.larger() == t.larger());
            edges.map(move |sides| ([a, sides[0].larger()], sides))
        })
    }

    /// The triangles at the edge between two vertices, ascending.
    pub(in crate::geometry) fn at(&self, a: u32, b: u32) -> &[Side] {
        let (sides, larger) = (self.above(a.min(b)), a.max(b));
        let from = sides.partition_point(|s| s.larger() < larger);
        let to = sides.partition_point(|s| s.larger() <= larger);
        &sides[from..to]
    }

    /// How many edges have an odd number of triangles: the border of a surface that is not closed.
    pub(in crate::geometry) fn open_edges(&self) -> usize {
        self.iter().filter(|(_, s)| s.len() % 2 == 1).count()
    }

    /// Triangles that travel the other way from now on.
    pub(in crate::geometry) fn turn(&mut self, is_turned: impl Fn(u32) -> bool) {
        self.sides.iter_mut().for_each(|side| side.0 ^= u64::from(is_turned(side.triangle())));
    }

    /// The sides of edges with this smaller vertex.
    fn above(&self, smaller: u32) -> &[Side] {
        let i = smaller as usize;
        &self.sides[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_edge_has_its_triangles() {
        let triangles = [[0, 1, 2], [2, 1, 3], [0, 1, 4]];
        let sides = Sides::of(&triangles);
        let told = |sides: &[Side]| sides.iter().map(|s| (s.triangle(), s.upwards())).collect::<Vec<_>>();
        assert_eq!(told(sides.at(1, 0)), [(0, true), (2, true)]);
        assert_eq!(told(sides.at(1, 2)), [(0, true), (1, false)]);
        assert_eq!(sides.at(0, 3), []);
        let all: Vec<_> = sides.iter().map(|(edge, s)| (edge, s.len())).collect();
        let counts =
            [([0, 1], 2), ([0, 2], 1), ([0, 4], 1), ([1, 2], 2), ([1, 3], 1), ([1, 4], 1), ([2, 3], 1)];
        assert_eq!(all, counts);
        assert!(all.iter().all(|(edge, _)| !sides.at(edge[0], edge[1]).is_empty()));
        assert_eq!(sides.open_edges(), 5);
        assert_eq!(Sides::of(&[]).iter().count(), 0);
        let mut sides = sides;
        sides.turn(|t| t == 2);
        assert_eq!(told(sides.at(1, 0)), [(0, true), (2, false)]);
    }
}
