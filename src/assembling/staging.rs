//! Where parts wait for their turn: laid out beside the assembly.

use nalgebra::{Translation3, Vector3};

use crate::geometry::{Bounds, Pose};
use crate::scene::Scene;

/// Between boxes of parts, and between them and all that moves, as a share of the longest side.
const GAP: f64 = 0.03;
/// A row is so much longer than the side of a square with the area of all boxes.
const SLACK: f64 = 1.1;

/// Poses (of their shapes) for parts that wait, turned as they will stand, in rows along x before what is
/// `occupied` (towards −y), in the order given: the first at the left end of the nearest row. Their boxes
/// stand on the plane parallel to xy at the bottom of the assembly and do not meet.
pub(super) fn laid_out(scene: &Scene, parts: &[usize], occupied: &Bounds) -> Vec<(usize, Pose)> {
    let gap = GAP * scene.longest_side;
    let sizes: Vec<Vector3<f64>> =
        parts.iter().map(|&p| scene.bodies[p].bounds.extents().add_scalar(gap)).collect();
    let area: f64 = sizes.iter().map(|s| s.x * s.y).sum();
    let widest = sizes.iter().map(|s| s.x).fold(0.0, f64::max);
    let width = occupied.extents().x.max(SLACK * area.sqrt()).max(widest);
    let floor = scene.bodies.iter().map(|b| b.bounds.min.z).fold(f64::INFINITY, f64::min);
    let (mut x, mut y, mut depth) = (0.0, occupied.min.y, 0.0f64);
    let mut out = Vec::with_capacity(parts.len());
    for (&part, size) in parts.iter().zip(&sizes) {
        if x > 0.0 && x + size.x > width {
            (x, y, depth) = (0.0, y - depth, 0.0);
        }
        let bounds = &scene.bodies[part].bounds;
        // The box begins a gap after the last one, and its far side is a gap before the row behind.
        let corner = Vector3::new(occupied.min.x + x, y - gap - bounds.extents().y, floor);
        let shift = Translation3::from(corner - bounds.min.coords);
        out.push((part, shift * scene.bodies[part].planning_from_shape));
        x += size.x;
        depth = depth.max(size.y);
    }
    out
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{cuboid, scene};

    proptest! {
        #[test]
        fn boxes_stand_on_the_floor_and_meet_nothing(
            sizes in prop::collection::vec(prop::array::uniform3(0.05..3.9f64), 1..30),
        ) {
            let all = sizes.iter().chain([&[4.0; 3]]);
            let meshes: Vec<_> = all.map(|s| cuboid([-s[0], -s[1], -s[2]], *s)).collect();
            let (scene, _) = scene(meshes);
            let parts: Vec<usize> = (0..scene.bodies.len()).rev().collect();
            let occupied = scene.bodies.iter().fold(Bounds::EMPTY, |b, body| b.union(&body.bounds));
            let floor = occupied.min.z;
            let placed = laid_out(&scene, &parts, &occupied);
            prop_assert_eq!(placed.iter().map(|(p, _)| *p).collect::<Vec<_>>(), parts);
            let mut boxes = vec![occupied];
            for (part, pose) in placed {
                let bounds = scene.bodies[part].shape.bounds().transformed(&pose);
                prop_assert!((bounds.min.z - floor).abs() < 1e-9);
                prop_assert!(boxes.iter().all(|b| !b.meets(&bounds)));
                boxes.push(bounds);
            }
        }
    }
}
