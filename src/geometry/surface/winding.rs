//! How often a surface winds around a point: 1 inside a closed surface, in between where it is open.
//!
//! Strips from the edges of the rim to infinity close an open surface. A ray the other way meets none
//! of them, so it leaves the closed surface more often than it enters it by as often as that winds
//! around its beginning; the share of the strips is the sum of their solid angles. This is exact but for
//! openings far away, and takes a walk through a tree and a few operations for each edge of the rim. Around
//! the triangles of a soup, which have rims of many edges, dipoles are summed
//! ([`DipoleTree`](super::DipoleTree)).
//!
//! Source: generalised winding numbers, A. Jacobson et al. (2013); the ray and the strips are ours.

use std::f64::consts::PI;

use nalgebra::Point3;

use super::Surface;
use super::derived::Opening;
use crate::geometry::ray::Ray;

impl Surface {
    /// The generalised winding number around `p`; on the surface, one half.
    pub(super) fn winding_number(&self, p: &Point3<f64>) -> f64 {
        let Opening { rim, dipoles } = self.opening();
        if let Some(dipoles) = dipoles {
            return dipoles.winding(p);
        }
        let along = |ray: Ray| {
            let crossings = f64::from(self.tree().crossings(&ray).ok()?);
            let strips = rim.as_ref().map_or(Some(0.0), |rim| rim.strips_behind(&ray))?;
            Some(crossings - strips / (4.0 * PI))
        };
        Ray::out_of(&self.bounds, p).find_map(along).unwrap_or(0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, healed, open_box, spread, surface};
    use crate::geometry::SourceMesh;
    use crate::geometry::solid_angle::SolidAngle;

    fn summed(s: &Surface, p: &Point3<f64>) -> f64 {
        let mut sum = SolidAngle::default();
        (0..s.triangles().len() as u32).for_each(|t| sum.add_triangle(p, &s.corners(t)));
        sum.sum() / (4.0 * PI)
    }

    /// A mesh of which every `step`th triangle is missing.
    fn torn(mesh: SourceMesh, step: usize) -> Surface {
        let mut mesh = healed(mesh);
        mesh.triangles =
            mesh.triangles.into_iter().enumerate().filter(|(i, _)| i % step != 0).map(|(_, t)| t).collect();
        mesh.solidity = crate::geometry::Solidity::Winding;
        Surface::new(&mesh)
    }

    /// Points anywhere, and such that are level with corners and edges.
    fn points() -> impl Iterator<Item = Point3<f64>> {
        let level = [-1.5, -1.0, -0.5, 0.0, 0.25, 0.5, 1.0, 1.75];
        let grid = level.into_iter().flat_map(move |x| {
            level.into_iter().flat_map(move |y| level.into_iter().map(move |z| Point3::new(x, y, z)))
        });
        spread([-1.5; 3], [1.5; 3], 2000).chain(grid)
    }

    #[test]
    fn it_is_the_sum_of_the_solid_angles() {
        // Openings count as dipoles where they are far.
        let surfaces = [
            (surface(open_box([0.0; 3], [1.0; 3])), 1e-3),
            (torn(ball(3), 2), 1e-3),
            (torn(ball(2), 7), 1e-3),
            (torn(cuboid([-1.0; 3], [1.0; 3]), 5), 1e-3),
            (surface(cuboid([-1.0; 3], [1.0; 3])), 1e-9),
        ];
        for (s, off) in &surfaces {
            let mut told = 0;
            for p in points().filter(|p| s.closest(p, 1e-9).is_none()) {
                let (found, expected) = (s.winding_number(&p), summed(s, &p));
                assert!((found - expected).abs() < *off, "{found} for {expected} at {p} of {s:?}");
                told += 1;
            }
            assert!(told > 2000);
        }
    }

    #[test]
    fn on_the_surface_it_is_one_half_or_that_of_a_side() {
        let s = surface(cuboid([-1.0; 3], [1.0; 3]));
        for p in [[1.0, 1.0, 1.0], [1.0, 1.0, 0.3], [1.0, 0.2, 0.3], [-1.0, -1.0, 0.0]] {
            let w = s.winding_number(&Point3::from(p));
            assert!([0.0, 0.5, 1.0].contains(&w), "{w}");
        }
    }

    #[test]
    fn a_surface_turned_inside_out_winds_the_other_way() {
        let mut mesh = healed(cuboid([-1.0; 3], [1.0; 3]));
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(Surface::new(&mesh).winding_number(&Point3::new(0.1, 0.2, -0.3)), -1.0);
    }
}
