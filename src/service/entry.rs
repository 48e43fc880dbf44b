//! An admitted assembly: from a request to its plan.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, TryLockError};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::blocking_graph::{BLOCKING, StaticAnalysis};
use crate::cache::{RecordKind, RequestCache};
use crate::geometry::{Assembly, Shape};
use crate::plan::{Base, OVERLAP, Plan, PlanStatus, VERDICT, Verifier};
use crate::scene::{HullTree, JoinedHulls};
use crate::search::{
    Effort, Engine, Observer, PlanRequest, PlanSink, PreferredGroups, Problem, Release, Staging, SteadyOrder,
    TraceEvent, initial_graphs, search,
};
use crate::simulation::{
    MOTION, PenaltyEngine, PenaltyParameters, SlidingEngine, TOUCHING, TransitionFunction,
};
use crate::termination::{Interrupt, Termination};

use super::ServiceError;
use super::answer::{self, CacheHits, PlanFrame, SearchAnswer, StageTimes};
use super::assembly_plan::AssemblyPlanner;
use super::pools::Pools;
use super::prepared::{self, Prepared};
use super::records::{PlanAnswer, PlanQuestion, remember_plan, remembered_plan};
use super::relay::{Discard, Relay, WithoutSteps};
use super::shared_shape::SharedShape;
use super::steady::Standing;

/// Refuses what is no length.
pub(super) fn check_length(field: &'static str, length: Option<f64>) -> Result<(), ServiceError> {
    let wrong = length.filter(|length| !length.is_finite() || *length < 0.0);
    wrong.map_or(Ok(()), |value| Err(ServiceError::NoLength { field, value }))
}

fn check_direction(field: &'static str, value: [f64; 3]) -> Result<(), ServiceError> {
    let length = Vector3::from(value).norm();
    let is_direction = length.is_finite() && length > 0.0;
    if is_direction { Ok(()) } else { Err(ServiceError::NoDirection { field, value }) }
}

/// Refuses a direction against gravity that is none, and a coefficient of friction that is negative or not finite.
///
/// # Errors
/// The value that is refused.
pub fn check_gravity(up: [f64; 3], friction: f64) -> Result<(), ServiceError> {
    if !(friction.is_finite() && friction >= 0.0) {
        return Err(ServiceError::NoFriction { value: friction });
    }
    check_direction("gravity", up)
}

/// What the wanted clearance of an assembly plan does not cover.
fn clearance_note(request: &PlanRequest) -> Option<String> {
    let waits = matches!(request.assembly, Some(Staging::Beside(_)));
    let words =
        "parts keep the clearance where they are put in, and not on their way there from where they wait";
    (waits && request.clearance > 0.0).then(|| words.to_owned())
}

/// Refuses values of a request that are none.
fn check_values(request: &PlanRequest) -> Result<(), ServiceError> {
    check_length("end_gap", request.end_gap)?;
    check_length("clearance", Some(request.clearance))?;
    request.up.map_or(Ok(()), |up| check_direction("up", up))?;
    if let Some(SteadyOrder { up, friction, .. }) = request.steady {
        check_gravity(up, friction)?;
    }
    if !request.groups.is_empty() && !request.prefers_groups() {
        let (planner, actions) = (request.planner.name(), request.actions.name());
        return Err(ServiceError::NoGroups { planner, actions });
    }
    Ok(())
}

/// An admitted assembly. Overlaps are measured, and fields built, when they are first needed.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) assembly: Assembly,
    /// The shapes of the assembly, with their fields.
    pub(super) shapes: Vec<Arc<SharedShape>>,
    /// How many of the shapes another assembly had before.
    shapes_known: u64,
    /// Joined hulls, shared with other assemblies.
    hulls: Arc<JoinedHulls>,
    prepared: Mutex<Option<Arc<Prepared>>>,
}

impl Entry {
    pub(super) fn new(
        assembly: Assembly,
        shapes: Vec<Arc<SharedShape>>,
        shapes_known: u64,
        hulls: Arc<JoinedHulls>,
    ) -> Self {
        Self { assembly, shapes, shapes_known, hulls, prepared: Mutex::default() }
    }

