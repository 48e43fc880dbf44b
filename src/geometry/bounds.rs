//! Axis-aligned boxes.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::Pose;

/// Along an axis to which the direction is steeper than this, boxes do not come apart soon.
const STEEP: f64 = 1e-3;
/// A box is left behind by this more than it is met, in units of the planning frame.
const CLEAR: f64 = 1e-6;

/// An axis-aligned box; `min` > `max` on some axis means empty.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Point3<f64>,
    /// Largest coordinates.
    pub max: Point3<f64>,
}

impl Bounds {
    /// The box of no points.
    pub const EMPTY: Self = Self {
        min: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The box of points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Point3<f64>>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.with_point(p))
    }

    /// Grown to hold a point.
    #[must_use]
    pub fn with_point(self, p: &Point3<f64>) -> Self {
        Self { min: self.min.inf(p), max: self.max.sup(p) }
    }

    /// The box of both.
    #[must_use]
    pub fn union(self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// What is in both boxes; empty if nothing is.
    #[must_use]
    pub fn intersection(self, other: &Self) -> Self {
        Self { min: self.min.sup(&other.min), max: self.max.inf(&other.max) }
    }

    /// Grown by `margin` on every side (shrunk if negative).
    #[must_use]
    pub fn grown(self, margin: f64) -> Self {
        let m = Vector3::repeat(margin);
        Self { min: self.min - m, max: self.max + m }
    }

    /// Whether the two share a point.
    #[must_use]
    pub fn meets(&self, other: &Self) -> bool {
        (0..3).all(|a| self.min[a] <= other.max[a] && other.min[a] <= self.max[a])
    }

    /// Whether `p` lies inside or on the box.
    #[must_use]
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        (0..3).all(|a| self.min[a] <= p[a] && p[a] <= self.max[a])
    }

    /// Side lengths.
    #[must_use]
    pub fn extents(&self) -> Vector3<f64> {
        self.max - self.min
    }

    /// The middle.
    #[must_use]
    pub fn centre(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// Distance from `p` to the box; 0 inside.
    #[must_use]
    pub fn distance(&self, p: &Point3<f64>) -> f64 {
        let d = (self.min - p).sup(&(p - self.max)).sup(&Vector3::zeros());
        d.norm()
    }

    /// How far the box reaches along a direction: the most that any of its points has of it.
    #[must_use]
    pub fn support(&self, direction: &Vector3<f64>) -> f64 {
        (0..3).map(|a| (direction[a] * self.min[a]).max(direction[a] * self.max[a])).sum()
    }

    /// How far the box has to go along a unit vector until it has left another one for good (both in units of
    /// the planning frame): 0 if it has, infinity if it stays beside it.
    #[must_use]
    pub fn way_past(&self, standing: &Self, direction: &Vector3<f64>) -> f64 {
        let along = |a: usize| match direction[a] {
            d if d > STEEP => (standing.max[a] - self.min[a]) / d,
            d if d < -STEEP => (standing.min[a] - self.max[a]) / d,
            _ => f64::INFINITY,
        };
        // A little further, so that nothing is lost to rounding.
        ((0..3).map(along).fold(f64::INFINITY, f64::min) + CLEAR).max(0.0)
    }

    /// A box that holds this one after `pose` (tight for the eight corners).
    #[must_use]
    pub fn transformed(&self, pose: &Pose) -> Self {
        let half = self.extents() / 2.0;
        let r = pose.rotation.to_rotation_matrix();
        let reach = r.matrix().abs() * half;
        let c = pose * self.centre();
        Self { min: c - reach, max: c + reach }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_reaches_as_far_as_its_furthest_corner() {
        let b = Bounds { min: Point3::new(-1.0, 2.0, 0.0), max: Point3::new(1.0, 3.0, 4.0) };
        assert_eq!((b.support(&Vector3::y()), b.support(&-Vector3::y())), (3.0, -2.0));
        assert_eq!(b.support(&Vector3::new(1.0, -1.0, 0.5)), 1.0 - 2.0 + 2.0);
    }

    #[test]
    fn a_turned_box_holds_its_corners() {
        let b = Bounds { min: Point3::new(-1.0, -2.0, 0.0), max: Point3::new(1.0, 3.0, 4.0) };
        let pose = Pose::new(Vector3::new(5.0, 0.0, -1.0), Vector3::new(0.3, -0.8, 1.1));
        let t = b.transformed(&pose).grown(1e-12);
        for i in 0..8 {
            let corner = Point3::new(
                if i & 1 == 0 { b.min.x } else { b.max.x },
                if i & 2 == 0 { b.min.y } else { b.max.y },
                if i & 4 == 0 { b.min.z } else { b.max.z },
            );
            assert!(t.contains(&(pose * corner)));
        }
    }
}
