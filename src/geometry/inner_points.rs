//! Points of a surface spread evenly over its area, and points well inside the solid that it encloses.
//!
//! A point inside is the centre of a ball that touches the surface from inside at a given point: the ball is shrunk until
//! no surface is in it (J. Ma, S. W. Bae and S. Choi 2012). So the centre is as deep as the ball's radius.

use nalgebra::{Point3, Vector3};

use super::Surface;
use super::surface::NO_TRIANGLE;
use super::triangle::area_normal;
use crate::budgets::BALL_SHRINKS;
use crate::tolerances::BALL_TOUCHES;

/// A point of a surface with the unit normal of its triangle.
pub type SurfacePoint = (Point3<f64>, Vector3<f64>);

impl Surface {
    /// Twice the area of a triangle.
    fn double_area_of(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.corners(triangle);
        area_normal(&a, &b, &c).norm()
    }

    /// The area of the surface.
    #[must_use]
    pub fn area(&self) -> f64 {
        (0..self.triangles().len() as u32).map(|t| self.double_area_of(t)).sum::<f64>() / 2.0
    }

    /// `count` points of the surface. Each stands for the same area, whatever the triangles are. A surface without area
    /// has none.
    pub fn spread_points(&self, count: usize) -> impl Iterator<Item = SurfacePoint> + '_ {
        // The R2 sequence (M. Roberts 2018) places the points within their triangles.
        const STEPS: [f64; 2] = [0.754_877_666_246_692_7, 0.569_840_290_998_053_2];
        let (triangles, total) = (self.triangles().len() as u32, 2.0 * self.area());
        let count = if total > 0.0 { count } else { 0 };
        let (mut next, mut passed) = (0, 0.0);
        (0..count).map(move |k| {
            let wanted = (k as f64 + 0.5) / count as f64 * total;
            while passed < wanted && next < triangles {
                passed += self.double_area_of(next);
                next += 1;
            }
            let triangle = next.saturating_sub(1);
            let [u, v] = STEPS.map(|step| ((k + 1) as f64 * step).fract());
            let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
            let [a, b, c] = self.corners(triangle);
            (a + (b - a) * u + (c - a) * v, self.face_normal(triangle))
        })
    }

    /// The centre of the largest ball that touches the surface at a point of it from inside. None where the
    /// solid is too thin for such a ball, or the signed distance says that its centre is outside.
    #[must_use]
    pub fn inner_point(&self, (p, normal): &SurfacePoint) -> Option<Point3<f64>> {
        // No ball in the solid is larger than this one.
        let mut radius = self.bounds().extents().norm() / 2.0;
        for _ in 0..BALL_SHRINKS {
            let centre = p - normal * radius;
            let near = self.closest(&centre, radius * (1.0 - BALL_TOUCHES));
            let Some(near) = near else {
                return (self.signed_distance(&centre) < 0.0).then_some(centre);
            };
            let chord = near.point - p;
            let inward = -chord.dot(normal);
            if inward <= 0.0 {
                return None;
            }
            radius = chord.norm_squared() / (2.0 * inward);
        }
        None
    }

    /// A point inside for each connected piece of the surface, as far as there is one: below the piece's largest
    /// triangle.
    #[must_use]
    pub(super) fn inner_points(&self) -> Vec<Point3<f64>> {
        let largest = self.largest_of_pieces();
        let below = |t: u32| {
            let [a, b, c] = self.corners(t);
            let middle = Point3::from((a.coords + b.coords + c.coords) / 3.0);
            self.inner_point(&(middle, self.face_normal(t)))
        };
        largest.into_iter().filter_map(below).collect()
    }

    /// The largest triangle of each connected piece.
    fn largest_of_pieces(&self) -> Vec<u32> {
        let mut seen = vec![false; self.triangles().len()];
        let mut largest = Vec::new();
        let mut open = Vec::new();
        for first in 0..self.triangles().len() as u32 {
            if std::mem::replace(&mut seen[first as usize], true) {
                continue;
            }
            let (mut best, mut best_area) = (first, self.double_area_of(first));
            open.push(first);
            while let Some(t) = open.pop() {
                let area = self.double_area_of(t);
                if area > best_area {
                    (best, best_area) = (t, area);
                }
                for other in (0..3).map(|e| self.neighbour(t, e)).filter(|t| *t != NO_TRIANGLE) {
                    if !std::mem::replace(&mut seen[other as usize], true) {
                        open.push(other);
                    }
                }
            }
            largest.push(best);
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{ball, cuboid, joined, l_shape, open_box, surface, tube};

    #[test]
    fn spread_points_lie_on_the_surface_and_each_stands_for_the_same_area() {
        let s = surface(cuboid([0.0; 3], [1.0, 2.0, 4.0]));
        let points: Vec<_> = s.spread_points(2800).collect();
        assert_eq!(points.len(), 2800);
        for (p, normal) in &points {
            assert!(s.signed_distance(p).abs() < 1e-12 && s.signed_distance(&(p - normal * 0.01)) < 0.0);
        }
        // The sides of 2 by 4 have 16 of the 28 units of area.
        let on_sides = points.iter().filter(|(_, n)| n.x.abs() > 0.9).count();
        assert!(on_sides.abs_diff(1600) <= 4, "{on_sides}");
    }

    #[test]
    fn an_inner_point_is_as_deep_as_its_ball_is_large() {
        for mesh in [cuboid([0.0; 3], [3.0, 2.0, 1.0]), ball(3), l_shape(), tube(1.0, 1.2, [0.0, 3.0], 48)] {
            let s = surface(mesh);
            let mut found = 0;
            for at in s.spread_points(200) {
                if let Some(p) = s.inner_point(&at) {
                    let (depth, radius) = (-s.signed_distance(&p), (p - at.0).norm());
                    assert!(depth > 0.0 && (depth - radius).abs() < 1e-6 * radius, "{depth} for {radius}");
                    found += 1;
                }
            }
            assert!(found > 190, "{found}");
        }
        let plate = surface(cuboid([0.0; 3], [8.0, 8.0, 0.5]));
        let p = plate.inner_point(&(Point3::new(3.0, 4.0, 0.5), Vector3::z())).unwrap();
        assert!((p - Point3::new(3.0, 4.0, 0.25)).norm() < 1e-9, "half-way through: {p}");
    }

    #[test]
    fn each_body_of_a_mesh_has_an_inner_point() {
        let bodies = [0.0, 2.0, 4.0].map(|x| cuboid([x, 0.0, 0.0], [x + 1.0, 1.0, 1.0]));
        let s = surface(joined(bodies));
        let mut at: Vec<_> = s.inner_points().iter().map(|p| p.x.floor()).collect();
        at.sort_by(f64::total_cmp);
        assert_eq!(at, [0.0, 2.0, 4.0]);
        assert_eq!(surface(open_box([0.0; 3], [1.0; 3])).inner_points().len(), 1);
    }
}
