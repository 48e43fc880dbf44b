//! What is remembered changes nothing but the time: plans of a service that remembers are those of one that
//! does not, to the bit, whatever was asked before.

use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::cache::CacheSettings;
use crate::fixtures::{cuboid, l_shape, moved, peg_in_hole, source};
use crate::geometry::{Pose, SourceMesh};
use crate::plan::PlanStep;
use crate::search::{ActionSet, Planner, Progress};

/// Wants to be told everything, so that no plan is remembered as a whole.
struct Told {
    all: bool,
}

impl PlanSink for Told {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &PlanStep) {}
    fn traces(&self) -> bool {
        self.all
    }
}

/// A block with a peg in a blind hole, two blocks on top that hold it down, one that leans on the side, and
/// one far off: 8 wide in all, so that small edits leave the planning frame.
fn machine() -> Vec<SourceMesh> {
    let [block, peg] = peg_in_hole(0.0);
    let beside = moved(l_shape(), &Pose::translation(3.0, -1.0, -1.0));
    vec![
        block,
        peg,
        cuboid([-2.5, -2.5, 0.0], [-0.2, 2.5, 1.0]),
        cuboid([0.2, -2.5, 0.0], [2.5, 2.5, 1.0]),
        beside,
        cuboid([-3.9, -3.9, -3.0], [-3.4, -3.4, 2.0]),
    ]
}

/// Three posts on their feet, alike but for rounding, with a wall beside: what is found out about one serves
/// the others, and must not depend on which is there.
fn posts() -> Vec<SourceMesh> {
    let pairs = [-4.9, -2.3, 0.3].map(|x: f64| {
        let foot = cuboid([-0.7, -0.8, 0.0], [0.9, 1.0, 0.5]);
        let post = cuboid([-0.3, -0.4, 0.5], [0.5, 0.6, 2.0]);
        [foot, post].map(|mesh| moved(mesh, &Pose::new([x, 0.1, 0.0].into(), [0.0, 0.0, 0.3].into())))
    });
    pairs.into_iter().flatten().chain([cuboid([2.3, -4.0, 0.0], [2.6, 4.0, 3.0])]).collect()
}

/// A question: an assembly and what is asked about it.
#[derive(Debug, Clone)]
struct Question {
    meshes: Vec<SourceMesh>,
    request: PlanRequest,
}

/// Something that differs from the question before.
#[derive(Debug, Clone)]
enum Edit {
    /// A part is gone already.
    Removed(usize),
    /// A part is not even there.
    Absent(usize),
    Moved(usize, [f64; 3]),
    Turned(usize, f64),
    Stretched(usize, f64),
    /// A part that shapes the hull, anywhere.
    Post([f64; 3]),
    /// Two parts change their names.
    Swapped(usize, usize),
    Fixed(usize),
    Base(usize),
    Keep(usize),
    /// Two parts rather leave together.
    Group(usize, usize),
    Target(usize),
}

fn edit() -> impl Strategy<Value = Edit> {
    let part = || 0usize..6;
    // Contact, overlap and play all occur.
    let step = || prop::sample::select(vec![0.0, 0.0, 0.5, -0.5, 0.03, -0.03, 1e-3, -1e-3, 2e-9, 1.3]);
    let shift = (step(), step(), step()).prop_map(|(x, y, z)| [x, y, z]);
    prop_oneof![
        3 => part().prop_map(Edit::Removed),
        1 => part().prop_map(Edit::Absent),
        4 => (part(), shift).prop_map(|(p, s)| Edit::Moved(p, s)),
        1 => (part(), -0.3..0.3f64).prop_map(|(p, a)| Edit::Turned(p, a)),
        2 => (part(), 0.8..1.1f64).prop_map(|(p, s)| Edit::Stretched(p, s)),
        2 => prop::array::uniform3(-3.9..3.0f64).prop_map(Edit::Post),
        1 => (part(), part()).prop_map(|(p, q)| Edit::Swapped(p, q)),
        1 => part().prop_map(Edit::Fixed),
        1 => part().prop_map(Edit::Base),
        2 => part().prop_map(Edit::Keep),
        2 => (part(), part()).prop_map(|(p, q)| Edit::Group(p, q)),
        1 => part().prop_map(Edit::Target),
    ]
}

