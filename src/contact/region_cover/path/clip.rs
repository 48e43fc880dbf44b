//! Clipping of long hulls to the box of another surface.

use nalgebra::Point3;

use crate::geometry::Bounds;
use crate::tolerances::CLIPPED_LENGTH;

/// Points whose hull is the part of the hull of `points` between two sides of a box: those beyond which it reaches
/// furthest. Only a short stretch of a bolt's long triangles passes a thin plate; without clipping the rest would be
/// split off piece by piece. `None` if there is little to clip.
pub(super) fn clipped(points: &[Point3<f64>], bounds: &Bounds) -> Option<Vec<Point3<f64>>> {
    let all = Bounds::of(points);
    let beyond = |axis: usize| {
        (bounds.min[axis] - all.min[axis]).max(0.0) + (all.max[axis] - bounds.max[axis]).max(0.0)
    };
    let axis = (0..3).max_by(|&a, &b| beyond(a).total_cmp(&beyond(b)))?;
    let within = all.extents()[axis] - beyond(axis);
    if beyond(axis) <= CLIPPED_LENGTH * within || within < 0.0 {
        return None;
    }
    let sides = [bounds.min[axis], bounds.max[axis]];
    let is_within = |p: &&Point3<f64>| (sides[0]..=sides[1]).contains(&p[axis]);
    let mut left: Vec<_> = points.iter().filter(is_within).copied().collect();
    // The edges of the hull are among the lines between its corners.
    for (i, p) in points.iter().enumerate() {
        for q in &points[..i] {
            let crossed = sides.iter().filter(|side| (p[axis] < **side) != (q[axis] < **side));
            left.extend(crossed.map(|side| {
                let mut at = p + (q - p) * ((side - p[axis]) / (q[axis] - p[axis]));
                at[axis] = *side;
                at
            }));
        }
    }
    (!left.is_empty()).then_some(left)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::vector;

    proptest! {
        #[test]
        fn what_is_left_holds_all_that_is_in_the_box_and_no_more(
            base in prop::collection::vec(vector(1.0), 3..6),
            long in vector(9.0),
            middle in vector(1.0),
            directions in prop::collection::vec(vector(1.0), 20),
            weights in prop::collection::vec(prop::collection::vec(0.0..1.0f64, 12), 40),
        ) {
            let points: Vec<Point3<f64>> =
                base.iter().flat_map(|p| [Point3::from(*p), Point3::from(p + long)]).collect();
            let bounds = Bounds::of([&Point3::from(middle)]).grown(0.5);
            let Some(left) = clipped(&points, &bounds) else { return Ok(()) };
            let reach = |d: &Vector3<f64>, points: &[Point3<f64>]| {
                points.iter().map(|p| d.dot(&p.coords)).fold(f64::NEG_INFINITY, f64::max)
            };
            for d in &directions {
                prop_assert!(reach(d, &left) <= reach(d, &points) + 1e-9);
            }
            for weights in &weights {
                // Mostly few corners count, so that edges and faces are met.
                let weights: Vec<f64> = weights.iter().map(|w| (w - 0.5).max(0.0).powi(2)).collect();
                let sum: f64 = weights.iter().zip(&points).map(|(w, _)| w).sum();
                let inside: Vector3<f64> =
                    weights.iter().zip(&points).map(|(w, p)| p.coords * *w).sum::<Vector3<f64>>() / sum;
                if bounds.contains(&Point3::from(inside)) {
                    for d in &directions {
                        prop_assert!(d.dot(&inside) <= reach(d, &left) + 1e-9);
                    }
                }
            }
        }
    }

    #[test]
    fn a_long_needle_is_clipped_to_its_middle_and_a_short_one_left_alone() {
        let needle = [[0.0, 0.0, -9.0], [1.0, 0.0, -9.0], [0.5, 0.0, 9.0]].map(Point3::from);
        let bounds = Bounds { min: Point3::new(-1.0, -1.0, -1.0), max: Point3::new(1.0, 1.0, 1.0) };
        let left = Bounds::of(&clipped(&needle, &bounds).unwrap());
        assert_eq!((left.min.z, left.max.z), (-1.0, 1.0));
        assert_eq!(clipped(&needle.map(|p| Point3::new(p.x, p.y, p.z / 9.0)), &bounds), None);
    }
}
