//! Slopes of an energy that has several at a point, because cells of the field meet there.
//!
//! A direction leads down at such a point if it does so for each of the slopes. The steepest one
//! is opposite to the shortest vector between them all, in the metric of a Newton step; where that
//! vector vanishes, the point is a minimum (C. Lemaréchal 1975). It is found exactly, by P. Wolfe's
//! method (1976).

use nalgebra::{Cholesky, Matrix6, SMatrix, SVector, U6, Vector6};

use crate::budgets::SLOPES_PER_POINT;

/// Relative to squared lengths, what counts as no difference.
const EQUAL: f64 = 1e-13;

/// The metric of a Newton step.
pub(super) struct Metric(Cholesky<f64, U6>);

impl Metric {
    /// The metric of a matrix; `None` unless it is positive.
    pub(super) fn new(matrix: Matrix6<f64>) -> Option<Self> {
        Cholesky::new(matrix).map(Self)
    }

    /// Coordinates of a slope in which the metric is that of plain lengths.
    pub(super) fn scaled(&self, slope: &Vector6<f64>) -> Vector6<f64> {
        let mut out = *slope;
        self.0.l_dirty().solve_lower_triangular_mut(&mut out);
        out
    }

    /// The Newton step up a scaled slope: matrix⁻¹ times the slope itself.
    pub(super) fn step(&self, scaled: &Vector6<f64>) -> Vector6<f64> {
        let mut out = *scaled;
        self.0.l_dirty().tr_solve_lower_triangular_mut(&mut out);
        out
    }
}

/// A few scaled slopes.
pub(super) struct Slopes {
    list: [Vector6<f64>; SLOPES_PER_POINT],
    count: usize,
}

/// Shares of slopes; 0 for those that have none.
type Shares = [f64; SLOPES_PER_POINT];

impl Slopes {
    pub(super) fn new(first: Vector6<f64>) -> Self {
        let mut list = [Vector6::zeros(); SLOPES_PER_POINT];
        list[0] = first;
        Self { list, count: 1 }
    }

    /// Keeps another one; false if there is no room.
    pub(super) fn add(&mut self, slope: Vector6<f64>) -> bool {
        let has_room = self.count < SLOPES_PER_POINT;
        if has_room {
            self.list[self.count] = slope;
            self.count += 1;
        }
        has_room
    }

    /// The shortest vector of their convex hull.
    pub(super) fn least(&self) -> Vector6<f64> {
        let all = &self.list[..self.count];
        let shortest =
            (1..all.len()).fold(0, |b, i| if all[i].norm_squared() < all[b].norm_squared() { i } else { b });
        let mut shares = [0.0; SLOPES_PER_POINT];
        shares[shortest] = 1.0;
        let mut active = [false; SLOPES_PER_POINT];
        active[shortest] = true;
        let mut x = all[shortest];
        // Each round ends at a shorter vector than the one before.
        for _ in 0..4 * SLOPES_PER_POINT {
            let along = |i: usize| x.dot(&all[i]);
            let next = (1..all.len()).fold(0, |b, i| if along(i) < along(b) { i } else { b });
            let largest = all.iter().map(Vector6::norm_squared).fold(0.0, f64::max);
            if active[next] || along(next) >= x.norm_squared() - EQUAL * largest {
                break;
            }
            active[next] = true;
            if !self.settle(&mut shares, &mut active) {
                break;
            }
            x = self.mixed(&shares);
        }
        x
    }

    fn mixed(&self, shares: &Shares) -> Vector6<f64> {
        self.list.iter().zip(shares).map(|(slope, share)| slope * *share).sum()
    }

    /// Moves the shares to the shortest vector of the active slopes' hull, leaving out those that
    /// it does not need. False if they are too much alike to tell.
    fn settle(&self, shares: &mut Shares, active: &mut [bool; SLOPES_PER_POINT]) -> bool {
        for _ in 0..SLOPES_PER_POINT {
            let Some(wanted) = self.shortest_of_plane(active) else { return false };
            let negative = |i: &usize| active[*i] && wanted[*i] <= 0.0;
            let Some(way) = (0..SLOPES_PER_POINT)
                .filter(negative)
                .map(|i| shares[i] / (shares[i] - wanted[i]).max(f64::MIN_POSITIVE))
                .reduce(f64::min)
            else {
                *shares = wanted;
                return true;
            };
            for i in 0..SLOPES_PER_POINT {
                shares[i] += way * (wanted[i] - shares[i]);
                if shares[i] <= EQUAL {
                    shares[i] = 0.0;
                    active[i] = false;
                }
            }
        }
        true
    }

