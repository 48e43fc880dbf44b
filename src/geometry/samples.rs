//! Points on a surface at which contact is looked for ([`SampleTree`](super::SampleTree)).
//!
//! Two surfaces first touch where a vertex or convex edge of one meets the other, so vertices and
//! convex edges are sampled closely and faces sparsely (faces matter where parts are flush and all
//! their edges coincide). Both surfaces of a pair are sampled. Known miss: features between two
//! samples that enter by less than half the spacing.

use std::collections::HashSet;

use nalgebra::Point3;

use super::Bounds;
use super::surface::{NO_TRIANGLE, Surface};

/// How densely a surface is sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spacing {
    /// Between vertices at blunt edges; without one, every vertex of the surface is a sample.
    pub vertex: Option<f64>,
    /// Along convex edges.
    pub edge: f64,
    /// Along convex edges so blunt that a straight chord is close to the surface.
    pub blunt_edge: f64,
    /// Over faces.
    pub face: f64,
}

/// Where on its surface a sample lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Site {
    /// At this vertex.
    Vertex(u32),
    /// On this edge of this triangle.
    Edge(u32, u8),
    /// Inside this triangle.
    Face(u32),
}

/// A sample and where it lies.
pub(super) type Sited = (Point3<f64>, Site);

/// The samples of a surface, in the order of its triangles.
pub(super) fn sited(surface: &Surface, spacing: &Spacing) -> Vec<Sited> {
    sited_on(surface, spacing, 0..surface.triangles().len() as u32, |_| true)
}

/// The same of those within a box.
pub(super) fn sited_within(surface: &Surface, spacing: &Spacing, bounds: &Bounds) -> Vec<Sited> {
    // Vertices are thinned among those beside them.
    let around = bounds.grown(spacing.vertex.unwrap_or(0.0).max(THINNEST));
    let reaches = |t: &u32| Bounds::of(&surface.corners(*t)).meets(&around);
    let triangles = (0..surface.triangles().len() as u32).filter(reaches);
    let mut out = sited_on(surface, spacing, triangles, |p| around.contains(p));
    out.retain(|(p, _)| bounds.contains(p));
    out
}

/// The same on some triangles, ascending, and at those of their vertices that are wanted, around which all must be.
fn sited_on(
    surface: &Surface,
    spacing: &Spacing,
    triangles: impl Iterator<Item = u32> + Clone,
    is_wanted: impl Fn(&Point3<f64>) -> bool,
) -> Vec<Sited> {
    let mut out = sample_vertices(surface, spacing, triangles.clone(), is_wanted);
    for t in triangles {
        sample_edges(surface, t, spacing, &mut out);
        sample_face(surface, t, spacing.face, &mut out);
    }
    out
}

/// Sharp vertices closer than this, in units of the planning frame, are one sample.
const THINNEST: f64 = 0.005;
/// cos of the dihedral deviation below which an edge counts as blunt (about 20 degrees).
const BLUNT_COS: f64 = 0.94;

/// How an edge is bent, seen from outside; of a wall, from the side on which it is convex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Bend {
    /// Flat or reentrant: no point of it is first to touch.
    Inward,
    /// Convex, but a chord is close to it.
    Blunt,
    /// Convex, or the rim of an open surface.
    Sharp,
}

fn bend(surface: &Surface, t: u32, e: u8) -> Bend {
    let other = surface.neighbour(t, e);
    if other == NO_TRIANGLE {
        return Bend::Sharp;
    }
    let corners = surface.corners(t);
    let edge = corners[(e as usize + 1) % 3] - corners[e as usize];
    let (n, m) = (surface.face_normal(t), surface.face_normal(other));
    // Convex: the neighbour's normal leans away from this face's inside.
    let lean = n.cross(&m).dot(&edge);
    let lean = if surface.is_wall() { lean.abs() } else { lean };
    if lean <= 1e-3 * edge.norm() {
        Bend::Inward
    } else if n.dot(&m) < BLUNT_COS {
        Bend::Sharp
    } else {
        Bend::Blunt
    }
}

/// The convex edges of a surface, and all edges and rims of a wall, each once: a triangle and which of its edges it is.
pub(super) fn convex_edges(surface: &Surface) -> impl Iterator<Item = (u32, u8)> {
    let all = (0..surface.triangles().len() as u32).flat_map(|t| (0..3u8).map(move |e| (t, e)));
    let is_first = |t: u32, other: u32| other == NO_TRIANGLE || other >= t;
    all.filter(move |&(t, e)| is_first(t, surface.neighbour(t, e)) && bend(surface, t, e) > Bend::Inward)
}

