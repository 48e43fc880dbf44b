//! A surface's triangles in a tree of bounding spheres: what a branch-and-bound over a surface
//! walks.

use nalgebra::Point3;

use crate::termination::{Interrupt, Poll};

use super::{Bounds, Surface};

/// A node: a sphere that holds the triangles of its subtree.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Centre of the sphere.
    pub centre: Point3<f64>,
    /// Its radius.
    pub radius: f64,
    /// Its triangles, as a range of those of the tree.
    start: u32,
    end: u32,
    /// Its vertices, likewise.
    first_vertex: u32,
    last_vertex: u32,
    /// Of the vertices, those that reach furthest in some directions, likewise.
    first_extreme: u32,
    last_extreme: u32,
    /// Index of the right child (the left one follows its parent); 0 for a leaf.
    right: u32,
}

/// What a patch is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Parts<'a> {
    /// Two smaller patches, as indices of their nodes.
    Patches([u32; 2]),
    /// Triangles.
    Triangles(&'a [u32]),
}

/// The triangles of one surface.
#[derive(Debug, Clone, Default)]
pub struct PatchTree {
    nodes: Vec<Patch>,
    triangles: Vec<u32>,
    /// The vertices of each leaf, leaf by leaf.
    vertices: Vec<Point3<f64>>,
    extremes: Vec<Point3<f64>>,
}

const LEAF: usize = 8;

impl PatchTree {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        let Self { nodes, triangles, vertices, extremes } = self;
        size_of_val(&**nodes)
            + size_of_val(&**triangles)
            + size_of_val(&**vertices)
            + size_of_val(&**extremes)
    }

    /// The tree of all triangles of a surface.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn new(surface: &Surface, poll: &Poll<'_>) -> Result<Self, Interrupt> {
        let mut triangles: Vec<u32> = (0..surface.triangles().len() as u32).collect();
        let n = triangles.len();
        // As many as there are of them at most, mostly; what is not used is given back.
        let mut tree = Self {
            nodes: Vec::with_capacity(n / 3),
            triangles: Vec::new(),
            vertices: Vec::with_capacity(2 * n),
            extremes: Vec::with_capacity(5 * n),
        };
        if n > 0 {
            let given = Given::of(surface);
            tree.build(&given, &mut triangles, (0, n), poll)?;
        }
        tree.nodes.shrink_to_fit();
        tree.vertices.shrink_to_fit();
        tree.extremes.shrink_to_fit();
        Ok(Self { triangles, ..tree })
    }

    /// The whole surface, unless it has no triangles.
    #[must_use]
    pub fn root(&self) -> Option<u32> {
        (!self.nodes.is_empty()).then_some(0)
    }

    /// A node.
    #[must_use]
    pub fn patch(&self, index: u32) -> &Patch {
        &self.nodes[index as usize]
    }

    /// The vertices of a node's triangles; those of several leaves come several times.
    #[must_use]
    pub fn vertices(&self, index: u32) -> &[Point3<f64>] {
        let patch = self.patch(index);
        &self.vertices[patch.first_vertex as usize..patch.last_vertex as usize]
    }

    /// Those of a node's vertices that say most about where it reaches.
    pub fn extremes(&self, index: u32) -> impl Iterator<Item = &Point3<f64>> {
        let patch = self.patch(index);
        self.extremes[patch.first_extreme as usize..patch.last_extreme as usize].iter()
    }

    /// All triangles of a node.
    #[must_use]
    pub fn triangles(&self, index: u32) -> &[u32] {
        let patch = self.patch(index);
        &self.triangles[patch.start as usize..patch.end as usize]
    }

    /// What a node holds.
    #[must_use]
    pub fn parts(&self, index: u32) -> Parts<'_> {
        match self.patch(index) {
            Patch { right: 0, start, end, .. } => {
                Parts::Triangles(&self.triangles[*start as usize..*end as usize])
            }
            Patch { right, .. } => Parts::Patches([index + 1, *right]),
        }
    }

    /// Which of the extremes of the node reach furthest.
    fn build(
        &mut self,
        given: &Given<'_>,
        triangles: &mut [u32],
        (start, end): (usize, usize),
        poll: &Poll<'_>,
    ) -> Result<Furthest, Interrupt> {
        poll.check()?;
        let mut furthest;
        let slice = &mut triangles[start..end];
        let bounds = slice.iter().fold(Bounds::EMPTY, |b, &t| b.union(&given.boxes[t as usize]));
        let centre = bounds.centre();
        let me = self.nodes.len();
        self.nodes.push(Patch {
            centre,
            // Told by its vertices, once they are there: corners of triangles are several times as many.
            radius: 0.0,
            start: start as u32,
            end: end as u32,
            first_vertex: self.vertices.len() as u32,
            last_vertex: 0,
            first_extreme: 0,
            last_extreme: 0,
            right: 0,
        });
        let extremes = if slice.len() <= LEAF {
            let mut ids: Vec<u32> =
                slice.iter().flat_map(|&t| given.surface.triangles()[t as usize]).collect();
            ids.sort_unstable();
            ids.dedup();
            let vertices: Vec<_> = ids.iter().map(|&v| given.surface.vertices()[v as usize]).collect();
            self.vertices.extend(&vertices);
            furthest = Furthest::of(&vertices);
            vertices
        } else {
            let axis = bounds.extents().imax();
            let middle = |t: u32| given.middles[t as usize][axis];
            let half = slice.len() / 2;
            slice.select_nth_unstable_by(half, |&s, &t| middle(s).total_cmp(&middle(t)).then(s.cmp(&t)));
            let left = self.build(given, triangles, (start, start + half), poll)?;
            let right = self.nodes.len() as u32;
            self.nodes[me].right = right;
            let others = self.build(given, triangles, (start + half, end), poll)?;
            // Who reaches furthest of all does so of one half.
            let mut extremes: Vec<_> = self.extremes(me as u32 + 1).copied().collect();
            furthest = left.joined(&others, extremes.len() as u32);
            extremes.extend(self.extremes(right));
            if extremes.len() <= FEW { extremes } else { furthest.alone(&extremes) }
        };
        let first_vertex = self.nodes[me].first_vertex as usize;
        let reach = self.vertices[first_vertex..].iter().map(|p| (p - centre).norm_squared());
        let node = &mut self.nodes[me];
        node.radius = reach.fold(0.0, f64::max).sqrt();
        node.last_vertex = self.vertices.len() as u32;
        node.first_extreme = self.extremes.len() as u32;
        self.extremes.extend(extremes);
        node.last_extreme = self.extremes.len() as u32;
        Ok(furthest)
    }
}

