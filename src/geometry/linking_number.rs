//! How often two closed curves wind through each other.
//!
//! The linking number does not change while the curves move without meeting, so two bodies whose
//! curves are linked never come apart. It is the degree of the map (s, t) ↦ direction from b(t) to
//! a(s); over two straight segments that map covers a plane parallelogram as seen from the origin,
//! whose solid angle is exact (A. van Oosterom and J. Strackee 1983).

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use crate::termination::{Interrupt, Poll};

/// The linking number of two closed polygons, which come no nearer to each other than
/// `clearance`; `None` if they do, for then it means nothing.
///
/// # Errors
/// The termination condition became true.
pub fn linking_number(
    a: &[Point3<f64>],
    b: &[Point3<f64>],
    clearance: f64,
    poll: &Poll<'_>,
) -> Result<Option<i64>, Interrupt> {
    let mut solid_angle = 0.0;
    for (a0, a1) in sides(a) {
        poll.check()?;
        for (b0, b1) in sides(b) {
            let corner = a0 - b0;
            let (along, across) = (a1 - a0, b0 - b1);
            if nearest_to_origin(&corner, &along, &across) < clearance {
                return Ok(None);
            }
            let opposite = corner + along + across;
            solid_angle += triangle(&corner, &(corner + along), &opposite)
                + triangle(&corner, &opposite, &(corner + across));
        }
    }
    let windings = solid_angle / (4.0 * PI);
    Ok(Some(windings.round() as i64))
}

fn sides(polygon: &[Point3<f64>]) -> impl Iterator<Item = (&Point3<f64>, &Point3<f64>)> {
    polygon.iter().zip(polygon.iter().cycle().skip(1))
}

/// The signed solid angle of a triangle as seen from the origin.
fn triangle(a: &Vector3<f64>, b: &Vector3<f64>, c: &Vector3<f64>) -> f64 {
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(&b.cross(c)).atan2(denominator)
}

/// The distance of the origin from the parallelogram corner + s·u + t·v, 0 ≤ s, t ≤ 1: that of the
/// two segments.
fn nearest_to_origin(corner: &Vector3<f64>, u: &Vector3<f64>, v: &Vector3<f64>) -> f64 {
    let on_side = |p: Vector3<f64>, d: &Vector3<f64>| {
        let s = if d.norm_squared() > 0.0 { (-p.dot(d) / d.norm_squared()).clamp(0.0, 1.0) } else { 0.0 };
        (p + d * s).norm()
    };
    let sides = [on_side(*corner, u), on_side(*corner, v), on_side(corner + v, u), on_side(corner + u, v)];
    let edge = sides.into_iter().fold(f64::INFINITY, f64::min);
    // Inside, where the foot of the perpendicular falls within.
    let (uu, uv, vv) = (u.dot(u), u.dot(v), v.dot(v));
    let (pu, pv) = (-corner.dot(u), -corner.dot(v));
    let determinant = uu * vv - uv * uv;
    if determinant <= 1e-12 * uu * vv {
        return edge;
    }
    let (s, t) = ((pu * vv - pv * uv) / determinant, (pv * uu - pu * uv) / determinant);
    let within = (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t);
    if within { (corner + u * s + v * t).norm().min(edge) } else { edge }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn linking_number(a: &[Point3<f64>], b: &[Point3<f64>], clearance: f64) -> Option<i64> {
        super::linking_number(a, b, clearance, &Poll::every(1, None)).unwrap()
    }

    /// A circle about `centre`, of radius 1, at right angles to an axis, run through `turns` times.
    fn circle(centre: [f64; 3], axis: Vector3<f64>, count: usize, turns: f64) -> Vec<Point3<f64>> {
        let u = axis.cross(&Vector3::new(0.3, 0.4, 0.86)).normalize();
        let v = axis.normalize().cross(&u);
        let at = |i: usize| {
            let angle = turns * 2.0 * PI * i as f64 / count as f64;
            Point3::from(centre) + u * angle.cos() + v * angle.sin()
        };
        (0..count).map(at).collect()
    }

    #[test]
    fn circles_link_once_or_not_at_all() {
        let a = circle([0.0; 3], Vector3::z(), 17, 1.0);
        let through = circle([1.0, 0.0, 0.0], Vector3::y(), 23, 1.0);
        assert_eq!(linking_number(&a, &through, 1e-3).map(i64::abs), Some(1));
        let mut backwards = through.clone();
        backwards.reverse();
        let both = [&through, &backwards].map(|b| linking_number(&a, b, 1e-3).unwrap());
        assert_eq!(both[0], -both[1]);
        for apart in [[0.0, 0.0, 0.5], [2.5, 0.0, 0.0], [0.3, 0.0, 3.0]] {
            assert_eq!(linking_number(&a, &circle(apart, Vector3::z(), 12, 1.0), 1e-3), Some(0), "{apart:?}");
        }
    }

    #[test]
    fn windings_are_counted() {
        let a = circle([0.0; 3], Vector3::z(), 17, 1.0);
        let thrice = circle([1.0, 0.0, 0.0], Vector3::y(), 70, 3.0);
        assert_eq!(linking_number(&a, &thrice, 1e-3).map(i64::abs), Some(3));
    }

    #[test]
    fn curves_that_meet_have_no_linking_number() {
        let a = circle([0.0; 3], Vector3::z(), 16, 1.0);
        assert_eq!(linking_number(&a, &a, 1e-6), None);
        let on = Point3::from((a[0].coords + a[1].coords) / 2.0);
        let b = [on, Point3::new(9.0, 0.0, 1.0), Point3::new(9.0, 0.0, -1.0)];
        assert_eq!(linking_number(&a, &b, 1e-6), None);
    }

    proptest! {
        /// The Gauss integral, summed over finely divided curves, says the same.
        #[test]
        fn it_is_the_gauss_integral(
            a in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 3..6),
            b in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 3..6),
        ) {
            let points = |list: &[[f64; 3]]| list.iter().map(|p| Point3::from(*p)).collect::<Vec<_>>();
            let (a, b) = (points(&a), points(&b));
            let Some(found) = linking_number(&a, &b, 0.2) else { return Ok(()) };
            const PIECES: usize = 40;
            let pieces = |polygon: &[Point3<f64>]| -> Vec<(Point3<f64>, Vector3<f64>)> {
                sides(polygon)
                    .flat_map(|(p, q)| {
                        let d = (q - p) / PIECES as f64;
                        (0..PIECES).map(move |i| (p + d * (i as f64 + 0.5), d))
                    })
                    .collect()
            };
            let mut sum = 0.0;
            for (p, dp) in &pieces(&a) {
                for (q, dq) in &pieces(&b) {
                    let r = p - q;
                    sum += r.dot(&dp.cross(dq)) / r.norm().powi(3);
                }
            }
            // The sign is a convention.
            prop_assert!((sum.abs() / (4.0 * PI) - found.abs() as f64).abs() < 0.1, "{sum} {found}");
        }
    }
}