    /// Approximate bytes in memory, without its shapes.
    pub(super) fn memory(&self) -> usize {
        let parts = self.assembly.parts.iter().map(|part| size_of_val(part) + part.name.len());
        size_of::<Self>() + parts.sum::<usize>() + self.at_hand().map_or(0, |prepared| prepared.memory())
    }

    /// The plan of a request: the cached one, or a new one, made on a pool with as many threads as the request asks
    /// for or, without pools, on the caller's threads.
    ///
    /// # Errors
    /// The threads could not be started.
    pub(super) fn plan(
        &self,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
        cache: &RequestCache,
        pools: Option<&Pools>,
    ) -> Result<Plan, ServiceError> {
        let started = Instant::now();
        let limited = request.planning_timeout.map(|limit| termination.with_planning_time(limit));
        let termination = limited.as_ref().unwrap_or(termination);
        let mut fixed = request.fixed.clone();
        fixed.extend(&self.assembly.fixed);
        let PlanRequest { mut removed, mut base, mut keep, keep_out, .. } = request.clone();
        fixed.extend(&keep_out);
        for list in [&mut fixed, &mut removed, &mut base, &mut keep] {
            list.sort_unstable();
            list.dedup();
        }
        for list in [&mut fixed, &mut base, &mut keep] {
            list.retain(|p| removed.binary_search(p).is_err());
        }
        check_values(request)?;
        for (field, list) in [("keep_out", &keep_out), ("fixed", &fixed), ("base", &base), ("keep", &keep)] {
            if let Some(&part) = request.targets.iter().flatten().find(|p| list.contains(p)) {
                let name = self.assembly.parts[part].name.clone();
                return Err(ServiceError::TargetStays { name, field });
            }
        }
        if let Some(&part) = keep.iter().find(|part| fixed.binary_search(part).is_ok()) {
            return Err(ServiceError::FixedAndKept { name: self.assembly.parts[part].name.clone() });
        }
        let frame = PlanFrame {
            assembly: &self.assembly,
            request,
            fixed,
            removed,
            base,
            keep,
            overlaps: Vec::new(),
            notes: Vec::new(),
        };
        let mut frame = frame;
        frame.notes.extend(clearance_note(request));
        let PlanFrame { fixed, removed, base, keep, .. } = &frame;
        let [fixed, removed, base, keep] = [fixed, removed, base, keep].map(Vec::clone);
        let assembly = &self.assembly;
        let question =
            PlanQuestion { assembly, request, fixed: &fixed, removed: &removed, base: &base, keep: &keep };
        // A trace shows what the search does, so the search must run.
        let known = if sink.traces() { None } else { remembered_plan(cache, &question) };
        let known = match known {
            Some(answered) if request.assembly.is_none() && request.steady.is_none() => {
                let (frame, answer) = self.remembered(frame, answered, sink, started);
                return Ok(frame.plan(answer));
            }
            known => known,
        };
        let time = Time { started, termination };
        let make = || self.made(frame, &question, known, time, sink, cache);
        match pools {
            Some(pools) => pools.on(request.threads, make),
            None => Ok(make()),
        }
    }