/// What is asked of a surface's triangles at every level of their tree, in one place.
struct Given<'a> {
    surface: &'a Surface,
    boxes: Vec<Bounds>,
    /// The sums of their corners.
    middles: Vec<[f64; 3]>,
}

impl<'a> Given<'a> {
    fn of(surface: &'a Surface) -> Self {
        let corners: Vec<_> = (0..surface.triangles().len() as u32).map(|t| surface.corners(t)).collect();
        let sum = |corners: &[Point3<f64>; 3]| [0, 1, 2].map(|axis| corners.iter().map(|p| p[axis]).sum());
        let middles = corners.iter().map(sum).collect();
        Self { surface, boxes: corners.iter().map(Bounds::of).collect(), middles }
    }
}

/// So many points are kept as they are.
const FEW: usize = 26;
/// Pairs of opposite directions.
const PAIRS: usize = 13;
/// One direction of each pair, of all those to the middles of a cube's faces, edges and corners.
const ALONG: [[f64; 3]; PAIRS] = {
    let mut along = [[0.0; 3]; PAIRS];
    let mut code = 0;
    while code < PAIRS {
        along[code] = [(code % 3) as f64 - 1.0, (code / 3 % 3) as f64 - 1.0, (code / 9) as f64 - 1.0];
        code += 1;
    }
    along
};

/// Of some points, those that reach furthest in each of 26 directions, by their numbers: of those that reach as
/// far, the last.
#[derive(Clone, Copy)]
struct Furthest {
    least: [f64; PAIRS],
    most: [f64; PAIRS],
    at_least: [u32; PAIRS],
    at_most: [u32; PAIRS],
}

impl Furthest {
    const NONE: Self = Self {
        least: [f64::INFINITY; PAIRS],
        most: [f64::NEG_INFINITY; PAIRS],
        at_least: [0; PAIRS],
        at_most: [0; PAIRS],
    };

    fn of(points: &[Point3<f64>]) -> Self {
        let mut all = Self::NONE;
        for (i, p) in (0u32..).zip(points) {
            for (k, [x, y, z]) in ALONG.iter().enumerate() {
                let reach = p.x * x + p.y * y + p.z * z;
                all.take(k, (reach, i), (reach, i));
            }
        }
        all
    }

