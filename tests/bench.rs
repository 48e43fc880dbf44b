//! Benchmarks: isolated runs, resuming, shards. Runs are of `bench/fake-sbdp` where they have to go
//! wrong. What is computed from records is tested beside it, in `src/bench/tests.rs`.

mod common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};
use sbdp::bench::{self, BenchError, BenchObserver, Record, Request, Shard, Summary, Unit, Workload};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests")
}

/// A corpus of that name whose assemblies have the given names, three meshes each.
fn corpus(folder: &Path, assemblies: &[&str]) -> PathBuf {
    let corpus = folder.join("corpus");
    for assembly in assemblies {
        fs::create_dir_all(corpus.join(assembly)).unwrap();
        (0..3).for_each(|i| fs::write(corpus.join(assembly).join(format!("{i}.obj")), "").unwrap());
    }
    corpus
}

fn request(folder: &Path, assemblies: &[&str]) -> Request {
    Request {
        corpora: vec![corpus(folder, assemblies)],
        planners: vec!["sbdp-star".to_owned()],
        engines: vec!["sliding".to_owned()],
        timeout: Duration::from_secs(7200),
        path_timeout: Duration::from_secs(360),
        actions: "paper",
        dbg: "sliding",
        sweeps: false,
        grace: Duration::from_secs(7200),
        threads: 0,
        jobs: 1,
        parts_up_to: None,
        rotations: 0,
        seed: 0,
        shard: Shard::WHOLE,
        out: folder.join("out"),
        program: root().join("bench/fake-sbdp"),
    }
}

struct Unwatched;

impl BenchObserver for Unwatched {
    fn begun(&mut self, _: &Workload) {}
    fn ran(&mut self, _: &Record, _: usize, _: Option<Duration>) {}
}

fn run(request: &Request) -> Result<Summary, BenchError> {
    bench::run(request, &AtomicBool::new(false), &mut Unwatched)
}

/// What the fake was started with, line by line: assembly, process and arguments.
fn log(out: &Path) -> Vec<String> {
    let text = fs::read_to_string(out.join("log")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

fn pid(line: &str) -> &str {
    line.split(' ').nth(1).unwrap()
}

#[test]
fn whatever_a_run_does_the_others_run_too() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a-good", "crash", "garbage", "panic", "refuse", "short", "silent", "stuck", "z-good"];
    for jobs in [1, 3] {
        let mut request = Request { jobs, ..request(folder.path(), &names) };
        request.out = folder.path().join(format!("out-{jobs}"));
        assert_eq!(run(&request).unwrap(), Summary { records: 9, missing: 0, repeated: 0 });
        let mut records = bench::read(&request.out).unwrap();
        records.sort_by(|a, b| a.assembly.cmp(&b.assembly));
        let ends: Vec<(&str, &str, &str, bool)> = records
            .iter()
            .map(|r| (&r.assembly[7..], r.status.as_str(), r.reason.as_deref().unwrap_or("-"), r.solved()))
            .collect();
        assert_eq!(ends[0], ("a-good", "complete", "-", true));
        assert_eq!((ends[1].1, ends[1].3), ("crashed", false));
        assert!(ends[1].2.contains("signal: 11") && ends[1].2.ends_with("something broke"), "{}", ends[1].2);
        assert!(ends[2].2.contains("cannot be read"), "{}", ends[2].2);
        assert_eq!(ends[3].1, "crashed");
        assert!(ends[3].2.ends_with("index out of bounds"), "{}", ends[3].2);
        assert_eq!(ends[4], ("refuse", "failed", "error: invalid value 'x' for '--planner'", false));
        assert_eq!(ends[5], ("short", "complete", "-", false), "a part that should be out is not");
        assert!(ends[6].2.contains("wrote no plan"), "{}", ends[6].2);
        assert_eq!(ends[7], ("stuck", "infeasible", "-", false));
        assert_eq!(ends[8], ("z-good", "complete", "-", true));
    }
}

#[test]
fn a_record_holds_the_papers_measures() {
    let folder = tempfile::tempdir().unwrap();
    let request = request(folder.path(), &["good"]);
    run(&request).unwrap();
    let record = bench::read(&request.out).unwrap().remove(0);
    assert_eq!(
        (record.assembly.as_str(), record.parts, record.category.as_str()),
        ("corpus/good", 3, "small")
    );
    assert_eq!((record.simulations, record.states, record.steps, record.verified), (7, 5, 2, true));
    let times = [record.path_time_s, record.total_time_s, record.sdf_time_s, record.static_analysis_time_s];
    // The total is without the second of verification.
    assert_eq!((times, record.verify_time_s), ([2.0, 3.0, 0.5, 0.25], 1.0));
    assert!(!record.settings.processor.is_empty() && record.settings.processors > 0);
    assert!(record.date.starts_with("20") && record.date.ends_with('Z'), "{}", record.date);
    let line = &log(&request.out)[0];
    assert!(
        line.contains(" --embedded --no-cache --planner sbdp-star --engine sliding --planning-timeout 7200 --path-timeout 360 --actions paper --dbg sliding --no-sweeps --json "),
        "{line}"
    );
}

#[test]
fn a_process_that_overstays_is_ended() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = request(folder.path(), &["hang"]);
    (request.timeout, request.grace) = (Duration::from_millis(300), Duration::from_millis(200));
    run(&request).unwrap();
    let record = bench::read(&request.out).unwrap().remove(0);
    assert_eq!((record.status.as_str(), record.solved()), ("killed", false));
    assert!(record.wall_time_s >= 0.5, "{}", record.wall_time_s);
    assert!(log(&request.out).iter().all(|line| !Path::new("/proc").join(pid(line)).exists()));
}