/// The vertices at convex edges. On finely tessellated surfaces they stand much closer than any
/// contact needs: blunt ones are thinned to the edge spacing, sharp ones only where they nearly
/// coincide (the crest of a thread is narrow). Without a spacing none is left out.
fn sample_vertices(
    surface: &Surface,
    spacing: &Spacing,
    triangles: impl Iterator<Item = u32>,
    is_wanted: impl Fn(&Point3<f64>) -> bool,
) -> Vec<Sited> {
    let vertices = (0..).zip(surface.vertices()).filter(|(_, p)| is_wanted(p));
    let Some(blunt) = spacing.vertex else {
        return vertices.map(|(v, p)| (*p, Site::Vertex(v))).collect();
    };
    let mut bends = vec![Bend::Inward; surface.vertices().len()];
    for i in triangles {
        let t = surface.triangles()[i as usize];
        for e in 0..3u8 {
            let bend = bend(surface, i, e);
            for v in [t[e as usize], t[(e as usize + 1) % 3]] {
                bends[v as usize] = bends[v as usize].max(bend);
            }
        }
    }
    let mut taken = HashSet::new();
    let mut out = Vec::new();
    for (cell, wanted) in [(THINNEST, Bend::Sharp), (blunt, Bend::Blunt)] {
        for (v, p) in vertices.clone().filter(|(v, _)| bends[*v as usize] == wanted) {
            if taken.insert((wanted == Bend::Sharp, p.coords.map(|x| (x / cell).floor() as i64))) {
                out.push((*p, Site::Vertex(v)));
            }
        }
    }
    out
}

fn sample_edges(surface: &Surface, t: u32, spacing: &Spacing, out: &mut Vec<Sited>) {
    let corners = surface.corners(t);
    for e in 0..3u8 {
        let other = surface.neighbour(t, e);
        // Each edge once, from its first triangle.
        if other != NO_TRIANGLE && other < t {
            continue;
        }
        let (a, b) = (corners[e as usize], corners[(e as usize + 1) % 3]);
        let step = match bend(surface, t, e) {
            Bend::Inward => continue,
            Bend::Blunt => spacing.blunt_edge,
            Bend::Sharp => spacing.edge,
        };
        let n = ((b - a).norm() / step).ceil().max(1.0) as usize;
        out.extend((1..n).map(|k| (a + (b - a) * (k as f64 / n as f64), Site::Edge(t, e))));
    }
}

