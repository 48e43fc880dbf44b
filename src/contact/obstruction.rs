//! How long a stretch of other parts is in the way of a straight motion, by rays from some points.
//!
//! To a search it is a hint at the direction in which a part is to be turned out: past the flanks of a thread this is
//! one tooth, past a head all of it. In the middle of such a stretch a point is mostly deep in the other part, which
//! shows at little cost that a path enters it.

use nalgebra::{Point3, Translation3, Vector3};

use crate::budgets::OBSTRUCTION_RAYS;
use crate::geometry::{Bounds, OrientedSamples, Pose, Surface};
use crate::scene::Scene;
use crate::termination::{Interrupt, Poll};
use crate::tolerances::WALL_STEEPNESS;

use super::pair_path::PairPath;

/// The longest stretch that a point of a part is inside another part, or a point of another inside of it, while the
/// part goes from `start` along the unit vector `direction` past everything. Measured at some samples: small things
/// may be missed.
///
/// # Errors
/// The termination condition became true.
pub fn obstruction(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    start: &Pose,
    direction: &Vector3<f64>,
    poll: &Poll<'_>,
) -> Result<f64, Interrupt> {
    let moving = &scene.bodies[part];
    let bounds = moving.shape.bounds().transformed(start);
    let furthest = standing.iter().map(|&s| scene.bodies[s].bounds.support(direction));
    let travel = furthest.fold(f64::NEG_INFINITY, f64::max) + bounds.support(&-direction);
    if travel <= 0.0 {
        return Ok(0.0);
    }
    let end = Translation3::from(direction * travel);
    let swept = bounds.union(&bounds.transformed(&Pose::from_parts(end, Default::default())));
    let past = |other: usize| {
        let standing = &scene.bodies[other];
        let standing_from_moving = standing.planning_from_shape.inverse() * start;
        let forward = standing.planning_from_shape.rotation.inverse() * direction;
        let backward = start.rotation.inverse() * -direction;
        let one = Rays { target: &standing.shape.surface, to_target: standing_from_moving, along: forward };
        let to_moving = standing_from_moving.inverse();
        let other = Rays { target: &moving.shape.surface, to_target: to_moving, along: backward };
        let one = one.longest(moving.shape.oriented(), travel, poll)?;
        Ok(one.max(other.longest(standing.shape.oriented(), travel, poll)?))
    };
    scene
        .broad_phase
        .meeting_of(standing, &swept)
        .into_iter()
        .map(past)
        .try_fold(0.0, |longest: f64, way| Ok(longest.max(way?)))
}

/// Whether a few vertices show that one part of a pair gets deeper into the other, on a straight leg of the path, than
/// allowed by more than `by` (planning frame). A yes is exact, and a no says nothing.
#[must_use]
pub fn is_seen_to_enter(pair_path: &PairPath<'_>, by: f64) -> bool {
    let [moving, standing] = pair_path.surfaces();
    let deepest = pair_path.allowed + by;
    let enters = |[sampled, target]: [&Surface; 2], to_target: Pose, shift: Vector3<f64>| {
        let length = shift.norm();
        let every = sampled.vertices().len().div_ceil(OBSTRUCTION_RAYS).max(1);
        let is_deep = |p: &Point3<f64>| {
            let (p, along) = (to_target * p, shift / length);
            let inside = target.inside_along(&p, &along, length, WALL_STEEPNESS);
            inside.is_some_and(|[from, to]| {
                to - from > 2.0 * deepest
                    && -target.signed_distance(&(p + along * from.midpoint(to))) > deepest
            })
        };
        target.has_inside_for(sampled) && sampled.vertices().iter().step_by(every).any(is_deep)
    };
    let legs = pair_path.path.iter().zip(pair_path.path.iter().skip(1));
    legs.filter(|(from, to)| from.rotation == to.rotation).any(|(from, to)| {
        let shift = to.translation.vector - from.translation.vector;
        let back = from.inverse();
        shift.norm() > 0.0
            && (enters([moving, standing], *from, shift)
                || enters([standing, moving], back, back.rotation * -shift))
    })
}

/// Segments from samples of one surface through another.
struct Rays<'a> {
    target: &'a Surface,
    to_target: Pose,
    /// The direction of the samples against the target, in its frame.
    along: Vector3<f64>,
}

impl Rays<'_> {
    fn longest(&self, samples: &OrientedSamples, travel: f64, poll: &Poll<'_>) -> Result<f64, Interrupt> {
        let corridor = self.corridor(travel);
        let inside = |p: Point3<f64>| {
            poll.check()?;
            if !corridor.contains(&p) {
                return Ok(0.0);
            }
            let inside = self.target.inside_along(&p, &self.along, travel, WALL_STEEPNESS);
            Ok(inside.map_or(0.0, |[from, to]| to - from))
        };
        let every = samples.iter().count().div_ceil(OBSTRUCTION_RAYS).max(1);
        samples
            .iter()
            .step_by(every)
            .map(|(p, _)| inside(self.to_target * p))
            .try_fold(0.0, |longest: f64, way| Ok(longest.max(way?)))
    }

    /// The box of the target, extended against the direction.
    fn corridor(&self, travel: f64) -> Bounds {
        let bounds = *self.target.bounds();
        let back = self.along * -travel;
        bounds.union(&Bounds { min: bounds.min + back, max: bounds.max + back })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{peg_in_hole, scene, thread};

    fn along(scene: &Scene, part: usize, direction: Vector3<f64>) -> f64 {
        let standing: Vec<_> = (0..scene.bodies.len()).filter(|&i| i != part).collect();
        let start = &scene.bodies[part].planning_from_shape;
        obstruction(scene, &standing, part, start, &direction, &Poll::every(1, None)).unwrap()
    }

    #[test]
    fn a_blind_hole_is_open_upwards_and_its_bottom_stands_in_the_way() {
        let (scene, _) = scene(peg_in_hole(-0.05));
        assert_eq!(along(&scene, 1, Vector3::z()), 0.0);
        assert_eq!(along(&scene, 0, -Vector3::z()), 0.0);
        let down = along(&scene, 1, -Vector3::z());
        assert!(down > 0.3 && (down - along(&scene, 0, Vector3::z())).abs() < 1e-9, "{down}");
        assert!(along(&scene, 1, Vector3::x()) > 1.0);
    }

    #[test]
    fn a_thread_stands_in_the_way_by_a_tooth() {
        let pitch = 0.5;
        let (scene, _) = scene(thread(3.0, pitch));
        let up = along(&scene, 1, Vector3::z());
        assert!(up > 0.1 * pitch && up < pitch, "{up}");
    }
}
