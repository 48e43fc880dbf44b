//! Sums of solid angles (A. van Oosterom and J. Strackee 1983).

use std::f64::consts::TAU;

use nalgebra::Point3;

/// The sum of the solid angles of triangles. Half of each is the angle of a complex number; the sum of
/// angles is that of the product, and how often it went around is counted: one arc tangent for all.
#[derive(Debug, Clone, Copy)]
pub(super) struct SolidAngle {
    re: f64,
    im: f64,
    around: f64,
}

impl Default for SolidAngle {
    fn default() -> Self {
        Self { re: 1.0, im: 0.0, around: 0.0 }
    }
}

impl SolidAngle {
    /// Adds that of a triangle as seen from `p`: positive from behind.
    pub(super) fn add_triangle(&mut self, p: &Point3<f64>, t: &[Point3<f64>; 3]) {
        let (a, b, c) = (t[0] - p, t[1] - p, t[2] - p);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        let im = a.dot(&b.cross(&c));
        self.add(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb, im);
    }

    /// Adds twice the angle of a complex number, which is between a half turn back and one forth.
    pub(super) fn add(&mut self, re: f64, im: f64) {
        let before = self.im;
        let product = [self.re * re - before * im, self.re * im + before * re];
        // Of no size: the point is a corner.
        let size = product[0].abs() + product[1].abs();
        if size == 0.0 {
            return;
        }
        (self.re, self.im) = (product[0] / size, product[1] / size);
        // Above the real axis, and turned further up, it is below only beyond the half turn.
        if before >= 0.0 && im > 0.0 && self.im < 0.0 {
            self.around += 1.0;
        } else if before < 0.0 && im < 0.0 && self.im >= 0.0 {
            self.around -= 1.0;
        }
    }

    /// The sum.
    pub(super) fn sum(&self) -> f64 {
        2.0 * (self.im.atan2(self.re) + TAU * self.around)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::spread;

    #[test]
    fn solid_angles_add_up_however_often_they_go_around() {
        let points: Vec<_> = spread([-1.0; 3], [1.0; 3], 300).collect();
        let angle = |p: &Point3<f64>, t: &[Point3<f64>; 3]| {
            let mut one = SolidAngle::default();
            one.add_triangle(p, t);
            one.sum()
        };
        for p in spread([-0.3; 3], [0.3; 3], 20) {
            for turned in [false, true] {
                let (mut all, mut expected) = (SolidAngle::default(), 0.0);
                for t in points.chunks_exact(3) {
                    let t = if turned { [t[1], t[0], t[2]] } else { [t[0], t[1], t[2]] };
                    // All the same way around, so that it goes around often.
                    let t = if (angle(&p, &t) < 0.0) == turned { t } else { [t[1], t[0], t[2]] };
                    all.add_triangle(&p, &t);
                    expected += angle(&p, &t);
                }
                assert!(expected.abs() > 4.0 * TAU && (all.sum() - expected).abs() < 1e-9, "{expected}");
            }
        }
    }
}
