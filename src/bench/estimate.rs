//! How long the rest will take, from what like runs took.

use std::collections::BTreeMap;
use std::time::Duration;

use super::corpus::Category;

/// Runs that take about as long as each other.
type Kind = (Category, String, String);

/// Counts what is left and what the rest took, per kind.
#[derive(Debug, Default)]
pub(super) struct Estimate {
    left: BTreeMap<Kind, usize>,
    took: BTreeMap<Kind, Mean>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(self, other: Self) -> Self {
        Self { sum: self.sum + other.sum, count: self.count + other.count }
    }

    fn value(self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }
}

impl Estimate {
    /// A run is to be done.
    pub(super) fn expect(&mut self, category: Category, planner: &str, engine: &str) {
        *self.left.entry((category, planner.to_owned(), engine.to_owned())).or_default() += 1;
    }

    /// A run that had been expected is done.
    pub(super) fn done(&mut self, category: Category, planner: &str, engine: &str) {
        let kind = (category, planner.to_owned(), engine.to_owned());
        if let Some(left) = self.left.get_mut(&kind) {
            *left = left.saturating_sub(1);
        }
    }

    /// A run, now or before an interruption, took so long.
    pub(super) fn took(&mut self, category: Category, planner: &str, engine: &str, seconds: f64) {
        let mean = self.took.entry((category, planner.to_owned(), engine.to_owned())).or_default();
        *mean = mean.add(Mean { sum: seconds, count: 1 });
    }

    /// What is left at one run at a time; unknown until something has run.
    pub(super) fn left(&self) -> Option<Duration> {
        let open = self.left.iter().filter(|(_, count)| **count > 0);
        let seconds: Option<f64> = open.map(|(kind, count)| Some(self.each(kind)? * *count as f64)).sum();
        Duration::try_from_secs_f64(seconds?).ok()
    }

    /// From runs of the same kind, else of the same size, else from all.
    fn each(&self, kind: &Kind) -> Option<f64> {
        let over = |like: &dyn Fn(&Kind) -> bool| {
            let means = self.took.iter().filter(|(k, _)| like(k)).map(|(_, mean)| *mean);
            means.fold(Mean::default(), Mean::add).value()
        };
        over(&|k| k == kind).or_else(|| over(&|k| k.0 == kind.0)).or_else(|| over(&|_| true))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn like_runs_count_first() {
        let mut estimate = Estimate::default();
        for planner in ["a", "a", "b"] {
            estimate.expect(Category::Small, planner, "e");
        }
        estimate.expect(Category::Large, "a", "e");
        assert_eq!(estimate.left(), None);
        estimate.done(Category::Small, "a", "e");
        estimate.took(Category::Small, "a", "e", 3.0);
        // One of `a` at 3, one of `b` and the large one as the only run so far.
        assert_eq!(estimate.left(), Some(Duration::from_secs(9)));
        estimate.took(Category::Large, "b", "e", 93.0);
        assert_eq!(estimate.left(), Some(Duration::from_secs(3 + 3 + 93)));
        estimate.took(Category::Small, "b", "e", 5.0);
        assert_eq!(estimate.left(), Some(Duration::from_secs(3 + 5 + 93)));
    }
}
