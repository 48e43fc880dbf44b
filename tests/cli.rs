//! The command line, driven from outside.

mod common;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use common::Daemon;
use rustix::process::{Pid, Signal, kill_process};
use sbdp::document::{PlanDocument, StatsDocument};

fn assembly(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name)
}

thread_local! {
    /// What the commands of a test remember; gone with its thread.
    static CACHE: tempfile::TempDir = tempfile::tempdir().unwrap();
}

/// The command, kept away from any daemon that runs for this user, and from what they remember.
fn sbdp() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sbdp"));
    command.env("SBDP_RUNTIME_DIR", "/nonexistent/sbdp-tests").stdin(Stdio::null());
    CACHE.with(|folder| command.env("SBDP_CACHE_DIR", folder.path()));
    command
}

fn run(arguments: &[&str]) -> Output {
    sbdp().args(arguments).output().unwrap()
}

fn plan(name: &str, options: &[&str]) -> Output {
    let path = assembly(name);
    run(&[&["plan", path.to_str().unwrap(), "--embedded"], options].concat())
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

#[track_caller]
fn refused(output: &Output, words: &[&str]) {
    let text = stderr(output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(words.iter().all(|w| text.contains(w)), "{words:?}: {text}");
    assert!(output.stdout.is_empty());
}

#[test]
fn wrong_usage_exits_2() {
    refused(&run(&[]), &["Usage"]);
    refused(&run(&["plan"]), &["ASSEMBLY"]);
    refused(&plan("l-slot", &["--planner", "a-star"]), &["a-star", "sbdp-star"]);
    refused(&plan("l-slot", &["--engine", "x"]), &["sliding"]);
    refused(&plan("l-slot", &["--timeout", "-1"]), &["--timeout", "seconds"]);
    refused(&plan("l-slot", &["--penalty", "stifness=1"]), &["--penalty", "stifness", "stiffness"]);
    refused(&plan("l-slot", &["--penalty", "time-step=0"]), &["--penalty", "time-step", "positive"]);
    refused(&plan("l-slot", &["--daemon"]), &["--embedded", "--daemon"]);
}

#[test]
fn a_turned_assembly_comes_apart_in_turned_directions() {
    let first_displacement = |options: &[&str]| {
        let output = plan("bolt-washer-plate", &[options, &["--json", "-"]].concat());
        let plan = PlanDocument::from_json(&stdout(&output)).unwrap();
        assert_eq!((plan.status.as_str(), plan.steps[0].parts.concat().as_str()), ("complete", "bolt"));
        let end = plan.steps[0].path.last().unwrap();
        nalgebra::Vector3::new(end[0], end[1], end[2]).normalize()
    };
    // A quarter turn about y maps z to x.
    let given = first_displacement(&[]);
    let turned = first_displacement(&["--rotate", "1,0,1,0"]);
    let expected = nalgebra::Vector3::new(given.z, given.y, -given.x);
    assert!((turned - expected).norm() < 1e-6, "{given} {turned}");
    refused(&plan("l-slot", &["--rotate", "1,0,0"]), &["--rotate", "four numbers"]);
}

#[test]
fn help_and_version_exit_0() {
    for argument in ["--help", "--version"] {
        assert_eq!(run(&[argument]).status.code(), Some(0));
    }
    assert!(stdout(&run(&["--help"])).contains("Exit codes"));
}

#[test]
fn unknown_parts_are_refused_with_the_nearest_names() {
    for option in ["--fixed", "--removed", "--target"] {
        refused(&plan("bolted-bracket-20", &[option, "blot-1"]), &[option, "`blot-1`", "`bolt-1`"]);
    }
}

#[test]
fn refused_geometry_names_file_part_and_reason() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    for command in ["plan", "check"] {
        refused(&run(&[command, "/no/such/folder"]), &["/no/such/folder"]);
        refused(&run(&[command, path]), &[path, "no .obj"]);
        fs::write(folder.path().join("lid.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        refused(&run(&[command, path]), &["lid.obj", "part `lid`", "one plane"]);
        fs::write(folder.path().join("lid.obj"), "").unwrap();
        refused(&run(&[command, path]), &["lid.obj", "0 bytes"]);
        fs::remove_file(folder.path().join("lid.obj")).unwrap();
    }
}

#[test]
fn without_a_daemon_status_and_force_say_so() {
    let path = assembly("l-slot");
    for arguments in [&["status"][..], &["plan", path.to_str().unwrap(), "--daemon"]] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains("daemon"), "{}", stderr(&output));
    }
}

#[test]
fn check_tells_parts_findings_and_overlaps() {
    let output = run(&["check", assembly("pin-bolt-cover").to_str().unwrap()]);
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    for line in [
        "pin-bolt-cover: 4 parts",
        "units mm; fixed base",
        "32.00 × 4.00 × 4.00",
        "found in healing:\n  nothing",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
    assert!(text.contains("overlaps at the assembled pose:\n  none"), "{text}");
}

/// A box as an OBJ file, after so many vertices of others.
fn box_obj(lo: [f64; 3], hi: [f64; 3], before: u32) -> String {
    let corner = |i: u32| (0..3).map(move |axis| if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] });
    let line = |kind: &str, words: Vec<String>| format!("{kind} {}\n", words.join(" "));
    let vertices = (0..8).map(|i| line("v", corner(i).map(|x| x.to_string()).collect()));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let faces = faces.map(|f: [u32; 4]| line("f", f.map(|v| (v + 1 + before).to_string()).to_vec()));
    vertices.chain(faces).collect()
}

