//! Converters of all kinds, as shell scripts.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use super::process::{self, Limits, Stopped};
use super::remembered::Remembered;
use super::{ConvertedStep, StepSettings, convert, forget};

/// One converter at a time: a script that is still open for writing in a process that another test is just starting
/// cannot be run.
static ONE: Mutex<()> = Mutex::new(());

const LINE: &str = r#"{"sbdp-step": 1, "converter": "x", "unit": "in", "deflection": 0.0254, "products": [], "warnings": ["`a` is odd"]}"#;

/// A converter that answers `--version` and then runs the script; `$1` to `$6` are its arguments.
struct Script {
    folder: tempfile::TempDir,
    _guard: MutexGuard<'static, ()>,
}

impl Script {
    fn new(body: &str) -> Self {
        Self::whole(&format!("if [ \"$1\" = --version ]; then echo script 1; exit; fi\n{body}\n"))
    }

    fn whole(text: &str) -> Self {
        let guard = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().unwrap();
        let program = folder.path().join("converter");
        fs::write(&program, format!("#!/bin/sh\nhere={}\n{text}", folder.path().display())).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        Self { folder, _guard: guard }
    }

    fn program(&self) -> PathBuf {
        self.folder.path().join("converter")
    }

    fn settings(&self) -> StepSettings {
        StepSettings {
            converter: Some(self.program()),
            deadline: Duration::from_secs(20),
            memory_bytes: 256 << 20,
            ..StepSettings::default()
        }
    }

    fn convert(&self) -> Result<ConvertedStep, String> {
        convert(b"ISO-10303-21;", &self.settings())
    }

    /// How often it converted, if its script counts.
    fn runs(&self) -> usize {
        fs::read_to_string(self.folder.path().join("runs")).unwrap_or_default().lines().count()
    }
}

/// A script that keeps the contract, and counts how often it was run.
fn good() -> Script {
    Script::new(&format!(
        "echo run >> $here/runs\nprintf 'glTF%s' \"$4 $6\" > \"$2\"\ncat >&2 \"$1\"\necho '{LINE}'"
    ))
}

fn refusal(body: &str) -> String {
    Script::new(body).convert().unwrap_err()
}

fn says(reason: &str, words: &[&str]) {
    assert!(words.iter().all(|word| reason.contains(word)), "{words:?}: {reason}");
}

#[test]
fn what_a_converter_writes_is_read() {
    let converted = good().convert().unwrap();
    assert_eq!(converted.glb, b"glTF0.01 0.5");
    assert_eq!(
        (converted.unit.as_str(), converted.warnings.as_slice()),
        ("in", &["`a` is odd".to_owned()][..])
    );
    assert!((converted.resolution - 0.001).abs() < 1e-12, "{}", converted.resolution);
}

#[test]
fn the_same_file_is_converted_once() {
    let script = good();
    let cache = tempfile::tempdir().unwrap();
    let settings = StepSettings { cache_folder: Some(cache.path().to_owned()), ..script.settings() };
    let first = convert(b"a", &settings).unwrap();
    assert_eq!(convert(b"a", &settings).unwrap(), first);
    assert_eq!(script.runs(), 1);
    convert(b"b", &settings).unwrap();
    convert(b"a", &StepSettings { deflection: 0.5, ..settings.clone() }).unwrap();
    assert_eq!(script.runs(), 3, "another file, another deflection");
    convert(b"a", &script.settings()).unwrap();
    assert_eq!(script.runs(), 4, "nothing is remembered without a folder");
    assert_eq!(forget(cache.path(), 0), 0);
    convert(b"a", &settings).unwrap();
    assert_eq!(script.runs(), 5, "what was forgotten");
}

#[test]
fn damaged_outputs_are_converted_again() {
    let script = good();
    let cache = tempfile::tempdir().unwrap();
    let settings = StepSettings { cache_folder: Some(cache.path().to_owned()), ..script.settings() };
    let first = convert(b"a", &settings).unwrap();
    let file = fs::read_dir(cache.path().join("step")).unwrap().next().unwrap().unwrap().path();
    let whole = fs::read(&file).unwrap();
    let mut turned = whole.clone();
    *turned.last_mut().unwrap() ^= 1;
    for (runs, damaged) in [&whole[..whole.len() - 1], &whole[..20], &turned, b""].into_iter().enumerate() {
        fs::write(&file, damaged).unwrap();
        assert_eq!(convert(b"a", &settings).unwrap(), first);
        assert_eq!(script.runs(), runs + 2);
        assert_eq!(fs::read(&file).unwrap(), whole, "it is replaced");
    }
}

