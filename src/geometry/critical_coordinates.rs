//! The coordinates along an axis at which a surface changes: where it begins or ends, where a face lies across the
//! axis, and where a sharp edge turns back.
//!
//! A solid that slides past another meets something new only where a critical coordinate of the one passes one of the
//! other: between two such places what stops it stays the same, exactly for solids whose faces are along and across the
//! axis. (The critical places of an exact cell decomposition: J.-C. Latombe, "Robot Motion Planning", 1991, chapter 5.)

use nalgebra::{Point3, Vector3};

use super::Surface;
use super::mesh::directed_edges;
use super::surface::NO_TRIANGLE;

/// Cosine. A face this near to lying across the axis has one coordinate (0.6 degrees).
const ACROSS: f64 = 0.99995;
/// Cosine. An edge whose faces differ by more is sharp (20 degrees): facets of round faces differ by less.
const SHARP: f64 = 0.94;
/// Share of the surface's extent below which coordinates are equal.
const EQUAL: f64 = 1e-9;

/// What a vertex is among its neighbours along the axis.
#[derive(Clone, Copy)]
struct Neighbours {
    any: bool,
    /// Whether all of them are no further along the axis, and no less far.
    none_above: bool,
    none_below: bool,
}

impl Neighbours {
    const NONE: Self = Self { any: false, none_above: true, none_below: true };

    fn add(&mut self, difference: f64, equal: f64) {
        self.any = true;
        self.none_above &= difference <= equal;
        self.none_below &= difference >= -equal;
    }

    fn is_extreme(self) -> bool {
        self.any && (self.none_above || self.none_below)
    }
}

/// Whether an edge of a triangle is sharp, or at a rim.
fn is_sharp(surface: &Surface, triangle: u32, edge: u8) -> bool {
    let beside = surface.neighbour(triangle, edge);
    beside == NO_TRIANGLE || surface.face_normal(triangle).dot(&surface.face_normal(beside)) < SHARP
}

/// The vertices at both ends of each sharp edge; an edge between two triangles comes once for each.
pub fn sharp_edges(surface: &Surface) -> impl Iterator<Item = [u32; 2]> {
    let triangles = (0u32..).zip(surface.triangles());
    triangles.flat_map(move |(triangle, corners)| {
        let edges = (0u8..).zip(directed_edges(corners));
        edges.filter(move |(edge, _)| is_sharp(surface, triangle, *edge)).map(|(_, ends)| ends)
    })
}

/// The critical coordinates of a surface along a unit vector in the surface's frame; not sorted, and often equal.
#[must_use]
pub fn critical_coordinates(surface: &Surface, axis: &Vector3<f64>) -> Vec<f64> {
    let along: Vec<f64> = surface.vertices().iter().map(|p: &Point3<f64>| axis.dot(&p.coords)).collect();
    let equal = EQUAL * surface.bounds().extents().max();
    let mut found = Vec::new();
    let mut on_surface = vec![Neighbours::NONE; along.len()];
    let mut on_edges = vec![Neighbours::NONE; along.len()];
    for (triangle, corners) in (0u32..).zip(surface.triangles()) {
        let normal = surface.face_normal(triangle);
        if normal.dot(axis).abs() > ACROSS {
            found.push(corners.iter().map(|&v| along[v as usize]).sum::<f64>() / 3.0);
        }
        for (edge, [a, b]) in (0u8..).zip(directed_edges(corners)) {
            let is_sharp = is_sharp(surface, triangle, edge);
            for [from, to] in [[a, b], [b, a]].map(|ends| ends.map(|v| v as usize)) {
                let difference = along[to] - along[from];
                on_surface[from].add(difference, equal);
                if is_sharp {
                    on_edges[from].add(difference, equal);
                }
            }
        }
    }
    let is_critical = |v: &usize| on_surface[*v].is_extreme() || on_edges[*v].is_extreme();
    found.extend((0..along.len()).filter(is_critical).map(|v| along[v]));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cells, surface, tube};

    /// The critical coordinates, sorted, each once.
    fn coordinates(surface: &Surface, axis: Vector3<f64>) -> Vec<f64> {
        let mut found = critical_coordinates(surface, &axis);
        found.sort_by(f64::total_cmp);
        found.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        found
    }

    #[test]
    fn faces_across_the_axis_and_rims_of_holes_are_critical() {
        let stairs = surface(cells([&[0.0, 1.0, 3.0, 4.0], &[0.0, 1.0, 2.0], &[0.0, 1.0]], |c| {
            c[1] == 0 || c[0] == 1
        }));
        assert_eq!(coordinates(&stairs, Vector3::x()), [0.0, 1.0, 3.0, 4.0]);
        assert_eq!(coordinates(&stairs, Vector3::y()), [0.0, 1.0, 2.0]);
        // A tube along z: across it, the rims of its hole and of its outside begin and end.
        let tube = surface(tube(1.0, 2.0, [-1.0, 1.0], 24));
        assert_eq!(coordinates(&tube, Vector3::z()), [-1.0, 1.0]);
        let across = coordinates(&tube, Vector3::x());
        assert_eq!(across.len(), 4, "{across:?}");
        assert!(across.iter().zip([-2.0, -1.0, 1.0, 2.0]).all(|(a, b)| (a - b).abs() < 0.1), "{across:?}");
        // A ball has no edges.
        assert_eq!(coordinates(&surface(ball(3)), Vector3::x()).len(), 2);
    }
}
