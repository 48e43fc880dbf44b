//! Points in a tree of bounding spheres, and walks through it, in space and in time.

use std::ops::Range;

use nalgebra::Point3;

use super::samples::{Spacing, sited};
use super::surface::Surface;

/// A node: a sphere that holds the samples of its subtree.
#[derive(Debug, Clone)]
pub struct SampleNode {
    /// Centre of the sphere.
    pub centre: Point3<f64>,
    /// Its radius.
    pub radius: f64,
    start: u32,
    end: u32,
    /// Index of the right child (the left one follows its parent); 0 for a leaf.
    right: u32,
    /// Index of the node after this subtree.
    after: u32,
}

/// Some samples: those in a sphere of the tree, or a single one.
#[derive(Debug, Clone, Copy)]
pub struct SampleBall<'a> {
    /// Centre of the sphere that holds them.
    pub centre: &'a Point3<f64>,
    /// Its radius.
    pub radius: f64,
    /// Of a single sample, its index among [`SampleTree::points`].
    pub sample: Option<usize>,
}

/// A node or a sample, by its index.
#[derive(Debug, Clone, Copy)]
enum TreeEntry {
    Node(usize),
    Sample(usize),
}

/// Samples of one surface.
#[derive(Debug, Clone, Default)]
pub struct SampleTree {
    points: Vec<Point3<f64>>,
    nodes: Vec<SampleNode>,
}

const LEAF: usize = 6;

impl SampleTree {
    /// Bytes in memory.
    #[must_use]
    pub fn memory(&self) -> usize {
        size_of_val(&*self.points) + size_of_val(&*self.nodes)
    }

    /// Samples a surface.
    #[must_use]
    pub fn new(surface: &Surface, spacing: &Spacing) -> Self {
        Self::over(sited(surface, spacing).into_iter().map(|(p, _)| p).collect())
    }

    /// A tree over given points.
    #[must_use]
    pub fn over(mut points: Vec<Point3<f64>>) -> Self {
        let mut nodes = Vec::new();
        let n = points.len();
        if n > 0 {
            build(&mut points, 0, n, &mut nodes);
        }
        points.shrink_to_fit();
        nodes.shrink_to_fit();
        Self { points, nodes }
    }

    /// All samples, in tree order.
    #[must_use]
    pub fn points(&self) -> &[Point3<f64>] {
        &self.points
    }

    /// Walks the tree. `enter` gets a sphere and what was learnt about the sphere around it, and
    /// returns what is known now, or `None` to leave the subtree out; `visit` gets the samples of
    /// all leaves entered, with what is known about the leaf.
    ///
    /// # Errors
    /// The first error of `enter` or `visit` ends the walk.
    pub fn walk<T: Copy, E>(
        &self,
        root: T,
        mut enter: impl FnMut(&SampleNode, T) -> Result<Option<T>, E>,
        mut visit: impl FnMut(&Point3<f64>, T) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut stack = Vec::with_capacity(48);
        if !self.nodes.is_empty() {
            stack.push((0usize, root));
        }
        while let Some((i, known)) = stack.pop() {
            let node = &self.nodes[i];
            let Some(known) = enter(node, known)? else { continue };
            if node.right == 0 {
                for p in &self.points[node.start as usize..node.end as usize] {
                    visit(p, known)?;
                }
            } else {
                stack.push((node.right as usize, known));
                stack.push((i + 1, known));
            }
        }
        Ok(())
    }
}

/// What becomes of samples over some moments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look<T> {
    /// They are left out.
    Out,
    /// They are looked at in the earlier and in the later half of the moments, with what is known.
    Halve(T),
    /// They are looked at one by one; of a single sample at a single moment, that is all.
    In(T),
}