/// Cancels when one run is done and the other hangs.
struct CancelWhileOneHangs<'a> {
    out: &'a Path,
    cancel: &'a AtomicBool,
}

impl BenchObserver for CancelWhileOneHangs<'_> {
    fn begun(&mut self, _: &Workload) {}
    fn ran(&mut self, _: &Record, _: usize, _: Option<Duration>) {
        while !log(self.out).iter().any(|l| l.starts_with("hang")) {
            std::thread::sleep(Duration::from_millis(5));
        }
        self.cancel.store(true, Ordering::Relaxed);
    }
}

#[test]
fn cancelling_ends_what_runs_and_leaves_it_for_the_next_time() {
    let folder = tempfile::tempdir().unwrap();
    let request = Request { jobs: 2, ..request(folder.path(), &["good", "hang"]) };
    let cancel = AtomicBool::new(false);
    let summary =
        bench::run(&request, &cancel, &mut CancelWhileOneHangs { out: &request.out, cancel: &cancel });
    assert_eq!(summary.unwrap(), Summary { records: 1, missing: 1, repeated: 0 });
    let hung = log(&request.out).into_iter().find(|l| l.starts_with("hang")).unwrap();
    assert!(!Path::new("/proc").join(pid(&hung)).exists(), "{hung}");
    assert_eq!(bench::read(&request.out).unwrap()[0].assembly, "corpus/good");
}

#[test]
fn a_benchmark_goes_on_where_it_was_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let request = request(folder.path(), &["one", "two", "three"]);
    run(&request).unwrap();
    let file = request.out.join("results.jsonl");
    let text = fs::read_to_string(&file).unwrap();
    // In the middle of a line, just before its end, and as it was.
    for (cut, again) in [(40, 1), (1, 1), (text.lines().last().unwrap().len() + 30, 2), (0, 0)] {
        let before = log(&request.out).len();
        fs::write(&file, &text[..text.len() - cut]).unwrap();
        assert_eq!(run(&request).unwrap(), Summary { records: 3, missing: 0, repeated: 0 });
        assert_eq!(log(&request.out).len() - before, again, "cut off {cut}");
        let names: BTreeSet<String> =
            bench::read(&request.out).unwrap().into_iter().map(|r| r.assembly).collect();
        assert_eq!(names.len(), 3, "{names:?}");
    }
}

#[test]
fn results_of_other_settings_are_not_mixed_in() {
    let folder = tempfile::tempdir().unwrap();
    let first = request(folder.path(), &["one"]);
    run(&first).unwrap();
    let other_program = folder.path().join("other");
    fs::copy("/bin/true", &other_program).unwrap();
    for other in [
        Request { timeout: Duration::from_secs(5), ..first.clone() },
        Request { threads: 1, ..first.clone() },
        Request { program: other_program, ..first.clone() },
    ] {
        let refused = run(&other).unwrap_err();
        assert!(matches!(&refused, BenchError::Refused(r) if r.contains("other settings")), "{refused}");
    }
    assert_eq!(log(&first.out).len(), 1);
}

