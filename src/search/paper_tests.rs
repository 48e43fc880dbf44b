//! What the paper prescribes: its worked example (its figure of the process) with the numbers, and its decisions.

use super::tests::{Recorder, problem};
use super::*;
use crate::blocking_graph::StaticAnalysis;
use crate::fixtures::{cells, cuboid, scene};
use crate::geometry::SourceMesh;
use crate::plan::PlanStatus;
use crate::simulation::{PenaltyEngine, PenaltyParameters, SlidingEngine, TransitionFunction};

const PIN: usize = 0;
const BOLT: usize = 1;
const COVER: usize = 2;
const NAMES: [&str; 3] = ["pin", "bolt", "cover"];

/// A bolt along y with a head and, near its end, a hole through it along z; in the hole a pin that sticks out on both
/// sides; on the shank, at the head, a cover that can slide towards the pin by 0.2. Above and below, the cover is a
/// channel that stops the pin by a ridge across its end, clear of the bolt, and is open towards +y.
///
/// The figures have no sizes. These follow from the numbers in the text. The vertices of the pin are extended by
/// 5 · 0.4/20 = 0.1 along y, so static analysis overlooks that the pin stops the cover; those of the cover by 0.25, so
/// once the cover is at the pin, the head counts as in its way back: f_a = 0 there.
pub(super) fn pin_bolt_cover() -> [SourceMesh; 3] {
    let pin = cells([&[-0.2, 0.2], &[0.55, 0.95], &[-1.0, -0.3, 0.3, 1.0]], |_| true);
    let bolt = cells(
        [&[-1.0, -0.5, -0.25, 0.25, 0.5, 1.0], &[-2.0, -1.0, 0.5, 1.0, 2.0], &[-1.0, -0.5, 0.5, 1.0]],
        |[x, y, z]| {
            let shank = (1..=3).contains(&x) && z == 1;
            let hole = x == 2 && y == 2;
            y == 0 || (shank && !hole)
        },
    );
    let cover = cells(
        [
            &[-0.75, -0.55, -0.3, -0.25, 0.25, 0.3, 0.55, 0.75],
            &[-1.0, 0.35, 0.7, 0.8, 1.6],
            &[-4.0, -3.5, -3.4, -1.3, -0.55, 0.0, 0.55, 1.3, 3.4, 3.5, 4.0],
        ],
        |[x, y, z]| {
            let bore = (1..=5).contains(&x) && (z == 4 || z == 5);
            let end = z == 0 || z == 9;
            let ridge = (z == 1 || z == 8) && (x != 3 || y == 2);
            let beside = (z == 2 || z == 7) && x != 3;
            if y == 0 { !bore } else { end || ridge || beside }
        },
    );
    [pin, bolt, cover]
}

fn traced(planner: Planner, engine: &dyn TransitionFunction) -> (Outcome, Vec<TraceEvent>) {
    let (scene, verifier) = scene(pin_bolt_cover());
    // As the service does: paths are verified to what the engine declares.
    let verifier = verifier.with_limit(verifier.limit().max(engine.depth_tolerance() + 1e-3));
    let mut recorder = Recorder::default();
    let problem = Problem { engine, static_analysis: StaticAnalysis::Paper, ..problem(scene, &verifier) };
    (search(planner, problem, &mut recorder), recorder.0)
}

/// Expansions and simulations as short texts, by pass.
fn account(events: &[TraceEvent]) -> Vec<Vec<String>> {
    let name = |p: usize| NAMES[p];
    let mut out = Vec::new();
    for event in events {
        let line = match event {
            TraceEvent::Pass { phase, .. } => {
                out.push(vec![format!("{phase:?}")]);
                continue;
            }
            TraceEvent::Expanded { state, part, evaluation, .. } => {
                let [c, a] = evaluation.unwrap();
                format!("expand s{state} {} ({c}, {a})", name(*part))
            }
            TraceEvent::Simulated { state, part, action, end, with, leads_to, .. } => {
                let with: Vec<_> = with.iter().map(|&p| name(p)).collect();
                let to = leads_to.map(|s| format!(" to s{s}")).unwrap_or_default();
                format!("s{state} {} {action} {end} {}{to}", name(*part), with.join("+"))
            }
            TraceEvent::Removed { parts, .. } => format!("{} is out", name(parts[0])),
            _ => continue,
        };
        out.last_mut().unwrap().push(line);
    }
    out
}

