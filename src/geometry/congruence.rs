//! Finds parts that are rigid copies of another part of the same assembly.
//!
//! Copies share their distance field, samples and hull. Only meshes with the same triangle list
//! are compared (copies in CAD exports have it); the rigid motion is fitted by least squares
//! (W. Kabsch 1976; SVD by faer) and accepted only if it maps vertex to vertex.

use faer::Mat;
use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::{Mesh, Pose};

/// Largest distance between a vertex and its image, in units of the planning frame (whose longest
/// side is at most 10): far below every tolerance of contact.
const RESIDUAL: f64 = 1e-5;

/// The pose that maps `from` onto `to`, if they are congruent vertex by vertex.
#[must_use]
pub(super) fn congruence(from: &Mesh, to: &Mesh) -> Option<Pose> {
    if from.vertices.len() != to.vertices.len()
        || from.solidity != to.solidity
        || from.triangles != to.triangles
    {
        return None;
    }
    let pose = fit(&from.vertices, &to.vertices)?;
    let fits = from.vertices.iter().zip(&to.vertices).all(|(a, b)| (pose * a - b).norm() <= RESIDUAL);
    fits.then_some(pose)
}

fn fit(from: &[Point3<f64>], to: &[Point3<f64>]) -> Option<Pose> {
    let n = from.len() as f64;
    let mean = |points: &[Point3<f64>]| points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
    let (ca, cb) = (mean(from), mean(to));
    let covariance: Matrix3<f64> =
        from.iter().zip(to).map(|(a, b)| (a.coords - ca) * (b.coords - cb).transpose()).sum();
    let rotation = snapped(best_rotation(&covariance)?);
    let t = cb - rotation * ca;
    Some(Pose::from_parts(Translation3::from(t), UnitQuaternion::from_rotation_matrix(&rotation)))
}

fn best_rotation(covariance: &Matrix3<f64>) -> Option<Rotation3<f64>> {
    let h = Mat::from_fn(3, 3, |i, j| covariance[(i, j)]);
    let svd = h.thin_svd().ok()?;
    let u = Matrix3::from_fn(|i, j| svd.U()[(i, j)]);
    let v = Matrix3::from_fn(|i, j| svd.V()[(i, j)]);
    let mut d = Matrix3::identity();
    d[(2, 2)] = (v * u.transpose()).determinant().signum();
    Some(Rotation3::from_matrix_unchecked(v * d * u.transpose()))
}

/// Copies mostly stand at right angles: there the rotation is made exact, so that a copy's faces
/// are as flush as the original's.
fn snapped(r: Rotation3<f64>) -> Rotation3<f64> {
    right_angled(&r).unwrap_or(r)
}

/// A rotation that maps axes to axes, exact, if one is that but for rounding.
#[must_use]
pub(super) fn right_angled(r: &Rotation3<f64>) -> Option<Rotation3<f64>> {
    let rounded = r.matrix().map(f64::round);
    ((r.matrix() - rounded).abs().max() < 1e-7).then(|| Rotation3::from_matrix_unchecked(rounded))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Solidity;

    fn wedge() -> Mesh {
        let v = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.5]];
        Mesh {
            vertices: v.map(Point3::from).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            solidity: Solidity::Closed,
        }
    }

    fn moved(mesh: &Mesh, f: impl Fn(&Point3<f64>) -> Point3<f64>) -> Mesh {
        Mesh { vertices: mesh.vertices.iter().map(f).collect(), ..mesh.clone() }
    }

    #[test]
    fn a_turned_copy_is_found_with_its_pose() {
        let pose = Pose::new(Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.4, 1.0, -0.2));
        let found = congruence(&wedge(), &moved(&wedge(), |p| pose * p)).unwrap();
        assert!((found.to_matrix() - pose.to_matrix()).norm() < 1e-9);
    }

    #[test]
    fn a_mirror_image_or_a_stretched_part_is_no_copy() {
        assert!(congruence(&wedge(), &moved(&wedge(), |p| Point3::new(-p.x, p.y, p.z))).is_none());
        assert!(congruence(&wedge(), &moved(&wedge(), |p| p * 1.001)).is_none());
    }
}