impl SampleTree {
    /// Walks the tree over some moments of a motion at once. `look` gets a sphere, the moments, and what was learnt
    /// about what holds both; a single sample is a sphere without a radius, and comes with its index.
    /// Of no single moment it may ask for halves.
    ///
    /// # Errors
    /// The first error of `look` ends the walk.
    pub fn walk_through<T: Copy, E>(
        &self,
        moments: Range<usize>,
        root: T,
        mut look: impl FnMut(SampleBall<'_>, &Range<usize>, T) -> Result<Look<T>, E>,
    ) -> Result<(), E> {
        let mut stack = Vec::with_capacity(64);
        if !self.nodes.is_empty() && !moments.is_empty() {
            stack.push((TreeEntry::Node(0), moments, root));
        }
        while let Some((held, moments, known)) = stack.pop() {
            let ball = match held {
                TreeEntry::Node(i) => {
                    SampleBall { centre: &self.nodes[i].centre, radius: self.nodes[i].radius, sample: None }
                }
                TreeEntry::Sample(i) => SampleBall { centre: &self.points[i], radius: 0.0, sample: Some(i) },
            };
            match (look(ball, &moments, known)?, held) {
                (Look::Out, _) | (Look::In(_), TreeEntry::Sample(_)) => {}
                (Look::Halve(known), _) => {
                    let middle = moments.start.midpoint(moments.end);
                    stack.push((held, middle..moments.end, known));
                    stack.push((held, moments.start..middle, known));
                }
                (Look::In(known), TreeEntry::Node(i)) => {
                    let node = &self.nodes[i];
                    if node.right == 0 {
                        let samples = (node.start as usize..node.end as usize).rev();
                        stack.extend(samples.map(|s| (TreeEntry::Sample(s), moments.clone(), known)));
                    } else {
                        stack.push((TreeEntry::Node(node.right as usize), moments.clone(), known));
                        stack.push((TreeEntry::Node(i + 1), moments, known));
                    }
                }
            }
        }
        Ok(())
    }

    /// Whether any sample passes a test, of the nodes that are entered.
    ///
    /// # Errors
    /// The first error of `enter` ends the walk.
    pub fn any<E>(
        &self,
        enter: impl Fn(&SampleNode) -> Result<bool, E>,
        test: impl Fn(&Point3<f64>) -> bool,
    ) -> Result<bool, E> {
        let mut next = 0;
        while next < self.nodes.len() {
            let node = &self.nodes[next];
            if !enter(node)? {
                next = node.after as usize;
                continue;
            }
            if node.right == 0 && self.points[node.start as usize..node.end as usize].iter().any(&test) {
                return Ok(true);
            }
            next += 1;
        }
        Ok(false)
    }
}

fn build(points: &mut [Point3<f64>], offset: usize, end: usize, nodes: &mut Vec<SampleNode>) {
    let me = nodes.len();
    let slice = &mut points[offset..end];
    let bounds = super::Bounds::of(slice.iter());
    let centre = bounds.centre();
    let radius = slice.iter().map(|p| (p - centre).norm_squared()).fold(0.0, f64::max).sqrt();
    nodes.push(SampleNode {
        centre,
        radius,
        start: offset as u32,
        end: end as u32,
        right: 0,
        after: me as u32 + 1,
    });
    if slice.len() <= LEAF {
        return;
    }
    let axis = bounds.extents().imax();
    let mid = slice.len() / 2;
    slice.select_nth_unstable_by(mid, |p, q| {
        // All coordinates decide, so that equal keys cannot depend on the input's order.
        p[axis].total_cmp(&q[axis]).then_with(|| {
            let k = |r: &Point3<f64>| [r.x, r.y, r.z];
            k(p).partial_cmp(&k(q)).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    build(points, offset, offset + mid, nodes);
    nodes[me].right = nodes.len() as u32;
    build(points, offset + mid, end, nodes);
    nodes[me].after = nodes.len() as u32;
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;
    use crate::fixtures::{ball, l_shape, surface};

    const SPACING: Spacing = Spacing { vertex: Some(0.1), edge: 0.1, blunt_edge: 0.3, face: 0.4 };

    #[test]
    fn a_walk_visits_every_sample_within_its_spheres() {
        let samples = SampleTree::new(&surface(ball(3)), &SPACING);
        let mut visited = Vec::new();
        let Ok::<(), Infallible>(()) = samples.walk(
            Vec::<(Point3<f64>, f64)>::new().len(),
            |node, depth| {
                assert!(node.radius.is_finite());
                Ok(Some(depth + 1))
            },
            |p, depth| {
                assert!(depth > 1);
                visited.push(*p);
                Ok(())
            },
        );
        visited.sort_by_key(|p| p.coords.map(f64::to_bits).data.0);
        let mut all = samples.points().to_vec();
        all.sort_by_key(|p| p.coords.map(f64::to_bits).data.0);
        assert_eq!(visited, all);
        // A leaf that is entered holds its samples; one that is not visits none.
        let Ok::<(), Infallible>(()) = samples.walk(
            (Point3::origin(), 2.0),
            |node, _| Ok(Some((node.centre, node.radius))),
            |p, (c, r)| {
                assert!((p - c).norm() <= r * (1.0 + 1e-12));
                Ok(())
            },
        );
        let Ok::<(), Infallible>(()) = samples.walk((), |_, ()| Ok(None), |_, ()| panic!("left out"));
        assert_eq!(samples.walk((), |_, ()| Err("ended"), |_, ()| Ok(())), Err("ended"));
    }

    #[test]
    fn a_walk_through_time_looks_at_each_sample_at_each_moment_that_is_not_left_out() {
        let samples = SampleTree::new(&surface(l_shape()), &SPACING);
        let (n, times) = (samples.points().len(), 11);
        // Something that passes along x leaves a wake: which samples it is near, and when.
        let is_near = |p: &Point3<f64>, time: usize, off: f64| (p.x - 0.2 * time as f64).abs() <= 0.15 + off;
        let expected: Vec<(usize, usize)> = (0..n)
            .flat_map(|i| (0..times).map(move |time| (i, time)))
            .filter(|&(i, time)| is_near(&samples.points()[i], time, 0.0))
            .collect();
        let (mut seen, mut looks) = (Vec::new(), 0);
        let Ok::<(), Infallible>(()) = samples.walk_through(0..times, (), |ball, moments, ()| {
            looks += 1;
            assert!(ball.sample.is_none_or(|i| samples.points()[i] == *ball.centre));
            if !moments.clone().any(|time| is_near(ball.centre, time, ball.radius)) {
                return Ok(Look::Out);
            }
            if moments.len() > 1 && ball.radius < 0.2 * moments.len() as f64 {
                return Ok(Look::Halve(()));
            }
            seen.extend(ball.sample.map(|i| (i, moments.start)));
            Ok(Look::In(()))
        });
        seen.sort_unstable();
        assert_eq!(seen, expected);
        assert!(!seen.is_empty() && looks < n * times, "{looks} of {}", n * times);
        let Ok::<(), Infallible>(()) =
            samples.walk_through(0..0, (), |_, _, ()| panic!("there is no moment"));
    }

    #[test]
    fn the_order_of_points_does_not_shape_the_tree() {
        let points: Vec<_> = crate::fixtures::spread([0.0; 3], [1.0; 3], 40).collect();
        let mut reversed = points.clone();
        reversed.reverse();
        let boxes = |tree: &SampleTree| tree.nodes.iter().map(|n| (n.centre, n.radius)).collect::<Vec<_>>();
        assert_eq!(boxes(&SampleTree::over(points)), boxes(&SampleTree::over(reversed)));
        assert!(SampleTree::over(Vec::new()).points().is_empty());
    }
}
