//! Distances from an axis at which a surface has points.

use smallvec::SmallVec;

/// Disjoint ranges, ascending, none nearer to the next than the joint with which they were added.
#[derive(Debug, Clone, Default)]
pub(super) struct Distances(SmallVec<[[f64; 2]; 2]>);

impl Distances {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds a range, unless it is empty, and joins what is no further from it than `joint`. In which order ranges are
    /// added makes no difference.
    pub(super) fn add(&mut self, [near, far]: [f64; 2], joint: f64) {
        if near > far {
            return;
        }
        let first = self.0.iter().take_while(|range| range[1] + joint < near).count();
        let joined = self.0[first..].iter().take_while(|range| range[0] - joint <= far).count();
        if joined == 0 {
            self.0.insert(first, [near, far]);
            return;
        }
        let last = self.0[first + joined - 1];
        self.0[first] = [self.0[first][0].min(near), last[1].max(far)];
        self.0.drain(first + 1..first + joined);
    }

    pub(super) fn add_all(&mut self, other: &Self, joint: f64) {
        other.0.iter().for_each(|range| self.add(*range, joint));
    }

    /// The least and the largest, if there are any.
    pub(super) fn ends(&self) -> impl Iterator<Item = f64> {
        [self.0.first().map(|range| range[0]), self.0.last().map(|range| range[1])].into_iter().flatten()
    }

    /// The least difference between one of these and one of others, negative if ranges overlap; infinite if there are
    /// none.
    pub(super) fn gap(&self, other: &Self) -> f64 {
        let between = |a: &[f64; 2], b: &[f64; 2]| (b[0] - a[1]).max(a[0] - b[1]);
        let pairs = self.0.iter().flat_map(|a| other.0.iter().map(move |b| between(a, b)));
        pairs.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_gap_is_that_of_the_nearest_ranges() {
        let distances = |ranges: &[[f64; 2]]| {
            let mut all = Distances::default();
            ranges.iter().for_each(|range| all.add(*range, 0.0));
            all
        };
        let tunnel = distances(&[[1.0, 1.1], [3.0, 3.1]]);
        let gap = |range: [f64; 2]| tunnel.gap(&distances(&[range]));
        assert!((gap([1.4, 2.8]) - 0.2).abs() < 1e-12 && (gap([3.5, 4.0]) - 0.4).abs() < 1e-12);
        assert!(gap([1.05, 2.0]) < 0.0 && gap([0.0, 5.0]) < 0.0);
        assert_eq!(tunnel.gap(&Distances::default()), f64::INFINITY);
    }

    proptest! {
        #[test]
        fn the_order_makes_no_difference(
            ranges in proptest::collection::vec((0.0..10.0f64, 0.0..1.0f64), 1..12),
            joint in 0.0..0.5f64,
            turn in 0..12usize,
        ) {
            let all = |order: &[(f64, f64)]| {
                let mut all = Distances::default();
                order.iter().for_each(|(near, size)| all.add([*near, near + size], joint));
                all.0
            };
            let mut turned = ranges.clone();
            turned.rotate_left(turn % ranges.len());
            let found = all(&ranges);
            prop_assert_eq!(&found, &all(&turned));
            prop_assert!(found.windows(2).all(|pair| pair[0][1] + joint < pair[1][0]));
            for (near, size) in &ranges {
                prop_assert!(found.iter().any(|range| range[0] <= *near && near + size <= range[1]));
            }
        }
    }
}