/// Points on rows parallel to the longest edge, all strictly inside.
fn sample_face(surface: &Surface, t: u32, step: f64, out: &mut Vec<Sited>) {
    let corners = surface.corners(t);
    let side = |e: usize| (corners[(e + 1) % 3] - corners[e]).norm();
    let base = (0..3).max_by(|&e, &f| side(e).total_cmp(&side(f))).unwrap_or(0);
    let (a, b, apex) = (corners[base], corners[(base + 1) % 3], corners[(base + 2) % 3]);
    let height = (b - a).cross(&(apex - a)).norm() / side(base).max(f64::MIN_POSITIVE);
    // Slivers and small faces are held by their edges and vertices.
    if height * side(base) < 0.04 * step * step {
        return;
    }
    let rows = (height / step).ceil().max(1.0) as usize;
    for row in 0..rows {
        let v = (row as f64 + 0.5) / rows as f64;
        let (from, to) = (a + (apex - a) * v, b + (apex - b) * v);
        let count = ((to - from).norm() / step).ceil().max(1.0) as usize;
        let point = |k: usize| from + (to - from) * ((k as f64 + 0.5) / count as f64);
        out.extend((0..count).map(|k| (point(k), Site::Face(t))));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{ball, cuboid, l_shape, moved, open_box, surface};
    use crate::geometry::{Pose, SampleTree};

    const SPACING: Spacing = Spacing { vertex: Some(0.1), edge: 0.1, blunt_edge: 0.3, face: 0.4 };

    /// The largest gap between samples along a segment, its ends counted as places to reach.
    fn widest_gap(samples: &SampleTree, a: Point3<f64>, b: Point3<f64>) -> f64 {
        let (d, length) = ((b - a).normalize(), (b - a).norm());
        let along = samples.points().iter().filter(|p| (*p - a).cross(&d).norm() < 1e-9);
        let mut at: Vec<f64> =
            along.map(|p| (p - a).dot(&d)).filter(|u| (-1e-9..=length + 1e-9).contains(u)).collect();
        at.extend([0.0, length]);
        at.sort_by(f64::total_cmp);
        at.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max)
    }

    #[test]
    fn samples_lie_on_the_surface() {
        let turn = Pose::new(Vector3::new(3.0, 0.1, -2.0), Vector3::new(0.3, -0.5, 0.2));
        for mesh in [
            cuboid([0.0; 3], [1.0, 2.0, 0.05]),
            ball(3),
            moved(l_shape(), &turn),
            open_box([0.0; 3], [1.0; 3]),
        ] {
            let s = surface(mesh);
            let samples = SampleTree::new(&s, &SPACING);
            assert!(samples.points().len() > 50);
            for p in samples.points() {
                let d = s.signed_distance(p).abs();
                assert!(d < 1e-12, "{d} off at {p}");
            }
        }
    }

    #[test]
    fn samples_within_a_box_are_those_of_all_that_are_there() {
        let turn = Pose::new(Vector3::new(0.3, 0.1, -0.2), Vector3::new(0.3, -0.5, 0.2));
        for mesh in [ball(4), moved(l_shape(), &turn), open_box([0.0; 3], [1.0; 3])] {
            let s = surface(mesh);
            let all = sited(&s, &SPACING);
            for corner in [Point3::origin(), Point3::new(0.2, -0.4, 0.1), Point3::new(9.0, 9.0, 9.0)] {
                for side in [0.05, 0.4, 1.5] {
                    let bounds = Bounds { min: corner, max: corner + Vector3::repeat(side) };
                    let within: Vec<_> = all.iter().filter(|(p, _)| bounds.contains(p)).copied().collect();
                    assert_eq!(sited_within(&s, &SPACING, &bounds), within, "{bounds:?}");
                }
            }
        }
    }

    #[test]
    fn convex_edges_of_a_box_are_sampled_at_the_spacing() {
        let size = [1.0, 2.33, 0.57];
        let samples = SampleTree::new(&surface(cuboid([0.0; 3], size)), &SPACING);
        for axis in 0..3 {
            for corner in 0..4 {
                let mut a = Point3::origin();
                a[(axis + 1) % 3] = size[(axis + 1) % 3] * f64::from(corner & 1);
                a[(axis + 2) % 3] = size[(axis + 2) % 3] * f64::from(corner >> 1);
                let mut b = a;
                b[axis] = size[axis];
                let gap = widest_gap(&samples, a, b);
                assert!(gap <= SPACING.edge + 1e-12, "{gap} between {a} and {b}");
                assert!(samples.points().contains(&a) && samples.points().contains(&b));
            }
        }
    }

    #[test]
    fn a_reentrant_edge_is_left_out() {
        let samples = SampleTree::new(&surface(l_shape()), &SPACING);
        let inner = |p: &&Point3<f64>| p.x == 1.0 && p.y == 1.0 && p.z > 0.0 && p.z < 1.0;
        assert_eq!(samples.points().iter().filter(inner).count(), 0);
        assert!(widest_gap(&samples, Point3::new(2.0, 1.0, 0.0), Point3::new(2.0, 1.0, 1.0)) <= 0.1 + 1e-12);
    }

    #[test]
    fn the_rim_of_an_open_surface_is_sampled() {
        let samples = SampleTree::new(&surface(open_box([0.0; 3], [1.0; 3])), &SPACING);
        assert!(widest_gap(&samples, Point3::new(0.0, 0.0, 1.0), Point3::new(1.0, 0.0, 1.0)) <= 0.1 + 1e-12);
    }

    #[test]
    fn no_point_of_a_face_is_far_from_a_sample() {
        let s = surface(cuboid([0.0; 3], [2.0, 2.0, 1.0]));
        let samples = SampleTree::new(&s, &SPACING);
        for (x, y) in (0..=20).flat_map(|i| (0..=20).map(move |j| (f64::from(i) / 10.0, f64::from(j) / 10.0)))
        {
            let p = Point3::new(x, y, 1.0);
            let d = samples.points().iter().map(|q| (p - q).norm()).fold(f64::INFINITY, f64::min);
            assert!(d <= SPACING.face, "{d} from a sample at {p}");
        }
    }
}