    /// Takes points that come behind these, if they reach as far along a pair of directions.
    #[inline]
    fn take(&mut self, k: usize, (least, at_least): (f64, u32), (most, at_most): (f64, u32)) {
        if least <= self.least[k] {
            (self.least[k], self.at_least[k]) = (least, at_least);
        }
        if most >= self.most[k] {
            (self.most[k], self.at_most[k]) = (most, at_most);
        }
    }

    /// Those of these points and others behind them, the first of which gets a number.
    fn joined(mut self, others: &Self, first: u32) -> Self {
        let Self { least, most, at_least, at_most } = others;
        for k in 0..PAIRS {
            self.take(k, (least[k], first + at_least[k]), (most[k], first + at_most[k]));
        }
        self
    }

    /// The points that are among those, in their order; from now on, these are the ones that are numbered.
    fn alone(&mut self, points: &[Point3<f64>]) -> Vec<Point3<f64>> {
        let mut numbers = vec![None; points.len()];
        let all = || self.at_least.iter().chain(&self.at_most);
        all().for_each(|&i| numbers[i as usize] = Some(0));
        let mut kept = Vec::with_capacity(FEW);
        for (number, p) in numbers.iter_mut().zip(points) {
            if let Some(number) = number {
                *number = kept.len() as u32;
                kept.push(*p);
            }
        }
        for at in self.at_least.iter_mut().chain(&mut self.at_most) {
            *at = numbers[*at as usize].unwrap_or_default();
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, l_shape, open_box, surface};
    use crate::termination::Termination;

    /// The triangles below a node; checks that its sphere holds them.
    fn held(tree: &PatchTree, surface: &Surface, index: u32) -> Vec<u32> {
        let found = match tree.parts(index) {
            Parts::Patches(children) => children.map(|c| held(tree, surface, c)).concat(),
            Parts::Triangles(list) => list.to_vec(),
        };
        let patch = tree.patch(index);
        for p in found.iter().flat_map(|&t| surface.corners(t)) {
            assert!(tree.vertices(index).contains(&p));
            assert!((p - patch.centre).norm() <= patch.radius * (1.0 + 1e-12));
        }
        found
    }

    #[test]
    fn a_tree_may_be_cut_short_anywhere() {
        let surface = surface(ball(3));
        let termination = Termination::default();
        let whole = PatchTree::new(&surface, &Poll::every(1, Some(&termination))).unwrap().nodes.len();
        termination.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        for steps in 1..whole as u32 {
            let poll = Poll::first_after(steps, &termination);
            assert!(PatchTree::new(&surface, &poll).is_err());
        }
    }

    /// Whether a node has, of its halves' extremes, those that reach furthest, and so on below.
    fn has_extremes(tree: &PatchTree, index: u32) -> bool {
        let Parts::Patches(halves) = tree.parts(index) else {
            return tree.extremes(index).eq(tree.vertices(index));
        };
        let all: Vec<_> = halves.iter().flat_map(|&half| tree.extremes(half).copied()).collect();
        let mut wanted: Vec<usize> = (0..27)
            .filter(|code| *code != 13)
            .filter_map(|code| {
                let along =
                    nalgebra::Vector3::new(code % 3, code / 3 % 3, code / 9).map(|x| f64::from(x - 1));
                let reach = |i: &usize| all[*i].coords.dot(&along);
                // The last of those that reach as far.
                (0..all.len()).max_by(|i, j| reach(i).partial_cmp(&reach(j)).unwrap())
            })
            .collect();
        wanted.sort_unstable();
        wanted.dedup();
        let wanted: Vec<_> =
            if all.len() <= FEW { all } else { wanted.into_iter().map(|i| all[i]).collect() };
        tree.extremes(index).eq(&wanted) && halves.iter().all(|&half| has_extremes(tree, half))
    }

    #[test]
    fn extremes_are_those_of_the_halves_that_reach_furthest() {
        for mesh in [ball(4), l_shape()] {
            let tree = PatchTree::new(&surface(mesh), &Poll::every(1, None)).unwrap();
            assert!(has_extremes(&tree, tree.root().unwrap()));
        }
    }

    #[test]
    fn every_triangle_is_in_one_leaf_and_in_all_spheres_above() {
        for mesh in [ball(3), l_shape(), open_box([0.0; 3], [1.0; 3])] {
            let s = surface(mesh);
            let tree = PatchTree::new(&s, &Poll::every(1, None)).unwrap();
            let mut all = held(&tree, &s, tree.root().unwrap());
            all.sort_unstable();
            assert_eq!(all, (0..s.triangles().len() as u32).collect::<Vec<_>>());
        }
        assert_eq!(PatchTree::default().root(), None);
    }
}
