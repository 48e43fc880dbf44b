//! The planes that a part lies against, by the rule of verdicts: the parts that are looked at are known
//! beforehand, so they are in the key.

use nalgebra::{Unit, Vector3};

use super::motion::add_standing;
use super::pair::add_pose;
use super::recall::About;
use super::records::TouchingRecord;
use super::{Digest, Kind, Recall};
use crate::geometry::Pose;
use crate::scene::Scene;
use crate::simulation::Touching;
use crate::termination::{Interrupt, Termination};

impl Recall {
    /// What a part at a pose touches ([`Touching::of`]), as remembered, or else as looked for, which is then
    /// remembered.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn touching(
        &self,
        scene: &Scene,
        part: usize,
        pose: &Pose,
        standing: &[usize],
        reach: f64,
        termination: &Termination,
    ) -> Result<Touching, Interrupt> {
        if !self.remembers() {
            return Touching::of(scene, part, pose, standing, reach, termination);
        }
        let parts = Touching::near(scene, part, pose, standing, reach);
        let mut digest = Digest::new();
        digest.hash(scene.bodies[part].shape.content()).numbers([reach]);
        add_pose(&mut digest, pose);
        parts.iter().for_each(|&other| add_standing(&mut digest, scene, part, other));
        let key = digest.key(Kind::Touching);
        if let Some(TouchingRecord { normals }) = self.get(&key) {
            self.count(About::Blocking);
            let of =
                |n: Vec<[f64; 3]>| n.into_iter().map(|n| Unit::new_unchecked(Vector3::from(n))).collect();
            return Ok(Touching { normals: normals.map(of), parts });
        }
        let found = Touching::of(scene, part, pose, standing, reach, termination)?;
        let record = |n: &Vec<Unit<Vector3<f64>>>| n.iter().map(|n| n.into_inner().into()).collect();
        self.put(key, &TouchingRecord { normals: found.normals.as_ref().map(record) });
        Ok(found)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::cache::Cache;
    use crate::fixtures::{cuboid, moved, peg_in_hole, scene};

    #[test]
    fn what_was_cut_short_is_not_remembered() {
        let recall = Recall::of(Arc::new(Cache::in_memory(1 << 20)));
        let (scene, _) = scene(peg_in_hole(0.0));
        let pose = scene.bodies[1].planning_from_shape;
        let t = Termination::default();
        t.cancel_flag().store(true, std::sync::atomic::Ordering::Relaxed);
        assert!(recall.touching(&scene, 1, &pose, &[0], 0.05, &t).is_err());
        let whole = recall.touching(&scene, 1, &pose, &[0], 0.05, &Termination::default()).unwrap();
        assert_eq!(recall.reused().blocking, 0);
        assert!(whole.normals.is_some_and(|n| n.len() >= 5));
    }

    #[test]
    fn what_is_remembered_is_what_is_found() {
        let recall = Recall::of(Arc::new(Cache::in_memory(1 << 20)));
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
                let warm = recall.touching(&scene, 1, &pose, &standing, 0.05, &t).unwrap();
                assert_eq!((&warm.normals, &warm.parts), (&cold.normals, &cold.parts));
            }
            assert!(cold.normals.is_some_and(|n| n.len() >= 5));
        }
        // The second look at each, and the third machine's first: what was moved off is not touched.
        assert_eq!(recall.reused().blocking, 5);
    }
}
