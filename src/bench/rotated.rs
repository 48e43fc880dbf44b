//! What rotating the input changes: solved problems and times of the same planner on the same
//! problems, rotated against as given.

use super::markdown::{Table, cell, number, optional, title};
use super::record::Record;
use super::statistics::{EngineResults, PlannerResults};

/// One planner's runs as given and rotated, over problems that ran both ways.
#[derive(Debug, Default, PartialEq)]
struct Comparison<'a> {
    /// Problems that ran both ways, and how many of them are solved as given.
    problems: usize,
    solved: usize,
    /// Runs of these under rotation, and how many of them solve their problem.
    rotated_runs: usize,
    rotated_solved: usize,
    /// Of each problem that is solved both ways: the median of its ratios.
    ratios: Vec<f64>,
    /// The highest ratio of all runs, and whose it is.
    worst: Option<(f64, &'a str)>,
    /// Solved as given, but not under all rotations: which, and in how many runs of how many.
    failures: Vec<(&'a str, usize, usize)>,
}

impl<'a> Comparison<'a> {
    fn of(given: &EngineResults<'a>, planner: &PlannerResults<'a>, rotated: &[EngineResults<'a>]) -> Self {
        let mut out = Self::default();
        for (problem, _) in &given.problems {
            let Some(as_given) = planner.runs.get(problem) else { continue };
            let turned = |r: &EngineResults<'a>| r.planner(planner.planner)?.runs.get(problem).copied();
            let runs: Vec<&Record> = rotated.iter().filter_map(turned).collect();
            if !runs.is_empty() {
                out.add(problem, as_given, &runs);
            }
        }
        out
    }

    fn add(&mut self, problem: &'a str, as_given: &Record, runs: &[&Record]) {
        let solved: Vec<&&Record> = runs.iter().filter(|r| r.solved()).collect();
        self.problems += 1;
        self.rotated_runs += runs.len();
        self.rotated_solved += solved.len();
        if !as_given.solved() {
            return;
        }
        self.solved += 1;
        if solved.len() < runs.len() {
            self.failures.push((problem, runs.len() - solved.len(), runs.len()));
        }
        let ratios: Vec<f64> = solved.iter().map(|r| r.wall_time_s / as_given.wall_time_s).collect();
        for &ratio in &ratios {
            if self.worst.is_none_or(|(worst, _)| ratio > worst) {
                self.worst = Some((ratio, problem));
            }
        }
        self.ratios.extend(median(&ratios));
    }
}

/// The middle of the values in order, or the mean of the two in the middle.
fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let half = sorted.len() / 2;
    let upper = *sorted.get(half)?;
    Some(if sorted.len() % 2 == 1 { upper } else { f64::midpoint(sorted[half - 1], upper) })
}

/// The report's section on rotation; empty if nothing was rotated.
pub(super) fn section(records: &[Record], given: &EngineResults<'_>) -> String {
    let most = records.iter().map(|r| r.rotation).max().unwrap_or(0);
    let rotated: Vec<_> = (1..=most).map(|number| EngineResults::of(given.engine, number, records)).collect();
    let mut table = Table::new(&[
        "",
        "Problems",
        "Solved as given",
        "Rotated runs",
        "Solved rotated",
        "Compared",
        "Median time ratio",
        "Worst",
        "",
    ]);
    let mut failures = String::new();
    for planner in &given.planners {
        let c = Comparison::of(given, planner, &rotated);
        if c.problems == 0 {
            continue;
        }
        table.row([
            title(planner.planner),
            c.problems.to_string(),
            share(c.solved, c.problems),
            c.rotated_runs.to_string(),
            share(c.rotated_solved, c.rotated_runs),
            c.ratios.len().to_string(),
            optional(median(&c.ratios), number),
            optional(c.worst, |(ratio, _)| number(ratio)),
            c.worst.map_or_else(String::new, |(_, problem)| cell(problem)),
        ]);
        for (problem, failed, runs) in c.failures {
            failures +=
                &format!("- {}: {}, {failed} of {runs} runs\n", title(planner.planner), cell(problem));
        }
    }
    if table.is_empty() {
        return String::new();
    }
    if failures.is_empty() {
        failures = "none\n".to_owned();
    }
    format!(
        "\n### Rotated\n\n{}\nOver problems that ran both ways. Time ratio: wall time of the process, rotated \
         over as given, of runs that solve the problem; of each problem its median counts, and of these the \
         median is shown; the worst is of a single run.\n\nSolved as given, but not under all rotations:\n\n\
         {failures}",
        table.render()
    )
}

fn share(part: usize, of: usize) -> String {
    format!("{part} ({:.0}%)", 100.0 * part as f64 / of as f64)
}

#[cfg(test)]
mod tests {
    use super::super::tests::record;
    use super::*;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 10.0]), Some(3.0));
        assert_eq!(median(&[4.0, 1.0, 10.0, 3.0]), Some(3.5));
    }

    /// Runs of one planner: the time as given and rotated, or none where the problem stays unsolved.
    fn runs(problem: &str, times: &[Option<f64>]) -> Vec<Record> {
        let run = |(rotation, time): (u32, &Option<f64>)| {
            let end = time.map(|t| (1, t, t)).ok_or("infeasible");
            let wall_time_s = time.unwrap_or(1.0);
            Record { rotation, wall_time_s, ..record((problem, 3), "sbdp-star", end) }
        };
        (0..).zip(times).map(run).collect()
    }

    #[test]
    fn problems_are_compared_with_themselves() {
        let records = [
            // Ratios 2, 3 and 10: the median is 3.
            runs("a", &[Some(2.0), Some(4.0), Some(20.0), Some(6.0)]),
            // One of three fails; 0.5 and 1.5: the median is 1.
            runs("b", &[Some(4.0), Some(2.0), None, Some(6.0)]),
            // Solved under rotation only: no ratio and no failure.
            runs("c", &[None, Some(1.0), None, None]),
            // Not rotated: left out.
            runs("d", &[Some(1.0)]),
        ]
        .concat();
        let text = section(&records, &EngineResults::by_engine(&records)[0]);
        let row = r"| SBDP\* | 3 | 2 (67%) | 9 | 6 (67%) | 2 | 2.00 | 10.0 | a |";
        assert!(text.lines().any(|l| l == row), "{text}");
        assert!(
            text.contains("\n- SBDP\\*: b, 1 of 3 runs\n") && text.matches("\n- ").count() == 1,
            "{text}"
        );
    }

    #[test]
    fn without_rotations_nothing_is_said_of_them() {
        let records = runs("a", &[Some(2.0)]);
        assert_eq!(section(&records, &EngineResults::by_engine(&records)[0]), "");
    }
}
