//! A scene at the scale of some of its parts.
//!
//! The planning frame has the whole assembly in (5, 10], and all steps and tolerances of motions are lengths in it. Of
//! what is much smaller, steps are as large as its details. So the scene is scaled up for it: by a power of two, which
//! loses no bit.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::geometry::{Bounds, Pose, SampleTree, Shape, scaled_pose};
use crate::sdf::Field;

use super::{AllowedPenetrations, Body, Scene};

/// A scene whose standing parts were scaled.
#[derive(Debug)]
pub(crate) struct OwnScale {
    /// The scene. Parts that do not stand have the size that they had: nothing may be asked about them.
    pub(crate) scene: Scene,
    /// The power of two that was multiplied by.
    pub(crate) factor: f64,
}

impl OwnScale {
    /// Scales the standing parts (ascending) of a scene by a power of two. `longest_side` is that of the assembly as which it counts.
    pub(crate) fn of(
        scene: &Scene,
        standing: &[usize],
        factor: f64,
        longest_side: f64,
        shapes: &ScaledShapes,
    ) -> Self {
        let mut bodies = scene.bodies.to_vec();
        for &part in standing {
            let body = &mut bodies[part];
            (body.shape, body.field) = shapes.of(body, factor);
            body.planning_from_shape = scaled_pose(&body.planning_from_shape, factor);
            body.bounds = Bounds { min: body.bounds.min * factor, max: body.bounds.max * factor };
            body.extra_samples = SampleTree::default();
        }
        let mut scaled = Scene::of(bodies, longest_side);
        let mut allowed = AllowedPenetrations::none();
        for (&(a, b), depth) in scene.allowed.depth.iter() {
            if [a, b].iter().all(|part| standing.binary_search(part).is_ok()) {
                allowed.allow(a, b, depth * factor);
            }
        }
        scaled.allowed = allowed;
        Self { scene: scaled, factor }
    }

    /// A pose of this scene in the scene that it was made from.
    pub(crate) fn restored(&self, pose: &Pose) -> Pose {
        scaled_pose(pose, 1.0 / self.factor)
    }
}

/// The scaled shapes of one request, by content and factor, so that each is made once.
#[derive(Debug, Default)]
pub struct ScaledShapes(Mutex<HashMap<([u8; 32], u64), ScaledShape>>);

type ScaledShape = (Arc<Shape>, Arc<Field>);

impl ScaledShapes {
    fn of(&self, body: &Body, factor: f64) -> ScaledShape {
        let key = (*body.shape.content(), factor.to_bits());
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let scaled = known.entry(key).or_insert_with(|| {
            let shape = body.shape.scaled(factor);
            let field = Field::of(&shape.surface);
            (Arc::new(shape), Arc::new(field))
        });
        scaled.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, scene};
    use crate::termination::Termination;

    #[test]
    fn parts_at_their_own_scale_are_the_same_to_the_bit() {
        let small = |at: f64| cuboid([at, 0.0, 0.0], [at + 0.3, 0.25, 0.1]);
        let (scene, _) = scene([cuboid([-5.0; 3], [4.0; 3]), small(4.1), small(4.5)]);
        let mut scene = scene;
        scene.allowed.allow(1, 2, 0.01);
        scene.allowed.allow(0, 1, 0.02);
        let shapes = ScaledShapes::default();
        let found = OwnScale::of(&scene, &[1, 2], 8.0, 7.5, &shapes);
        assert_eq!((found.scene.longest_side, found.factor), (7.5, 8.0));
        assert_eq!((found.scene.allowed.of(1, 2), found.scene.allowed.of(0, 1)), (0.08, 0.0));
        for part in [1, 2] {
            let [old, new] = [&scene.bodies[part], &found.scene.bodies[part]];
            assert_eq!(found.restored(&new.planning_from_shape), old.planning_from_shape);
            let restored: Vec<_> = new.shape.surface.vertices().iter().map(|v| v / found.factor).collect();
            assert_eq!(restored, old.shape.surface.vertices());
            let anew = Shape::of(new.shape.mesh().clone(), &Termination::default()).unwrap();
            assert_eq!((&anew.hull, anew.content()), (&new.shape.hull, new.shape.content()));
        }
        assert_eq!(found.scene.bodies[0].bounds, scene.bodies[0].bounds);
        let again = OwnScale::of(&scene, &[1], 8.0, 7.5, &shapes);
        assert!(
            Arc::ptr_eq(&again.scene.bodies[1].shape, &found.scene.bodies[2].shape),
            "equal parts share one"
        );
    }
}