/// (f_c, f_a) of a displaced state in the graphs that static analysis gave it.
fn analysed(events: &[TraceEvent], wanted: usize) -> (usize, usize) {
    let of_state = |e: &TraceEvent| match e {
        TraceEvent::Analysed { state, blocked, .. } if *state == wanted => Some(blocked.clone()),
        _ => None,
    };
    let blocked = events.iter().find_map(of_state).unwrap();
    let parts: std::collections::BTreeSet<_> = blocked.iter().flat_map(|b| &b.parts).collect();
    (parts.len(), 6 - blocked.len())
}

#[test]
fn the_worked_example_has_the_papers_numbers() {
    let penalty = PenaltyEngine::new(PenaltyParameters::default());
    for engine in [&SlidingEngine as &dyn TransitionFunction, &penalty] {
        let (outcome, events) = traced(Planner::SbdpStar, engine);
        assert_eq!(outcome.status, PlanStatus::Complete, "{}: {:?}", engine.name(), outcome.reason);
        let passes = account(&events);
        // Parts (a) to (c): static analysis overlooks that the pin stops the cover; the bolt has no open action.
        assert_eq!(
            passes[0],
            [
                "Translation",
                "expand s0 cover (1, 1)",
                "expand s0 pin (1, 2)",
                "expand s0 bolt (2, 0)",
                "s0 cover +y collision pin to s1",
                "s0 pin +z collision cover to s2",
                "s0 pin -z collision cover to s3",
            ],
            "{}",
            engine.name()
        );
        // Part (d): rotational planning begins at the initial state, tries all actions and takes nothing out.
        assert_eq!(passes[1][0], "Rotation");
        let tried = passes[1].iter().filter(|l| l.starts_with("s0 ")).count();
        assert_eq!(tried, 3 * 12, "{}", engine.name());
        assert!(passes[1].iter().all(|l| !l.ends_with("is out") && !l.contains("disassembled")));
        // Part (e). Of the two states of the pin either may come first; ours is the older.
        assert_eq!([1, 2, 3].map(|state| analysed(&events, state)), [(2, 0), (1, 3), (1, 3)]);
        // Parts (f) to (h): without the pin, the graphs of s1 and s0 are the same, and s1 comes first.
        assert_eq!(
            passes[2],
            [
                "Translation",
                "expand s2 pin (1, 3)",
                "s2 pin +y disassembled ",
                "pin is out",
                "expand s1 cover (1, 1)",
                "s1 cover +y disassembled ",
                "cover is out",
            ],
            "{}",
            engine.name()
        );
        assert_eq!(outcome.remaining, [BOLT]);
        assert_eq!((outcome.removals[1].requires.as_slice(), outcome.removals[1].wave), (&[0][..], 1));
    }
}

#[test]
fn without_graphs_it_takes_more_simulations() {
    let (guided, _) = traced(Planner::SbdpStar, &SlidingEngine);
    let (plain, events) = traced(Planner::Sbdp, &SlidingEngine);
    assert_eq!((plain.status, plain.removals[0].parts[0]), (guided.status, PIN));
    let counts = (plain.counters.simulations, guided.counters.simulations);
    assert!(counts.0 > counts.1, "{counts:?}");
    for event in &events {
        match event {
            TraceEvent::Expanded { evaluation, excluded, .. } => {
                assert!(evaluation.is_none() && excluded.is_empty());
            }
            other => assert!(!matches!(other, TraceEvent::Analysed { .. })),
        }
    }
}

/// A base with a peg pressed into a blind hole, and in a closed void beside it a cube that slides to and fro. The peg's
/// head holds a block down in a recess, if there is a block.
///
/// By the paper's rule the peg, 0.05 too large, is blocked in all six directions, so only rotational planning takes it
/// out. It frees the block, and nothing of the cube.
fn pressed_peg(block: bool) -> Vec<SourceMesh> {
    let base = cells(
        [&[0.0, 1.0, 2.0, 2.5, 3.5, 4.5, 7.5, 8.0], &[0.0, 1.0, 2.0, 3.0], &[0.0, 1.0, 2.0, 3.0]],
        |[x, y, z]| {
            let hole = x == 1 && z >= 1;
            let recess = x == 3 && z == 2;
            let void = x == 5 && z == 1;
            y != 1 || !(hole || recess || void)
        },
    );
    let peg = cells([&[0.95, 2.05, 3.3], &[0.95, 1.5, 2.05], &[1.0, 3.0, 3.5]], |[x, _, z]| x == 0 || z == 1);
    let cube = cuboid([4.52, 1.02, 1.02], [5.48, 1.98, 1.98]);
    let held = block.then(|| cuboid([2.52, 1.02, 2.0], [3.48, 1.98, 2.98]));
    [base, peg, cube].into_iter().chain(held).collect()
}

