//! The frame of a mesh's own box and largest faces, and which of some copies gives the shape of them all: it is the
//! same to the bit in whatever order they come, and in other assemblies.

use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::congruence::right_angled;
use super::content_hash::mesh_hash;
use super::{Bounds, Mesh, Pose, area_normal};

/// The first triangle that is as large as the largest but for this share is taken for it: equal ones differ
/// by rounding.
const NEARLY: f64 = 1e-3;

/// Vertices of shapes stand on this grid, in units of the planning frame: a part that stands elsewhere in
/// another assembly has the same shape to the bit, whatever was rounded on the way there, but for one
/// coordinate in some ten thousand. Far below every tolerance of contact.
const GRID: f64 = 1.0 / (1u64 << 33) as f64;

/// The frame of a shape.
#[derive(Debug, Clone)]
pub(super) struct OwnFrame {
    /// The middle of the box.
    origin: Point3<f64>,
    /// From the axes in which the mesh is given into the shape's.
    turn: Rotation3<f64>,
}

impl OwnFrame {
    /// That of a mesh, if its largest faces are at right angles to the axes in which it is given: coordinates are
    /// only permuted and change their signs.
    #[must_use]
    fn along_faces(mesh: &Mesh) -> Option<Self> {
        Some(Self { turn: turn_into_own_axes(mesh)?, ..Self::as_given(mesh) })
    }

    /// That of a mesh, not turned.
    #[must_use]
    pub(super) fn as_given(mesh: &Mesh) -> Self {
        Self { origin: Bounds::of(&mesh.vertices).centre(), turn: Rotation3::identity() }
    }

    /// That of a mesh without copies: along its faces, if these allow it.
    #[must_use]
    pub(super) fn of(mesh: &Mesh) -> Self {
        Self::along_faces(mesh).unwrap_or_else(|| Self::as_given(mesh))
    }

    /// Of some copies (with their numbers) the one of which their shape is made, and its frame: one along
    /// its faces, if any is, and of several the one whose vertices, which differ by what files round, have
    /// the least hash.
    #[must_use]
    pub(super) fn among(copies: &[(usize, &Mesh)]) -> Option<(usize, Self)> {
        let along_faces = |&(i, mesh)| Some((i, mesh, Self::along_faces(mesh)?));
        let as_given = |&(i, mesh)| (i, mesh, Self::as_given(mesh));
        let mut all: Vec<(usize, &Mesh, Self)> = copies.iter().filter_map(along_faces).collect();
        if all.is_empty() {
            all = copies.iter().map(as_given).collect();
        }
        if all.len() > 1 {
            all.sort_by_cached_key(|(_, mesh, frame)| mesh_hash(&frame.framed((*mesh).clone())));
        }
        all.into_iter().next().map(|(i, _, frame)| (i, frame))
    }

    /// The mesh in its frame.
    #[must_use]
    pub(super) fn framed(&self, mut mesh: Mesh) -> Mesh {
        // Adding zero makes zeros positive.
        let onto_grid = |x: f64| (x / GRID).round() * GRID + 0.0;
        for p in &mut mesh.vertices {
            *p = (self.turn * (*p - self.origin)).map(onto_grid).into();
        }
        mesh
    }

    /// Where the shape stands in the frame in which the mesh is given.
    #[must_use]
    pub(super) fn pose(&self) -> Pose {
        let rotation = UnitQuaternion::from_rotation_matrix(&self.turn.inverse());
        Pose::from_parts(Translation3::from(self.origin), rotation)
    }
}

/// The rotation into the axes of a mesh's own largest faces, if these are at right angles to the axes that it is
/// given in.
fn turn_into_own_axes(mesh: &Mesh) -> Option<Rotation3<f64>> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c]: [Point3<f64>; 3] = t.map(|v| mesh.vertices[v as usize]);
        area_normal(&a, &b, &c)
    };
    let z = largest(mesh.triangles.iter().map(normal))?;
    let x = largest(mesh.triangles.iter().map(|t| across(&normal(t), &z)))?;
    // Once more: what is nearly along z has lost digits.
    let x = across(&x, &z).try_normalize(0.0)?;
    let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
    right_angled(&Rotation3::from_matrix_unchecked(axes.transpose()))
}

/// What of a vector is across a unit vector.
fn across(v: &Vector3<f64>, unit: &Vector3<f64>) -> Vector3<f64> {
    v - unit * v.dot(unit)
}

/// The direction of the largest of some vectors.
fn largest(vectors: impl Iterator<Item = Vector3<f64>> + Clone) -> Option<Vector3<f64>> {
    let most = vectors.clone().map(|v| v.norm()).fold(0.0, f64::max);
    let mut vectors = vectors;
    vectors.find(|v| v.norm() >= most * (1.0 - NEARLY))?.try_normalize(0.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use super::*;
    use crate::fixtures::{ball, healed, l_shape, moved};
    use crate::geometry::Shape;
    use crate::termination::Termination;

    fn turned(by: Vector3<f64>) -> Mesh {
        healed(moved(l_shape(), &Pose::new(Vector3::new(0.3, -1.7, 0.1), by)))
    }

    #[test]
    fn copies_at_right_angles_have_one_shape_to_the_bit() {
        let content = |by: Vector3<f64>| {
            let mesh = turned(by);
            let frame = OwnFrame::along_faces(&mesh).unwrap();
            *Shape::within(mesh, &frame, &Termination::default()).unwrap().content()
        };
        let turns = [Vector3::x() * FRAC_PI_2, Vector3::y() * -FRAC_PI_2, Vector3::z() * PI];
        let third = Vector3::new(1.0, 1.0, 1.0).normalize() * (2.0 * PI / 3.0);
        for by in turns.into_iter().chain([third]) {
            assert_eq!(content(by), content(Vector3::zeros()), "{by}");
        }
    }

    #[test]
    fn what_stands_askew_or_has_no_faces_along_its_axes_is_left() {
        assert!(OwnFrame::along_faces(&turned(Vector3::new(0.1, 0.0, 0.0))).is_none());
        assert!(OwnFrame::along_faces(&healed(ball(2))).is_none());
    }
}