    /// Makes a plan. `known` is the search's cached answer, if there is one.
    fn made(
        &self,
        frame: PlanFrame<'_>,
        question: &PlanQuestion<'_>,
        known: Option<PlanAnswer>,
        time: Time<'_>,
        sink: &mut dyn PlanSink,
        cache: &RequestCache,
    ) -> Plan {
        let (prepared, hit) = match self.ready(question.request, time.termination, cache) {
            Ok(prepared) => prepared,
            Err(interrupt) => return ended_before(frame, interrupt, "overlaps were measured"),
        };
        let started = Instant::now();
        if looks_at_all_fields(question.request)
            && let Err(interrupt) = prepared.build_fields(time.termination, sink)
        {
            return ended_before(frame, interrupt, "fields were built");
        }
        let ready = SearchInput { prepared: &prepared, hit, fields: started.elapsed(), cache, question };
        let PlanRequest { assembly: staging, steady, .. } = question.request;
        if staging.is_none() && steady.is_none() {
            let (frame, answer) = self.searched(frame, &ready, time, sink);
            return frame.plan(answer);
        }
        // Steps in the order of the search are not those of the plan.
        let without_steps = &mut WithoutSteps { sink: &mut *sink };
        let (mut frame, mut answer) = match known {
            Some(known) => self.remembered(frame, known, without_steps, time.started),
            None => self.searched(frame, &ready, time, without_steps),
        };
        if let Some(wanted) = steady {
            let is_there = |part: &usize| frame.removed.binary_search(part).is_err();
            let present: Vec<usize> = (0..self.assembly.parts.len()).filter(is_there).collect();
            let around = Standing {
                assembly: &self.assembly,
                scene: &prepared.scene,
                present: &present,
                fixed: &frame.fixed,
            };
            frame.notes.extend(around.in_steady_order(wanted, &mut answer.outcome, time.termination));
            answer.times.total = time.started.elapsed();
        }
        let Some(staging) = staging else {
            for removal in &answer.outcome.removals {
                sink.step(&answer::removal(&self.assembly, removal));
            }
            return frame.plan(answer);
        };
        let removals = answer.outcome.removals.clone();
        let plan = frame.plan(answer);
        let planner =
            AssemblyPlanner { assembly: &self.assembly, prepared: &prepared, removals: &removals, staging };
        planner.plan(plan, time.started, time.termination, sink)
    }

    /// The overlaps, and whether they were there already.
    fn ready(
        &self,
        request: &PlanRequest,
        termination: &Termination,
        cache: &RequestCache,
    ) -> Result<(Arc<Prepared>, bool), Interrupt> {
        if !request.no_cache {
            return self.prepared(termination, cache);
        }
        let fresh = |shape: &Arc<Shape>| Arc::new(SharedShape::new(Arc::clone(shape)));
        let fresh: Vec<_> = self.assembly.shapes.iter().map(fresh).collect();
        let prepared = Prepared::new(&self.assembly, &fresh, &Arc::default(), termination, cache)?;
        Ok((Arc::new(prepared), false))
    }