    /// The shares of the shortest vector of the plane through the active slopes.
    fn shortest_of_plane(&self, active: &[bool; SLOPES_PER_POINT]) -> Option<Shares> {
        let size = (0..SLOPES_PER_POINT)
            .filter(|i| active[*i])
            .map(|i| self.list[i].norm_squared())
            .fold(0.0, f64::max);
        let gram = SMatrix::<f64, SLOPES_PER_POINT, SLOPES_PER_POINT>::from_fn(|i, j| {
            match (active[i] && active[j], i == j) {
                (true, _) => self.list[i].dot(&self.list[j]) / size + 1.0,
                (false, same) => f64::from(u8::from(same)),
            }
        });
        let ones = SVector::<f64, SLOPES_PER_POINT>::from_fn(|i, _| f64::from(u8::from(active[i])));
        let shares = Cholesky::new(gram)?.solve(&ones);
        let sum = shares.sum();
        (sum > 0.0 && sum.is_finite()).then(|| std::array::from_fn(|i| shares[i] / sum))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::spread;

    /// Some slopes around a point at a distance from zero.
    fn slopes(count: usize, seed: usize, distance: f64) -> Slopes {
        let halves: Vec<_> = spread([-1.0; 3], [1.0; 3], seed + 2 * count).skip(seed).collect();
        let slope = |i: usize| {
            let (a, b) = (halves[2 * i], halves[2 * i + 1]);
            Vector6::new(a.x + distance, a.y, a.z, b.x, b.y, b.z)
        };
        let mut out = Slopes::new(slope(0));
        for i in 1..count {
            assert!(out.add(slope(i)));
        }
        out
    }

    #[test]
    fn the_shortest_vector_makes_no_slope_longer_to_follow() {
        for (count, seed) in (1..=SLOPES_PER_POINT).flat_map(|c| (0..60).map(move |s| (c, 7 * s))) {
            for distance in [0.0, 0.7, 3.0] {
                let slopes = slopes(count, seed, distance);
                let x = slopes.least();
                // Optimal exactly if no slope is less along it than it is itself.
                for slope in &slopes.list[..count] {
                    let along = x.dot(slope) - x.norm_squared();
                    assert!(along > -1e-9, "{along} with {count} slopes, seed {seed}");
                }
            }
        }
    }

    #[test]
    fn slopes_on_all_sides_cancel() {
        let unit = |a: usize, s: f64| Vector6::from_fn(|i, _| if i == a { s } else { 0.0 });
        let mut slopes = Slopes::new(unit(0, 1e4));
        for (a, s) in [(1, 1e4), (2, 3.0), (0, -2e4), (1, -1.0), (2, -50.0), (0, 1e4)] {
            slopes.add(unit(a, s));
        }
        assert!(slopes.least().norm() < 1e-8, "{}", slopes.least());
        assert!(slopes.add(unit(3, 1.0)) && !slopes.add(unit(4, 1.0)));
    }

    #[test]
    fn a_metric_scales_slopes_so_that_steps_are_those_of_newton() {
        let half = Matrix6::from_fn(|i, j| if i == j { 2.0 } else { 0.1 * (i + 2 * j) as f64 });
        let matrix = half * half.transpose();
        let metric = Metric::new(matrix).unwrap();
        let slope = Vector6::new(1.0, -2.0, 0.5, 3.0, 0.1, -0.4);
        let step = metric.step(&metric.scaled(&slope));
        assert!((matrix * step - slope).norm() < 1e-9);
        assert!((metric.scaled(&slope).norm_squared() - slope.dot(&step)).abs() < 1e-9);
        assert!(Metric::new(-matrix).is_none());
    }
}
