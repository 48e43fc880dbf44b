//! Some parts of a scene at their own scale.
//!
//! The planning frame has the whole assembly in (5, 10], and all steps of motions are lengths in it. Of a group that is
//! much smaller, steps are as large as its details. So the group is scaled as if it were alone: by a power of two, which
//! loses no bit.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::geometry::{Bounds, Mesh, Pose, SampleTree, Shape};
use crate::sdf::Field;
use crate::termination::{Interrupt, Termination};

use super::{AllowedPenetrations, Scene, rounded_down};

/// Some parts of a scene, scaled so that their longest side is in (5, 10].
#[derive(Debug)]
pub(crate) struct OwnScale {
    /// The scene. Parts that were not named have the size that they had: nothing may be asked about them.
    pub(crate) scene: Scene,
    /// The power of two that was multiplied by; at least 2.
    pub(crate) factor: f64,
}

impl OwnScale {
    /// Scales parts; `None` if they are as large as an assembly already.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn of(
        scene: &Scene,
        parts: &[usize],
        termination: &Termination,
    ) -> Result<Option<Self>, Interrupt> {
        let bounds = parts.iter().fold(Bounds::EMPTY, |all, &part| all.union(&scene.bodies[part].bounds));
        let longest = bounds.extents().max();
        // Where the longest side is a power of two times 10, it becomes 10.
        let factor = (10.0 / longest).log2().floor().exp2();
        if !factor.is_finite() || factor < 2.0 {
            return Ok(None);
        }
        let mut scaled: HashMap<*const Shape, Arc<Shape>> = HashMap::new();
        let mut bodies = scene.bodies.to_vec();
        for &part in parts {
            let body = &mut bodies[part];
            let shape = match scaled.get(&Arc::as_ptr(&body.shape)) {
                Some(shape) => Arc::clone(shape),
                None => {
                    let shape = Arc::new(Shape::of(scaled_mesh(body.shape.mesh(), factor), termination)?);
                    scaled.insert(Arc::as_ptr(&body.shape), Arc::clone(&shape));
                    shape
                }
            };
            body.field = Arc::new(Field::of(&shape.surface));
            body.shape = shape;
            body.planning_from_shape = scaled_pose(&body.planning_from_shape, factor);
            body.bounds = Bounds { min: body.bounds.min * factor, max: body.bounds.max * factor };
            body.extra_samples = SampleTree::default();
        }
        let mut scene_at_scale = Scene::of(bodies, rounded_down(longest * factor));
        let mut allowed = AllowedPenetrations::none();
        for (i, &a) in parts.iter().enumerate() {
            for &b in &parts[..i] {
                let depth = scene.allowed.of(a, b);
                if depth > 0.0 {
                    allowed.allow(a, b, depth * factor);
                }
            }
        }
        scene_at_scale.allowed = allowed;
        Ok(Some(Self { scene: scene_at_scale, factor }))
    }

    /// A pose of this scene in the scene that it was made from.
    pub(crate) fn restored(&self, pose: &Pose) -> Pose {
        scaled_pose(pose, 1.0 / self.factor)
    }
}

fn scaled_mesh(mesh: &Mesh, factor: f64) -> Mesh {
    Mesh { vertices: mesh.vertices.iter().map(|v| v * factor).collect(), ..mesh.clone() }
}

fn scaled_pose(pose: &Pose, factor: f64) -> Pose {
    let shift: Vector3<f64> = pose.translation.vector * factor;
    Pose::from_parts(shift.into(), pose.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, scene};

    #[test]
    fn parts_at_their_own_scale_are_the_same_to_the_bit() {
        let small = |at: f64| cuboid([at, 0.0, 0.0], [at + 0.3, 0.25, 0.1]);
        let (scene, _) = scene([cuboid([-5.0; 3], [4.0; 3]), small(4.1), small(4.5)]);
        let mut scene = scene;
        scene.allowed.allow(1, 2, 0.01);
        let found = OwnScale::of(&scene, &[1, 2], &Termination::default()).unwrap().unwrap();
        let longest =
            [1, 2].map(|part| scene.bodies[part].bounds).into_iter().fold(Bounds::EMPTY, |a, b| a.union(&b));
        let side = longest.extents().max() * found.factor;
        assert!(side > 5.0 && side <= 10.0, "{side}");
        assert_eq!(found.factor.log2().fract(), 0.0);
        assert_eq!(found.scene.allowed.of(1, 2), 0.01 * found.factor);
        for part in [1, 2] {
            let [old, new] = [&scene.bodies[part], &found.scene.bodies[part]];
            assert_eq!(found.restored(&new.planning_from_shape), old.planning_from_shape);
            let restored: Vec<_> = new.shape.surface.vertices().iter().map(|v| v / found.factor).collect();
            assert_eq!(restored, old.shape.surface.vertices());
        }
        let all = OwnScale::of(&scene, &[0, 1, 2], &Termination::default()).unwrap();
        assert!(all.is_none(), "the whole has its scale");
    }
}