#[test]
fn after_a_turned_part_translation_goes_on_without_analysis_if_it_left_an_action_open() {
    for (block, order, passes_before_analysis) in [(true, vec![1, 3], 3), (false, vec![1], 1)] {
        let (scene, verifier) = scene(pressed_peg(block));
        let mut recorder = Recorder::default();
        let problem =
            Problem { fixed: vec![0], static_analysis: StaticAnalysis::Paper, ..problem(scene, &verifier) };
        let outcome = search(Planner::SbdpStar, problem, &mut recorder);
        assert_eq!(outcome.removals.iter().map(|r| r.parts[0]).collect::<Vec<_>>(), order);
        let events = recorder.0;
        let peg_out = events
            .iter()
            .position(|e| matches!(e, TraceEvent::Removed { parts, .. } if parts[..] == [1]))
            .unwrap();
        let is_displaced = |e: &TraceEvent| matches!(e, TraceEvent::Analysed { state, .. } if *state > 0);
        let analysis = events.iter().position(is_displaced).expect("the cube has moved");
        assert!(
            events[..peg_out]
                .iter()
                .any(|e| matches!(e, TraceEvent::Simulated { part: 2, leads_to: Some(1), .. }))
        );
        let is_pass = |e: &&TraceEvent| matches!(e, TraceEvent::Pass { .. });
        // With the block: translation without analysis, rotation, translation. Without it: translation.
        assert_eq!(
            events[peg_out..analysis].iter().filter(is_pass).count(),
            passes_before_analysis,
            "{block}"
        );
    }
}

#[test]
fn without_sweeps_a_part_that_is_apart_already_is_simulated_like_all() {
    let apart = || scene([cuboid([0.0; 3], [4.0; 3]), cuboid([5.0, 0.0, 0.0], [8.0, 1.0, 1.0])]);
    let of_paper = Planner::ALL.into_iter().filter(|p| !matches!(p, Planner::Rrt | Planner::BkRrt));
    for (planner, sweeps) in of_paper.map(|p| (p, false)).chain([(Planner::SbdpStar, true)]) {
        let (scene, verifier) = apart();
        let problem = Problem { sweeps, ..problem(scene, &verifier) };
        let outcome = search(planner, problem, &mut Recorder::default());
        assert_eq!(outcome.status, PlanStatus::Complete);
        assert_eq!(outcome.counters.simulations, u64::from(!sweeps), "{planner:?}");
    }
}

#[test]
fn only_simulations_that_are_used_take_path_planning_time() {
    let (scene, verifier) = scene(pin_bolt_cover());
    let mut recorder = Recorder::default();
    let (mut disassembly, _) =
        super::disassembly::Disassembly::beside(problem(scene, &verifier), &mut recorder, |_| Ok(()));
    let start = disassembly.assembled(COVER);
    let action = crate::simulation::Action::translations()[2];
    let run = super::disassembly::Transition { part: COVER, start, action };
    let Ok(motions) = disassembly.simulate(&[run, run]) else { panic!("nothing interrupts it") };
    assert!(disassembly.counters.simulation.is_zero(), "none is used yet");
    disassembly.used(&motions[1]);
    assert!(!motions[1].time.is_zero());
    assert_eq!(disassembly.counters.simulation, motions[1].time);
}

#[test]
fn verification_takes_nothing_of_the_planning_time() {
    let (scene, verifier) = scene(pin_bolt_cover());
    let start = scene.bodies[PIN].planning_from_shape;
    let lifted = crate::geometry::Pose::translation(0.0, 0.0, 1.0) * start;
    let termination = Termination::default().with_planning_time(std::time::Duration::ZERO);
    let problem = Problem { termination, ..problem(scene, &verifier) };
    assert_eq!(problem.termination.check(), Err(Interrupt::DeadlinePassed));
    let checked = problem.checked_path(&[BOLT, COVER], PIN, &[start, lifted]);
    assert!(matches!(checked, Ok(Ok(_))), "{checked:?}");
    let outcome = search(Planner::Sbdp, problem, &mut Recorder::default());
    assert_eq!((outcome.status, outcome.removals.len()), (PlanStatus::Timeout, 0));
}
