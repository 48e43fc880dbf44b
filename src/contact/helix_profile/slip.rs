//! Threads of surfaces, found by how they slip.
//!
//! A surface slips along a screw motion that keeps every point's velocity in its tangent plane (N. Gelfand and L.
//! Guibas 2004, Shape segmentation using local slippage analysis): the flanks of a thread do so along their own
//! helix. Of the screws near a given one, the screw along which the flanks slip best is a linear least-squares
//! problem. Facets of something else (chamfers, run-outs) get smaller weights the worse they slip (A. Beaton and J.
//! Tukey 1974, iterative reweighting, here with Cauchy's weights).

use nalgebra::{Point3, SMatrix, SVector, Vector3};

use crate::budgets::{FEWEST_FLANK_FACETS, FLANK_ROUNDS};
use crate::geometry::Helix;
use crate::tolerances::{FLANK_LEAN, FLANK_SLIP};

/// A facet of a surface.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlankFacet {
    pub(super) middle: Point3<f64>,
    pub(super) corners: [Point3<f64>; 3],
    pub(super) normal: Vector3<f64>,
    pub(super) area: f64,
}

impl FlankFacet {
    pub(super) fn of(corners: &[Point3<f64>; 3]) -> Option<Self> {
        let double = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        // Right triangles on a curved surface have the normal of the surface.
        let side = |i: usize| (corners[(i + 1) % 3] - corners[i]).norm_squared();
        let longest = (1..3).fold(0, |best, i| if side(i) > side(best) { i } else { best });
        let middle = nalgebra::center(&corners[longest], &corners[(longest + 1) % 3]);
        Some(Self {
            middle,
            corners: *corners,
            normal: double.try_normalize(0.0)?,
            area: double.norm() / 2.0,
        })
    }

    /// Whether it leans along the axis as the flanks of threads do.
    pub(super) fn is_flank(&self) -> bool {
        (FLANK_LEAN[0]..FLANK_LEAN[1]).contains(&self.normal.z.abs())
    }
}

/// The helix of some rise along which the flanks among some facets slip best, near the z axis of the frame of the
/// facets. `None` if there are too few, or they determine no axis. (Facets on a grid lean all the same way against
/// their flank and would give a false rise; around the axis this evens out.)
pub(super) fn slipping(facets: &[FlankFacet], rise: f64) -> Option<Helix> {
    // The speed along the normal is linear in the twist: ω = (a, b, 1), v = (c, d, rise).
    let row = |f: &FlankFacet| {
        let lever = f.middle.coords.cross(&f.normal);
        SVector::<f64, 4>::new(lever.x, lever.y, f.normal.x, f.normal.y)
    };
    let turning = |f: &FlankFacet| f.middle.coords.cross(&f.normal).z + rise * f.normal.z;
    let mut twist = SVector::<f64, 4>::zeros();
    let share = |f: &FlankFacet, twist: &SVector<f64, 4>| {
        (row(f).dot(twist) + turning(f)) / f.middle.xy().coords.norm().max(1e-12)
    };
    let flanks: Vec<&FlankFacet> =
        facets.iter().filter(|f| f.is_flank() && share(f, &twist).abs() < FLANK_SLIP).collect();
    if flanks.len() < FEWEST_FLANK_FACETS {
        return None;
    }
    for _ in 0..FLANK_ROUNDS {
        let shares: Vec<f64> = flanks.iter().map(|f| share(f, &twist).abs()).collect();
        let mut sorted = shares.clone();
        sorted.sort_by(f64::total_cmp);
        let scale = sorted[sorted.len() / 2].max(1e-9);
        let mut normal = SMatrix::<f64, 4, 4>::zeros();
        let mut right = SVector::<f64, 4>::zeros();
        for (f, own) in flanks.iter().zip(&shares) {
            let weight = f.area / (1.0 + (own / scale).powi(2)) / f.middle.xy().coords.norm_squared();
            normal += row(f) * row(f).transpose() * weight;
            right -= row(f) * (turning(f) * weight);
        }
        twist = normal.cholesky()?.solve(&right);
    }
    let (omega, v) = (Vector3::new(twist[0], twist[1], 1.0), Vector3::new(twist[2], twist[3], rise));
    let squared = omega.norm_squared();
    let through = Point3::from(omega.cross(&v) / squared);
    Some(Helix::about(&omega.normalize(), &through, omega.dot(&v) / squared))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, surface, thread};
    use crate::geometry::{Pose, Surface};

    fn facets(surface: &Surface, place: &Pose) -> Vec<FlankFacet> {
        let corners = |t: u32| surface.corners(t).map(|p| place * p);
        (0..surface.triangles().len() as u32).filter_map(|t| FlankFacet::of(&corners(t))).collect()
    }

    #[test]
    fn the_axis_of_a_displaced_thread_is_found() {
        let (pitch, [bolt, nut]) = (0.5, thread(3.0, 0.5));
        let place = Pose::new(Vector3::new(0.03, -0.02, 0.01), Vector3::new(0.004, -0.006, 0.4));
        for mesh in [bolt, nut] {
            let found = slipping(&facets(&surface(mesh), &place), pitch / std::f64::consts::TAU).unwrap();
            let axis_from_thread = found.axis_from_frame * place;
            for z in [0.0, 6.0] {
                let at = axis_from_thread * Point3::new(0.0, 0.0, z);
                // A fifth of the play between the two.
                assert!(at.xy().coords.norm() < 6e-3, "{at}");
            }
        }
    }

    #[test]
    fn what_has_no_flanks_tells_no_axis() {
        let small = facets(&surface(ball(0)), &Pose::identity());
        assert_eq!(slipping(&small, 0.1), None);
    }
}