impl Question {
    /// Everything at once, on top of what was asked before.
    fn edited(&self, edit: &Edit) -> Self {
        let mut next = self.clone();
        let Self { meshes, request } = &mut next;
        let count = meshes.len();
        let centre = |m: &SourceMesh| Pose::translation(m.vertices[0][0], m.vertices[0][1], m.vertices[0][2]);
        let place = |mesh: &mut SourceMesh, pose: &Pose| *mesh = moved(mesh.clone(), pose);
        match *edit {
            Edit::Removed(p) => request.removed = vec![p % count],
            Edit::Absent(p) if count > 2 => drop(meshes.remove(p % count)),
            Edit::Absent(_) => {}
            Edit::Moved(p, [x, y, z]) => place(&mut meshes[p % count], &Pose::translation(x, y, z)),
            Edit::Turned(p, angle) => {
                let mesh = &mut meshes[p % count];
                let about = centre(mesh);
                place(mesh, &(about * Pose::rotation([0.0, angle, 0.0].into()) * about.inverse()));
            }
            Edit::Stretched(p, factor) => {
                let mesh = &mut meshes[p % count];
                let from = mesh.vertices[0][2];
                mesh.vertices.iter_mut().for_each(|v| v[2] = from + (v[2] - from) * factor);
            }
            Edit::Post([x, y, z]) => meshes.push(cuboid([x, y, z], [x + 0.3, y + 0.3, z + 1.5])),
            Edit::Swapped(p, q) => meshes.swap(p % count, q % count),
            Edit::Fixed(p) => request.fixed = vec![p % count],
            Edit::Base(p) => request.base = vec![p % count],
            Edit::Keep(p) => request.keep.push(p % count),
            Edit::Group(p, q) if request.prefers_groups() => {
                request.groups.push(vec![p % count, q % count]);
            }
            // Other planners refuse it.
            Edit::Group(..) => {}
            Edit::Target(p) => request.targets = Some(vec![p % count]),
        }
        let count = meshes.len();
        let PlanRequest { removed, fixed, base, keep, targets, groups, .. } = request;
        for list in [&mut *removed, fixed, base, keep].into_iter().chain(&mut *targets).chain(groups) {
            list.retain(|&p| p < count);
        }
        // What may not move is not kept, and what stays is no target.
        keep.retain(|part| !fixed.contains(part));
        let stay = [&fixed[..], base, keep].concat();
        targets.iter_mut().for_each(|targets| targets.retain(|p| !stay.contains(p)));
        next
    }

    fn ask(&self, service: &Service, no_cache: bool, sink: &mut dyn PlanSink) -> Plan {
        let id = service.admit(&source(self.meshes.clone())).unwrap().id;
        let request = PlanRequest { no_cache, ..self.request.clone() };
        service.plan(id, &request, &Termination::default(), sink).unwrap()
    }
}

/// The same plan but for what it took: numbers are equal to the bit.
fn told(plan: Plan) -> String {
    let found = (plan.stats.simulations, plan.stats.sweeps, plan.stats.states);
    let bare = Plan { stats: crate::plan::PlanStats::default(), ..plan };
    format!("{bare:?} {found:?}")
}

fn requests() -> impl Strategy<Value = PlanRequest> {
    let of = |planner, actions, sweeps| PlanRequest {
        planner,
        actions,
        sweeps: Some(sweeps),
        max_simulations: Some(40),
        threads: 1,
        ..PlanRequest::default()
    };
    prop::sample::select(vec![
        of(Planner::SbdpStar, ActionSet::Paper, false),
        of(Planner::SbdpStar, ActionSet::Extended, true),
        of(Planner::SbdpStar, ActionSet::Extended, false),
        of(Planner::PdpT, ActionSet::Paper, false),
    ])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(
        std::env::var("SBDP_TEST_EDITS").ok().and_then(|n| n.parse().ok()).unwrap_or(12)
    ))]
    #[test]
    fn a_service_that_remembers_plans_as_one_that_does_not(
        request in requests(),
        meshes in prop::sample::select(vec![machine(), posts()]),
        edits in prop::collection::vec(edit(), 1..5),
    ) {
        let remembering = Service::default();
        let mut question = Question { meshes, request };
        question.ask(&remembering, false, &mut Told { all: true });
        for edit in &edits {
            question = question.edited(edit);
            let cold = told(question.ask(&Service::default(), true, &mut Told { all: false }));
            // With what is remembered of other questions, with all of it but the plan, and with the plan.
            for all in [true, true, false] {
                let warm = told(question.ask(&remembering, false, &mut Told { all }));
                prop_assert_eq!(&warm, &cold, "after {:?}", edit);
            }
        }
    }
}

