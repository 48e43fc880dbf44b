use super::*;

#[test]
fn the_definition_is_consistent() {
    use clap::CommandFactory;
    Arguments::command().debug_assert();
}

#[test]
fn a_benchmark_runs_or_reports() {
    let parse = |line: &str| Arguments::try_parse_from(line.split(' ')).map(|a| a.command);
    let Ok(Command::Bench(run)) = parse("sbdp bench a b --out o --planners sbdp,pdp-star --shard 2/3") else {
        panic!("does not parse")
    };
    let run = run.run.unwrap();
    assert_eq!(run.corpora, [PathBuf::from("a"), PathBuf::from("b")]);
    assert_eq!(run.planners, ["sbdp", "pdp-star"]);
    assert_eq!((run.engines, run.timeout), (vec!["sliding".to_owned()], crate::bench::TIMEOUT));
    let Ok(Command::Bench(report)) = parse("sbdp bench report a b --out o") else { panic!("does not parse") };
    let Some(BenchCommand::Report(report)) = report.command else { panic!("no report") };
    assert_eq!(report.results.len(), 2);
    let Ok(Command::Bench(scale)) = parse("sbdp bench scale --out o --families rack --parts 10,20") else {
        panic!("does not parse")
    };
    let Some(BenchCommand::Scale(scale)) = scale.command else { panic!("no scale") };
    assert_eq!((scale.parts, scale.families.len()), (vec![10, 20], 1));
    for wrong in ["", " a", " --out o", " a --out o --planners x", " a --out o --jobs 0", " report"] {
        assert!(parse(&format!("sbdp bench{wrong}")).is_err(), "{wrong}");
    }
}

#[test]
fn sweeps_are_asked_for_or_refused_or_left_open() {
    for (flags, asked) in [
        ("", None),
        (" --sweeps", Some(true)),
        (" --no-sweeps", Some(false)),
        (" --sweeps --no-sweeps", Some(false)),
        (" --no-sweeps --sweeps", Some(true)),
    ] {
        let plan = Arguments::try_parse_from(format!("sbdp plan a{flags}").split(' ')).unwrap();
        let Command::Plan(plan) = plan.command else { panic!("no plan") };
        assert_eq!(plan.sweeps.asked(), asked, "{flags}");
        let bench = Arguments::try_parse_from(format!("sbdp bench a --out o{flags}").split(' ')).unwrap();
        let Command::Bench(bench) = bench.command else { panic!("no benchmark") };
        assert_eq!(bench.run.unwrap().sweeps().asked(), asked, "{flags}");
    }
}

#[test]
fn a_rotation_is_a_quaternion_of_any_length() {
    let half_turn = rotation("0,-2,0,0").unwrap();
    assert!((half_turn.angle() - std::f64::consts::PI).abs() < 1e-12);
    for wrong in ["", "1,0,0", "0,0,0,0", "1,0,0,x", "nan,0,0,0", "inf,0,0,1", "1,0,0,0,0"] {
        assert!(rotation(wrong).is_err(), "{wrong}");
    }
    assert!(Arguments::try_parse_from("sbdp plan a --rotate -1,0,0,1".split(' ')).is_ok());
}

#[test]
fn parts_move_by_a_shift_and_a_turn() {
    let identity = [1.0, 0.0, 0.0, 0.0];
    assert_eq!(moved("a=b=1,-2,3"), Ok(("a=b".into(), [1.0, -2.0, 3.0, 1.0, 0.0, 0.0, 0.0])));
    assert_eq!(moved("a=0,0,0,-2,0,0,0").unwrap().1[3..], identity);
    for wrong in ["a", "a=1,2", "a=1,2,nan", "a=1,2,3,4", "a=1,2,3,0,0,0,0", "a=1,2,3,1,0,0,0,0"] {
        assert!(moved(wrong).is_err(), "{wrong}");
    }
}

#[test]
fn seconds_are_from_zero_on() {
    assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
    assert_eq!(seconds("0"), Ok(Duration::ZERO));
    for wrong in ["-1", "nan", "inf", "x", ""] {
        assert!(seconds(wrong).is_err(), "{wrong}");
    }
}
