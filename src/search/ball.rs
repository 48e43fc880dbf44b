//! Balls: parts that turning does not change.

use nalgebra::{Point3, Vector3};

use crate::geometry::Shape;

/// Whether a shape is a ball but for `tolerance`: its whole surface is that far from a sphere about
/// the centre of mass at most. Turning it is then no motion, at this resolution.
pub(super) fn is_ball(shape: &Shape, tolerance: f64) -> bool {
    let (surface, centre) = (&shape.surface, shape.mass.centre);
    // The search for the closest point is slowest for a surface at about the same distance on all sides. Most
    // parts that are no balls have a vertex or the middle of a triangle that proves it sooner.
    let is_near = |p: &Point3<f64>| shape.reach - (p - centre).norm() > tolerance;
    let middle =
        |t: u32| Point3::from(surface.corners(t).iter().map(|p| p.coords).sum::<Vector3<f64>>() / 3.0);
    if surface.vertices().iter().any(is_near)
        || (0..surface.triangles().len() as u32).any(|t| is_near(&middle(t)))
    {
        return false;
    }
    let least = surface.closest(&centre, f64::INFINITY).map_or(0.0, |c| c.distance);
    // No point is farther than the farthest vertex, none nearer than the nearest of the surface.
    least > 0.0 && shape.reach - least <= tolerance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, healed, rod, shape_of};

    #[test]
    fn balls_are_round_and_dice_are_not() {
        let shape = |mesh| shape_of(&healed(mesh));
        assert!(is_ball(&shape(ball(3)), 0.05));
        assert!(!is_ball(&shape(ball(0)), 0.05), "an octahedron");
        assert!(!is_ball(&shape(cuboid([-1.0; 3], [1.0; 3])), 0.05));
        assert!(!is_ball(&shape(rod(1.0, [-1.0, 1.0], 32)), 0.05));
    }
}
