//! The planes that a sample must stay above one of.

use nalgebra::{Point3, Vector3};

use crate::geometry::{Closest, Surface};
use crate::tolerances::ONE_PLANE_COSINE;

/// A sample seen from the surface that it is near to.
pub(super) struct ContactSample {
    pub(super) point: Point3<f64>,
    /// The displacement that is wanted.
    pub(super) motion: Vector3<f64>,
    pub(super) closest: Closest,
    pub(super) distance: f64,
    /// How far below a plane the sample may be and still count as separated by it.
    pub(super) below: f64,
}

/// A plane that a sample may be asked to stay above.
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

    /// Adds a plane, or keeps the higher of two that are nearly parallel.
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
    /// The planes of which the sample must stay above one: those of the closest feature, and, if
    /// the wanted motion goes below all of them, those of the feature that is closest ahead, as `closest_to` tells
    /// of a point if there is one as near. The
    /// solid near a convex feature lies below all its planes, so to stay above any is enough.
    pub(super) fn planes(
        &self,
        surface: &Surface,
        closest_to: impl FnOnce(&Point3<f64>, f64) -> Option<Closest>,
        out: &mut Planes,
    ) {
        let away = self.point - self.closest.point;
        // The direction to the closest point: good unless the two coincide.
        let radial = away.try_normalize(1e-7).map(|d| if self.distance < 0.0 { -d } else { d });
        let above = |normal: Vector3<f64>, foot: &Point3<f64>| {
            let height = normal.dot(&(self.point - foot));
            (height >= -self.below).then_some(Plane { normal, height })
        };
        // Too deep, the way out is the shortest one.
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
