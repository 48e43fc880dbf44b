//! Triangles without area, and edges that meet a vertex between their ends.

use nalgebra::Point3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};

use super::{Draft, Findings, RELATIVE_TOLERANCE};
use crate::geometry::incidence::Sides;
use crate::geometry::mesh::{self, directed_edges};

/// Slivers can make new slivers of their neighbours; after so many rounds the rest stays.
const MAX_ROUNDS: usize = 16;

/// Drops triangles with a repeated vertex or without height. A sliver that belongs to the
/// surface (a vertex between the ends of a longer edge) hands that vertex to the triangle
/// across the long edge, so that the surface stays closed.
pub(super) fn drop_degenerate(draft: &mut Draft, findings: &mut Findings) {
    let before = draft.triangles.len();
    draft.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let mut dropped = before - draft.triangles.len();
    for _ in 0..MAX_ROUNDS {
        let found = remove_slivers(draft);
        dropped += found;
        if found == 0 {
            break;
        }
    }
    findings.add(dropped, "degenerate triangle", "dropped");
}

/// A triangle whose middle vertex lies on its longest edge.
struct Sliver {
    triangle: u32,
    ends: [u32; 2],
    middle: u32,
}

/// One round; neighbours of a sliver that was treated wait for the next.
fn remove_slivers(draft: &mut Draft) -> usize {
    let slivers: Vec<Sliver> =
        (0u32..).zip(&draft.triangles).filter_map(|(i, t)| as_sliver(draft, i, t)).collect();
    if slivers.is_empty() {
        return 0;
    }
    let sides = Sides::of(&draft.triangles);
    let others = |a: u32, b: u32| sides.at(a, b).len().saturating_sub(1);
    let mut removed = vec![false; draft.triangles.len()];
    let mut touched = removed.clone();
    let mut added = Vec::new();
    let mut count = 0;
    for Sliver { triangle, ends: [p, q], middle } in slivers {
        if touched[triangle as usize] {
            continue;
        }
        let belongs = others(p, q) == 1 && others(p, middle) % 2 == 1 && others(middle, q) % 2 == 1;
        let across = sides.at(p, q).iter().find(|s| s.triangle() != triangle);
        if let (true, Some(across)) = (belongs, across) {
            let n = across.triangle() as usize;
            if touched[n] {
                continue;
            }
            (touched[n], removed[n]) = (true, true);
            added.extend(split(&draft.triangles[n], [p, q], middle));
        }
        (touched[triangle as usize], removed[triangle as usize]) = (true, true);
        count += 1;
    }
    let mut index = 0;
    draft.triangles.retain(|_| {
        index += 1;
        !removed[index - 1]
    });
    draft.triangles.extend(added);
    count
}

fn as_sliver(draft: &Draft, triangle: u32, t: &[u32; 3]) -> Option<Sliver> {
    let edges = directed_edges(t);
    let lengths = edges.map(|[a, b]| (draft.vertices[a as usize] - draft.vertices[b as usize]).norm());
    let longest = (0..3).max_by(|&a, &b| lengths[a].total_cmp(&lengths[b]))?;
    let (ends, middle) = (edges[longest], t[(longest + 2) % 3]);
    let [p, q] = ends.map(|v| draft.vertices[v as usize]);
    let on_it = distance_to_line(&draft.vertices[middle as usize], &p, &q) <= draft.tolerance;
    on_it.then_some(Sliver { triangle, ends, middle })
}

fn distance_to_line(point: &Point3<f64>, p: &Point3<f64>, q: &Point3<f64>) -> f64 {
    let along = q - p;
    let length = along.norm();
    if length == 0.0 { (point - p).norm() } else { along.cross(&(point - p)).norm() / length }
}

/// The two halves of a triangle cut from `middle`, a point of its edge `ends`, to the far
/// corner; none where that corner is the middle itself (two slivers back to back).
fn split(t: &[u32; 3], ends: [u32; 2], middle: u32) -> Vec<[u32; 3]> {
    let Some(&apex) = t.iter().find(|v| !ends.contains(v)) else { return Vec::new() };
    if apex == middle {
        return Vec::new();
    }
    let with = |from: u32| t.map(|v| if v == from { middle } else { v });
    vec![with(ends[0]), with(ends[1])]
}

