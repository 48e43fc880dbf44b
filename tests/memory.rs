//! What the service says that its assemblies take in memory is what they take, and it keeps its budget.

#![allow(missing_docs)]

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicIsize, Ordering};

use common::assembly;
use sbdp::cache::Cache;
use sbdp::geometry::SourceAssembly;
use sbdp::plan::{Plan, PlanStatus};
use sbdp::search::{PlanRequest, Termination};
use sbdp::service::{AssemblyId, RECORD_KINDS, Service, ServiceError};

/// The system's, counting what is taken and not given back.
struct Counting;

static TAKEN: AtomicIsize = AtomicIsize::new(0);

// SAFETY: everything is left to the system's allocator.
#[allow(unsafe_code)]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        TAKEN.fetch_add(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        TAKEN.fetch_sub(layout.size() as isize, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A service that keeps nothing but assemblies.
fn service(budget: usize) -> Service {
    Service::new(Arc::new(Cache::in_memory(0, &RECORD_KINDS)), budget)
}

fn plan(service: &Service, assembly: &SourceAssembly) -> (AssemblyId, Plan) {
    let id = service.admit(assembly).unwrap().id;
    let request = PlanRequest { threads: 1, ..PlanRequest::default() };
    let plan = service.plan(id, &request, &Termination::default(), &mut ()).unwrap();
    assert_eq!(plan.status, PlanStatus::Complete);
    (id, plan)
}

/// The same, larger: no shape of it is one of the other.
fn grown(assembly: &SourceAssembly, by: f64) -> SourceAssembly {
    let mut grown = assembly.clone();
    for vertex in grown.parts.iter_mut().flat_map(|part| &mut part.mesh.vertices) {
        *vertex = vertex.map(|x| x * by);
    }
    grown
}

fn taken() -> isize {
    TAKEN.load(Ordering::Relaxed)
}

#[test]
fn what_assemblies_are_said_to_take_is_what_they_take() {
    // One test after the other: they all count.
    for name in ["bolted-bracket-20", "pin-bolt-cover", "l-slot"] {
        let assembly = assembly(name);
        plan(&service(usize::MAX), &assembly);
        let before = taken();
        let service = service(usize::MAX);
        plan(&service, &assembly);
        let (real, said) = (taken() - before, service.store_statistics().bytes);
        let ratio = said as f64 / real as f64;
        assert!((0.75..1.25).contains(&ratio), "{name}: {said} said, {real} taken");
    }
    what_records_are_said_to_take_is_what_they_take();
    the_budget_is_kept_whatever_comes();
    assemblies_leave_what_records_and_answers_take();
    equal_shapes_of_different_assemblies_are_one();
}

/// Of small ones, nearly all is what they are kept in.
fn what_records_are_said_to_take_is_what_they_take() {
    let base = assembly("bolted-bracket-20");
    let before = taken();
    let cache = Arc::new(Cache::in_memory(usize::MAX, &RECORD_KINDS));
    let service = Service::new(Arc::clone(&cache), 0);
    for i in 0..60 {
        plan(&service, &grown(&base, 1.0 + f64::from(i) / 100.0));
    }
    drop(service);
    let said = cache.statistics();
    let entries: u64 = said.kinds.iter().map(|kind| kind.entries).sum();
    let (real, said) = (taken() - before, said.memory_bytes);
    let ratio = said as f64 / real as f64;
    assert!((0.75..1.25).contains(&ratio), "{said} said, {real} taken by {entries} records");
    assert!(real < 180 * entries as isize, "{real} taken by {entries} records of a few bytes");
}

fn assemblies_leave_what_records_and_answers_take() {
    let base = assembly("pin-bolt-cover");
    let measuring = service(usize::MAX);
    plan(&measuring, &base);
    let one = measuring.store_statistics().bytes as usize;
    let (budget, answers) = (one * 13 / 2, one * 2);
    let service = Service::new(Arc::new(Cache::in_memory(one, &RECORD_KINDS)), budget);
    let held = |service: &Service| {
        let remembered = service.remembered();
        let (assemblies, records) = (remembered.assemblies, remembered.records.memory_bytes);
        (assemblies.assemblies, (assemblies.bytes + records) as usize)
    };
    for i in 0..12 {
        plan(&service, &grown(&base, 1.0 + f64::from(i) / 100.0));
        assert!(held(&service).1 <= budget, "{:?} of {budget} after {i}", held(&service));
    }
    let (before, _) = held(&service);
    service.set_response_bytes(answers);
    plan(&service, &grown(&base, 2.0));
    let (after, bytes) = held(&service);
    assert!(bytes <= budget - answers, "{bytes} beside {answers} of {budget}");
    assert!(before > after && after > 1, "{before} assemblies, then {after}");
}

fn the_budget_is_kept_whatever_comes() {
    let base = assembly("pin-bolt-cover");
    let measuring = service(usize::MAX);
    plan(&measuring, &base);
    let one = measuring.store_statistics().bytes as usize;
    let budget = one * 7 / 2;
    let service = service(budget);
    let before = taken();
    let mut ids = Vec::new();
    for i in 0..20 {
        let (id, _) = plan(&service, &grown(&base, 1.0 + f64::from(i) / 100.0));
        ids.push(id);
        let bytes = service.store_statistics().bytes as usize;
        assert!(bytes <= budget, "{bytes} of {budget} after {i}");
    }
    let real = taken() - before;
    assert!(real < budget as isize * 5 / 4, "{real} taken, the budget is {budget}");
    let known: Vec<bool> = ids.iter().map(|id| service.knows(*id)).collect();
    let (gone, kept) = known.split_at(17);
    assert!(
        gone.iter().all(|known| !known) && kept.iter().all(|known| *known),
        "the last ones stay: {known:?}"
    );
    let forgotten = service.plan(ids[0], &PlanRequest::default(), &Termination::default(), &mut ());
    assert!(matches!(forgotten, Err(ServiceError::UnknownAssembly)));
    plan(&service, &base);
}

fn equal_shapes_of_different_assemblies_are_one() {
    let base = assembly("bolted-bracket-20");
    let service = service(usize::MAX);
    plan(&service, &base);
    let (shapes, bytes) = (service.store_statistics().shapes, service.store_statistics().bytes);
    let mut other = base.clone();
    // A foot further off.
    let mut foot = base.parts[0].clone();
    foot.name = "foot".to_owned();
    foot.mesh.vertices.iter_mut().for_each(|v| *v = [v[0] * 0.5, v[1] * 0.5, v[2] * 0.5 - 30.0]);
    other.parts.push(foot);
    let (_, plan) = plan(&service, &other);
    let after = service.store_statistics();
    assert_eq!((after.shapes, after.shared), (shapes + 1, plan.stats.sdf_hits));
    assert!(after.shared + 1 >= shapes, "all but one: {} of {shapes}", after.shared);
    assert!(after.bytes < bytes * 3 / 2, "what is shared counts once: {} after {bytes}", after.bytes);
}