/// A base, the same with one edge split, a lid on it, and all of it as one mesh: without the faces between the two, which
/// healing drops.
fn given_twice(folder: &Path) {
    let (base, lid) = (([0.0; 3], [10.0; 3]), ([0.0, 0.0, 10.0], [10.0, 10.0, 12.0]));
    let split = box_obj(base.0, base.1, 0).replace("f 1 2 6 5\n", "v 5 0 0\nf 1 9 5\nf 9 2 6\nf 9 6 5\n");
    let split = split.replace("f 1 3 4 2\n", "f 1 3 9\nf 3 4 9\nf 4 2 9\n");
    let whole = box_obj(base.0, base.1, 0) + &box_obj(lid.0, lid.1, 8);
    for (name, text) in [
        ("base", box_obj(base.0, base.1, 0)),
        ("copy", split),
        ("lid", box_obj(lid.0, lid.1, 0)),
        ("zz_full", whole),
    ] {
        fs::write(folder.join(name).with_extension("obj"), text).unwrap();
    }
}

const COPIES: &str =
    "base and copy are the same body in the same place: leave one of them out (--removed copy)";
const WHOLE: &str = "zz_full holds base, copy and lid: it seems to be the whole assembly beside its bodies; \
                     leave it out (--removed zz_full)";

#[test]
fn parts_that_are_given_twice_are_named_by_check_and_in_plans() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    given_twice(folder.path());
    let text = stdout(&run(&["check", path]));
    let overlaps = "  base and copy: 5.00 deep\n  base and zz_full: 5.00 deep\n  copy and zz_full: 5.00 deep\n  \
                    lid and zz_full: 2.00 deep\n";
    for part in [&format!("given twice:\n  {COPIES}\n  {WHOLE}\n"), overlaps] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    let warnings = |options: &[&str], daemon: Option<&Daemon>| {
        let mut command = sbdp();
        if let Some(daemon) = daemon {
            command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir());
        }
        let place = if daemon.is_some() { "--daemon" } else { "--embedded" };
        let output = command.args(["plan", path, place, "--json", "-"]).args(options).output().unwrap();
        let plan: PlanDocument = serde_json::from_slice(&output.stdout).unwrap();
        (output.status.code(), plan.warnings.into_iter().map(|w| w.message).collect::<Vec<_>>())
    };
    let daemon = Daemon::start();
    for place in [None, Some(&daemon)] {
        // Parts that cannot leave are searched for a way out for long.
        let (_, found) = warnings(&["--max-simulations", "1"], place);
        assert!(found.ends_with(&[COPIES.to_owned(), WHOLE.to_owned()]), "{found:?}");
        let (status, found) = warnings(&["--removed", "copy", "--removed", "zz_full"], place);
        assert_eq!(status, Some(0));
        assert!(!found.iter().any(|w| w.contains("same body") || w.contains("holds")), "{found:?}");
    }
    let text = stdout(&run(&["check", assembly("pin-bolt-cover").to_str().unwrap()]));
    assert!(text.contains("given twice:\n  nothing\n"), "{text}");
}

