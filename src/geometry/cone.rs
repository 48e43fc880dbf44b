//! Polyhedral cones of directions, given by the planes that bound them.

use nalgebra::{Unit, Vector3};

/// Two planes whose normals have a cross product shorter than this are parallel (one degree).
const PARALLEL: f64 = 0.02;
/// How far a direction may lead into a plane, per length, and still count as along it: coordinates in
/// files are rounded, and so are the normals of small faces.
const ALONG: f64 = 2e-3;
/// cos of the angle within which two directions are one (a quarter of a degree).
const ALIKE: f64 = 0.999_99;

/// The extreme rays of the cone {d : nᵢ·d ≥ 0}: unit directions along two of the planes that lead into
/// none of the others, in the order of the pairs of planes. Of a cone that holds whole lines
/// only these lines are found, both ways. Source: the definition (every ray is cut out by two planes
/// that are not parallel), tried for all pairs, so cubic in the number of planes.
#[must_use]
pub fn extreme_rays(normals: &[Unit<Vector3<f64>>]) -> Vec<Unit<Vector3<f64>>> {
    let mut rays: Vec<Unit<Vector3<f64>>> = Vec::new();
    for (i, a) in normals.iter().enumerate() {
        for b in &normals[i + 1..] {
            let Some(along) = Unit::try_new(a.cross(b), PARALLEL) else { continue };
            for ray in [along, -along] {
                let is_in = normals.iter().all(|n| n.dot(&ray) >= -ALONG);
                if is_in && !rays.iter().any(|r| r.dot(&ray) > ALIKE) {
                    rays.push(ray);
                }
            }
        }
    }
    rays
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rays(normals: &[[f64; 3]]) -> Vec<Unit<Vector3<f64>>> {
        extreme_rays(&normals.map_unit())
    }

    trait MapUnit {
        fn map_unit(&self) -> Vec<Unit<Vector3<f64>>>;
    }

    impl MapUnit for [[f64; 3]] {
        fn map_unit(&self) -> Vec<Unit<Vector3<f64>>> {
            self.iter().map(|n| Unit::new_normalize(Vector3::from(*n))).collect()
        }
    }

    #[test]
    fn a_corner_leaves_its_three_edges() {
        let found = rays(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        assert_eq!(found, [Vector3::z_axis(), Vector3::y_axis(), Vector3::x_axis()]);
    }

    #[test]
    fn a_dovetail_leaves_its_groove_both_ways() {
        let found = rays(&[[0.0, 0.0, 1.0], [0.8, 0.0, -0.6], [-0.8, 0.0, -0.6]]);
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|r| r.y.abs() > 1.0 - 1e-12) && found[0] == -found[1]);
    }

    #[test]
    fn a_slanted_blind_hole_leaves_only_the_way_out() {
        let way = Unit::new_normalize(Vector3::new(0.4, 0.3, 1.0));
        let (u, v) = (Vector3::new(1.0, 0.0, -0.4), Vector3::new(0.0, 1.0, -0.3));
        let walls = [u, -u, v, -v].map(Into::into);
        let found = rays(&[&walls[..], &[[0.0, 0.0, 1.0]]].concat());
        assert_eq!(found.len(), 1);
        assert!(found[0].dot(&way) > 1.0 - 1e-12);
    }

    #[test]
    fn what_is_held_all_around_or_by_one_plane_has_none() {
        let tetrahedron = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]];
        assert!(rays(&tetrahedron).is_empty());
        assert!(rays(&[[0.0, 0.0, 1.0]]).is_empty() && rays(&[]).is_empty());
    }
}
