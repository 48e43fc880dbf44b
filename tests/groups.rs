//! Plans with groups and with parts moved aside: through the real daemon as in this process, after a restart, and after
//! changes.

mod common;

use common::{Daemon, assembly};
use sbdp::geometry::SourceAssembly;
use sbdp::plan::{Plan, PlanStatus, PlanStep, StepEnd};
use sbdp::search::PlanRequest;
use sbdp::service::Service;
use sbdp::termination::Termination;
use sbdp_client as client;
use sbdp_client::{Client, Handle, Part, PlanOptions, Summary, Vertices};

fn planned(service: &Service, name: &str, request: &PlanRequest) -> Plan {
    let id = service.admit(&assembly(name)).unwrap().id;
    service.plan(id, request, &Termination::default(), &mut ()).unwrap()
}

/// What moves out of what, and how it ends, by name.
fn moves(plan: &Plan) -> Vec<(Vec<&str>, Option<usize>, StepEnd)> {
    let names = |step: &PlanStep| step.parts.iter().map(|&part| plan.part_name(part)).collect();
    plan.steps.iter().map(|step| (names(step), step.of, step.ends)).collect()
}

/// All of a plan that a changed question may change.
fn told(plan: &Plan) -> String {
    format!(
        "{:?} {:?} {:?} {:?} {:?}",
        plan.status, plan.steps, plan.remaining, plan.kept_together, plan.reason
    )
}

fn target(name: &str, part: &str) -> PlanRequest {
    let names = assembly(name).parts.into_iter().map(|p| p.name).collect::<Vec<_>>();
    let targets = vec![names.iter().position(|n| n == part).unwrap()];
    PlanRequest { targets: Some(targets), ..PlanRequest::default() }
}

#[test]
fn a_group_leaves_and_is_taken_apart_in_groups() {
    let plan = planned(&Service::default(), "pinned-block", &PlanRequest::default());
    assert_eq!(plan.status, PlanStatus::Complete, "{:?}", plan.reason);
    let moves = moves(&plan);
    assert_eq!(moves[0], (vec!["block", "box", "pin"], None, StepEnd::Out));
    assert_eq!(moves[1], (vec!["block", "pin"], Some(0), StepEnd::Out));
    assert_eq!((moves.len(), moves[2].0.len(), moves[2].1), (3, 1, Some(1)));
    assert_eq!(plan.steps.iter().map(|step| step.wave).collect::<Vec<_>>(), [0, 1, 2]);
    for step in &plan.steps {
        assert_eq!(step.path[0], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], "where its parts stand");
    }
}

#[test]
fn a_slider_is_moved_aside_for_a_target() {
    let plan = planned(&Service::default(), "covered-pin", &target("covered-pin", "pin"));
    assert_eq!(plan.status, PlanStatus::Complete, "{:?}", plan.reason);
    assert_eq!(moves(&plan), [(vec!["slider"], None, StepEnd::Aside), (vec!["pin"], None, StepEnd::Out)]);
    assert_eq!((&plan.steps[1].requires[..], plan.remaining.len()), (&[0][..], 2));
}

/// A step as a client receives it.
type Received = (Vec<u32>, Option<u32>, client::StepEnd, Vec<[f64; 7]>, Vec<u32>, u32);

fn received(client: &Client, handle: Handle, options: &PlanOptions) -> (Vec<Received>, Summary) {
    let plan = client.plan(handle, options).unwrap().plan_to_end().unwrap();
    let received = |step: &client::Step| {
        let s = step.view();
        (s.parts.to_vec(), s.of, s.ends, s.path.to_vec(), s.requires.to_vec(), s.wave)
    };
    (plan.steps.iter().map(received).collect(), plan.summary)
}

fn uploaded(client: &Client, source: &SourceAssembly) -> Handle {
    let part = |p: &'_ sbdp::geometry::SourcePart| (p.name.clone(), p.mesh.clone());
    let owned: Vec<_> = source.parts.iter().map(part).collect();
    let parts = owned.iter().map(|(name, mesh)| Part {
        name,
        vertices: Vertices::F64(&mesh.vertices),
        triangles: &mesh.triangles,
    });
    let fixed: Vec<&str> = source.fixed.iter().map(String::as_str).collect();
    let assembly = client::Assembly {
        name: &source.name,
        units: source.units.as_deref(),
        parts: parts.collect(),
        fixed,
    };
    client.upload(&assembly).unwrap()
}

#[test]
fn a_client_receives_the_plan_of_this_process_also_after_a_restart() {
    let mut daemon = Daemon::start();
    for (name, request) in
        [("pinned-block", PlanRequest::default()), ("covered-pin", target("covered-pin", "pin"))]
    {
        let plan = planned(&Service::default(), name, &request);
        let numbers = |list: &[usize]| list.iter().map(|&n| n as u32).collect::<Vec<_>>();
        let end = |end| match end {
            StepEnd::Out => client::StepEnd::Out,
            StepEnd::Aside => client::StepEnd::Aside,
            StepEnd::In => client::StepEnd::In,
        };
        let expected: Vec<Received> = plan
            .steps
            .iter()
            .map(|s| {
                let (parts, requires) = (numbers(&s.parts), numbers(&s.requires));
                (parts, s.of.map(|of| of as u32), end(s.ends), s.path.clone(), requires, s.wave as u32)
            })
            .collect();
        let targets = request.targets.as_deref().map(numbers);
        let options = PlanOptions { targets, ..PlanOptions::default() };
        for round in ["cold", "asked again", "after a restart"] {
            if round == "after a restart" {
                daemon.kill_and_restart();
            }
            let client = daemon.connect();
            let handle = uploaded(&client, &assembly(name));
            let (steps, summary) = received(&client, handle, &options);
            assert_eq!(steps, expected, "{name}, {round}");
            assert_eq!(summary.status, client::PlanStatus::Complete, "{name}, {round}");
        }
    }
}

#[test]
fn a_changed_question_is_answered_as_by_a_service_that_knows_nothing() {
    for name in ["pinned-block", "covered-pin"] {
        let service = Service::default();
        planned(&service, name, &PlanRequest::default());
        let SourceAssembly { parts, fixed: stay, .. } = assembly(name);
        let one = |part: usize| {
            let (removed, fixed, base, targets) = (vec![part], vec![part], vec![part], Some(vec![part]));
            [
                PlanRequest { removed, ..PlanRequest::default() },
                PlanRequest { fixed, ..PlanRequest::default() },
                PlanRequest { base, ..PlanRequest::default() },
                PlanRequest { targets, ..PlanRequest::default() },
            ]
        };
        // A target that may not move is refused.
        let is_sound = |request: &PlanRequest| {
            request.targets.iter().flatten().all(|&part| !stay.contains(&parts[part].name))
        };
        for request in (0..parts.len()).flat_map(one).filter(is_sound) {
            let warm = planned(&service, name, &request);
            let cold = planned(&Service::default(), name, &request);
            assert_eq!(told(&warm), told(&cold), "{name}, {request:?}");
        }
    }
}
