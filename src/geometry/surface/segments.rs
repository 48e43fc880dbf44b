//! Where segments meet a surface.

use nalgebra::{Point3, Vector3};

use super::super::triangle::crossing;
use super::Surface;

impl Surface {
    /// Whether the segment from `p` along the unit vector `direction` crosses a triangle from its
    /// outer side, at more than a grazing angle (`steepness`: sine of the angle). The border of a
    /// triangle belongs to it.
    #[must_use]
    pub fn is_entered_along(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        steepness: f64,
    ) -> bool {
        self.tree().any_along(p, direction, length, |t| {
            let against = -self.face_normal(t).dot(direction);
            against > steepness
                && crossing(p, direction, &self.corners(t)).is_some_and(|at| (0.0..=length).contains(&at))
        })
    }

    /// Where that segment first crosses one, in units from `p`.
    #[must_use]
    pub fn entered_along(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        steepness: f64,
    ) -> Option<f64> {
        let mut first: Option<f64> = None;
        self.tree().any_along(p, direction, length, |t| {
            if -self.face_normal(t).dot(direction) > steepness {
                let at = crossing(p, direction, &self.corners(t));
                first = at.filter(|at| (0.0..=first.unwrap_or(length)).contains(at)).or(first);
            }
            false
        });
        first
    }

    /// The longest stretch of the segment of `length` from `p` along the unit vector `direction` that lies
    /// inside; faces met at less than a grazing angle (`steepness`: sine of the angle) are no ends of it.
    #[must_use]
    pub fn longest_inside_along(
        &self,
        p: &Point3<f64>,
        direction: &Vector3<f64>,
        length: f64,
        steepness: f64,
    ) -> f64 {
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
        let mut longest: f64 = 0.0;
        for (at, enters) in crossings {
            match (enters, entered) {
                (true, None) => entered = Some(at),
                (false, Some(from)) => {
                    longest = longest.max(at - from);
                    entered = None;
                }
                _ => {}
            }
        }
        entered.map_or(longest, |from| longest.max(length - from))
    }
}
