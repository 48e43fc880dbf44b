//! The planes that a part lies against.

use nalgebra::{Unit, Vector3, Vector6};

use crate::geometry::Pose;

use super::Scene;
use super::contact::{Mover, Near};

/// cos of the angle within which two planes are one (a quarter of a degree).
const ALIKE: f64 = 0.999_99;

/// What a part touches.
#[derive(Debug, Clone, Default)]
pub struct Touching {
    /// The normals of the planes, in the planning frame, towards the part; in the order in which
    /// contacts are gathered.
    pub normals: Vec<Unit<Vector3<f64>>>,
    /// The parts whose surfaces they are, ascending.
    pub parts: Vec<usize>,
}

impl Touching {
    /// The planes of faces within `reach` (a gap in the planning frame) of a part at a pose; `standing`
    /// is ascending. Contacts that leave a choice of planes, as those at convex edges do, tell of
    /// none; a face has others.
    #[must_use]
    pub fn of(scene: &Scene, part: usize, pose: &Pose, standing: &[usize], reach: f64) -> Self {
        let mover = Mover::new(scene, part, *pose);
        let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(reach);
        let (mut out, mut options) = (Self::default(), Vec::new());
        for other in scene.broad_phase.meeting_of(standing, &bounds) {
            let mut near = Near { contacts: Vec::new(), clearance: f64::INFINITY };
            mover.near_pair(other, reach, &mut near);
            if !near.contacts.is_empty() {
                out.parts.push(other);
            }
            for contact in &near.contacts {
                options.clear();
                mover.options(contact, &Vector6::zeros(), &mut options);
                let [row] = &options[..] else { continue };
                let normal = Unit::new_normalize(row.a.fixed_rows::<3>(0).into_owned());
                if !out.normals.iter().any(|n| n.dot(&normal) > ALIKE) {
                    out.normals.push(normal);
                }
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, peg_in_hole, scene};

    fn touching(meshes: [crate::geometry::SourceMesh; 2], reach: f64) -> Touching {
        let (scene, _) = scene(meshes);
        Touching::of(&scene, 1, &scene.bodies[1].planning_from_shape, &[0], reach)
    }

    #[test]
    fn a_block_on_a_plate_touches_one_plane() {
        let found = touching(block_on_plate(), 0.01);
        assert_eq!(found.parts, [0]);
        assert!(found.normals.len() == 1 && found.normals[0].z > 1.0 - 1e-12, "{found:?}");
    }

    #[test]
    fn a_peg_in_its_hole_touches_five_also_with_play() {
        for play in [0.0, 0.02] {
            let found = touching(peg_in_hole(-play), 0.05).normals;
            let sum: Vector3<f64> = found.iter().map(|n| n.into_inner()).sum();
            assert!(found.len() == 5 && (sum - Vector3::z()).norm() < 1e-9, "{found:?}");
        }
    }

    #[test]
    fn what_is_apart_touches_nothing() {
        let found = touching(peg_in_hole(-0.2), 0.05);
        assert_eq!(found.parts, [0], "the bottom of the hole");
        assert_eq!(found.normals.len(), 1);
    }
}