#[test]
fn outputs_used_least_recently_make_room() {
    let cache = tempfile::tempdir().unwrap();
    let place = |name: &str| Remembered::new(cache.path(), name.as_bytes(), "1", 0.01, 0.5, 25_000);
    let output =
        ConvertedStep { glb: vec![7; 10_000], unit: "mm".into(), resolution: 0.01, warnings: Vec::new() };
    for name in ["a", "b"] {
        place(name).save(&output);
        thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(place("a").load().as_ref(), Some(&output));
    thread::sleep(Duration::from_millis(20));
    place("c").save(&output);
    let kept = ["a", "b", "c"].map(|name| place(name).load().is_some());
    assert_eq!(kept, [true, false, true]);
}

#[test]
fn a_refused_file_is_told_in_the_words_of_the_converter() {
    let reason = refusal("echo noise >&2; printf 'the file is \\033[31mtruncated\\n\\n' >&2; exit 3");
    says(&reason, &["refuses", "truncated"]);
    assert!(!reason.contains('\u{1b}') && !reason.contains("noise"), "{reason:?}");
}

#[test]
fn converters_that_break_the_contract_are_named() {
    let line = format!("echo '{LINE}'");
    for (body, words) in [
        (line.as_str(), &["converter", "no file"][..]),
        (&format!("echo garbage > \"$2\"; {line}"), &["something else than a GLB"]),
        ("printf glTF > \"$2\"", &["line of JSON"]),
        ("printf glTF > \"$2\"; echo fine", &["not the contract's JSON"]),
        (
            "printf glTF > \"$2\"; echo '{\"sbdp-step\": 2, \"unit\": \"mm\", \"deflection\": 1}'",
            &["version 2"],
        ),
        (
            "printf glTF > \"$2\"; echo '{\"sbdp-step\": 1, \"unit\": \"ell\", \"deflection\": 1}'",
            &["unit `ell`"],
        ),
        (
            "printf glTF > \"$2\"; echo '{\"sbdp-step\": 1, \"unit\": \"mm\", \"deflection\": -1}'",
            &["deflection"],
        ),
        ("echo 'no such option' >&2; exit 2", &["exit code 2", "no such option"]),
        ("exit 3", &["exit code 3"]),
        ("kill -SEGV $$", &["crashed", "signal 11", "256 MB"]),
    ] {
        says(&refusal(body), words);
    }
}

#[test]
fn a_converter_that_hangs_is_killed_with_its_children() {
    let script = Script::new("sleep 1000 & echo $! > $here/child; echo $$ > $here/own; wait");
    let settings = StepSettings { deadline: Duration::from_millis(500), ..script.settings() };
    let began = Instant::now();
    says(&convert(b"x", &settings).unwrap_err(), &["within 0.5 s", "--deflection"]);
    assert!(began.elapsed() < Duration::from_secs(5));
    for file in ["child", "own"] {
        let process = fs::read_to_string(script.folder.path().join(file)).unwrap();
        assert!(is_gone(process.trim()), "{file}");
    }
}

/// Whether a process is no more, or will be in a moment. One that is dead and not yet reaped is gone.
fn is_gone(process: &str) -> bool {
    let runs = || {
        let stat = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
        stat.rsplit(')')
            .next()
            .is_some_and(|rest| !rest.is_empty() && !rest.trim_start().starts_with(['Z', 'X']))
    };
    (0..100).any(|_| {
        thread::sleep(Duration::from_millis(20));
        !runs()
    })
}

#[test]
fn floods_are_stopped() {
    for (body, stream) in [("exec yes", "stdout"), ("exec yes >&2", "stderr")] {
        let began = Instant::now();
        says(&refusal(body), &["without end", stream]);
        assert!(began.elapsed() < Duration::from_secs(15), "{stream}");
    }
}

#[test]
fn memory_is_limited() {
    let began = Instant::now();
    let reason = refusal("a=xxxxxxxx; while :; do a=$a$a; done");
    says(&reason, &["the converter"]);
    assert!(reason.contains("exit code") || reason.contains("crashed"), "{reason}");
    assert!(began.elapsed() < Duration::from_secs(15), "the limit ends it, not the deadline");
}

#[test]
fn the_size_of_files_is_limited() {
    let script = Script::new("");
    let folder = tempfile::tempdir().unwrap();
    let text = "head -c 1000000 /dev/zero > big; wc -c < big";
    let limits = Limits { deadline: Duration::from_secs(20), memory_bytes: 1 << 30, file_bytes: 1 << 19 };
    let arguments = ["-c".into(), text.into()];
    let finished = process::run(Path::new("/bin/sh"), &arguments, folder.path(), &limits).unwrap();
    assert_eq!(fs::metadata(folder.path().join("big")).unwrap().len(), 1 << 19, "{finished:?}");
    drop(script);
}

#[test]
fn a_converter_does_not_outlive_sbdp() {
    let script = Script::new("");
    let file = script.folder.path().join("pid");
    let text = format!("echo $$ > {}; exec sleep 1000", file.display());
    let limits = Limits { deadline: Duration::from_secs(60), memory_bytes: 1 << 30, file_bytes: 1 << 20 };
    let mut group = process::Group::start(
        Path::new("/bin/sh"),
        &["-c".into(), text.into()],
        script.folder.path(),
        &limits,
    )
    .unwrap();
    let until = Instant::now() + Duration::from_secs(10);
    while !fs::read_to_string(&file).is_ok_and(|pid| pid.ends_with('\n')) && Instant::now() < until {
        thread::sleep(Duration::from_millis(10));
    }
    // As it is closed when the process dies.
    drop(group.child.stdin.take());
    assert!(is_gone(fs::read_to_string(&file).unwrap().trim()));
}

#[test]
fn output_that_a_daemon_holds_open_is_not_waited_for() {
    // `setsid` leaves the group, so that it is not killed.
    let script = Script::new(&format!("setsid sleep 8 & printf glTF > \"$2\"; echo '{LINE}'"));
    let began = Instant::now();
    script.convert().unwrap();
    assert!(began.elapsed() < Duration::from_secs(6));
}

#[test]
fn what_is_no_program_is_named() {
    let script = Script::new("");
    let settings = |path: &Path| StepSettings { converter: Some(path.to_owned()), ..StepSettings::default() };
    for path in [Path::new("/no/such/program"), script.folder.path(), Path::new("no-such-name-on-the-path")] {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        says(&convert(b"x", &settings(path)).unwrap_err(), &["--converter", &name, "not there"]);
    }
    let wrong = script.folder.path().join("wrong");
    fs::write(&wrong, "#!/no/such/shell\n").unwrap();
    fs::set_permissions(&wrong, fs::Permissions::from_mode(0o755)).unwrap();
    says(&convert(b"x", &settings(&wrong)).unwrap_err(), &["wrong", "exit code"]);
}

#[test]
fn a_version_is_one_line() {
    for (text, words) in [
        ("exit 4", &["exit code 4"][..]),
        ("", &["--version", "one line"]),
        ("echo a; echo b", &["--version", "one line"]),
    ] {
        says(&Script::whole(text).convert().unwrap_err(), words);
    }
    let script = Script::whole("sleep 1000");
    let settings = StepSettings { deadline: Duration::from_millis(300), ..script.settings() };
    says(&convert(b"x", &settings).unwrap_err(), &["did not end within 0.3 s"]);
}

#[test]
fn stopping_is_an_error_of_its_own() {
    let script = Script::new("sleep 1000");
    let limits = Limits { deadline: Duration::from_millis(100), memory_bytes: 1 << 30, file_bytes: 1 << 20 };
    let stopped = process::run(&script.program(), &[], script.folder.path(), &limits);
    assert!(matches!(stopped, Err(Stopped::Late)), "{stopped:?}");
}
