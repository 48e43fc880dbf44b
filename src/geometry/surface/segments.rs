//! Where segments meet a surface.

use nalgebra::{Point3, Vector3};

use super::super::triangle::{crossing, met_by_edge};
use super::Surface;

/// From which sides a face stops what meets it.
#[derive(Clone, Copy)]
enum Sides {
    Outer,
    Both,
}

impl Sides {
    fn of(surface: &Surface) -> Self {
        if surface.is_wall() { Self::Both } else { Self::Outer }
    }

    /// The sine of the angle at which a unit vector meets a face from a side that stops it.
    fn against(self, normal: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
        let against = -normal.dot(direction);
        match self {
            Self::Outer => against,
            Self::Both => against.abs(),
        }
    }
}

impl Surface {
    /// How far a point gets from `p` along the unit vector `direction`, up to `length`, until it is deeper than
    /// `sunk` below a triangle that it met from its outer side (of a wall, from either side), at more than a grazing
    /// angle (`steepness`: sine of the angle); none where it gets there. The border of a triangle belongs to it.
    #[must_use]
    pub fn met_by_point(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        [steepness, sunk]: [f64; 2],
    ) -> Option<f64> {
        let mut first = First { within: length, at: None };
        let sides = Sides::of(self);
        self.tree().any_along(p, direction, length, |t| {
            let against = sides.against(&self.face_normal(t), direction);
            if against > steepness {
                let met = crossing(p, direction, &self.corners(t)).filter(|at| *at >= 0.0);
                first.take(met.map(|at| at + sunk / against));
            }
            false
        });
        first.at
    }

    /// The same of an edge `[a, b]`; one that is through a triangle already meets it at once.
    #[must_use]
    pub fn met_by_edge(
        &self,
        edge: &[Point3<f64>; 2],
        direction: &Vector3<f64>,
        length: f64,
        [steepness, sunk]: [f64; 2],
    ) -> Option<f64> {
        let mut first = First { within: length, at: None };
        let sides = Sides::of(self);
        self.tree().any_swept(edge, direction, length, |t| {
            let normal = self.face_normal(t);
            let against = sides.against(&normal, direction);
            if against > steepness {
                let met = met_by_edge(edge, direction, &self.corners(t), &normal);
                first.take(met.map(|at| at + sunk / against));
            }
            false
        });
        first.at
    }

    /// The begin and end, as lengths from `p`, of the longest stretch inside that the segment of `length` from `p` along
    /// the unit vector `direction` has; faces met at less than a grazing angle (`steepness`: sine of the angle) are no
    /// ends of it. `None` if it has none.
    #[must_use]
    pub fn inside_along(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        steepness: f64,
    ) -> Option<[f64; 2]> {
        let mut crossings: Vec<(f64, bool)> = Vec::new();
        self.tree().any_along(p, direction, length, |t| {
            let against = -self.face_normal(t).dot(direction);
            let at = crossing(p, direction, &self.corners(t)).filter(|at| (0.0..=length).contains(at));
            crossings.extend(at.filter(|_| against.abs() > steepness).map(|at| (at, against > 0.0)));
            false
        });
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        // What is left first was entered before.
        let mut entered = crossings.first().and_then(|(_, enters)| (!enters).then_some(0.0));
        let mut longest: Option<[f64; 2]> = None;
        let mut add = |from: f64, to: f64| {
            if longest.is_none_or(|[a, b]| b - a < to - from) {
                longest = Some([from, to]);
            }
        };
        for (at, enters) in crossings {
            match (enters, entered) {
                (true, None) => entered = Some(at),
                (false, Some(from)) => {
                    add(from, at);
                    entered = None;
                }
                _ => {}
            }
        }
        if let Some(from) = entered {
            add(from, length);
        }
        longest
    }
}

/// The first of some places along a segment.
struct First {
    /// No further than this.
    within: f64,
    at: Option<f64>,
}

impl First {
    fn take(&mut self, at: Option<f64>) {
        if let Some(at) = at.filter(|at| *at <= self.within) {
            (self.within, self.at) = (at, Some(at));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cuboid, moved, surface};
    use crate::geometry::Pose;

    /// A box on [-1, 1]³, turned about y by an angle: its left side faces up a little.
    fn turned_box(angle: f64) -> Surface {
        surface(moved(cuboid([-1.0; 3], [1.0; 3]), &Pose::rotation(Vector3::y() * angle)))
    }

    #[test]
    fn points_and_edges_meet_the_first_face_that_they_get_below() {
        let target = turned_box(0.0);
        let up = Vector3::z();
        let sunk = 1e-3;
        let point =
            |x: f64, length: f64| target.met_by_point(&Point3::new(x, 0.2, -3.0), &up, length, [1e-3, sunk]);
        assert_eq!((point(0.3, 5.0), point(0.3, 1.5), point(1.3, 5.0)), (Some(2.0 + sunk), None, None));
        // Its ends are beside the box, and one of them is lower.
        let edge = [Point3::new(-2.0, 0.2, -3.0), Point3::new(2.0, 0.2, -2.0)];
        let met = target.met_by_edge(&edge, &up, 5.0, [1e-3, sunk]);
        assert!(met.is_some_and(|at| (at - (1.25 + sunk)).abs() < 1e-8), "{met:?}");
        assert_eq!(target.met_by_edge(&edge, &up, 1.2, [1e-3, sunk]), None);
        assert_eq!(
            target.met_by_edge(&edge, &-up, 5.0, [1e-3, sunk]),
            None,
            "the upper side is not met from below"
        );
    }

    #[test]
    fn an_edge_through_a_face_meets_it_at_once_and_one_hardly_askew_after_it_got_as_deep() {
        let sunk = 1e-4;
        // From within the box to its left, where it is.
        let edge = [Point3::new(-1.2, 0.1, 0.1), Point3::new(-0.8, 0.3, 0.1)];
        for slope in [2e-3, 0.1, 0.5f64] {
            let target = turned_box(slope);
            for (along, against) in [(-Vector3::z(), slope.sin()), (Vector3::x(), slope.cos())] {
                let met = |length: f64| target.met_by_edge(&edge, &along, length, [1e-3, sunk]);
                let at = sunk / against;
                assert!(
                    met(1.01 * at).is_some_and(|met| (met - at).abs() < 1e-6 * at),
                    "{slope}: {:?}",
                    met(1.0)
                );
                assert_eq!(met(0.99 * at), None);
            }
        }
    }
}