    /// The answer from the cache, with all steps reported to the sink.
    fn remembered<'f>(
        &self,
        mut frame: PlanFrame<'f>,
        answered: PlanAnswer,
        sink: &mut dyn PlanSink,
        started: Instant,
    ) -> (PlanFrame<'f>, SearchAnswer) {
        let PlanAnswer { outcome, overlaps } = answered;
        frame.overlaps = answer::overlaps(&self.assembly, &overlaps);
        frame.notes.extend(answer::deep_overlaps(&self.assembly, &overlaps));
        let engine = engine_of(frame.request.engine, frame.request.penalty);
        frame.notes.extend(accepted(&*engine, prepared::depth_limit(&self.assembly), &self.assembly).1);
        for removal in &outcome.removals {
            sink.step(&answer::removal(&self.assembly, removal));
        }
        let times = StageTimes { total: started.elapsed(), ..StageTimes::default() };
        (frame, SearchAnswer { outcome, times, found: CacheHits { plan: true, ..CacheHits::default() } })
    }

    fn searched<'f>(
        &self,
        mut frame: PlanFrame<'f>,
        ready: &SearchInput<'_>,
        time: Time<'_>,
        sink: &mut dyn PlanSink,
    ) -> (PlanFrame<'f>, SearchAnswer) {
        let request = frame.request;
        let Time { started, termination } = time;
        let SearchInput { prepared, hit, fields, cache, question } = *ready;
        frame.overlaps = answer::overlaps(&self.assembly, &prepared.overlaps);
        frame.notes.extend(answer::deep_overlaps(&self.assembly, &prepared.overlaps));
        let engine = engine_of(request.engine, request.penalty);
        let (limit, note) = accepted(&*engine, prepared.verifier.limit(), &self.assembly);
        let verifier = prepared.verifier.with_limit(limit);
        frame.notes.extend(note);
        let asked = SearchQuestion { question, engine: &*engine, verifier: &verifier };
        let problem = self.problem(prepared, &asked, termination, cache);
        let total = problem.present.len() as u32;
        let mut relay = Relay { assembly: &self.assembly, sink, total, tried: None };
        if relay.traces() {
            relay.traced(TraceEvent::Start {
                parts: self.assembly.parts.iter().map(|p| p.name.clone()).collect(),
                planner: request.planner.name().to_owned(),
                engine: request.engine.name().to_owned(),
            });
        }
        let outcome = search(request.planner, problem, &mut relay);
        remember_plan(cache, question, termination, &outcome, &prepared.overlaps);
        let reused = |kinds: &[&RecordKind]| kinds.iter().map(|kind| cache.reused(kind)).sum();
        let found = CacheHits {
            fields: self.shapes_reused(request, hit),
            blocking: reused(&[&OVERLAP, &BLOCKING, &TOUCHING]),
            motions: reused(&[&MOTION]),
            verdicts: reused(&[&VERDICT]),
            plan: false,
        };
        let overlaps = if hit { Duration::ZERO } else { prepared.overlap_time };
        let times = StageTimes { fields, overlaps, total: started.elapsed() };
        (frame, SearchAnswer { outcome, times, found })
    }

    /// How many shapes, with the bricks of their fields so far, were there already.
    fn shapes_reused(&self, request: &PlanRequest, prepared: bool) -> u64 {
        match (request.no_cache, prepared) {
            (true, _) => 0,
            (false, true) => self.shapes.len() as u64,
            (false, false) => self.shapes_known,
        }
    }

    /// The request as a problem of the search, in the planning frame.
    fn problem<'a>(
        &self,
        prepared: &Prepared,
        asked: &SearchQuestion<'a>,
        termination: &Termination,
        cache: &RequestCache,
    ) -> Problem<'a> {
        let PlanQuestion { request, fixed, removed, base, keep, .. } = *asked.question;
        let is_there = |part: &usize| removed.binary_search(part).is_err();
        Problem {
            scene: prepared.scene.clone(),
            verifier: asked.verifier,
            engine: asked.engine,
            present: (0..self.assembly.parts.len()).filter(is_there).collect(),
            fixed: fixed.to_vec(),
            base: Base { parts: base.to_vec(), reason: None },
            keep: keep.to_vec(),
            keep_out: request.keep_out.clone(),
            releases_kept: false,
            released: Release::Nothing,
            preferred: PreferredGroups::new(&request.groups),
            up: request.up.map(|up| Vector3::from(up).normalize()),
            targets: request.targets.clone(),
            is_group: false,
            effort: Effort::All,
            actions: request.actions,
            static_analysis: request.static_analysis,
            sweeps: request.sweeps(),
            end_gap: request.end_gap.map(|length| length * self.assembly.scale),
            clearance: request.clearance * self.assembly.scale,
            seed: request.seed,
            max_simulations: request.max_simulations,
            earlier: Vec::new(),
            spent: 0,
            path_timeout: request.path_timeout,
            termination: termination.clone(),
            cache: cache.clone(),
            verdicts: Arc::default(),
            scaled: Arc::default(),
            extra_points: HashMap::new(),
        }
    }

    /// Computes what any plan needs, until `termination` interrupts it.
    pub(super) fn prepare(&self, termination: &Termination, cache: &RequestCache) {
        // First what is not cached: a request right after a restart waits for it.
        if self.shapes.par_iter().try_for_each(|shape| shape.shape.derive(termination)).is_err() {
            return;
        }
        let Ok((prepared, _)) = self.prepared(termination, cache) else { return };
        let request = PlanRequest::default();
        let (assembly, request) = (&self.assembly, &request);
        let question = PlanQuestion { assembly, request, fixed: &[], removed: &[], base: &[], keep: &[] };
        let engine = engine_of(request.engine, request.penalty);
        let asked = SearchQuestion { question: &question, engine: &*engine, verifier: &prepared.verifier };
        // If it is interrupted, the blockages that were found are cached all the same.
        let _ = initial_graphs(&self.problem(&prepared, &asked, termination, cache));
        let all = (0..self.assembly.parts.len()).collect();
        let _ = HullTree::new(&prepared.scene, all, termination);
        let _ = prepared.build_fields(termination, &mut Discard);
    }

    /// The overlaps, if they are there.
    fn at_hand(&self) -> Option<Arc<Prepared>> {
        match self.prepared.try_lock() {
            Ok(slot) => slot.clone(),
            Err(TryLockError::Poisoned(slot)) => slot.into_inner().clone(),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// The overlaps, and whether they were there already. A request that comes while another one measures them waits
    /// for them until its own termination.
    pub(super) fn prepared(
        &self,
        termination: &Termination,
        cache: &RequestCache,
    ) -> Result<(Arc<Prepared>, bool), Interrupt> {
        loop {
            let mut slot = match self.prepared.try_lock() {
                Ok(slot) => slot,
                Err(TryLockError::Poisoned(slot)) => slot.into_inner(),
                Err(TryLockError::WouldBlock) => {
                    termination.check()?;
                    std::thread::sleep(Duration::from_millis(2));
                    continue;
                }
            };
            if let Some(prepared) = &*slot {
                return Ok((Arc::clone(prepared), true));
            }
            let prepared = Prepared::new(&self.assembly, &self.shapes, &self.hulls, termination, cache)?;
            let prepared = Arc::new(prepared);
            *slot = Some(Arc::clone(&prepared));
            return Ok((prepared, false));
        }
    }
}

/// A question, with the engine and the verifier that answer it.
struct SearchQuestion<'a> {
    question: &'a PlanQuestion<'a>,
    engine: &'a dyn TransitionFunction,
    verifier: &'a Verifier,
}

