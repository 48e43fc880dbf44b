//! The convex edges of a surface, and where they end: one solid that is moved against another first touches it
//! with one of these, or one of the other's.

use nalgebra::{Point3, Vector3};

use super::leading::{Groups, LeadingItem};
use super::oriented::faces_at;
use super::samples::{Site, convex_edges};
use super::surface::NO_TRIANGLE;
use super::{Bounds, OrientedSamples, Pose, Surface};

/// The convex edges of a surface. Of a wall, all edges and rims, once for each side.
#[derive(Debug, Clone, Default)]
pub struct ConvexEdges {
    /// Corners, where one direction leads below all faces that meet there. Where none does, solids meet in a point or
    /// an edge: each edge has an end of its own, with its own faces alone.
    ends: OrientedSamples,
    edges: Vec<ConvexEdge>,
    groups: Groups,
}

/// An edge between two faces, or at the rim of one.
#[derive(Debug, Clone, Copy)]
pub struct ConvexEdge {
    ends: [u32; 2],
    /// The unit normals of the faces; one twice at a rim.
    pub normals: [Vector3<f64>; 2],
}

/// A point, and the unit normals of the faces that meet there.
pub type Corner<'a> = (&'a Point3<f64>, &'a [Vector3<f64>]);

impl ConvexEdges {
    /// Bytes in memory.
    pub(super) fn memory(&self) -> usize {
        self.ends.memory() + size_of_val(&*self.edges) + self.groups.memory()
    }

    pub(super) fn new(surface: &Surface) -> Self {
        let mut numbers = vec![u32::MAX; surface.vertices().len()];
        let mut sited = Vec::new();
        let mut edges = Vec::new();
        for (t, e) in convex_edges(surface) {
            let corners = surface.triangles()[t as usize];
            let ends = [e, (e + 1) % 3].map(|k| {
                let v = corners[k as usize];
                let number = &mut numbers[v as usize];
                if *number == u32::MAX {
                    *number = sited.len() as u32;
                    let is_corner = surface.is_wall() || has_inside(surface, v);
                    let site = if is_corner { Site::Vertex(v) } else { Site::Edge(t, e) };
                    sited.push((surface.vertices()[v as usize], site));
                    if !is_corner {
                        // Each edge has an end of its own there.
                        return std::mem::replace(number, u32::MAX);
                    }
                }
                *number
            });
            let other = surface.neighbour(t, e);
            let normals = [t, if other == NO_TRIANGLE { t } else { other }].map(|t| surface.face_normal(t));
            edges.push(ConvexEdge { ends, normals });
            if surface.is_wall() {
                edges.push(ConvexEdge { ends, normals: normals.map(|n| -n) });
            }
        }
        edges.shrink_to_fit();
        let ends = OrientedSamples::new(surface, &sited);
        let item = |edge: &ConvexEdge| LeadingItem::new(edge.ends.map(|i| ends.at(i).0), &edge.normals);
        let groups = Groups::new(&edges.iter().map(item).collect::<Vec<_>>());
        Self { ends, edges, groups }
    }

    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.edges.len()
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &ConvexEdge> {
        self.edges.iter()
    }

    /// Where they end.
    #[must_use]
    pub fn ends(&self) -> &OrientedSamples {
        &self.ends
    }

    /// The ends of an edge.
    #[must_use]
    pub fn ends_of(&self, edge: &ConvexEdge) -> [Corner<'_>; 2] {
        edge.ends.map(|i| self.ends.at(i))
    }

    /// Those of which any may reach into a box with a pose and have a face with more than `steepness` along a
    /// direction, in no order that matters.
    pub fn leading<'s>(
        &'s self,
        box_from_self: &'s Pose,
        within: &'s Bounds,
        direction: &'s Vector3<f64>,
        steepness: f64,
    ) -> impl Iterator<Item = &'s ConvexEdge> {
        self.groups.leading(box_from_self, within, direction, steepness).map(|i| &self.edges[i as usize])
    }
}

/// Whether a direction leads below all faces that meet at a vertex (perceptron).
fn has_inside(surface: &Surface, vertex: u32) -> bool {
    /// Cosine. Faces that leave less room make no corner. A knife of a tenth of a degree leaves as much.
    const LEAST_ROOM: f64 = 1e-3;
    /// Some thousand are needed for the sharpest corners, and a few for most.
    const STEPS: usize = 2000;
    let mut normals = Vec::new();
    faces_at(surface, Site::Vertex(vertex), |t| normals.push(surface.face_normal(t)));
    let mut inward = -normals.iter().sum::<Vector3<f64>>();
    for _ in 0..STEPS {
        let length = inward.norm();
        match normals.iter().find(|n| n.dot(&inward) > -LEAST_ROOM * length) {
            Some(normal) => inward -= normal,
            None => return true,
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use crate::fixtures::{cells, cuboid, healed, l_shape, shape_of};

    #[test]
    fn where_solids_meet_in_a_point_each_edge_has_an_end_of_its_own() {
        // Two cells on a plate that meet in an edge: their corners on the plate and above are of two solids.
        let lines: &[f64] = &[0.0, 1.0, 2.0];
        let mesh = cells([lines, lines, &[0.0, 1.0, 2.0]], |[x, y, z]| z == 0 || x == y);
        let shape = shape_of(&healed(mesh));
        let found = shape.convex_edges();
        let inside_out = |normals: &[nalgebra::Vector3<f64>]| {
            normals.iter().any(|a| normals.iter().any(|b| a.dot(b) < -0.5))
        };
        let ends = || found.edges.iter().flat_map(|edge| found.ends_of(edge));
        assert!(ends().count() > 40 && !ends().any(|(_, normals)| inside_out(normals)));
    }

    #[test]
    fn edges_of_solids_are_convex_where_they_are_not_flat_or_reentrant() {
        // Diagonals are flat. The L is made of unit cells: an edge of length 2 is two edges.
        for (mesh, count, length) in [(cuboid([-1.0; 3], [1.0, 2.0, 3.0]), 12, 36.0), (l_shape(), 21, 21.0)] {
            let shape = shape_of(&healed(mesh));
            let found = shape.convex_edges();
            let mut all = 0.0;
            for edge in &found.edges {
                let [(a, at_a), (b, at_b)] = found.ends_of(edge);
                assert!(edge.normals.iter().all(|n| n.dot(&(b - a)).abs() < 1e-12));
                assert!(edge.normals.iter().all(|n| at_a.contains(n) && at_b.contains(n)));
                all += (b - a).norm();
            }
            assert_eq!(found.count(), count);
            assert!((all - length).abs() < 1e-9, "{all}");
        }
    }
}