#[test]
fn pdp_star_runs_what_it_is_put_together_from() {
    let folder = tempfile::tempdir().unwrap();
    let mut request = request(folder.path(), &["one"]);
    request.planners = ["pdp-star", "pdp-r", "sbdp"].map(str::to_owned).to_vec();
    run(&request).unwrap();
    let ran: Vec<String> = bench::read(&request.out).unwrap().into_iter().map(|r| r.planner).collect();
    assert_eq!(ran, ["sbdp", "pdp-r", "pdp-t"]);
    request.planners.push("magic".to_owned());
    assert!(run(&request).unwrap_err().to_string().contains("`magic`"));
}

#[test]
fn rotated_runs_are_runs_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let once = Request { rotations: 1, seed: 7, ..request(folder.path(), &["one", "stuck"]) };
    assert_eq!(run(&once).unwrap().records, 4);
    let turned = |log: &[String]| log.iter().filter(|l| l.contains(" --rotate=")).count();
    assert_eq!(turned(&log(&once.out)), 2);
    // More of them: only the new ones run; less of them: none.
    let more = Request { rotations: 3, ..once.clone() };
    assert_eq!(run(&more).unwrap().records, 8);
    assert_eq!((log(&more.out).len(), turned(&log(&more.out))), (8, 6));
    assert_eq!(run(&once).unwrap().missing, 0);
    let rotations: Vec<String> = log(&more.out)
        .iter()
        .filter_map(|l| Some(l.split_once("--rotate=")?.1.split(' ').next()?.to_owned()))
        .collect();
    assert_eq!(rotations.iter().collect::<BTreeSet<_>>().len(), 6, "{rotations:?}");
    let tables = fs::read_to_string(more.out.join("tables.md")).unwrap();
    assert!(tables.contains("| 2 | 1 (50%) | 6 | 3 (50%) | 1 |"), "{tables}");
    assert!(tables.contains("All, 3+ (2)"), "rotated problems are no further problems: {tables}");
    let other_seed = run(&Request { seed: 8, ..more }).unwrap_err().to_string();
    assert!(other_seed.contains("seed 7") && other_seed.contains("seed 8"), "{other_seed}");
}

#[test]
fn shards_of_rotated_runs_are_put_together() {
    let folder = tempfile::tempdir().unwrap();
    let whole = Request { rotations: 2, ..request(folder.path(), &["a", "b", "c"]) };
    let shards = ["1/2", "2/2"].map(|shard| Request {
        shard: shard.parse().unwrap(),
        out: folder.path().join(shard.replace('/', "-")),
        ..whole.clone()
    });
    let ran: usize = shards.iter().map(|s| run(s).unwrap().records).sum();
    let folders = shards.each_ref().map(|s| s.out.clone());
    let summary = bench::report(&folders, &folder.path().join("all")).unwrap();
    assert_eq!((ran, summary), (9, Summary { records: 9, missing: 0, repeated: 0 }));
    // A shard turns an assembly as the whole does.
    run(&whole).unwrap();
    let lines = |outs: &[PathBuf]| -> BTreeSet<String> {
        let logs = outs.iter().flat_map(|out| log(out));
        let turned =
            |l: String| Some((l.split(' ').next()?.to_owned(), l.split_once("--rotate=")?.1.to_owned()));
        logs.filter_map(turned).map(|(name, rest)| name + rest.split(' ').next().unwrap_or("")).collect()
    };
    assert_eq!(lines(&folders), lines(&[whole.out]));
}

#[test]
fn units_have_the_records_of_the_whole_but_for_the_times() {
    let folder = tempfile::tempdir().unwrap();
    let planners = ["sbdp-star", "pdp-star"].map(str::to_owned).to_vec();
    let whole = Request { planners, rotations: 1, ..request(folder.path(), &["a", "crash", "refuse"]) };
    run(&whole).unwrap();
    let timeless = |mut record: Record| {
        (record.wall_time_s, record.peak_memory_kib) = (0.0, 0);
        assert!(!record.date.is_empty());
        record.date.clear();
        format!("{record:?}")
    };
    let expected: Vec<String> = bench::read(&whole.out).unwrap().into_iter().map(timeless).collect();
    let alone = |unit: Unit| {
        let line = serde_json::to_string(&unit).unwrap();
        let unit = Unit::from_json(&line).unwrap();
        timeless(bench::run_unit(unit, &whole.program, &AtomicBool::new(false)).unwrap().unwrap())
    };
    let units = bench::units(&whole).unwrap();
    assert_eq!(units.len(), 3 * 2 * 3, "pdp-star is two");
    assert_eq!(units.into_iter().map(alone).collect::<Vec<_>>(), expected);
}