#[test]
fn a_file_of_a_whole_assembly_is_taken_apart_and_shown_as_it_was_read() {
    let folder = tempfile::tempdir().unwrap();
    let lower = box_obj([0.0; 3], [4.0, 4.0, 1.0], 0);
    let upper = box_obj([0.0, 0.0, 1.0], [4.0, 4.0, 2.0], 8);
    let spare = box_obj([9.0; 3], [10.0; 3], 16);
    let named = folder.path().join("named.obj");
    fs::write(&named, format!("o lower\n{lower}o upper\n{upper}o spare screw\n{spare}")).unwrap();
    let (named, json) = (named.to_str().unwrap(), folder.path().join("plan.json"));
    let json = json.to_str().unwrap();
    let page = folder.path().join("page.html");
    for (options, parts, warning) in [
        (
            &[][..],
            &["lower", "spare screw", "upper"][..],
            "3 objects (`lower`, `upper`, `spare screw`) taken as a part each",
        ),
        (&["--ignore", "*screw*"], &["lower", "upper"], "`spare screw` ignored, as asked"),
        (&["--split", "bodies"], &["1", "2", "3"], ""),
        (
            &["--split", "none"],
            &["named"],
            "nothing to take apart; it has 3 separate bodies, and `--split bodies`",
        ),
    ] {
        let output = run(&[&["plan", named, "--embedded", "--json", json], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        assert!(stdout(&output).contains(warning), "{}", stdout(&output));
        let plan = PlanDocument::from_json(&fs::read_to_string(json).unwrap()).unwrap();
        assert_eq!(plan.parts, parts);
        assert_eq!(plan.warnings.iter().any(|w| w.message.contains(warning)), !plan.warnings.is_empty());
        // The plan says how its files were read.
        let shown = run(&["view", json, "-o", page.to_str().unwrap()]);
        assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
    }
    let text = stdout(&run(&["check", named]));
    assert!(text.contains("found in reading:\n  named.obj: 3 objects"), "{text}");
    refused(&run(&["plan", named, "--split", "all"]), &["--split", "objects, bodies, none"]);
    refused(&run(&["plan", named, "--ignore", "[a"]), &["--ignore", "[a"]);
    refused(&run(&["plan", named, "--ignore", "*"]), &["all parts are ignored"]);
    // What overlaps this deeply is hardly meant.
    let deep = box_obj([0.0, 0.0, 0.5], [4.0, 4.0, 2.0], 8);
    fs::write(named, format!("o lower\n{lower}o upper\n{deep}")).unwrap();
    let output = stdout(&run(&["plan", named, "--embedded"]));
    assert!(output.contains("lower is in upper by 50 % of its smallest side as assembled"), "{output}");
}

#[test]
fn check_compares_the_blocking_graphs_with_simulation() {
    // How many are excluded is kept here: fewer make searches longer, and nobody would see it.
    for (name, excluded) in [
        ("bolt-washer-plate", "16 of 18"),
        ("bolted-bracket-20", "108 of 120"),
        ("l-slot", "10 of 12"),
        ("linked-rings", "0 of 12"),
        ("peg-stl", "8 of 12"),
        ("pin-bolt-cover", "21 of 24"),
        ("threaded-bolt-and-nut", "12 of 12"),
    ] {
        let text = stdout(&run(&["check", assembly(name).to_str().unwrap(), "--graphs"]));
        let expected =
            format!("blocking graphs: {excluded} translations excluded, 0 of them wrongly; 0 more found");
        assert!(text.contains(&expected), "{name}: {text}");
    }
}

#[test]
fn the_pin_locks_the_bolt_and_the_bolt_the_cover() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("plan.json");
    let output = plan("pin-bolt-cover", &["--json", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let document = PlanDocument::from_json(&fs::read_to_string(file).unwrap()).unwrap();
    assert_eq!(document.status, "complete");
    let order: Vec<String> = document.steps.iter().map(|s| s.parts.join(" and ")).collect();
    assert_eq!(order, ["pin", "bolt", "cover"]);
    assert_eq!((document.fixed, document.remaining), (vec!["base".to_owned()], vec!["base".to_owned()]));
    let text = stdout(&output);
    assert!(text.contains("pin-bolt-cover: complete; 3 of 4 parts come off"), "{text}");
    assert_eq!(stderr(&output), "", "no progress in pipes");
}

#[test]
fn json_on_stdout_replaces_the_table() {
    let output = plan("peg-stl", &["--json", "-", "--no-cache", "--threads", "1"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let document = PlanDocument::from_json(&stdout(&output)).unwrap();
    assert_eq!(document.steps.len(), 1);
    assert_eq!(document.steps[0].parts, ["peg"]);
    assert_eq!(document.steps[0].path[0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn removed_parts_and_targets_are_respected() {
    let output = plan("pin-bolt-cover", &["--removed", "pin", "--target", "bolt", "--json", "-"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let document = PlanDocument::from_json(&stdout(&output)).unwrap();
    assert_eq!(document.initial.removed, ["pin"]);
    assert_eq!(document.targets, Some(vec!["bolt".to_owned()]));
    assert_eq!(document.steps.last().unwrap().parts, ["bolt"]);
}

#[test]
fn a_given_base_stays_and_what_contradicts_itself_is_refused() {
    let told = stdout(&plan("pin-bolt-cover", &["--base", "cover"]));
    assert!(
        told.contains("base:\n  cover: as given\n") && told.contains("remaining:\n  base, cover\n"),
        "{told}"
    );
    refused(
        &plan("pin-bolt-cover", &["--base", "cover", "--target", "cover"]),
        &["part `cover` is a target and in `base`"],
    );
    refused(&plan("pin-bolt-cover", &["--end-gap", "-1"]), &["`end_gap` is -1"]);
    refused(&plan("pin-bolt-cover", &["--up", "0,0,0"]), &["--up", "+z", "0,0,0"]);
    refused(&plan("pin-bolt-cover", &["--clearance", "nan"]), &["`clearance` is NaN"]);
    refused(
        &plan("pin-bolt-cover", &["--keep-out", "pin", "--target", "pin"]),
        &["part `pin` is a target and in `keep_out`"],
    );
}

#[test]
fn what_is_to_be_kept_stays_unless_others_cannot_leave_otherwise() {
    let document = |output: &Output| {
        assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
        PlanDocument::from_json(&stdout(output)).unwrap()
    };
    let kept = document(&plan("pin-bolt-cover", &["--keep", "cover", "--keep", "bolt", "--json", "-"]));
    assert_eq!((&kept.status[..], kept.steps.len()), ("complete", 1));
    assert_eq!(
        (&kept.keep[..], &kept.remaining[..]),
        (&["bolt", "cover"].map(String::from)[..], &["base", "bolt", "cover"].map(String::from)[..])
    );
    assert!(kept.warnings.is_empty(), "{:?}", kept.warnings);
    let left = document(&plan("pin-bolt-cover", &["--keep", "pin", "--target", "bolt", "--json", "-"]));
    assert_eq!(left.remaining, ["base", "cover"]);
    let warning = &left.warnings[0];
    assert_eq!(warning.part.as_deref(), Some("pin"));
    assert!(warning.message.contains("to be kept"), "{}", warning.message);

    // The description of a folder says the same, and the option takes precedence.
    let folder = tempfile::tempdir().unwrap();
    for file in fs::read_dir(assembly("pin-bolt-cover")).unwrap().map(Result::unwrap) {
        fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
    }
    let path = folder.path().to_str().unwrap();
    let run_with = |keep: &str, options: &[&str]| {
        fs::write(folder.path().join("assembly.json"), format!(r#"{{"fixed": ["base"], "keep": {keep}}}"#))
            .unwrap();
        run(&[&["plan", path, "--embedded", "--json", "-"], options].concat())
    };
    assert_eq!(document(&run_with(r#"["cover.obj"]"#, &[])).remaining, ["base", "cover"]);
    let option = document(&run_with(r#"["bolt", "cover"]"#, &["--keep", "cover"]));
    assert_eq!((&option.keep[..], option.remaining.len()), (&["cover".to_owned()][..], 2));
    refused(&run_with(r#"["lid"]"#, &[]), &["assembly.json", "there is no part `lid`"]);
    refused(&run_with(r#"["base"]"#, &[]), &["part `base` is in `fixed` and in `keep`"]);
    refused(&plan("pin-bolt-cover", &["--keep", "lid"]), &["--keep", "`lid`"]);
    refused(&plan("pin-bolt-cover", &["--keep", "pin", "--fixed", "pin"]), &["`pin`", "`fixed`", "`keep`"]);
    refused(
        &plan("pin-bolt-cover", &["--keep", "pin", "--target", "pin"]),
        &["part `pin` is a target and in `keep`"],
    );
}

#[test]
fn groups_of_the_input_leave_as_wholes_if_they_are_preferred() {
    refused(&plan("pin-bolt-cover", &["--groups", "prefer"]), &["names no groups", "assembly.json"]);
    let folder = tempfile::tempdir().unwrap();
    for file in fs::read_dir(assembly("pin-bolt-cover")).unwrap().map(Result::unwrap) {
        fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
    }
    fs::write(folder.path().join("assembly.json"), r#"{"groups": {"lid": ["cover", "bolt"]}}"#).unwrap();
    let path = folder.path().to_str().unwrap();
    let steps = |options: &[&str]| {
        let output = run(&[&["plan", path, "--embedded", "--base", "base", "--json", "-"], options].concat());
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let steps = PlanDocument::from_json(&stdout(&output)).unwrap().steps.into_iter();
        steps.map(|step| (step.parts.join(" "), step.of)).collect::<Vec<_>>()
    };
    assert!(steps(&[]).iter().all(|(parts, of)| !parts.contains(' ') && of.is_none()));
    let preferred = steps(&["--groups", "prefer"]);
    let lid = preferred.iter().position(|(parts, of)| parts == "bolt cover" && of.is_none());
    assert!(lid.is_some() && preferred.iter().any(|(_, of)| *of == lid), "{preferred:?}");
    refused(
        &run(&["plan", path, "--embedded", "--groups", "prefer", "--planner", "pdp-t"]),
        &["`groups`", "sbdp-star", "pdp-t"],
    );
}

#[test]
fn a_spent_budget_exits_3_and_a_passed_deadline_4() {
    let spent = plan("threaded-bolt-and-nut", &["--no-sweeps", "--max-simulations", "0", "--json", "-"]);
    assert_eq!(spent.status.code(), Some(3), "{}", stderr(&spent));
    assert_eq!(PlanDocument::from_json(&stdout(&spent)).unwrap().status, "partial");
    let late = plan("linked-rings", &["--timeout", "0", "--json", "-"]);
    assert_eq!(late.status.code(), Some(4), "{}", stderr(&late));
    assert_eq!(PlanDocument::from_json(&stdout(&late)).unwrap().status, "timeout");
}

#[test]
fn a_trace_is_explained_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("trace.jsonl");
    let output = plan("pin-bolt-cover", &["--trace", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let told = run(&["explain", file.to_str().unwrap()]);
    assert_eq!(told.status.code(), Some(0), "{}", stderr(&told));
    let text = stdout(&told);
    for words in [
        "sbdp-star with sliding on 4 parts",
        "static analysis of pin",
        "=== bolt is out, which requires pin to have moved",
        "complete",
    ] {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert_eq!(plan("linked-rings", &["--trace", file.to_str().unwrap()]).status.code(), Some(3));
    let text = stdout(&run(&["explain", file.to_str().unwrap()]));
    assert!(text.contains("Parts a and b remain. It is proved that"), "{text}");
    fs::write(&file, "{\"event\":\"pass\",\"phase\":\"rotation\",\"depth_limit\":null}\nnonsense\n").unwrap();
    refused(&run(&["explain", file.to_str().unwrap()]), &["trace.jsonl", "line 2"]);
}

#[test]
fn every_planner_plans_from_the_command_line() {
    for planner in sbdp::search::Planner::ALL.map(sbdp::search::Planner::name) {
        let output = plan("pin-bolt-cover", &["--planner", planner, "--json", "-"]);
        assert_eq!(output.status.code(), Some(0), "{planner}: {}", stderr(&output));
        let document: PlanDocument = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(document.planner, planner);
    }
}

#[test]
fn an_unwritable_file_exits_1() {
    let output = plan("peg-stl", &["--json", "/nonexistent/plan.json"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/nonexistent/plan.json"));
}

/// A chain of so many rings that a search would take minutes to give up on it.
fn chain(folder: &Path) {
    for link in 0..60 {
        fs::write(folder.join(format!("{link}.obj")), common::ring(link)).unwrap();
    }
}

/// A plan that takes longer than the tests that cut it short, at work: `place` is an option.
fn start_long(daemon: Option<&Daemon>, place: &[&str], assembly: &Path) -> Child {
    chain(assembly);
    let trace = tempfile::NamedTempFile::new().unwrap();
    fs::remove_file(trace.path()).unwrap();
    let mut command = sbdp();
    if let Some(daemon) = daemon {
        command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir());
    }
    command.arg("plan").arg(assembly).args(place).args(["--json", "-", "--trace"]).arg(trace.path());
    let planning = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // The trace is begun when all files are read.
    while !trace.path().exists() || daemon.is_some_and(|d| plans_running(d) == 0) {
        std::thread::sleep(Duration::from_millis(10));
    }
    planning
}

fn interrupt(process: &Child) {
    kill_process(Pid::from_child(process), Signal::INT).unwrap();
}

/// It ended with exit code 5 and the plan so far.
#[track_caller]
fn cancelled(output: &Output) -> PlanDocument {
    assert_eq!(output.status.code(), Some(5), "{}", stderr(output));
    let document = PlanDocument::from_json(&stdout(output)).unwrap();
    assert_eq!(document.status, "cancelled");
    document
}

/// Whether the process has set its handlers, by the kernel's mask of caught signals.
fn catches_interrupts(process: &Child) -> bool {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).unwrap();
    let caught = status.lines().find_map(|l| l.strip_prefix("SigCgt:"));
    let caught = caught.expect("the process ended early; its status has no signals");
    u64::from_str_radix(caught.trim(), 16).unwrap() >> (Signal::INT.as_raw() - 1) & 1 == 1
}

fn plans_running(daemon: &Daemon) -> u32 {
    daemon.connect().status().unwrap().numbers.running
}

#[test]
fn an_interrupt_ends_with_what_is_there() {
    let daemon = Daemon::start();
    for daemon in [None, Some(&daemon)] {
        let folder = tempfile::tempdir().unwrap();
        let place = if daemon.is_some() { "--daemon" } else { "--embedded" };
        let planning = start_long(daemon, &[place], folder.path());
        interrupt(&planning);
        cancelled(&planning.wait_with_output().unwrap());
    }
}

#[test]
fn an_interrupt_while_files_are_read_ends_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("endless.obj");
    rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR).unwrap();
    let mut command = sbdp();
    let reading = command.arg("plan").arg(&pipe).stdout(Stdio::piped()).spawn().unwrap();
    while !catches_interrupts(&reading) {
        std::thread::sleep(Duration::from_millis(10));
    }
    interrupt(&reading);
    let output = reading.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stdout.len()), (Some(5), 0));
}

#[test]
fn an_interrupt_is_heard_while_the_daemon_hangs() {
    let daemon = Daemon::start();
    let folder = tempfile::tempdir().unwrap();
    let planning = start_long(Some(&daemon), &[], folder.path());
    daemon.signal(Signal::STOP);
    interrupt(&planning);
    let plan = cancelled(&planning.wait_with_output().unwrap());
    assert_eq!((plan.steps.len(), plan.remaining.len()), (0, 60));
}

#[test]
fn a_daemon_that_dies_is_told_where_no_other_place_will_do() {
    let daemon = Daemon::start();
    let folder = tempfile::tempdir().unwrap();
    let planning = start_long(Some(&daemon), &["--daemon"], folder.path());
    // Killed and not waited for: what remains of it until then must not pass for a daemon.
    daemon.signal(Signal::KILL);
    let output = planning.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).contains("restart `sbdpd`"), "{}", stderr(&output));
}

#[test]
fn a_plan_whose_daemon_dies_is_made_here_and_that_is_told_at_once() {
    let daemon = Daemon::start();
    let folder = tempfile::tempdir().unwrap();
    let mut planning = start_long(Some(&daemon), &[], folder.path());
    daemon.signal(Signal::KILL);
    let mut line = String::new();
    BufReader::new(planning.stderr.take().unwrap()).read_line(&mut line).unwrap();
    assert!(line.contains("went away") && line.contains("planning in this process"), "{line}");
    interrupt(&planning);
    cancelled(&planning.wait_with_output().unwrap());
}

#[test]
fn a_plan_whose_daemon_dies_is_the_same() {
    let mut daemon = Daemon::start();
    let traces = tempfile::tempdir().unwrap();
    let [through, here] = ["through", "here"].map(|name| traces.path().join(name));
    // The daemon is stopped while it is asked, so that it dies before it has answered.
    daemon.signal(Signal::STOP);
    let mut command = sbdp();
    command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir()).arg("plan").arg(assembly("pin-bolt-cover"));
    command.args(["--json", "-", "--trace"]).arg(&through).stdout(Stdio::piped()).stderr(Stdio::piped());
    let planning = command.spawn().unwrap();
    while !through.exists() {
        std::thread::sleep(Duration::from_millis(10));
    }
    daemon.signal(Signal::KILL);
    daemon.wait();
    let output = planning.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(stderr(&output).contains("planning in this process"), "{}", stderr(&output));
    let there = PlanDocument::from_json(&stdout(&output)).unwrap();
    let alone = plan("pin-bolt-cover", &["--json", "-", "--trace", here.to_str().unwrap()]);
    let alone = PlanDocument::from_json(&stdout(&alone)).unwrap();
    assert_eq!(there.steps, alone.steps);
    assert_eq!(fs::read(through).unwrap().len(), fs::read(here).unwrap().len());
}

#[test]
fn a_running_daemon_is_used_and_gives_the_same_plan() {
    let daemon = Daemon::start();
    let through = |options: &[&str]| {
        let mut command = sbdp();
        command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir()).arg("plan").arg(assembly("pin-bolt-cover"));
        let output = command.args(options).args(["--json", "-"]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let document = PlanDocument::from_json(&stdout(&output)).unwrap();
        PlanDocument { stats: StatsDocument::default(), ..document }
    };
    let embedded = through(&["--embedded"]);
    assert_eq!(daemon.connect().status().unwrap().numbers.requests, 0);
    assert_eq!(through(&["--daemon"]), embedded);
    assert_eq!(through(&[]), embedded);
    assert_eq!(daemon.connect().status().unwrap().numbers.requests, 2);
    let status = sbdp().env("SBDP_RUNTIME_DIR", daemon.runtime_dir()).arg("status").output().unwrap();
    assert_eq!(status.status.code(), Some(0));
    assert!(stdout(&status).contains(&format!("pid {}", daemon.pid())), "{}", stdout(&status));
}

#[test]
fn what_the_daemon_refuses_is_told_with_its_file() {
    let daemon = Daemon::start();
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("lid.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let mut command = sbdp();
    command.env("SBDP_RUNTIME_DIR", daemon.runtime_dir()).arg("plan").arg(folder.path()).arg("--daemon");
    refused(&command.output().unwrap(), &["lid.obj", "part `lid`", "one plane"]);
}

#[test]
fn json_is_indented_on_request_and_quiet_shows_nothing() {
    let pretty = plan("l-slot", &["--json", "-", "--pretty"]);
    assert!(stdout(&pretty).starts_with("{\n  \"schema\""));
    assert_eq!(PlanDocument::from_json(&stdout(&pretty)).unwrap().status, "complete");
    refused(&plan("l-slot", &["--pretty"]), &["--json"]);
    let quiet = plan("l-slot", &["--quiet"]);
    assert_eq!(
        (quiet.status.code(), stdout(&quiet), stderr(&quiet)),
        (Some(0), String::new(), String::new())
    );
}

#[test]
fn a_page_lies_beside_what_it_shows() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("l-slot.v2");
    fs::create_dir(&folder).unwrap();
    for file in fs::read_dir(assembly("l-slot")).unwrap().map(Result::unwrap) {
        fs::copy(file.path(), folder.join(file.file_name())).unwrap();
    }
    let json = place.path().join("plan.json");
    let view = ["view", folder.to_str().unwrap(), "--embedded", "--json", json.to_str().unwrap()];
    let shown = run(&view);
    assert_eq!(shown.status.code(), Some(0), "{}", stderr(&shown));
    let page = place.path().join("l-slot.v2.html");
    assert!(stdout(&shown).contains(page.canonicalize().unwrap().to_str().unwrap()));
    assert_eq!(run(&["view", json.to_str().unwrap()]).status.code(), Some(0));
    assert!(fs::read_to_string(place.path().join("plan.html")).unwrap().contains("<html"));
    // Without a browser the page is there all the same, and the error says so.
    let opened = sbdp().args(view).arg("--open").env("PATH", "/nonexistent").output().unwrap();
    assert_eq!(opened.status.code(), Some(1));
    assert!(stderr(&opened).contains("xdg-open") && stderr(&opened).contains("l-slot.v2.html"));
}

#[test]
fn shells_and_man_know_all_commands() {
    for shell in ["bash", "zsh", "fish"] {
        let text = stdout(&run(&["completions", shell]));
        assert!(text.contains("planning-timeout") && text.contains("completions"), "{shell}");
    }
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("man1");
    assert_eq!(run(&["man", folder.to_str().unwrap()]).status.code(), Some(0));
    for page in ["sbdp.1", "sbdp-plan.1", "sbdp-bench-replan.1", "sbdp-cache-evict.1"] {
        assert!(fs::read_to_string(folder.join(page)).unwrap().starts_with(".ie"), "{page}");
    }
}