/// A service that remembers in a folder as well.
fn on_disk(folder: &std::path::Path) -> Service {
    let settings = CacheSettings { folder: Some(folder.to_owned()), ..CacheSettings::default() };
    Service::remembering(Arc::new(Cache::open(&settings, &RECORD_KINDS).unwrap()))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(
        std::env::var("SBDP_TEST_EDITS").ok().and_then(|n| n.parse().ok()).unwrap_or(6)
    ))]
    /// Every question is asked of a service that just started, about an assembly that an earlier one took in.
    #[test]
    fn a_service_that_starts_again_plans_as_one_that_does_not_remember(
        request in requests(),
        meshes in prop::sample::select(vec![machine(), posts()]),
        edits in prop::collection::vec(edit(), 1..4),
        reads_ahead in any::<bool>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut question = Question { meshes, request };
        for edit in &edits {
            let id = {
                let service = on_disk(folder.path());
                let id = service.admit(&source(question.meshes.clone())).unwrap().id;
                service.keep(id).unwrap();
                question.ask(&service, false, &mut Told { all: true });
                id
            };
            let service = on_disk(folder.path());
            prop_assert!(source_of(service.cache(), &id.0).is_none(), "there is nothing to heal it from");
            if reads_ahead {
                service.recall_recent();
                prop_assert!(service.remembered().records.memory_bytes > 0);
            }
            let cold = told(question.ask(&Service::default(), true, &mut Told { all: false }));
            let kept = service.plan(id, &question.request, &Termination::default(), &mut Told { all: true });
            prop_assert_eq!(told(kept.unwrap()), cold);
            // A change of what was kept, beside the same change of what was just taken in.
            let shifted = Pose::translation(0.0, 0.0, 0.25);
            let change = Revision { moved: vec![(1, shifted)], ..Revision::default() };
            let changed = |service: &Service, no_cache: bool| {
                let request = PlanRequest { no_cache, ..question.request.clone() };
                let id = service.revise(id, &change).unwrap().id;
                service.plan(id, &request, &Termination::default(), &mut Told { all: true }).unwrap()
            };
            let fresh = Service::default();
            fresh.admit(&source(question.meshes.clone())).unwrap();
            prop_assert_eq!(told(changed(&service, false)), told(changed(&fresh, true)), "before {:?}", edit);
            question = question.edited(edit);
        }
    }
}

/// The paper's actions, everything simulated.
fn simulated() -> PlanRequest {
    PlanRequest { actions: ActionSet::Paper, sweeps: Some(false), threads: 1, ..PlanRequest::default() }
}

fn asked(service: &Service, meshes: &[SourceMesh], request: &PlanRequest) -> Plan {
    let question = Question { meshes: meshes.to_vec(), request: request.clone() };
    question.ask(service, false, &mut Told { all: true })
}

#[test]
fn the_same_question_is_answered_without_a_simulation() {
    let service = Service::default();
    let first = asked(&service, &machine(), &simulated());
    assert_eq!(first.stats.motion_hits, 0);
    assert_eq!(first.stats.simulations_run, first.stats.simulations);
    assert!(first.stats.simulations > 3, "{:?}", first.stats);
    let again = asked(&service, &machine(), &simulated());
    assert_eq!((again.stats.simulations, again.stats.simulations_run), (first.stats.simulations, 0));
    assert!(again.stats.verdict_hits > Some(0) && again.stats.blocking_hits > 0 && !again.stats.plan_hit);
    assert_eq!(told(again), told(first));
}

#[test]
fn an_edit_far_away_costs_no_simulation_and_one_near_by_does() {
    let service = Service::default();
    asked(&service, &machine(), &simulated());
    let with = |part: usize, shift: f64| {
        let mut meshes = machine();
        meshes[part] = moved(meshes[part].clone(), &Pose::translation(0.0, 0.0, shift));
        asked(&service, &meshes, &simulated()).stats
    };
    let (far, near) = (with(5, 0.25), with(2, 0.25));
    assert!(far.simulations_run * 3 < far.simulations, "{far:?}");
    assert!(near.simulations_run > far.simulations_run, "{near:?}");
}

/// The part's motion is known, but whether it is out depends on what stands: a post far off, beyond all that
/// the motion looked at, makes the hull larger, and taking it away makes it smaller again.
#[test]
fn where_a_part_is_out_is_asked_afresh() {
    let plate = cuboid([-4.0, -4.0, -1.0], [4.0, 4.0, 0.0]);
    let block = cuboid([-1.0, -1.0, 0.0], [1.0, 1.0, 0.5]);
    let post = cuboid([-3.9, -3.9, 0.0], [-3.5, -3.5, 6.0]);
    let (low, high) = (vec![plate.clone(), block.clone()], vec![plate, block, post]);
    let request = PlanRequest { targets: Some(vec![1]), fixed: vec![0], ..simulated() };
    let length = |plan: &Plan| plan.steps.iter().find(|s| s.parts == [1]).map(|s| s.path.last().unwrap()[2]);
    for order in [[&low, &high, &low], [&high, &low, &high]] {
        let service = Service::default();
        for meshes in order {
            let request =
                PlanRequest { fixed: (0..meshes.len()).filter(|&p| p != 1).collect(), ..request.clone() };
            let warm = asked(&service, meshes, &request);
            let cold = asked(&Service::default(), meshes, &request);
            assert!(length(&warm).is_some());
            assert_eq!(told(warm), told(cold));
        }
    }
}

