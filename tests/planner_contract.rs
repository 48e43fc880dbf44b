//! What every planner owes with every engine, asked on the small assemblies.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use sbdp::files::load_assembly;
use sbdp::geometry::{SourceAssembly, Waypoint};
use sbdp::plan::{MotionKind, Plan, PlanStatus, PlanStep};
use sbdp::search::{ActionSet, Engine, PlanRequest, PlanSink, Planner, Progress};
use sbdp::service::Service;
use sbdp::termination::Termination;

/// All that exist: a new planner or engine is held to the same.
fn kinds() -> impl Iterator<Item = (Planner, Engine)> {
    Planner::ALL.into_iter().flat_map(|planner| Engine::ALL.map(|engine| (planner, engine)))
}

const IDENTITY: Waypoint = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// Depth beyond the assembled one that a step may have, of the assembly's longest side: what the
/// engines declare for a longest side of at least 5.
fn depth(engine: Engine) -> f64 {
    match engine {
        Engine::Sliding => 1e-3,
        Engine::Penalty => 0.031 / 5.0,
    }
}

fn load(name: &str) -> SourceAssembly {
    load_assembly(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies").join(name)).unwrap()
}

fn part(assembly: &SourceAssembly, name: &str) -> usize {
    assembly.parts.iter().position(|p| p.name == name).unwrap()
}

fn longest_side(assembly: &SourceAssembly) -> f64 {
    let vertices = || assembly.parts.iter().flat_map(|p| &p.mesh.vertices);
    let side = |axis: usize| {
        let values = || vertices().map(move |v| v[axis]);
        values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// Keeps the steps, and cancels after the first if it was given the flag.
#[derive(Default)]
struct Listener {
    steps: Vec<PlanStep>,
    cancel: Option<Arc<AtomicBool>>,
}

impl PlanSink for Listener {
    fn progress(&mut self, _: Progress) {}

    fn step(&mut self, step: &PlanStep) {
        self.steps.push(step.clone());
        if let Some(flag) = &self.cancel {
            flag.store(true, Ordering::Relaxed);
        }
    }
}

/// Plans, and checks what holds for every plan whatever its status.
fn plan_until(
    assembly: &SourceAssembly,
    request: &PlanRequest,
    termination: &Termination,
    mut listener: Listener,
) -> Plan {
    let service = Service::default();
    let id = service.admit(assembly).unwrap().id;
    let plan = service.plan(id, request, termination, &mut listener).unwrap();
    assert_eq!(listener.steps, plan.steps, "what was streamed is the plan");
    assert_sound(assembly, request, &plan);
    plan
}

fn plan(assembly: &SourceAssembly, request: &PlanRequest) -> Plan {
    plan_until(assembly, request, &Termination::default(), Listener::default())
}

fn assert_sound(assembly: &SourceAssembly, request: &PlanRequest, plan: &Plan) {
    let names: Vec<&String> = assembly.parts.iter().map(|p| &p.name).collect();
    assert_eq!(plan.parts.iter().collect::<Vec<_>>(), names);
    assert_eq!(plan.reason.is_none(), plan.status == PlanStatus::Complete, "{:?}", plan.reason);
    let mut gone: BTreeSet<usize> = request.removed.iter().copied().collect();
    assert_eq!(plan.removed, gone.iter().copied().collect::<Vec<_>>());
    for (i, step) in plan.steps.iter().enumerate() {
        let [part] = step.parts[..] else { panic!("one part at a time: {:?}", step.parts) };
        assert!(!plan.fixed.contains(&part), "a fixed part moves");
        let before = |&number: &usize| plan.steps.get(number).filter(|_| number < i);
        let required: Vec<_> = step.requires.iter().map(|number| before(number).unwrap()).collect();
        assert_eq!(step.wave, required.iter().map(|s| s.wave + 1).max().unwrap_or(0));
        assert!(gone.insert(part), "part {part} leaves twice, or was gone");
        assert_path(step, depth(request.engine) * longest_side(assembly));
    }
    let left: Vec<usize> = (0..plan.parts.len()).filter(|p| !gone.contains(p)).collect();
    assert_eq!(plan.remaining, left);
    for blocked in &plan.blocked {
        assert!(left.contains(&blocked.part));
        assert!(blocked.by.iter().all(|p| left.contains(p)), "blocked by a part that is gone");
    }
}

fn assert_path(step: &PlanStep, deepest: f64) {
    assert_eq!(step.path.first(), Some(&IDENTITY), "a path starts where the part stands");
    for waypoint in &step.path {
        assert!(waypoint.iter().all(|x| x.is_finite()));
        let norm = waypoint[3..].iter().map(|x| x * x).sum::<f64>();
        assert!((norm - 1.0).abs() < 1e-9, "not a rotation: {waypoint:?}");
    }
    let turns = step.path.iter().any(|w| w[3..] != IDENTITY[3..]);
    assert_eq!(step.motion == MotionKind::Rotation, turns);
    assert!((0.0..=deepest).contains(&step.verified_depth), "depth {}", step.verified_depth);
}

fn requests() -> impl Iterator<Item = PlanRequest> {
    kinds().map(|(planner, engine)| PlanRequest {
        planner,
        engine,
        actions: planner.default_actions(),
        ..PlanRequest::default()
    })
}

fn order(plan: &Plan) -> Vec<&str> {
    plan.steps.iter().map(|s| plan.part_name(s.parts[0])).collect()
}

#[test]
fn what_comes_apart_is_planned_completely() {
    for request in requests() {
        for name in ["bolt-washer-plate", "l-slot", "bolted-bracket-20", "peg-stl", "pegs.glb", "translated"]
        {
            // Random straight ways do not pass a slot without play.
            if name == "l-slot" && request.planner == Planner::Rrt {
                continue;
            }
            let plan = plan(&load(name), &request);
            assert_eq!(plan.status, PlanStatus::Complete, "{name}: {:?}", plan.reason);
            assert_eq!(plan.remaining.len(), 1, "{name}: one part stays as the rest leaves");
            assert!(plan.stats.simulations >= plan.stats.simulations_run);
        }
    }
}

#[test]
fn the_pin_leaves_before_the_bolt_before_the_cover() {
    for request in requests() {
        let plan = plan(&load("pin-bolt-cover"), &request);
        assert_eq!(plan.status, PlanStatus::Complete);
        assert_eq!(order(&plan), ["pin", "bolt", "cover"]);
        assert_eq!(plan.fixed, plan.remaining);
    }
}

#[test]
fn a_thread_is_unscrewed() {
    let assembly = load("threaded-bolt-and-nut");
    // Neither translations nor random straight ways unscrew; random simulations with penalty forces take minutes.
    let unscrews = |r: &PlanRequest| match r.planner {
        Planner::PdpT | Planner::Rrt => false,
        Planner::BkRrt => r.engine == Engine::Sliding,
        _ => true,
    };
    for request in requests().filter(unscrews) {
        let plan = plan(&assembly, &request);
        assert_eq!(plan.status, PlanStatus::Complete, "{:?}", plan.reason);
        assert_eq!(plan.steps.iter().map(|s| s.motion).collect::<Vec<_>>(), [MotionKind::Rotation]);
    }
}

#[test]
fn fixed_parts_never_move() {
    let assembly = load("pin-bolt-cover");
    for request in requests() {
        let plan = plan(&assembly, &PlanRequest { fixed: vec![part(&assembly, "cover")], ..request });
        assert_eq!(plan.status, PlanStatus::Complete, "nothing but fixed parts is left");
        assert_eq!(order(&plan), ["pin", "bolt"]);
        assert_eq!(plan.remaining, plan.fixed);
        assert_eq!(plan.fixed.len(), 2, "the request's and the assembly's own");
    }
}

#[test]
fn removed_parts_are_absent() {
    let assembly = load("pin-bolt-cover");
    for request in requests() {
        let removed = vec![part(&assembly, "pin")];
        let plan = plan(&assembly, &PlanRequest { removed, ..request });
        assert_eq!(plan.status, PlanStatus::Complete);
        assert_eq!(order(&plan), ["bolt", "cover"]);
        let bolt = part(&assembly, "bolt");
        let bolt = plan.steps.iter().find(|s| s.parts == [bolt]).unwrap();
        assert!(bolt.requires.is_empty(), "what was gone before is no step");
    }
}

#[test]
fn targets_end_the_plan() {
    let assembly = load("pin-bolt-cover");
    for request in requests() {
        let bolt = part(&assembly, "bolt");
        let plan = plan(&assembly, &PlanRequest { targets: Some(vec![bolt]), ..request });
        assert_eq!(plan.status, PlanStatus::Complete);
        assert_eq!(plan.targets, Some(vec![bolt]));
        assert_eq!(order(&plan), ["pin", "bolt"]);
    }
}

#[test]
fn a_spent_budget_gives_a_partial_plan_with_its_reason() {
    for request in requests() {
        let request = PlanRequest { max_simulations: Some(1), sweeps: Some(false), ..request };
        let plan = plan(&load("pin-bolt-cover"), &request);
        assert_eq!(plan.status, PlanStatus::Partial);
        assert!(plan.reason.as_ref().is_some_and(|r| r.contains("1 simulation")), "{:?}", plan.reason);
        assert!(plan.stats.simulations <= 1 && plan.steps.len() <= 1);
    }
}

#[test]
fn a_deadline_in_the_past_is_a_timeout() {
    for request in requests() {
        let late = Termination::new(Some(Instant::now()));
        let plan = plan_until(&load("l-slot"), &request, &late, Listener::default());
        assert_eq!((plan.status, plan.steps.len()), (PlanStatus::Timeout, 0));
    }
}

#[test]
fn a_request_cancelled_before_it_began_is_cancelled() {
    for request in requests() {
        let termination = Termination::default();
        termination.cancel_flag().store(true, Ordering::Relaxed);
        let plan = plan_until(&load("l-slot"), &request, &termination, Listener::default());
        assert_eq!((plan.status, plan.steps.len()), (PlanStatus::Cancelled, 0));
    }
}

#[test]
fn a_request_cancelled_on_the_way_keeps_what_it_has() {
    let assembly = load("pin-bolt-cover");
    // PDP* tells nothing before its first run has succeeded.
    for request in requests().filter(|r| r.planner != Planner::PdpStar) {
        let termination = Termination::default();
        let listener = Listener { cancel: Some(termination.cancel_flag()), ..Listener::default() };
        let plan = plan_until(&assembly, &request, &termination, listener);
        assert_eq!(plan.status, PlanStatus::Cancelled);
        assert_eq!(order(&plan), ["pin"]);
    }
}

#[test]
fn pdp_star_answers_with_the_run_that_succeeds() {
    let with = |planner, name| {
        let request = PlanRequest { planner, actions: ActionSet::Paper, ..PlanRequest::default() };
        plan(&load(name), &request)
    };
    for (name, run) in [("pin-bolt-cover", Planner::PdpT), ("threaded-bolt-and-nut", Planner::PdpR)] {
        let (both, alone) = (with(Planner::PdpStar, name), with(run, name));
        assert_eq!((both.status, &both.steps), (alone.status, &alone.steps), "{name}");
        assert_eq!(both.stats.simulations, alone.stats.simulations, "{name}: only the successful run counts");
    }
    let plan = with(Planner::PdpT, "threaded-bolt-and-nut");
    assert_eq!((plan.status, plan.steps.len()), (PlanStatus::Exhausted, 0), "no translation unscrews");
}

#[test]
fn random_trees_depend_on_the_seed_and_not_on_threads() {
    let assembly = load("bolt-washer-plate");
    for planner in [Planner::Rrt, Planner::BkRrt] {
        let with = |seed, threads| {
            plan(&assembly, &PlanRequest { planner, seed, threads, ..PlanRequest::default() })
        };
        let (first, again, other) = (with(1, 1), with(1, 2), with(2, 2));
        assert_eq!((first.status, other.status), (PlanStatus::Complete, PlanStatus::Complete));
        assert_eq!((&first.steps, first.stats.simulations), (&again.steps, again.stats.simulations));
        assert_ne!(first.steps, other.steps, "other random poses, other ways");
    }
}

#[test]
fn linked_rings_never_come_apart_and_name_each_other() {
    for request in requests() {
        let plan = plan(&load("linked-rings"), &PlanRequest { max_simulations: Some(60), ..request });
        assert!(matches!(plan.status, PlanStatus::Infeasible | PlanStatus::Partial), "{:?}", plan.status);
        assert!(plan.steps.is_empty());
        for ring in 0..2 {
            assert!(plan.blocked.iter().any(|b| b.part == ring && b.by == [1 - ring]), "ring {ring}");
        }
    }
}
