//! The planes of which a sample must stay above one.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Closest, Surface};
use crate::tolerances::ONE_PLANE_COSINE;

/// A sample and the surface near it.
pub(super) struct ContactSample {
    pub(super) point: Point3<f64>,
    /// The wanted displacement.
    pub(super) motion: Vector3<f64>,
    pub(super) closest: Closest,
    pub(super) distance: f64,
    /// How far below a plane the sample may be and still count as above it.
    pub(super) below: f64,
}

/// A plane that a sample may stay above.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub(super) normal: Vector3<f64>,
    /// Height of the sample above it.
    pub(super) height: f64,
}

/// A few planes with different normals.
#[derive(Default)]
pub(super) struct Planes {
    list: [Option<Plane>; 6],
}

impl Planes {
    pub(super) fn iter(&self) -> impl Iterator<Item = &Plane> {
        self.list.iter().flatten()
    }

    /// Adds a plane; of two that are nearly parallel, the higher one stays.
    fn add(&mut self, plane: Plane) {
        for slot in &mut self.list {
            match slot {
                Some(p) if p.normal.dot(&plane.normal) > ONE_PLANE_COSINE => {
                    p.height = p.height.max(plane.height);
                    return;
                }
                Some(_) => {}
                None => {
                    *slot = Some(plane);
                    return;
                }
            }
        }
    }
}

impl ContactSample {
    /// The planes of which the sample must stay above one: those of the closest feature. If the wanted motion goes
    /// below all of them, also those of the feature that is closest ahead, if there is one as near (`closest_to`
    /// finds it). Near a convex feature the solid lies below all of its planes, so it is enough to stay above any.
    pub(super) fn planes(
        &self,
        surface: &Surface,
        closest_to: impl FnOnce(&Point3<f64>, f64) -> Option<Closest>,
        out: &mut Planes,
    ) {
        let away = self.point - self.closest.point;
        // The direction to the closest point is good unless the two coincide.
        let radial = away.try_normalize(1e-7).map(|d| if self.distance < 0.0 { -d } else { d });
        let above = |normal: Vector3<f64>, foot: &Point3<f64>| {
            let height = normal.dot(&(self.point - foot));
            (height >= -self.below).then_some(Plane { normal, height })
        };
        // For a sample that is too deep, the shortest way out.
        if let (Some(normal), true) = (radial, self.distance < -self.below) {
            return out.add(Plane { normal, height: self.distance });
        }
        surface.feature_normals(&self.closest, |n| {
            if let Some(p) = above(n, &self.closest.point) {
                out.add(p);
            }
        });
        if let Some(p) = radial.and_then(|d| above(d, &self.closest.point)) {
            out.add(p);
        }
        let stopped = out.iter().all(|p| p.height + p.normal.dot(&self.motion) < 0.0);
        if stopped && let Some(ahead) = closest_to(&(self.point + self.motion), self.motion.norm()) {
            surface.feature_normals(&ahead, |n| {
                if let Some(p) = above(n, &ahead.point) {
                    out.add(p);
                }
            });
        }
        if out.iter().next().is_none() {
            let normal = surface.pseudo_normal(&self.closest);
            out.add(Plane {
                normal: normal.try_normalize(0.0).unwrap_or_else(Vector3::x),
                height: self.distance,
            });
        }
    }
}