#[test]
fn names_and_threads_do_not_count_but_what_is_asked_does() {
    let service = Service::default();
    let mut renamed = source(machine());
    renamed.parts.iter_mut().enumerate().for_each(|(i, p)| p.name = format!("part {i}"));
    let ask = |assembly: &SourceAssembly, request: &PlanRequest| {
        let id = service.admit(assembly).unwrap().id;
        service.plan(id, request, &Termination::default(), &mut Told { all: false }).unwrap()
    };
    let first = ask(&source(machine()), &simulated());
    assert!(!first.stats.plan_hit);
    let hit = ask(&renamed, &PlanRequest { threads: 2, ..simulated() });
    assert!(hit.stats.plan_hit && hit.stats.simulations_run == 0 && hit.parts[3] == "part 3");
    // Warnings have the names in them.
    assert_eq!(hit.warnings.len(), first.warnings.len());
    let (parts, warnings) = (first.parts.clone(), first.warnings.clone());
    assert_eq!(told(Plan { parts, warnings, ..hit }), told(first));
    for other in [
        PlanRequest { removed: vec![5], ..simulated() },
        PlanRequest { fixed: vec![5], ..simulated() },
        PlanRequest { targets: Some(vec![5]), ..simulated() },
        PlanRequest { keep: vec![5], ..simulated() },
        PlanRequest { base: vec![5], ..simulated() },
        PlanRequest { max_simulations: Some(3), ..simulated() },
        PlanRequest { sweeps: Some(true), ..simulated() },
        PlanRequest { planner: Planner::Sbdp, max_simulations: Some(3), ..simulated() },
    ] {
        assert!(!ask(&renamed, &other).stats.plan_hit, "{other:?}");
        assert!(ask(&renamed, &other).stats.plan_hit, "{other:?}");
    }
    let timed =
        PlanRequest { path_timeout: Some(Duration::from_secs(3600)), removed: vec![4], ..simulated() };
    ask(&renamed, &timed);
    assert!(!ask(&renamed, &timed).stats.plan_hit, "a plan that depends on the clock");
}

/// Hits and misses of distance fields on disk.
fn fields_found(service: &Service) -> (u64, u64) {
    let counts = service.remembered().records;
    let field = counts.kinds.iter().find(|kind| kind.kind == "field").unwrap();
    (field.hits, field.misses)
}

#[test]
fn a_service_that_starts_again_maps_the_fields_that_were_looked_at() {
    let folder = tempfile::tempdir().unwrap();
    // Motions of this engine look at fields, and are not remembered.
    let request = PlanRequest { engine: Engine::Penalty, max_simulations: Some(3), ..simulated() };
    let cold = told(asked(&Service::default(), &machine(), &request));
    let service = on_disk(folder.path());
    assert_eq!(told(asked(&service, &machine(), &request)), cold);
    let (found, built) = fields_found(&service);
    assert!(found == 0 && built > 0);
    assert_eq!(service.remembered().records.mapped_bytes, 0);
    drop(service);
    let service = on_disk(folder.path());
    // The same, for a question that was not asked.
    let request = PlanRequest { max_simulations: Some(4), ..request };
    let cold = told(asked(&Service::default(), &machine(), &request));
    assert_eq!(told(asked(&service, &machine(), &request)), cold);
    let (found, _) = fields_found(&service);
    let records = service.remembered().records;
    assert!(found > 0 && records.mapped_bytes > 0 && records.mapped_bytes <= records.field_file_bytes);
}

#[test]
fn no_cache_neither_reads_nor_writes() {
    let service = Service::default();
    let question = Question { meshes: machine(), request: simulated() };
    question.ask(&service, true, &mut Told { all: false });
    let written = service.cache().statistics();
    assert!(written.kinds.iter().all(|k| k.entries + k.hits + k.misses == 0), "{written:?}");
    question.ask(&service, false, &mut Told { all: false });
    let plan = question.ask(&service, true, &mut Told { all: false });
    assert!(!plan.stats.plan_hit && plan.stats.motion_hits + plan.stats.blocking_hits == 0);
    assert_eq!(plan.stats.simulations_run, plan.stats.simulations);
}
