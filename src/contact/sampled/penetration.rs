//! Whether a sample of one body is inside another: by the distance fields alone, or exactly.
//!
//! The fields are wrong by up to their error bound: what they alone show to be deeper, or clear, is so; between the two
//! they say nothing. What samples miss goes unseen, so paths are verified by other means.

use nalgebra::Point3;

use crate::budgets::{PASSAGE_POSES, SHORT_STEPS_PER_POLL};
use crate::geometry::{Pose, SampleTree, interpolate};
use crate::scene::{Body, PosedPart, Scene};
use crate::sdf::Grid;
use crate::termination::{Interrupt, Poll, Termination, try_all};

use super::MovingBody;

impl MovingBody<'_> {
    /// Whether the fields alone show that a sample of either surface is deeper than allowed. Measures nothing exactly,
    /// so it is quick.
    pub(crate) fn clearly_enters(&self, standing: &[usize]) -> Result<bool, Interrupt> {
        self.any_pair(standing, 0.0, |[sampled, measured], to_measured, allowed, poll| {
            let limit = -allowed - measured.field.error_bound();
            is_any_below(sampled, &measured.field, to_measured, limit, poll)
        })
    }

    /// Whether the fields alone show that no sample of either surface is within some distance of the other.
    fn seems_clear(&self, standing: &[usize], by: f64) -> Result<bool, Interrupt> {
        let is_near = self.any_pair(standing, by, |[sampled, measured], to_measured, _, poll| {
            let limit = by + measured.field.error_bound();
            is_any_below(sampled, &measured.field, to_measured, limit, poll)
        })?;
        Ok(!is_near)
    }

    /// Whether a sample of either surface is deeper by `depth` than allowed: exact, and quick where many are.
    pub(crate) fn enters_by(&self, depth: f64, standing: &[usize]) -> Result<bool, Interrupt> {
        self.any_pair(standing, 0.0, |[sampled, measured], to_measured, allowed, poll| {
            is_deeper(sampled.shape.samples(), measured, to_measured, allowed + depth, poll)
        })
    }

    /// Whether a test of one body's samples against the other body holds for any pair that may come as close as
    /// `margin`. The test gets the sampled and the measured body, the pose from the one's frame to the other's, and the
    /// pair's allowed penetration.
    fn any_pair(
        &self,
        standing: &[usize],
        margin: f64,
        test: impl Fn([&Body; 2], &Pose, f64, &Poll<'_>) -> Result<bool, Interrupt>,
    ) -> Result<bool, Interrupt> {
        let poll = Poll::every(SHORT_STEPS_PER_POLL, self.termination);
        let bounds = self.body.shape.bounds().transformed(&self.pose).grown(margin);
        for other in self.scene.broad_phase.meeting_of(standing, &bounds) {
            let still = &self.scene.bodies[other];
            self.prepare_fields(still)?;
            let allowed = self.scene.allowed.of(self.part, other);
            let to_still = still.planning_from_shape.inverse() * self.pose;
            for (bodies, to_measured) in
                [([self.body, still], to_still), ([still, self.body], to_still.inverse())]
            {
                let [sampled, measured] = bodies.map(|body| &body.shape.surface);
                if measured.has_inside_for(sampled) && test(bodies, &to_measured, allowed, &poll)? {
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

/// Whether the field of one body is below a limit at a sample of another.
fn is_any_below(
    sampled: &Body,
    field: &Grid,
    to_measured: &Pose,
    limit: f64,
    poll: &Poll<'_>,
) -> Result<bool, Interrupt> {
    sampled.shape.samples().any(
        |node| {
            poll.check()?;
            Ok(field.value(&(to_measured * node.centre)) - node.radius < limit)
        },
        |sample| field.value(&(to_measured * sample)) < limit,
    )
}

/// Whether some sample is deeper than `limit` in a body, exactly; the body's field shows which samples need not be
/// measured.
///
/// # Errors
/// The condition of the poll became true.
pub(crate) fn is_deeper(
    samples: &SampleTree,
    measured: &Body,
    to_measured: &Pose,
    limit: f64,
    poll: &Poll<'_>,
) -> Result<bool, Interrupt> {
    let field: &Grid = &measured.field;
    samples.any(
        |node| {
            poll.check()?;
            let p = to_measured * node.centre;
            // A ball that is no larger than the limit is left out by its depth: outside the depth is 0.
            let is_left_out = if node.radius > limit {
                field.estimate(&p).lower_bound > node.radius
            } else {
                field.deepest(&p) + node.radius <= limit
            };
            Ok(!is_left_out)
        },
        |sample| is_point_deeper(measured, &(to_measured * sample), limit),
    )
}

fn is_point_deeper(measured: &Body, p: &Point3<f64>, limit: f64) -> bool {
    if measured.field.deepest(p) <= limit {
        return false;
    }
    let surface = &measured.shape.surface;
    // No point is deeper than it is far from any one triangle.
    let near = |t| surface.closest_on(t, p).distance <= limit;
    if measured.field.likely_nearest(p).is_some_and(near) {
        return false;
    }
    measured.closest(p, 0.0).is_some_and(|(_, distance)| -distance > limit)
}

/// Whether a part, moved straight from one pose to another (its centre of mass on a line, its rotation slerped), is seen
/// to enter none of the parts that stand: for trying ways, not for plans. It is looked at every half of its smallest
/// side, so it steps over no wall. Entering by less than the error of the distance fields goes unseen.
///
/// # Errors
/// The termination condition became true.
pub fn passes_straight(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    [from, to]: [&Pose; 2],
    termination: &Termination,
) -> Result<bool, Interrupt> {
    let shape = &scene.bodies[part].shape;
    let centre = shape.mass.centre;
    let travel = (to * centre - from * centre).norm() + from.rotation.angle_to(&to.rotation) * shape.reach;
    let step = shape.bounds().extents().min() / 2.0;
    let count =
        if step > 0.0 { (travel / step).ceil().min(PASSAGE_POSES as f64) as usize } else { PASSAGE_POSES };
    try_all(1..count, |i| {
        let pose = interpolate(from, to, &centre, i as f64 / count as f64);
        Ok(!MovingBody::new(scene, part, pose).until(termination).clearly_enters(standing)?)
    })
}

/// Whether a part at a pose is seen to keep clear of all parts that stand by a distance: by more than the distance
/// fields can be wrong by. What is finer than samples goes unseen.
///
/// # Errors
/// The termination condition became true.
pub fn seems_clear(
    scene: &Scene,
    standing: &[usize],
    PosedPart { part, pose }: PosedPart<'_>,
    by: f64,
    termination: &Termination,
) -> Result<bool, Interrupt> {
    MovingBody::new(scene, part, *pose).until(termination).seems_clear(standing, by)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, Vector3};

    use super::*;
    use crate::fixtures::{peg_in_hole, scene};

    #[test]
    fn a_peg_passes_through_its_hole_but_not_through_the_wall() {
        let (scene, _) = scene(peg_in_hole(-0.05));
        let at = |x: f64, z: f64| {
            Translation3::from(Vector3::new(x, 0.0, z)) * scene.bodies[1].planning_from_shape
        };
        let passes = |from: Pose, to: Pose| {
            passes_straight(&scene, &[0], 1, [&from, &to], &Termination::default()).unwrap()
        };
        assert!(passes(at(0.0, 0.0), at(0.0, 4.0)) && passes(at(0.0, 4.0), at(0.0, 0.0)));
        assert!(passes(at(0.0, 4.0), at(6.0, 4.0)) && passes(at(6.0, 4.0), at(6.0, 0.0)));
        assert!(!passes(at(0.0, 0.0), at(6.0, 0.0)), "both ends are free, the way is not");
        assert!(passes(at(0.0, 0.0), at(0.0, 0.0)));
    }
}
