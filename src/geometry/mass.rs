//! What a rigid motion needs to know about a body of uniform density.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{Bounds, Surface};

impl Surface {
    /// Volume, centroid and spread about it of the enclosed solid; for meshes that enclose none,
    /// those of the bounding box.
    #[must_use]
    pub fn mass_properties(&self) -> MassProperties {
        let origin = self.bounds().centre();
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), 0.0);
        let mut products = Matrix3::zeros();
        for t in 0..self.triangles().len() as u32 {
            let [a, b, c] = self.corners(t).map(|p| p - origin);
            let v = a.dot(&b.cross(&c)) / 6.0;
            volume += v;
            first += (a + b + c) * (v / 4.0);
            let s = a + b + c;
            second += v / 20.0 * (a.norm_squared() + b.norm_squared() + c.norm_squared() + s.norm_squared());
            products += [a, b, c, s].map(|x| x * x.transpose()).iter().sum::<Matrix3<f64>>() * (v / 20.0);
        }
        let boxed = MassProperties::of_box(self.bounds());
        if volume <= 1e-3 * boxed.volume {
            return boxed;
        }
        let centre = first / volume;
        let gyration_squared = second / volume - centre.norm_squared();
        if !self.bounds().contains(&(origin + centre)) || gyration_squared <= 0.0 {
            return boxed;
        }
        let mut covariance = products / volume - centre * centre.transpose();
        // What an open surface encloses may have none; all that is known then is its size.
        if covariance.symmetric_eigenvalues().min() <= 0.0 {
            covariance = Matrix3::from_diagonal_element(gyration_squared / 3.0);
        }
        MassProperties { volume, centre: origin + centre, gyration_squared, covariance }
    }
}

/// What a rigid motion needs to know about a body of uniform density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Enclosed volume.
    pub volume: f64,
    /// Centre of mass.
    pub centre: Point3<f64>,
    /// Mean squared distance of the mass from the centre: the trace of `covariance`.
    pub gyration_squared: f64,
    /// Mean of (x − centre)(x − centre)ᵀ over the mass, in the mesh's axes; lengths squared.
    pub covariance: Matrix3<f64>,
}

impl MassProperties {
    /// The properties of a solid box.
    fn of_box(bounds: &Bounds) -> Self {
        let e = bounds.extents();
        Self {
            volume: e.product(),
            centre: bounds.centre(),
            gyration_squared: e.norm_squared() / 12.0,
            covariance: Matrix3::from_diagonal(&(e.component_mul(&e) / 12.0)),
        }
    }

    /// The inertia tensor about the centre of mass for a mass of 1, in the mesh's axes.
    #[must_use]
    pub fn unit_inertia(&self) -> Matrix3<f64> {
        Matrix3::from_diagonal_element(self.covariance.trace()) - self.covariance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, healed, l_shape, moved, open_box, surface};
    use crate::geometry::Pose;

    #[test]
    fn mass_properties_of_a_box() {
        let s = surface(cuboid([1.0, -2.0, 3.0], [3.0, 1.0, 3.5]));
        let m = s.mass_properties();
        assert!((m.volume - 3.0).abs() < 1e-12);
        assert!((m.centre - Point3::new(2.0, -0.5, 3.25)).norm() < 1e-12);
        assert!((m.gyration_squared - (4.0 + 9.0 + 0.25) / 12.0).abs() < 1e-12);
        let spread = Matrix3::from_diagonal(&(Vector3::new(4.0, 9.0, 0.25) / 12.0));
        assert!((m.covariance - spread).norm() < 1e-12, "{}", m.covariance);
        let inertia = Matrix3::from_diagonal(&(Vector3::new(9.25, 4.25, 13.0) / 12.0));
        assert!((m.unit_inertia() - inertia).norm() < 1e-12, "{}", m.unit_inertia());
    }

    #[test]
    fn the_covariance_turns_with_the_solid() {
        let turn = Pose::new(Vector3::new(1.0, 2.0, -0.5), Vector3::new(0.3, -0.5, 0.2));
        let (still, turned) = (surface(l_shape()), surface(moved(l_shape(), &turn)));
        let (still, turned) = (still.mass_properties(), turned.mass_properties());
        let r = turn.rotation.to_rotation_matrix();
        let expected = r.matrix() * still.covariance * r.matrix().transpose();
        assert!((turned.covariance - expected).norm() < 1e-12, "{}", turned.covariance);
        assert!(still.covariance[(0, 1)] < -0.05, "no shape to test with: {}", still.covariance);
        for m in [still, turned] {
            assert!((m.covariance.trace() - m.gyration_squared).abs() < 1e-12);
        }
    }

    #[test]
    fn mass_properties_of_two_boxes_in_one_are_their_sum() {
        let m = surface(l_shape()).mass_properties();
        assert!((m.volume - 3.0).abs() < 1e-12);
        assert!((m.centre - Point3::new(2.5 / 3.0, 2.5 / 3.0, 0.5)).norm() < 1e-12);
        // Three unit cubes: each has 3/12 about its own centre.
        let centres = [[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [0.5, 1.5, 0.5]].map(Point3::from);
        let offsets = centres.iter().map(|c| (c - m.centre).norm_squared()).sum::<f64>() / 3.0;
        assert!((m.gyration_squared - 0.25 - offsets).abs() < 1e-12);
    }

    #[test]
    fn a_surface_without_volume_has_the_mass_of_its_box() {
        let mut flat = healed(open_box([0.0; 3], [2.0, 2.0, 1.0]));
        flat.triangles.truncate(2);
        let m = Surface::new(&flat).mass_properties();
        assert!(m.gyration_squared > 0.0 && m.centre.coords.iter().all(|x| x.is_finite()), "{m:?}");
    }
}
