//! The paper's measures against values worked out by hand, through the files that a user gets.

use std::fs;
use std::path::Path;

use super::statistics::{EngineResults, Group};
use super::{Category, Record, Settings, report};

/// Sim, PT and DT, or the status of a run that did not end well.
type End = Result<(u64, f64, f64), &'static str>;

/// A record of a run that took so many simulations and seconds (PT and DT), or did not end well.
pub(super) fn record(problem: (&str, usize), planner: &str, end: End) -> Record {
    let (simulations, path_time_s, total_time_s) = end.unwrap_or((1, 1.0, 1.0));
    Record {
        assembly: problem.0.to_owned(),
        rotation: 0,
        parts: problem.1,
        date: "2026-01-02T03:04:05Z".to_owned(),
        category: Category::of(problem.1).name().to_owned(),
        planner: planner.to_owned(),
        engine: "sliding".to_owned(),
        status: end.err().unwrap_or("complete").to_owned(),
        reason: None,
        simulations,
        swept: 0,
        states: 1,
        path_time_s,
        total_time_s,
        sdf_time_s: 0.0,
        static_analysis_time_s: 0.0,
        verify_time_s: 0.0,
        wall_time_s: 1.0,
        peak_memory_kib: 0,
        steps: 1,
        verified: true,
        settings: Settings {
            version: "1".to_owned(),
            build: "b".to_owned(),
            timeout_s: 100.0,
            path_timeout_s: 360.0,
            actions: "paper".to_owned(),
            dbg: "sliding".to_owned(),
            sweeps: false,
            seed: 0,
            threads: 0,
            jobs: 1,
            processor: "Fast 9000".to_owned(),
            processors: 2,
        },
    }
}

/// Five planners on six problems, small enough to work out everything by hand.
fn synthetic() -> Vec<Record> {
    let problems = [("s1", 4), ("s2", 9), ("s3", 3), ("m", 10), ("l", 50), ("p", 2)];
    let t = Err("timeout");
    let runs = [
        (
            "sbdp-star",
            [
                Ok((10, 1., 2.)),
                Ok((20, 3., 5.)),
                Err("partial"),
                Ok((30, 10., 12.)),
                Ok((100, 50., 80.)),
                Ok((2, 1., 1.)),
            ],
        ),
        (
            "sbdp",
            [Ok((14, 2., 3.)), Ok((20, 2., 4.)), Ok((5, 1., 1.)), Ok((60, 20., 24.)), t, Ok((4, 2., 2.))],
        ),
        (
            "pdp-r",
            [
                Ok((50, 9., 9.)),
                Ok((30, 1., 2.)),
                Ok((9, 1., 1.)),
                Ok((90, 40., 42.)),
                Err("killed"),
                Ok((6, 3., 3.)),
            ],
        ),
        ("pdp-t", [Ok((40, 4., 4.)), Err("infeasible"), Err("infeasible"), t, t, Err("crashed")]),
    ];
    let of = |(planner, ends): (&'static str, [End; 6])| {
        problems.into_iter().zip(ends).map(move |(problem, end)| record(problem, planner, end))
    };
    runs.into_iter().flat_map(of).collect()
}

fn write(folder: &Path, records: &[Record]) {
    let lines: String = records.iter().map(|r| serde_json::to_string(r).unwrap() + "\n").collect();
    fs::write(folder.join("results.jsonl"), lines).unwrap();
}

fn tables(records: &[Record]) -> String {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), records);
    report(&[folder.path().to_owned()], folder.path()).unwrap();
    fs::read_to_string(folder.path().join("tables.md")).unwrap()
}

#[track_caller]
fn has_rows(text: &str, rows: &[&str]) {
    for row in rows {
        assert!(text.lines().any(|l| l == *row), "no row\n{row}\nin\n{text}");
    }
}

#[test]
fn the_table_of_solved_problems_is_the_papers() {
    has_rows(
        &tables(&synthetic()),
        &[
            r"|  | All, 3+ (5) | Small, 3–9 (3) | Medium, 10–49 (1) | Large, 50+ (1) | Pairs, up to 2 (1) | Difference with SBDP\* | Difference with SBDP\* in pairs |",
            r"| SBDP\* | **4** | 2 | **1** | **1** | **1** | -0/+0 | -0/+0 |",
            r"| SBDP | **4** | **3** | **1** | 0 | **1** | -1/+1 | -0/+0 |",
            r"| PDP\* | **4** | **3** | **1** | 0 | **1** | -1/+1 | -0/+0 |",
            r"| PDP_r | **4** | **3** | **1** | 0 | **1** | -1/+1 | -0/+0 |",
            r"| PDP_t | 1 | 1 | 0 | 0 | 0 | -3/+0 | -1/+0 |",
        ],
    );
}

