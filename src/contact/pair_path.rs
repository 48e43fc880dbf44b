//! The path of a part past one standing part: what is verified, pair by pair.
//!
//! The path is in the standing part's frame, rounded far finer than depth is measured, and it ends where the part has
//! passed. So all bolts that leave congruent nuts ask the same question to the bit, wherever the nuts are and however
//! far the rest of the assembly reaches.

use nalgebra::{Point3, Translation3};

use crate::geometry::{Pose, Shape, Surface};
use crate::scene::{AllowedPenetrations, CongruentPair, Scene, rounded, rounded_pose};

/// Directions whose components differ by less are equal: the rounding of poses.
const ALIKE: f64 = 1.0 / (1u64 << 40) as f64;

/// The path of a part past one standing part.
#[derive(Debug, Clone)]
pub struct PairPath<'a> {
    /// The indices of the moving and of the standing part.
    pub parts: [usize; 2],
    /// Their shapes.
    pub shapes: [&'a Shape; 2],
    /// Poses of the moving shape in the frame of the standing one, rounded.
    pub path: Vec<Pose>,
    /// The point of the moving shape, in its frame, that moves on a line between two poses.
    pub centre: Point3<f64>,
    /// The allowed penetration, in the planning frame.
    pub allowed: f64,
}

impl<'a> PairPath<'a> {
    /// The part of a path (poses of the moving shape in the planning frame) that passes the standing part.
    #[must_use]
    pub fn new(scene: &'a Scene, allowed: &AllowedPenetrations, parts: [usize; 2], path: &[Pose]) -> Self {
        Self::about(scene, allowed, parts, path, scene.centre_in_shape(parts[0]))
    }

    /// The pieces of a path of a body past a standing part: one for each part that the body stands for, with the pose of
    /// that part's shape in the body's frame.
    pub(crate) fn of_members(
        scene: &'a Scene,
        allowed: &'a AllowedPenetrations,
        [body, other]: [usize; 2],
        path: &'a [Pose],
    ) -> impl Iterator<Item = (Self, Pose)> {
        let assembled = scene.bodies[body].planning_from_shape;
        let centre = scene.centre_in_shape(body);
        let is_part = scene.bodies[body].members.is_empty();
        let members: Vec<usize> = scene.members(&body).to_vec();
        members.into_iter().map(move |part| {
            if is_part {
                return (Self::new(scene, allowed, [part, other], path), Pose::identity());
            }
            let body_from_part = assembled.inverse() * scene.bodies[part].planning_from_shape;
            let path: Vec<Pose> = path.iter().map(|pose| pose * body_from_part).collect();
            let centre = body_from_part.inverse_transform_point(&centre);
            (Self::about(scene, allowed, [part, other], &path, centre), body_from_part)
        })
    }

    /// The same where a point of the moving shape, in its frame, moves on a line between two poses.
    fn about(
        scene: &'a Scene,
        allowed: &AllowedPenetrations,
        parts: [usize; 2],
        path: &[Pose],
        centre: Point3<f64>,
    ) -> Self {
        let [part, other] = parts;
        let shapes = shapes(scene, parts);
        let path = way_past(shapes, &scene.bodies[other].planning_from_shape, path);
        let turns = path.iter().any(|pose| pose.rotation != path[0].rotation);
        Self {
            parts,
            shapes,
            // On a path that does not turn, any point moves on a line.
            centre: if turns { centre } else { shapes[0].bounds().centre() }.map(rounded),
            allowed: allowed.of(part, other),
            path,
        }
    }

    /// A pair that does not move, without allowed penetration.
    #[must_use]
    pub fn standing(scene: &'a Scene, pair: &CongruentPair) -> Self {
        let [one, other] = pair.poses;
        let shapes = shapes(scene, pair.parts);
        Self {
            parts: pair.parts,
            shapes,
            path: vec![other.inverse() * one],
            centre: shapes[0].bounds().centre(),
            allowed: 0.0,
        }
    }

    /// The largest distance of a point of the moving part from the centre.
    #[must_use]
    pub fn reach(&self) -> f64 {
        let hull = self.shapes[0].hull.iter();
        hull.map(|p| (p - self.centre).norm_squared()).fold(0.0, f64::max).sqrt()
    }

    /// The longest sides of the smaller and of the larger part, in their frames: verification derives its precision from
    /// them, so that what else is in the assembly changes nothing.
    #[must_use]
    pub fn sizes(&self) -> [f64; 2] {
        let [a, b] = self.shapes.map(|shape| shape.bounds().extents().max());
        [a.min(b), a.max(b)]
    }

    /// The surfaces of the moving and of the standing part.
    #[must_use]
    pub fn surfaces(&self) -> [&'a Surface; 2] {
        self.shapes.map(|shape| &*shape.surface)
    }
}

fn shapes(scene: &Scene, parts: [usize; 2]) -> [&Shape; 2] {
    parts.map(|part| &*scene.bodies[part].shape)
}

