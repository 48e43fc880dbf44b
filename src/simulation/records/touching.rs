//! The planes that a part lies against. The parts that are looked at are known beforehand, so they are in the key.

use nalgebra::{Unit, Vector3};

use super::SOURCES;
use crate::cache::{Digest, RecordKind, RequestCache, Storage};
use crate::geometry::{Pose, add_pose};
use crate::scene::{Scene, add_standing};
use crate::simulation::Touching;
use crate::termination::{Interrupt, Termination};

/// The planes that a part lies against.
pub(crate) static TOUCHING: RecordKind =
    RecordKind::of::<Normals>(7, "touching", Storage::MemoryAndDisk, SOURCES);

/// As [`Touching::normals`].
type Normals = Option<Vec<Unit<Vector3<f64>>>>;

/// What a part at a pose touches ([`Touching::of`]), as remembered, or else as found, which is then remembered.
///
/// # Errors
/// The termination condition became true.
pub(crate) fn remembered_touching(
    cache: &RequestCache,
    scene: &Scene,
    part: usize,
    pose: &Pose,
    standing: &[usize],
    reach: f64,
    termination: &Termination,
) -> Result<Touching, Interrupt> {
    let parts = Touching::near(scene, part, pose, standing, reach);
    let mut digest = Digest::new();
    digest.hash(scene.bodies[part].shape.content()).numbers([reach]);
    add_pose(&mut digest, pose);
    parts.iter().for_each(|&other| add_standing(&mut digest, scene, part, other));
    let normals: Normals = cache.get_or(digest.key(&TOUCHING), || {
        Ok(Touching::of(scene, part, pose, standing, reach, termination)?.normals)
    })?;
    Ok(Touching { normals, parts })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cache::Cache;
    use crate::fixtures::{cuboid, moved, peg_in_hole, scene};

    #[test]
    fn what_was_cut_short_is_not_remembered() {
        let cache = RequestCache::of(Arc::new(Cache::in_memory(1 << 20, &[])));
        let (scene, _) = scene(peg_in_hole(0.0));
        let pose = scene.bodies[1].planning_from_shape;
        let t = Termination::default();
        t.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(remembered_touching(&cache, &scene, 1, &pose, &[0], 0.05, &t).is_err());
        let whole =
            remembered_touching(&cache, &scene, 1, &pose, &[0], 0.05, &Termination::default()).unwrap();
        assert_eq!(cache.reused(&TOUCHING), 0);
        assert!(whole.normals.is_some_and(|n| n.len() >= 5));
    }

    #[test]
    fn what_is_remembered_is_what_is_found() {
        let cache = RequestCache::of(Arc::new(Cache::in_memory(1 << 20, &[])));
        let [block, peg] = peg_in_hole(0.0);
        let beside = cuboid([1.0, -1.0, 0.0], [2.0, 1.0, 1.0]);
        let turn = Pose::new([0.1, 0.2, 0.0].into(), [0.1, 0.2, 0.3].into());
        for meshes in [
            vec![block.clone(), peg.clone()],
            vec![block.clone(), peg.clone(), beside.clone()],
            vec![block.clone(), peg.clone(), moved(beside, &Pose::translation(0.0, 0.0, 2.0))],
            vec![moved(block, &turn), moved(peg, &turn)],
        ] {
            let (scene, _) = scene(meshes);
            let standing: Vec<usize> = (0..scene.bodies.len()).filter(|&p| p != 1).collect();
            let pose = scene.bodies[1].planning_from_shape;
            let t = Termination::default();
            let cold = Touching::of(&scene, 1, &pose, &standing, 0.05, &t).unwrap();
            for _ in 0..2 {
                let warm = remembered_touching(&cache, &scene, 1, &pose, &standing, 0.05, &t).unwrap();
                assert_eq!((&warm.normals, &warm.parts), (&cold.normals, &cold.parts));
            }
            assert!(cold.normals.is_some_and(|n| n.len() >= 5));
        }
        // The second look at each, and the third machine's first: what was moved off is not touched.
        assert_eq!(cache.reused(&TOUCHING), 5);
    }
}