#[test]
fn averages_are_over_what_all_but_pdp_t_solved() {
    let text = tables(&synthetic());
    has_rows(
        &text,
        &[
            // 10, 20, 30; 1, 3, 10; 2, 5, 12.
            r"| All, 3+ (3) | SBDP\* | **20.0** | **8.16** | **4.67** | **3.86** | **6.33** | **4.19** |",
            // PDP* is PDP_t on s1 (40, 4, 4), PDP_r on s2 (30, 1, 2) and m.
            r"| Small, 3–9 (2) | SBDP\* | **15.0** | 5.00 | **2.00** | 1.00 | 3.50 | 1.50 |",
            r"| Small, 3–9 (2) | SBDP | 17.0 | **3.00** | **2.00** | **0** | 3.50 | **0.500** |",
            r"| Small, 3–9 (2) | PDP\* | 35.0 | 5.00 | 2.50 | 1.50 | **3.00** | 1.00 |",
            r"| Small, 3–9 (2) | PDP_r | 40.0 | 10.0 | 5.00 | 4.00 | 5.50 | 3.50 |",
            r"| Pairs, up to 2 (1) | PDP\* | 6.00 | **0** | 3.00 | **0** | 3.00 | **0** |",
        ],
    );
    assert!(!text.contains("Large, 50+ (0)"), "nothing there was solved by all");
}

#[test]
fn less_time_reduction_and_increase_are_counted_on_their_side_only() {
    has_rows(
        &tables(&synthetic()),
        &[
            // PT 1−9, 3−1, 10−40; DT 2−9, 5−2, 12−42.
            r"| All, 3+ (3) | SBDP\*/PDP_r | 67% | -19.0/+2.00 | 67% | -18.5/+3.00 |",
            // PT 1−4, 3−1, 10−40; DT 2−4, 5−2, 12−42.
            r"| All, 3+ (3) | SBDP\*/PDP\* | 67% | -16.5/+2.00 | 67% | -16.0/+3.00 |",
            r"| Medium, 10–49 (1) | SBDP\*/PDP\* | 100% | -30.0/– | 100% | -30.0/– |",
        ],
    );
}

#[test]
fn endings_are_counted_and_what_is_not_verified_is_not_solved() {
    let mut records = synthetic();
    records[0].verified = false;
    records[23].reason = Some("exit | 101".to_owned());
    let text = tables(&records);
    has_rows(
        &text,
        &[
            r"|  | complete | complete, not verified | crashed | infeasible | killed | partial | timeout |",
            r"| SBDP\* | 4 | 1 | 0 | 0 | 0 | 1 | 0 |",
            r"| PDP_t | 1 | 0 | 1 | 2 | 0 | 0 | 2 |",
            r"| 1 | PDP_t | crashed | exit \| 101 |",
            r"| SBDP\* | 3 | 1 | **1** | **1** | **1** | -0/+0 | -0/+0 |",
        ],
    );
}

#[test]
fn engines_are_compared_run_by_run() {
    let mut records = synthetic();
    let star = |r: &&Record| r.planner == "sbdp-star";
    let mut other: Vec<Record> = records.iter().filter(star).cloned().collect();
    for run in &mut other {
        run.engine = "penalty".to_owned();
        run.path_time_s *= 4.0;
    }
    // The second takes 16 times as long on s2, solves s3 and does not solve l, and leaves p out.
    other[1].path_time_s *= 4.0;
    other[2].status = "complete".to_owned();
    other[4].status = "timeout".to_owned();
    other.pop();
    records.extend(other);
    let text = tables(&records);
    // The geometric mean of 4, 16 and 4.
    has_rows(&text, &[r"| SBDP\* | 5 | 3 | 1 | 1 | 3 | 6.35 |"]);
    assert!(text.contains("## Engine penalty\n") && text.contains("## Engines sliding and penalty\n"));
}

#[test]
fn planners_that_lag_behind_are_named() {
    let mut records = synthetic();
    records.retain(|r| r.planner != "sbdp" || r.assembly != "m");
    assert!(tables(&records).contains("- SBDP: 5 of 6 problems so far\n"));
    assert!(!tables(&synthetic()).contains("so far"));
}

#[test]
fn the_figure_has_a_line_per_planner_and_a_panel_per_category() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &synthetic());
    report(&[folder.path().to_owned()], folder.path()).unwrap();
    let svg = fs::read_to_string(folder.path().join("coverage-sliding.svg")).unwrap();
    for text in [
        "SBDP*",
        "PDP_t",
        "All, 3+ parts (5 problems)",
        "Large, 50+ parts (1 problems)",
        "Pairs, up to 2 parts",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    // Five planners in five panels, and the frames.
    assert!(svg.matches("<polyline").count() >= 25, "{}", svg.matches("<polyline").count());
    let common = fs::read_to_string(folder.path().join("coverage-common-sliding.svg")).unwrap();
    let solved = EngineResults::by_engine(&synthetic())[0].common(Group::All).len();
    assert!(solved > 0 && solved < 5, "{solved} are solved by all");
    assert!(common.contains(&format!("All, 3+ parts ({solved} solved by all)")));
    assert!(common.contains("% of these solved") && common.contains("SBDP*") && !common.contains("PDP_t"));
    for name in ["coverage-sliding.png", "coverage-common-sliding.png"] {
        let png = fs::read(folder.path().join(name)).unwrap();
        assert!(png.starts_with(b"\x89PNG") && png.len() > 10_000, "{} bytes", png.len());
    }
}