/// The path up to where the part has passed the other for good: its last piece, if straight, is as long as their
/// boxes meet.
fn way_past([moving, standing]: [&Shape; 2], planning_from_standing: &Pose, path: &[Pose]) -> Vec<Pose> {
    let into = planning_from_standing.inverse();
    let mut way: Vec<Pose> = path.iter().map(|pose| rounded_pose(&(into * pose))).collect();
    if let ([.., start, end], [.., from, to]) = (path, &mut way[..])
        && from.rotation == to.rotation
        && let shift = end.translation.vector - start.translation.vector
        && let Some(direction) = shift.try_normalize(0.0)
    {
        // The result is the same to the bit wherever the path ends.
        let direction = (into.rotation * direction).map(|x| (x / ALIKE).round() * ALIKE);
        let passed = moving.bounds().transformed(from).way_past(standing.bounds(), &direction);
        if passed == 0.0 {
            way.pop();
        } else if passed < shift.norm() {
            *to = rounded_pose(&(Translation3::from(direction * passed) * *from));
        }
    }
    way
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::fixtures::{block_on_plate, cuboid, moved, scene};
    use crate::geometry::{Bounds, interpolate};
    use crate::termination::Termination;

    fn straight(start: &Pose, shift: Vector3<f64>) -> [Pose; 2] {
        [*start, Translation3::from(shift) * *start]
    }

    #[test]
    fn the_way_past_a_part_ends_where_that_is_left_behind_and_does_not_depend_on_the_path() {
        let [plate, block] = block_on_plate();
        let wall = cuboid([2.5, -4.0, 0.0], [3.0, 4.0, 3.0]);
        let (scene, _) = scene([plate, block, wall]);
        let start = scene.bodies[1].planning_from_shape;
        let direction = Vector3::new(2.0, 0.3, 0.5).normalize();
        let way = |travel: f64, other| {
            PairPath::new(&scene, &scene.allowed, [1, other], &straight(&start, direction * travel)).path
        };
        // Past the wall and past the plate, from which it rises slowly.
        for other in [0, 2] {
            let [moving, standing] = shapes(&scene, [1, other]).map(Shape::bounds);
            let long = way(30.0, other);
            assert_eq!(long, way(47.3, other));
            let at = |back: f64| {
                let into = scene.bodies[other].planning_from_shape.inverse();
                let back = Translation3::from(into.rotation * direction * -back);
                moving.transformed(&(back * long[1]))
            };
            let meets = |b: Bounds| b.meets(standing);
            assert!(!meets(at(0.0)) && meets(at(1e-5)), "it has left {other}");
        }
        let [from, to] = <[Pose; 2]>::try_from(way(0.1, 2)).unwrap();
        let short = (to.translation.vector - from.translation.vector).norm();
        assert!((short - 0.1).abs() < 1e-8, "a path that ends before is looked at as it is");
    }

    #[test]
    fn the_parts_of_a_body_go_with_it() {
        let place = Pose::new(Vector3::new(1.0, 0.5, 0.0), Vector3::new(0.2, 0.3, 0.7));
        let foot = moved(cuboid([-1.0, -1.5, 0.0], [2.0, 1.0, 0.5]), &place);
        let post = moved(cuboid([0.0, 0.0, 0.5], [1.0, 0.75, 3.0]), &place);
        let (scene, _) = scene([foot, post, cuboid([3.0, -3.0, 0.0], [4.0, 3.0, 6.0])]);
        let scene = scene.with_joined(&[0, 1], &Termination::default()).unwrap();
        let body = 3;
        let start = scene.bodies[body].planning_from_shape;
        let turned = Pose::new(Vector3::new(0.3, -0.4, 2.0), Vector3::new(0.1, 0.9, -0.2)) * start;
        let path = [start, turned];
        let half = interpolate(&start, &turned, &scene.centre_in_shape(body), 0.5);
        for (pair, body_from_part) in PairPath::of_members(&scene, &scene.allowed, [body, 2], &path) {
            let into = scene.bodies[2].planning_from_shape.inverse();
            let there = interpolate(&pair.path[0], &pair.path[1], &pair.centre, 0.5);
            let expected = into * half * body_from_part;
            let off = (there.translation.vector - expected.translation.vector).norm();
            assert!(off < 1e-8 && there.rotation.angle_to(&expected.rotation) < 1e-8, "{:?}", pair.parts);
        }
    }

    #[test]
    fn parts_that_stand_alike_are_passed_alike() {
        // A pair, and the same elsewhere, turned about a slanted axis.
        let place = Pose::new(Vector3::new(4.0, 1.0, -2.0), Vector3::new(0.3, -0.2, 0.9));
        let foot = || cuboid([-1.0, -1.5, 0.0], [2.0, 1.0, 0.5]);
        let post = || cuboid([0.0, 0.0, 0.5], [1.0, 0.75, 3.0]);
        let (scene, _) = scene([foot(), post(), moved(foot(), &place), moved(post(), &place)]);
        let way = |parts: [usize; 2], direction: Vector3<f64>, travel: f64| {
            let start = &scene.bodies[parts[0]].planning_from_shape;
            let path = straight(start, direction * travel);
            let PairPath { path, centre, shapes, .. } = PairPath::new(&scene, &scene.allowed, parts, &path);
            (path, centre, shapes.map(Shape::content))
        };
        let up = Vector3::z();
        assert_eq!(way([1, 0], up, 20.0), way([3, 2], place * up, 31.0));
        assert_ne!(way([1, 0], up, 20.0), way([1, 2], up, 20.0));
    }
}
