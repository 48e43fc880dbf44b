//! Several placed shapes as one rigid body.

use super::own_frame::OwnFrame;
use super::{Mesh, Pose, Shape, Solidity};
use crate::termination::{Interrupt, Termination};

impl Shape {
    /// The shape of several shapes that keep their places against each other, not turned, and where it stands. What they
    /// have in common is inside: signs come from winding numbers. If one has holes, all count as walls.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(crate) fn joined(
        placed: &[(&Self, &Pose)],
        termination: &Termination,
    ) -> Result<(Self, Pose), Interrupt> {
        let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new(), solidity: Solidity::Winding };
        for (shape, pose) in placed {
            let first = mesh.vertices.len() as u32;
            let Mesh { vertices, triangles, solidity } = shape.mesh();
            mesh.vertices.extend(vertices.iter().map(|v| *pose * v));
            mesh.triangles.extend(triangles.iter().map(|t| t.map(|i| first + i)));
            if *solidity == Solidity::Wall {
                mesh.solidity = Solidity::Wall;
            }
        }
        let frame = OwnFrame::as_given(&mesh);
        Ok((Self::within(mesh, &frame, termination)?, frame.pose()))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use crate::fixtures::{block_on_plate, scene};
    use crate::geometry::Shape;
    use crate::termination::Termination;

    #[test]
    fn a_point_between_two_that_touch_is_inside() {
        let (scene, _) = scene(block_on_plate());
        let placed = [0, 1].map(|i| (&*scene.bodies[i].shape, &scene.bodies[i].planning_from_shape));
        let (shape, pose) = Shape::joined(&placed, &Termination::default()).unwrap();
        let bounds = scene.bodies[0].bounds.union(&scene.bodies[1].bounds);
        assert!((pose * shape.bounds().centre() - bounds.centre()).norm() < 1e-9);
        let at = |p: Point3<f64>| shape.surface.signed_distance(&pose.inverse_transform_point(&p));
        let [plate, block] = [0, 1].map(|i| scene.bodies[i].bounds);
        let touch = block.centre() - nalgebra::Vector3::z() * (block.extents().z / 2.0);
        for side in [-0.05, 0.05] {
            assert!(at(touch + nalgebra::Vector3::z() * side) < 0.0, "{side}");
        }
        assert!(at(plate.max + nalgebra::Vector3::repeat(0.1)) > 0.0);
        let volume = [0, 1].map(|i| scene.bodies[i].shape.mass.volume).iter().sum::<f64>();
        assert!((shape.mass.volume - volume).abs() < 1e-9 * volume);
    }
}