/// The start of a request's work, and its termination.
#[derive(Clone, Copy)]
struct Time<'a> {
    started: Instant,
    termination: &'a Termination,
}

/// The input of a search.
#[derive(Clone, Copy)]
struct SearchInput<'a> {
    prepared: &'a Prepared,
    /// Whether `prepared` was there already.
    hit: bool,
    /// The time to build fields before the search.
    fields: Duration,
    cache: &'a RequestCache,
    question: &'a PlanQuestion<'a>,
}

/// Whether a request needs the fields of all parts, so that they are built in parallel before. Other requests build
/// the bricks that they use.
fn looks_at_all_fields(request: &PlanRequest) -> bool {
    let PlanRequest { engine, static_analysis, assembly, .. } = request;
    *engine == Engine::Penalty || *static_analysis == StaticAnalysis::Paper || assembly.is_some()
}

/// The plan of a request that ended before its search began.
fn ended_before(frame: PlanFrame<'_>, interrupt: Interrupt, what: &str) -> Plan {
    match interrupt {
        Interrupt::Cancelled => frame.empty(PlanStatus::Cancelled, Some("cancelled".to_owned())),
        Interrupt::DeadlinePassed => {
            frame.empty(PlanStatus::Timeout, Some(format!("the deadline passed while {what}")))
        }
    }
}

/// The depth to which paths are verified, and a note for the plan: paths of an engine whose depth tolerance is larger
/// than the limit are verified to that tolerance.
fn accepted(engine: &dyn TransitionFunction, limit: f64, assembly: &Assembly) -> (f64, Option<String>) {
    if engine.depth_tolerance() <= limit {
        return (limit, None);
    }
    let limit = engine.depth_tolerance() + BETWEEN_SAMPLES;
    let (name, depth) = (engine.name(), limit / assembly.scale);
    let note =
        format!("the engine `{name}` lets parts overlap by {depth:.3e}; paths are verified to that depth");
    (limit, Some(note))
}

pub(super) fn engine_of(engine: Engine, penalty: PenaltyParameters) -> Box<dyn TransitionFunction> {
    match engine {
        Engine::Sliding => Box::new(SlidingEngine),
        Engine::Penalty => Box::new(PenaltyEngine::new(penalty)),
    }
}

/// The depth that verification may find between the samples of an engine, in units of the planning frame.
const BETWEEN_SAMPLES: f64 = 1e-3;
