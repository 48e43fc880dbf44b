//! `tables.md`: the paper's three tables per engine, how runs ended, and engines against each
//! other.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};

use super::PDP_STAR;
use super::markdown::{Table, bold, cell, number, optional, title};
use super::record::Record;
use super::rotated;
use super::statistics::{EngineResults, Group, Measure, PlannerResults, REFERENCE, geometric_mean};

/// Statuses of runs that ended without a plan.
const NO_PLAN: [&str; 3] = ["killed", "crashed", "failed"];
/// So many different messages are shown.
const ACCIDENTS: usize = 20;

/// Everything but the coverage figure.
pub(super) fn document(records: &[Record], engines: &[EngineResults<'_>]) -> String {
    let mut text = format!("# Benchmark\n\n{}", conditions(records));
    for results in engines {
        text += &format!("\n## Engine {}\n", results.engine);
        text += &unequal(results);
        text += &format!("\n### Solved\n\n{}", solved(results));
        text += &format!("\n### Simulations and times\n\n{}", spreads(results));
        let versus = versus(results);
        if !versus.is_empty() {
            text += &format!("\n### {} against the others\n\n{versus}", title(REFERENCE));
        }
        text += &rotated::section(records, results);
        text += &format!("\n### How runs ended\n\n{}{}", endings(results), accidents(results));
        text += &format!(
            "\nCoverage over time: `coverage-{0}.svg`, `coverage-{0}.png`; of commonly solved problems, in per cent: \
             `coverage-common-{0}.svg`, `coverage-common-{0}.png`.\n",
            results.engine
        );
    }
    if let [first, second] = engines {
        text += &format!(
            "\n## Engines {} and {}\n\n{}",
            first.engine,
            second.engine,
            engines_in_all(first, second)
        );
    }
    text
}

/// Every problem that ran with both engines.
pub(super) fn engines_by_problem(first: &EngineResults<'_>, second: &EngineResults<'_>) -> String {
    let mut table = Table::new(&[
        "Problem",
        "Planner",
        first.engine,
        second.engine,
        "Same",
        &format!("PT(s) {}", first.engine),
        &format!("PT(s) {}", second.engine),
        "Ratio",
    ]);
    for (problem, _) in &first.problems {
        for (planner, a, b) in pairs(first, second)
            .filter_map(|(p, a, b)| Some((p, *a.runs.get(problem)?, *b.runs.get(problem)?)))
        {
            table.row([
                cell(problem),
                title(planner),
                verdict(a).to_owned(),
                verdict(b).to_owned(),
                if verdict(a) == verdict(b) { "yes" } else { "**no**" }.to_owned(),
                number(a.path_time_s),
                number(b.path_time_s),
                optional(ratio(a, b), number),
            ]);
        }
    }
    format!("# Engines problem by problem\n\n{}\n\n{}", RATIO, table.render())
}

const RATIO: &str = "Ratio: path planning time of the second engine over that of the first, where both solved \
the problem by simulation.";

/// What the numbers mean and what they were made with.
fn conditions(records: &[Record]) -> String {
    let mut builds: BTreeSet<String> = BTreeSet::new();
    let mut crowded = false;
    for record in records {
        builds.insert(record.settings.to_string());
        crowded |= record.settings.jobs > 1;
    }
    let mut text = format!("{} runs. ", records.len());
    text += "Solved: all that is wanted is out and every path verified on the triangles. Sim: simulations \
             executed. PT: seconds in simulation. DT: seconds for everything but thinning and verification. \
             PDP\\* is PDP_t where that solves the problem, else PDP_r; only the one that counts is measured. \
             \"All\" leaves out problems of one or two parts, which the paper has none of.\n\n";
    builds.iter().for_each(|b| text += &format!("- {b}\n"));
    if records.iter().any(|r| r.rotation > 0) {
        text += "- Runs of rotated assemblies count only where rotation is spoken of.\n";
    }
    if crowded {
        text += "- Several runs went on at a time: their times disturb each other.\n";
    }
    text
}

/// A planner that did not run on all problems cannot be compared by what it solved.
fn unequal(results: &EngineResults<'_>) -> String {
    let all = results.problems.len();
    let behind = results.planners.iter().filter(|p| p.runs.len() < all);
    let lines =
        behind.map(|p| format!("- {}: {} of {all} problems so far\n", title(p.planner), p.runs.len()));
    let lines: String = lines.collect();
    if lines.is_empty() { lines } else { format!("\nNot everything has run:\n\n{lines}") }
}

/// The paper's first table.
fn solved(results: &EngineResults<'_>) -> String {
    let mut header = vec![String::new()];
    for group in Group::LIST {
        header.push(format!("{} ({})", group.title(), results.group(group).count()));
    }
    let against = title(REFERENCE);
    header.extend([format!("Difference with {against}"), format!("Difference with {against} in pairs")]);
    let mut table = Table::new(&header);
    for planner in &results.planners {
        let mut row = vec![title(planner.planner)];
        for group in Group::LIST {
            let most = results.planners.iter().map(|p| results.solved(p, group)).max();
            let count = results.solved(planner, group);
            row.push(bold(count.to_string(), count > 0 && Some(count) == most));
        }
        for group in [Group::All, Group::LIST[4]] {
            let signed = |(less, more)| format!("-{less}/+{more}");
            row.push(optional(results.difference(planner, group), signed));
        }
        table.row(row);
    }
    let note = "problems that SBDP\\* solved and the planner did not, and the other way round.";
    format!("{}\nDifference: {note}\n", table.render())
}

/// The paper's second table, its groups one below the other.
fn spreads(results: &EngineResults<'_>) -> String {
    let header =
        ["Commonly solved", "", "Sim avg", "Sim std", "PT(s) avg", "PT(s) std", "DT(s) avg", "DT(s) std"];
    let mut table = Table::new(&header);
    for group in Group::LIST {
        let common = results.common(group).len();
        if common == 0 {
            continue;
        }
        let mut rows: Vec<Vec<Option<f64>>> = Vec::new();
        for planner in results.counted() {
            let spreads = Measure::ALL.map(|m| results.spread(planner, group, m));
            rows.push(spreads.iter().flat_map(|s| [s.map(|s| s.average), s.map(|s| s.deviation)]).collect());
        }
        for (planner, row) in results.counted().zip(&rows) {
            let mut cells = vec![format!("{} ({common})", group.title()), title(planner.planner)];
            cells.extend(row.iter().enumerate().map(|(column, value)| {
                let least = rows.iter().filter_map(|r| r[column]).fold(f64::INFINITY, f64::min);
                bold(optional(*value, number), rows.len() > 1 && *value == Some(least))
            }));
            table.row(cells);
        }
    }
    if table.is_empty() {
        return "No problem was solved by all planners.\n".to_owned();
    }
    let note = "Over the problems that all planners but PDP_t solved; standard deviation over all of them.";
    format!("{}\n{note} K is 10³.\n", table.render())
}

/// The table of the paper's appendix.
fn versus(results: &EngineResults<'_>) -> String {
    let others: Vec<_> = ["pdp-r", PDP_STAR].iter().filter_map(|p| results.planner(p)).collect();
    let mut table = Table::new(&["Commonly solved", "", "PP LR", "PP TR/TI(s)", "DP LR", "DP TR/TI(s)"]);
    for group in Group::LIST {
        let common = results.common(group).len();
        for other in &others {
            let both = [Measure::Pt, Measure::Dt].map(|m| results.versus(other, group, m));
            let [Some(pp), Some(dp)] = both else { continue };
            let mut row = vec![format!("{} ({common})", group.title())];
            row.push(format!("{}/{}", title(REFERENCE), title(other.planner)));
            for v in [pp, dp] {
                row.push(format!("{:.0}%", 100.0 * v.less));
                let signed =
                    |side: Option<f64>, sign| optional(side, |s| format!("{sign}{}", number(s.abs())));
                row.push(format!("{}/{}", signed(v.reduction, '-'), signed(v.increase, '+')));
            }
            table.row(row);
        }
    }
    if table.is_empty() {
        return String::new();
    }
    let note = "LR: share of problems on which SBDP\\* takes less time, in path planning (PP) and in disassembly \
                planning (DP). TR/TI: average of what it saves where it takes less, and of what it spends more \
                where it takes more.";
    format!("{}\n{note}\n", table.render())
}

fn endings(results: &EngineResults<'_>) -> String {
    let runs = || results.planners.iter().flat_map(|p| p.runs.values());
    let statuses: BTreeSet<&str> = runs().map(|r| status(r)).collect();
    let mut table = Table::new(&[&[""], &statuses.iter().copied().collect::<Vec<_>>()[..]].concat());
    for planner in &results.planners {
        let count = |s: &&str| planner.runs.values().filter(|r| status(r) == *s).count().to_string();
        table.row([title(planner.planner)].into_iter().chain(statuses.iter().map(count)));
    }
    table.render()
}

/// What runs said that ended without a plan, most frequent first.
fn accidents(results: &EngineResults<'_>) -> String {
    let mut counts: BTreeMap<(String, String, String), usize> = BTreeMap::new();
    for planner in results.planners.iter().filter(|p| p.planner != PDP_STAR) {
        for run in planner.runs.values().filter(|r| NO_PLAN.contains(&r.status.as_str())) {
            let reason = cell(run.reason.as_deref().unwrap_or_default());
            *counts.entry((title(planner.planner), run.status.clone(), reason)).or_default() += 1;
        }
    }
    if counts.is_empty() {
        return String::new();
    }
    let mut rows: Vec<_> = counts.into_iter().collect();
    rows.sort_by_key(|(_, count)| Reverse(*count));
    let mut table = Table::new(&["Runs", "", "", "What they said"]);
    for ((planner, status, reason), count) in rows.into_iter().take(ACCIDENTS) {
        table.row([count.to_string(), planner, status, reason]);
    }
    format!("\n{}", table.render())
}

fn status(record: &Record) -> &str {
    if record.status == "complete" && !record.verified { "complete, not verified" } else { &record.status }
}

/// Planners that ran with both engines.
fn pairs<'r, 'a>(
    first: &'r EngineResults<'a>,
    second: &'r EngineResults<'a>,
) -> impl Iterator<Item = (&'static str, &'r PlannerResults<'a>, &'r PlannerResults<'a>)> {
    first.planners.iter().filter_map(|a| Some((a.planner, a, second.planner(a.planner)?)))
}

fn engines_in_all(first: &EngineResults<'_>, second: &EngineResults<'_>) -> String {
    let header = [
        "",
        "Problems",
        "Same verdict",
        &format!("Solved only by {}", first.engine),
        &format!("Solved only by {}", second.engine),
        "Compared",
        "Geometric mean of ratios",
    ];
    let mut table = Table::new(&header);
    for (planner, a, b) in pairs(first, second) {
        let both: Vec<(&Record, &Record)> =
            a.runs.iter().filter_map(|(problem, run)| Some((*run, *b.runs.get(problem)?))).collect();
        let count = |keep: &dyn Fn(&Record, &Record) -> bool| {
            both.iter().filter(|(a, b)| keep(a, b)).count().to_string()
        };
        let ratios: Vec<f64> = both.iter().filter_map(|(a, b)| ratio(a, b)).collect();
        table.row([
            title(planner),
            both.len().to_string(),
            count(&|a, b| verdict(a) == verdict(b)),
            count(&|a, b| a.solved() && !b.solved()),
            count(&|a, b| !a.solved() && b.solved()),
            ratios.len().to_string(),
            optional(geometric_mean(&ratios), number),
        ]);
    }
    format!("{}\n{RATIO} Problem by problem: `engines.md`.\n", table.render())
}

/// What a run found out about the problem.
fn verdict(record: &Record) -> &'static str {
    match record.status.as_str() {
        _ if record.solved() => "solved",
        "infeasible" => "infeasible",
        "exhausted" => "exhausted",
        _ => "none",
    }
}

fn ratio(first: &Record, second: &Record) -> Option<f64> {
    let solved = first.solved() && second.solved();
    let simulated = first.path_time_s > 0.0 && second.path_time_s > 0.0;
    (solved && simulated).then(|| second.path_time_s / first.path_time_s)
}