/// Where the border of an open surface runs along one long edge on one side and several
/// short ones on the other, splits the long one at the vertices between.
pub(super) fn split_at_junctions(
    draft: &mut Draft,
    given: Sides,
    tolerance: f64,
    findings: &mut Findings,
) -> Sides {
    let tolerance = tolerance.max(draft.tolerance);
    let original = draft.triangles.clone();
    let (mut splits, mut split) = (0, None);
    for _ in 0..MAX_ROUNDS {
        let found = split_round(draft, split.as_ref().unwrap_or(&given), tolerance);
        splits += found;
        if found == 0 {
            break;
        }
        split = Some(Sides::of(&draft.triangles));
    }
    match split {
        Some(sides) if sides.open_edges() < given.open_edges() => {
            findings.add(splits, "edge", "split where a vertex of a neighbour lies on it");
            sides
        }
        _ => {
            draft.triangles = original;
            given
        }
    }
}

fn split_round(draft: &mut Draft, sides: &Sides, tolerance: f64) -> usize {
    let border: Vec<([u32; 2], u32)> = sides
        .iter()
        .filter_map(|(edge, sides)| Some((edge, <[_; 1]>::try_from(sides).ok()?[0].triangle())))
        .collect();
    let vertices = BorderVertices::new(draft, &border, tolerance);
    let mut touched = vec![false; draft.triangles.len()];
    let mut count = 0;
    for (ends, triangle) in border {
        let triangle = triangle as usize;
        if touched[triangle] {
            continue;
        }
        let Some(middle) = vertices.between(draft, ends) else { continue };
        if let [a, b] = split(&draft.triangles[triangle], ends, middle)[..] {
            touched[triangle] = true;
            draft.triangles[triangle] = a;
            draft.triangles.push(b);
            count += 1;
        }
    }
    count
}

/// The vertices along the border of a surface, in a tree.
struct BorderVertices {
    vertices: Vec<u32>,
    /// By place in `vertices`: of one or two leaves parry panics on other numbers than 0 and 1.
    tree: Bvh,
    tolerance: f64,
    scale: f64,
}

impl BorderVertices {
    fn new(draft: &Draft, border: &[([u32; 2], u32)], tolerance: f64) -> Self {
        let mut vertices: Vec<u32> = border.iter().flat_map(|(edge, _)| *edge).collect();
        vertices.sort_unstable();
        vertices.dedup();
        // The tree multiplies lengths: in units of the part's size they stay in range.
        let scale = RELATIVE_TOLERANCE / draft.tolerance;
        let leaf = |&v: &u32| around(&[draft.vertices[v as usize]], scale, tolerance);
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, vertices.iter().map(leaf).enumerate());
        Self { vertices, tree, tolerance, scale }
    }

    /// The first border vertex strictly between the ends of an edge, and on it.
    fn between(&self, draft: &Draft, ends: [u32; 2]) -> Option<u32> {
        let [p, q] = ends.map(|v| draft.vertices[v as usize]);
        let length = (q - p).norm();
        let on_it = |v: &u32| {
            let m = draft.vertices[*v as usize];
            let along = (m - p).dot(&(q - p)) / length;
            along > self.tolerance
                && along < length - self.tolerance
                && distance_to_line(&m, &p, &q) <= self.tolerance
        };
        let region = around(&[p, q], self.scale, self.tolerance);
        let near = self.tree.intersect_aabb(&region).map(|place| self.vertices[place as usize]);
        near.filter(|v| !ends.contains(v)).filter(on_it).min()
    }
}

/// The box of points, scaled, with a margin.
fn around(points: &[Point3<f64>], scale: f64, margin: f64) -> Aabb {
    let (lo, hi) = mesh::bounds(points);
    let corner = |p: Point3<f64>, d: f64| {
        let p = p.map(|c| (c + d) * scale);
        Vector::new(p.x, p.y, p.z)
    };
    Aabb::new(corner(lo, -margin), corner(hi, margin))
}
