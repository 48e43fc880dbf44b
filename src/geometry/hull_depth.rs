//! How deep the hull of some points may get into a surface, told by a few of its triangles.
//!
//! A point is no deeper than it is far from any triangle. These distances are convex functions, and so are
//! their mixtures, which are largest at a corner of the hull. So the least such mixture bounds the depth of
//! all of the hull, wherever in it the surface is: also halfway between two faces, which no convex
//! region outside ([`FreeRegion`](super::FreeRegion)) tells. For planes it is the depth (von Neumann's
//! minimax). No sign is asked for: it holds for surfaces with holes, too.

use nalgebra::Point3;

use super::Surface;

/// So many triangles are mixed at most.
const ROUNDS: usize = 6;
/// Halvings by which a share is looked for; any is a bound.
const HALVINGS: usize = 20;
/// A triangle that lowers the bound by no more than this share is the last.
const VAIN: f64 = 1e-2;

/// How deep a hull gets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HullDepth {
    /// No point of it gets deeper.
    pub bound: f64,
    /// Which of its corners is as deep as that, as far as could be told.
    pub worst: usize,
}

impl Surface {
    /// A bound of the depth of the hull of some points, no closer than needed to tell that it is at most
    /// `enough`. `nearest` is a triangle near them. None for no points.
    #[must_use]
    pub fn hull_depth(&self, points: &[Point3<f64>], nearest: u32, enough: f64) -> Option<HullDepth> {
        let mut mixture = Vec::with_capacity(points.len());
        mixture.extend(points.iter().map(|p| self.closest_on(nearest, p).distance));
        let mut found = largest(mixture.iter().copied())?;
        let mut distances = Vec::with_capacity(points.len());
        for _ in 0..ROUNDS {
            if found.bound <= enough {
                break;
            }
            let triangle = self.closest_from(&points[found.worst], nearest).triangle;
            distances.clear();
            distances.extend(points.iter().map(|p| self.closest_on(triangle, p).distance));
            let share = best_share(&mixture, &distances);
            mixture.iter_mut().zip(&distances).for_each(|(m, d)| *m += (d - *m) * share);
            let last = std::mem::replace(&mut found, largest(mixture.iter().copied())?);
            if found.bound >= last.bound * (1.0 - VAIN) {
                break;
            }
        }
        Some(found)
    }
}

/// The share of `b` in a mixture with `a` whose largest element is smallest: the least point of the upper
/// envelope of lines, by bisection.
fn best_share(a: &[f64], b: &[f64]) -> f64 {
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..HALVINGS {
        let share = (low + high) / 2.0;
        let lines = a.iter().zip(b);
        let Some(top) = largest(lines.map(|(a, b)| a + (b - a) * share)) else { return low };
        *if b[top.worst] < a[top.worst] { &mut low } else { &mut high } = share;
    }
    low
}

fn largest(values: impl Iterator<Item = f64>) -> Option<HullDepth> {
    let all = values.enumerate().map(|(worst, bound)| HullDepth { bound, worst });
    all.reduce(|most, next| if next.bound > most.bound { next } else { most })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::fixtures::{ball, cuboid, open_box, spread, surface, tube};

    fn bound(surface: &Surface, points: &[Point3<f64>], enough: f64) -> f64 {
        surface.hull_depth(points, 0, enough).unwrap().bound
    }

    #[test]
    fn a_sheet_halfway_between_two_faces_is_as_deep_as_half_the_way() {
        let plate = surface(cuboid([-10.0, -10.0, -0.5], [10.0, 10.0, 0.5]));
        // It lies askew, each half of it nearer to another face, and off the faces' diagonals.
        let sheet = [[-2.0, -7.0, -0.1], [2.0, -7.0, 0.1], [2.0, -5.0, 0.1], [-2.0, -5.0, -0.1]];
        let depth = bound(&plate, &sheet.map(Point3::from), 0.0);
        assert!((0.5..0.501).contains(&depth), "{depth}");
        assert!(surface(cuboid([-10.0; 3], [10.0; 3])).hull_depth(&[], 0, 0.0).is_none());
    }

    #[test]
    fn no_more_is_looked_at_than_is_asked_for() {
        let plate = surface(cuboid([0.0; 3], [10.0; 3]));
        let points = [Point3::new(1.0, 5.0, 5.0), Point3::new(2.0, 5.0, 5.0)];
        assert!((2.0..8.0).contains(&bound(&plate, &points, 8.0)));
        assert!((2.0..2.1).contains(&bound(&plate, &points, 0.0)));
    }

    proptest! {
        #[test]
        fn nothing_in_the_hull_is_deeper(
            corners in prop::collection::vec(prop::array::uniform3(-1.5..1.5f64), 1..7),
            shares in prop::collection::vec(prop::collection::vec(0.0..1.0f64, 7), 40),
        ) {
            let points: Vec<_> = corners.iter().map(|p| Point3::from(*p)).collect();
            for mesh in [ball(2), tube(0.5, 1.0, [-1.0, 1.0], 12), open_box([-1.0; 3], [1.0; 3])] {
                let surface = surface(mesh);
                for enough in [0.0, 0.3] {
                    let depth = bound(&surface, &points, enough);
                    for shares in &shares {
                        let all: f64 = shares[..points.len()].iter().sum();
                        let terms = points.iter().zip(shares);
                        let inside = Point3::from(terms.map(|(p, s)| p.coords * (s / all)).sum::<nalgebra::Vector3<f64>>());
                        prop_assert!(-surface.signed_distance(&inside) <= depth + 1e-12);
                    }
                }
            }
        }
    }

    #[test]
    fn a_small_hull_in_a_corner_of_three_faces_is_told_closely() {
        let block = surface(cuboid([0.0; 3], [10.0; 3]));
        let points: Vec<_> = spread([1.0; 3], [1.2; 3], 20).collect();
        let deepest = points.iter().map(|p| p.coords.min()).fold(0.0, f64::max);
        let depth = bound(&block, &points, 0.0);
        assert!((deepest..1.2).contains(&depth), "{depth} of {deepest}");
    }
}
