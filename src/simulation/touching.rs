//! The planes that a part lies against.
//!
//! Contact between faces is searched from inside faces: at a corner in a corner, the nearest point leaves a choice of
//! planes; at the middle of a face it does not. Both surfaces are cut into bits as fine as the common part of their
//! boxes is small. Planes that hold the part by less than one bit, or only by an edge or a corner, are missed.

use nalgebra::{Point3, Unit, Vector3};

use crate::budgets::{LONG_STEPS_PER_POLL, TOUCHED_PLANES};
use crate::geometry::{Bounds, Pose, Surface, bisected};
use crate::scene::{Body, Scene};
use crate::termination::{Interrupt, Poll, Termination};
use crate::tolerances::{ONE_DIRECTION_COSINE, OPPOSED_COSINE, TOUCHING_BIT};

/// What a part touches.
#[derive(Debug, Clone, Default)]
pub struct Touching {
    /// The normals of the planes, in the planning frame, towards the part; `None` if there are too many.
    pub normals: Option<Vec<Unit<Vector3<f64>>>>,
    /// The parts near it, ascending.
    pub parts: Vec<usize>,
}

impl Touching {
    /// The parts that may be touched within `reach`; no others matter.
    #[must_use]
    pub fn near(scene: &Scene, part: usize, pose: &Pose, standing: &[usize], reach: f64) -> Vec<usize> {
        let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(reach);
        scene.broad_phase.meeting_of(standing, &bounds)
    }

    /// The planes of faces within `reach` (a gap in the planning frame) of a part at a pose; `standing`
    /// is ascending.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn of(
        scene: &Scene,
        part: usize,
        pose: &Pose,
        standing: &[usize],
        reach: f64,
        termination: &Termination,
    ) -> Result<Self, Interrupt> {
        let poll = Poll::every(LONG_STEPS_PER_POLL, Some(termination));
        let body = &scene.bodies[part];
        let bounds = body.shape.bounds().transformed(pose).grown(reach);
        let parts = Self::near(scene, part, pose, standing, reach);
        let mut normals = Vec::new();
        for &other in &parts {
            let still = &scene.bodies[other];
            body.field.prepare_here(termination)?;
            still.field.prepare_here(termination)?;
            let within = common(&bounds, &still.bounds.grown(reach));
            let deepest = reach + scene.allowed.of(part, other);
            for (asked, at, measured, stands, sense) in [
                (body, pose, still, &still.planning_from_shape, 1.0),
                (still, &still.planning_from_shape, body, pose, -1.0),
            ] {
                let bits = Vec::new();
                let mut faces =
                    TouchingFaces { asked, at, measured, stands, within, reach, deepest, bits, poll: &poll };
                if !faces.planes(sense, &mut normals)? {
                    return Ok(Self { normals: None, parts });
                }
            }
        }
        Ok(Self { normals: Some(normals), parts })
    }
}

/// The common part of two boxes that meet.
fn common(a: &Bounds, b: &Bounds) -> Bounds {
    Bounds { min: a.min.sup(&b.min), max: a.max.inf(&b.max) }
}

/// A body whose faces are cut into bits, and a body that is measured from there.
struct TouchingFaces<'a> {
    asked: &'a Body,
    at: &'a Pose,
    measured: &'a Body,
    stands: &'a Pose,
    /// The pose of the bits in the planning frame.
    within: Bounds,
    reach: f64,
    deepest: f64,
    /// Bits that are left, by their corners in the planning frame.
    bits: Vec<[Point3<f64>; 3]>,
    poll: &'a Poll<'a>,
}

impl TouchingFaces<'_> {
    /// Adds the planes of the measured body, or of the cut one if `sense` is negative; faces in contact look against
    /// each other. False if there are too many.
    fn planes(&mut self, sense: f64, normals: &mut Vec<Unit<Vector3<f64>>>) -> Result<bool, Interrupt> {
        let surface: &Surface = &self.asked.shape.surface;
        let finest = self.within.extents().max() * TOUCHING_BIT;
        for t in 0..surface.triangles().len() as u32 {
            let looks = self.at.rotation * surface.face_normal(t);
            self.bits.push(surface.corners(t).map(|p| self.at * p));
            while let Some(bit) = self.bits.pop() {
                self.poll.check()?;
                if !Bounds::of(&bit).meets(&self.within) {
                    continue;
                }
                let (longest, halves) = bisected(&bit);
                if longest > finest {
                    self.bits.extend(halves);
                    continue;
                }
                // A wall that leans over the part's top ends near it, and does not hold it there.
                let is_faced = |n: &Vector3<f64>| n.dot(&looks) < -OPPOSED_COSINE;
                let Some(normal) = self.plane_at(&middle(&bit)).filter(is_faced) else { continue };
                let normal = Unit::new_normalize(normal * sense);
                if !normals.iter().any(|n| n.dot(&normal) > ONE_DIRECTION_COSINE) {
                    normals.push(normal);
                    if normals.len() > TOUCHED_PLANES {
                        return Ok(false);
                    }
                }
            }
        }
        Ok(true)
    }

    /// The normal of the measured body's face at a point near it, if one face alone is nearest.
    fn plane_at(&self, p: &Point3<f64>) -> Option<Vector3<f64>> {
        let (closest, distance) =
            self.measured.closest(&self.stands.inverse_transform_point(p), self.reach)?;
        if !(-self.deepest..self.reach).contains(&distance) {
            return None;
        }
        let (mut found, mut alone) = (None, true);
        self.measured.shape.surface.feature_normals(&closest, |n| match found {
            None => found = Some(n),
            Some(m) => alone &= n.dot(&m) > ONE_DIRECTION_COSINE,
        });
        found.filter(|_| alone).map(|n| self.stands.rotation * n)
    }
}

fn middle([a, b, c]: &[Point3<f64>; 3]) -> Point3<f64> {
    Point3::from((a.coords + b.coords + c.coords) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, peg_in_hole, scene, thread};
    use crate::geometry::SourceMesh;

    fn normals(meshes: [SourceMesh; 2], reach: f64) -> Option<Vec<Unit<Vector3<f64>>>> {
        let (scene, _) = scene(meshes);
        let found = Touching::of(
            &scene,
            1,
            &scene.bodies[1].planning_from_shape,
            &[0],
            reach,
            &Termination::default(),
        )
        .unwrap();
        assert_eq!(found.parts, [0]);
        found.normals
    }

    #[test]
    fn a_block_on_a_plate_touches_one_plane() {
        let found = normals(block_on_plate(), 0.01).unwrap();
        assert!(found.len() == 1 && found[0].z > 1.0 - 1e-12, "{found:?}");
    }

    #[test]
    fn a_peg_in_its_hole_touches_five_also_with_play_or_pressed_in() {
        for excess in [-0.02, 0.0, 0.02] {
            let found = normals(peg_in_hole(excess), 0.05).unwrap();
            let sum: Vector3<f64> = found.iter().map(|n| n.into_inner()).sum();
            assert!(found.len() == 5 && (sum - Vector3::z()).norm() < 1e-9, "{excess}: {found:?}");
        }
    }

    #[test]
    fn walls_that_are_apart_are_not_touched() {
        assert_eq!(normals(peg_in_hole(-0.2), 0.05).unwrap(), [Vector3::z_axis()], "the bottom alone");
    }

    #[test]
    fn a_thread_touches_too_many_planes() {
        assert!(normals(thread(3.0, 0.5), 0.05).is_none());
    }
}
