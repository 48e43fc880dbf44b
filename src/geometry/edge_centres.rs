//! The centres of circles that sharp edges lie on: where round holes and pins have their axes.

use std::collections::HashMap;

use nalgebra::Point3;

use super::Surface;
use super::critical_coordinates::sharp_edges;

/// Share of a radius by which the circles through successive triples of corners may differ. Rounded coordinates move
/// the circle of a short arc by some 1e-6. At half no effect; at double, more corners of helices and spirals
/// get centres, which are no axes.
const SAME_CIRCLE: f64 = 1e-3;
/// Sine. Corners on a straighter line lie on no circle: an arc of 500 corners to a turn.
const STRAIGHT: f64 = 0.006;

/// The centre of each circle on which at least five successive corners of a sharp edge lie, once for all but the two
/// outer ones on each side: often equal.
#[must_use]
pub fn edge_centres(surface: &Surface) -> Vec<Point3<f64>> {
    // Of each vertex: the vertices that sharp edges lead to.
    let mut sharp: HashMap<u32, Vec<u32>> = HashMap::new();
    for [a, b] in sharp_edges(surface) {
        for (from, to) in [(a, b), (b, a)] {
            let others = sharp.entry(from).or_default();
            if !others.contains(&to) {
                others.push(to);
            }
        }
    }
    let point = |v: u32| &surface.vertices()[v as usize];
    let circle = |v: u32| match sharp.get(&v).map(Vec::as_slice) {
        Some(&[a, b]) => centre(point(a), point(v), point(b)),
        _ => None,
    };
    let mut vertices: Vec<u32> = sharp.keys().copied().collect();
    vertices.sort_unstable();
    let shared = |v: u32| {
        let own = circle(v)?;
        let radius = (point(v) - own).norm();
        let is_same = |&other: &u32| circle(other).is_some_and(|c| (c - own).norm() < SAME_CIRCLE * radius);
        sharp.get(&v)?.iter().all(is_same).then_some(own)
    };
    vertices.into_iter().filter_map(shared).collect()
}

/// The centre of the circle through three points.
fn centre(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Option<Point3<f64>> {
    let [u, v] = [b - a, c - a];
    let normal = u.cross(&v);
    let (uu, vv, nn) = (u.norm_squared(), v.norm_squared(), normal.norm_squared());
    let is_straight = nn <= STRAIGHT * STRAIGHT * uu * vv;
    (!is_straight).then(|| a + (normal.cross(&u) * vv + v.cross(&normal) * uu) / (2.0 * nn))
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{ball, cuboid, moved, surface, tube};
    use crate::geometry::Pose;

    #[test]
    fn rims_of_a_tube_have_their_centres_on_its_axis() {
        let pose = Pose::new(Vector3::new(0.5, -1.0, 2.0), Vector3::new(0.3, 0.2, -0.4));
        let found = edge_centres(&surface(moved(tube(1.0, 2.0, [-1.0, 1.0], 24), &pose)));
        assert_eq!(found.len(), 4 * 24, "two rims at each end");
        for p in found.iter().map(|p| pose.inverse() * p) {
            assert!(p.xy().coords.norm() < 1e-9 && (p.z.abs() - 1.0).abs() < 1e-9, "{p}");
        }
    }

    #[test]
    fn blocks_and_balls_have_none() {
        assert!(edge_centres(&surface(cuboid([-1.0; 3], [1.0; 3]))).is_empty());
        assert!(edge_centres(&surface(ball(3))).is_empty());
    }
}