#[test]
fn assemblies_of_more_parts_are_left_out_if_asked() {
    let folder = tempfile::tempdir().unwrap();
    let request = request(folder.path(), &["three", "four"]);
    fs::write(folder.path().join("corpus/four/3.obj"), "").unwrap();
    let few = Request { parts_up_to: Some(3), ..request };
    run(&few).unwrap();
    let names: Vec<String> = bench::read(&few.out).unwrap().into_iter().map(|r| r.assembly).collect();
    assert_eq!(names, ["corpus/three"]);
}

#[test]
fn reports_put_shards_together() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["a", "b", "c", "d", "e"];
    let shards = ["1/2", "2/2"].map(|shard| Request {
        shard: shard.parse().unwrap(),
        out: folder.path().join(shard.replace('/', "-")),
        ..request(folder.path(), &names)
    });
    let ran: usize = shards.iter().map(|s| run(s).unwrap().records).sum();
    assert_eq!(ran, 5);
    let [one, two] = shards.each_ref().map(|s| s.out.clone());
    let all = folder.path().join("all");
    // The second time there is something in the way, and nothing of it is lost.
    for _ in 0..2 {
        let summary = bench::report(&[one.clone(), two.clone(), one.clone()], &all).unwrap();
        assert_eq!((summary.records, summary.repeated), (5, 3));
    }
    let merged: BTreeSet<String> = bench::read(&all).unwrap().into_iter().map(|r| r.assembly).collect();
    assert_eq!(merged, names.map(|n| format!("corpus/{n}")).into());
    assert!(fs::read_to_string(all.join("tables.md")).unwrap().contains("All, 3+ (5)"));
    let lost = bench::report(&[two], &one).unwrap_err().to_string();
    assert!(lost.contains("would be lost"), "{lost}");
    assert_eq!(bench::read(&one).unwrap().len(), 3);
}

fn sbdp() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.env("SBDP_RUNTIME_DIR", "/nonexistent/sbdp-tests").stdin(Stdio::null());
    command
}

#[test]
fn the_command_line_measures_real_assemblies() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["l-slot", "bolt-washer-plate"] {
        std::os::unix::fs::symlink(root().join("assemblies").join(name), folder.path().join(name)).unwrap();
    }
    let out = folder.path().join("out");
    let mut command = sbdp();
    // On one thread: with more, simulations may take longer in all than the clock shows.
    command
        .arg("bench")
        .arg(folder.path())
        .args(["--planners", "sbdp-star", "--threads", "1", "--out"])
        .arg(&out);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(
        said.lines().count() == 3
            && said.starts_with("2 runs, timeout 2 h; worst case: ")
            && said.contains("1/2, about ")
            && said.contains("complete after"),
        "{said}"
    );
    let records = bench::read(&out).unwrap();
    assert!(records.iter().all(|r| r.solved() && r.simulations > 0 && r.path_time_s > 0.0), "{records:?}");
    assert!(records.iter().all(|r| r.total_time_s > r.path_time_s && r.wall_time_s > r.total_time_s));
    let again = command.output().unwrap();
    assert!(String::from_utf8_lossy(&again.stderr).contains("2 of 2 runs were done before"));
    for file in ["tables.md", "coverage-sliding.svg", "coverage-sliding.png", "coverage-common-sliding.svg"] {
        assert!(out.join(file).exists(), "{file}");
    }
    assert!(!out.join("running").exists());
}

#[test]
fn an_interrupted_command_exits_5_and_records_nothing_of_what_ran() {
    let folder = tempfile::tempdir().unwrap();
    let chain = folder.path().join("chains/chain");
    fs::create_dir_all(&chain).unwrap();
    (0..60).for_each(|link| fs::write(chain.join(format!("{link}.obj")), common::ring(link)).unwrap());
    let out = folder.path().join("out");
    let mut command = sbdp();
    command
        .arg("bench")
        .arg(folder.path().join("chains"))
        .args(["--planners", "sbdp-star", "--out"])
        .arg(&out);
    let mut bench = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let says = out.join(format!("running/{}/0.stderr", bench.id()));
    while !says.exists() {
        assert!(bench.try_wait().unwrap().is_none(), "it ended at once");
        std::thread::sleep(Duration::from_millis(5));
    }
    kill_process(Pid::from_child(&bench), Signal::INT).unwrap();
    let output = bench.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(5), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("1 runs are left"));
    let outlook = "1 runs, timeout 2 h; worst case: 1 × 2 h / 1 at a time = 2 h of planning";
    assert!(String::from_utf8_lossy(&output.stderr).contains(outlook), "{output:?}");
    assert_eq!(fs::read(out.join("results.jsonl")).unwrap(), b"");
}
