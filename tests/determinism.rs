//! The same request gives the same plan, to the bit: from a fresh service, from one asked before,
//! with nothing remembered, and for any number of threads.

use std::path::Path;

use sbdp::files::load_assembly;
use sbdp::plan::Plan;
use sbdp::search::PlanRequest;
use sbdp::service::Service;
use sbdp::termination::Termination;

/// All of a plan but its times; numbers as bits, so that `-0.0` differs from `0.0`.
fn fingerprint(plan: &Plan) -> String {
    let mut text = format!("{:?} {:?}\n", plan.status, plan.reason);
    for step in &plan.steps {
        let path: Vec<Vec<u64>> = step.path.iter().map(|w| w.iter().map(|x| x.to_bits()).collect()).collect();
        let depth = step.verified_depth.to_bits();
        text += &format!(
            "{:?} {:?} {depth:x} {:?} {path:x?}\n",
            (&step.parts, step.of, step.ends),
            step.motion,
            step.requires
        );
    }
    text + &format!("{:?} {:?} {}", plan.remaining, plan.blocked, plan.stats.simulations)
}

/// Fresh services, a service asked again, remembering nothing; one thread and two.
fn assert_deterministic(name: &str, request: &PlanRequest) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name);
    let assembly = load_assembly(&path).unwrap();
    let mut first = None;
    for threads in [1, 2] {
        let service = Service::default();
        let id = service.admit(&assembly).unwrap().id;
        for no_cache in [false, false, true] {
            let request = PlanRequest { threads, no_cache, ..request.clone() };
            let plan = service.plan(id, &request, &Termination::default(), &mut ()).unwrap();
            let found = fingerprint(&plan);
            let expected = first.get_or_insert_with(|| found.clone());
            assert!(*expected == found, "{name}, {threads} threads:\n{expected}\n{found}");
        }
    }
}

#[test]
fn pin_bolt_cover_is_planned_the_same_again() {
    assert_deterministic("pin-bolt-cover", &PlanRequest::default());
}

#[test]
fn l_slot_is_planned_the_same_again() {
    assert_deterministic("l-slot", &PlanRequest::default());
}

#[test]
fn bolted_bracket_is_planned_the_same_again() {
    assert_deterministic("bolted-bracket-20", &PlanRequest::default());
}

#[test]
fn groups_and_parts_moved_aside_are_planned_the_same_again() {
    for name in ["pinned-block", "covered-pin"] {
        assert_deterministic(name, &PlanRequest::default());
    }
}

#[test]
fn a_search_cut_short_by_its_budget_stops_at_the_same_place() {
    let request = PlanRequest { max_simulations: Some(20), ..PlanRequest::default() };
    assert_deterministic("linked-rings", &request);
}
