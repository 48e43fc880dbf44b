//! The planning service: assemblies that it knows by content, and plans about them.
//!
//! The daemon's workers and the command line without a daemon both call this, so what is
//! tested is what is used. It knows nothing of shared memory.
//!
//! Data flow of a request: assembly (`geometry`) → fields (`sdf`) and overlaps → `search` → plan in
//! the input's units (`plan`). What was answered before, in whole or in part, the `cache` knows.

mod answer;
mod prepared;
mod relay;
mod store;
#[cfg(test)]
mod tests;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, TryLockError};
use std::time::{Duration, Instant};

use crate::blocking_graph::{Audit, StaticAnalysis, audit};
use crate::cache::{Answered, Cache, PlanQuestion, Recall};
use crate::geometry::{Assembly, GeometryError, Revision, SourceAssembly, content_hash};
use crate::plan::{Overlap, Plan, PlanStatus, Warning};
use crate::search::{Engine, Observer, PlanRequest, PlanSink, Problem, TraceEvent, least_travel, search};
use crate::simulation::{PenaltyEngine, PenaltyParameters, SlidingEngine, TransitionFunction};
use crate::termination::{Interrupt, Termination};

use answer::{Found, Frame, Times};
use prepared::Prepared;
use relay::{Relay, Silent};
pub use store::StoreStatistics;
use store::{SharedShape, Store};

/// The name of an assembly: the hash of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AssemblyId(pub [u8; 32]);

/// What admission found out about an assembly.
#[derive(Debug, Clone, PartialEq)]
pub struct Admission {
    /// Its handle.
    pub id: AssemblyId,
    /// It was there before: nothing was done.
    pub known: bool,
    /// What healing found.
    pub warnings: Vec<Warning>,
}

/// Why a request was not planned at all.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// No assembly has this id (it was never uploaded, or it was evicted).
    #[error("unknown assembly: upload it (again) first")]
    UnknownAssembly,
    /// The request names a part that is not there.
    #[error("the request names part {index} in `{field}`, but the assembly has {count} parts")]
    NoSuchPart {
        /// Which list.
        field: &'static str,
        /// The index given.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// The worker threads for the request could not be started.
    #[error("cannot start worker threads: {0}")]
    Threads(String),
    /// The geometry was refused.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// One admitted assembly; fields and overlaps are made when first needed.
#[derive(Debug)]
struct Entry {
    assembly: Assembly,
    /// Those of the assembly, with their fields.
    shapes: Vec<Arc<SharedShape>>,
    prepared: Mutex<Option<Arc<Prepared>>>,
}

/// The service. Shared by all threads.
#[derive(Debug)]
pub struct Service {
    store: Store,
    cache: Arc<Cache>,
}

/// Bytes of records that a service remembers which was given no cache.
const RECORDS: usize = 64 << 20;
/// Bytes of assemblies that a service knows which was given no budget.
const ASSEMBLIES: usize = 1 << 30;

impl Default for Service {
    /// Remembers in memory, for as long as it lives.
    fn default() -> Self {
        Self::new(Arc::new(Cache::in_memory(RECORDS)), ASSEMBLIES)
    }
}

impl Service {
    /// A service for one process's own questions, which remembers in a cache.
    #[must_use]
    pub fn remembering(cache: Arc<Cache>) -> Self {
        Self::new(cache, ASSEMBLIES)
    }

    /// A service that remembers in a cache, and knows assemblies up to so many bytes of memory.
    #[must_use]
    pub fn new(cache: Arc<Cache>, budget: usize) -> Self {
        Self { store: Store::new(budget), cache }
    }

    /// How many assemblies it knows, and what they take.
    #[must_use]
    pub fn store_statistics(&self) -> StoreStatistics {
        self.store.statistics()
    }

    /// What it remembers in.
    #[must_use]
    pub fn cache(&self) -> &Arc<Cache> {
        &self.cache
    }

    /// Validates, heals and registers an assembly. The same content gives the same id, at once.
    ///
    /// # Errors
    /// The geometry was refused; the error names the part and the reason.
    pub fn admit(&self, source: &SourceAssembly) -> Result<Admission, ServiceError> {
        let id = AssemblyId(content_hash(source));
        if let Ok(entry) = self.entry(id) {
            return Ok(Admission { id, known: true, warnings: answer::warnings(&entry.assembly) });
        }
        Ok(self.taken_in(id, Assembly::new(source)?))
    }

    /// Registers what becomes of a known assembly with some change. Of no change it is the same.
    ///
    /// # Errors
    /// The base is unknown, or the change is refused; the error names the part and the reason.
    pub fn revise(&self, base: AssemblyId, revision: &Revision) -> Result<Admission, ServiceError> {
        let entry = self.entry(base)?;
        check_parts(&revised_parts(revision), entry.assembly.parts.len())?;
        let id = if revision.is_empty() { base } else { AssemblyId(revision.content_hash(&base.0)) };
        if let Ok(entry) = self.entry(id) {
            return Ok(Admission { id, known: true, warnings: answer::warnings(&entry.assembly) });
        }
        Ok(self.taken_in(id, entry.assembly.revised(revision)?))
    }

    fn taken_in(&self, id: AssemblyId, assembly: Assembly) -> Admission {
        let entry = self.store.insert(id, assembly);
        Admission { id, known: false, warnings: answer::warnings(&entry.assembly) }
    }

    /// Whether an assembly is known. If it is, it counts as used: whoever asks is about to.
    #[must_use]
    pub fn knows(&self, id: AssemblyId) -> bool {
        self.store.get(id).is_some()
    }

    /// The overlaps at the assembled pose, in the input's units.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn overlaps(&self, id: AssemblyId) -> Result<Vec<Overlap>, ServiceError> {
        let entry = self.entry(id)?;
        let recall = Recall::of(Arc::clone(&self.cache));
        let found = entry.prepared(&Termination::default(), &mut Silent, &recall);
        Ok(found.map_or_else(|_| Vec::new(), |(p, _)| answer::overlaps(&entry.assembly, &p.overlaps)))
    }

    /// Plans. Blocks until done; `termination` ends it early with a plan that says so.
    ///
    /// # Errors
    /// Nothing could be planned: unknown id, part numbers out of range.
    pub fn plan(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError> {
        let entry = self.entry(id)?;
        check_parts(&named_parts(request), entry.assembly.parts.len())?;
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(request.threads)
            .build()
            .map_err(|e| ServiceError::Threads(e.to_string()))?;
        let recall = if request.no_cache { Recall::default() } else { Recall::of(Arc::clone(&self.cache)) };
        let plan = pool.install(|| entry.plan(request, termination, sink, &recall));
        self.store.settle(id, &entry);
        Ok(plan)
    }

    /// Compares the initial blocking graphs of an assembly with simulation.
    ///
    /// # Errors
    /// The assembly is unknown, or the termination condition became true (`Ok(None)`).
    pub fn audit(
        &self,
        id: AssemblyId,
        engine: Engine,
        rule: StaticAnalysis,
        termination: &Termination,
    ) -> Result<Option<Audit>, ServiceError> {
        let entry = self.entry(id)?;
        let recall = Recall::of(Arc::clone(&self.cache));
        let Ok((prepared, _)) = entry.prepared(termination, &mut Silent, &recall) else { return Ok(None) };
        let scene = &prepared.scene;
        let present: Vec<usize> = (0..scene.bodies.len()).collect();
        let least = |part| least_travel(scene, part);
        let engine = engine_of(engine, PenaltyParameters::default());
        Ok(audit(rule, scene, &present, &*engine, &least, termination).ok())
    }

    fn entry(&self, id: AssemblyId) -> Result<Arc<Entry>, ServiceError> {
        self.store.get(id).ok_or(ServiceError::UnknownAssembly)
    }
}

impl Entry {
    fn new(assembly: Assembly, shapes: Vec<Arc<SharedShape>>) -> Self {
        Self { assembly, shapes, prepared: Mutex::default() }
    }

    /// Bytes in memory beside its shapes, about.
    fn memory(&self) -> usize {
        let parts = self.assembly.parts.iter().map(|part| size_of_val(part) + part.name.len());
        size_of::<Self>() + parts.sum::<usize>() + self.at_hand().map_or(0, |prepared| prepared.memory())
    }

    fn plan(
        &self,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
        recall: &Recall,
    ) -> Plan {
        let started = Instant::now();
        let mut fixed = request.fixed.clone();
        fixed.extend(&self.assembly.fixed);
        let mut removed = request.removed.clone();
        for list in [&mut fixed, &mut removed] {
            list.sort_unstable();
            list.dedup();
        }
        fixed.retain(|p| removed.binary_search(p).is_err());
        let frame = Frame {
            assembly: &self.assembly,
            request,
            fixed,
            removed,
            overlaps: Vec::new(),
            notes: Vec::new(),
        };
        let (fixed, removed) = (frame.fixed.clone(), frame.removed.clone());
        let question = PlanQuestion { assembly: &self.assembly, request, fixed: &fixed, removed: &removed };
        // Whoever wants to be told what the search does wants it done.
        if !sink.traces()
            && let Some(answered) = recall.plan(&question)
        {
            return self.answered(frame, answered, sink, started);
        }
        let prepared = if request.no_cache {
            let fresh: Vec<_> =
                self.assembly.shapes.iter().map(|s| Arc::new(SharedShape::new(Arc::clone(s)))).collect();
            Prepared::new(&self.assembly, &fresh, termination, sink, recall).map(|p| (Arc::new(p), false))
        } else {
            self.prepared(termination, sink, recall)
        };
        match prepared {
            Ok((prepared, hit)) => {
                let prepared = Ready { prepared: &prepared, hit, recall, question: &question };
                self.searched(frame, &prepared, termination, sink, started)
            }
            Err(Interrupt::Cancelled) => frame.empty(PlanStatus::Cancelled, Some("cancelled".to_owned())),
            Err(Interrupt::DeadlinePassed) => frame
                .empty(PlanStatus::Timeout, Some("the deadline passed while fields were built".to_owned())),
        }
    }

    /// A plan that was made before, told as if it were made now.
    fn answered(
        &self,
        mut frame: Frame<'_>,
        answered: Answered,
        sink: &mut dyn PlanSink,
        started: Instant,
    ) -> Plan {
        let Answered { outcome, overlaps } = answered;
        frame.overlaps = answer::overlaps(&self.assembly, &overlaps);
        let engine = engine_of(frame.request.engine, frame.request.penalty);
        frame.notes.extend(accepted(&*engine, prepared::depth_limit(&self.assembly), &self.assembly).1);
        for removal in &outcome.removals {
            sink.step(&answer::step(&self.assembly, removal));
        }
        let times = Times { total: started.elapsed(), ..Times::default() };
        frame.plan(outcome, &times, &Found { plan: true, ..Found::default() })
    }

    fn searched(
        &self,
        mut frame: Frame<'_>,
        ready: &Ready<'_>,
        termination: &Termination,
        sink: &mut dyn PlanSink,
        started: Instant,
    ) -> Plan {
        let request = frame.request;
        let Ready { prepared, hit, recall, question } = *ready;
        frame.overlaps = answer::overlaps(&self.assembly, &prepared.overlaps);
        let engine = engine_of(request.engine, request.penalty);
        let present: Vec<usize> =
            (0..self.assembly.parts.len()).filter(|p| frame.removed.binary_search(p).is_err()).collect();
        let total = present.len() as u32;
        let (limit, note) = accepted(&*engine, prepared.verifier.limit(), &self.assembly);
        let verifier = prepared.verifier.with_limit(limit);
        frame.notes.extend(note);
        let problem = Problem {
            scene: prepared.scene.clone(),
            verifier: &verifier,
            engine: &*engine,
            present,
            fixed: frame.fixed.clone(),
            targets: request.targets.clone(),
            actions: request.actions,
            static_analysis: request.static_analysis,
            sweeps: request.sweeps(),
            max_simulations: request.max_simulations,
            spent: 0,
            path_timeout: request.path_timeout,
            termination: termination.clone(),
            recall: recall.clone(),
            extra_points: HashMap::new(),
        };
        let mut relay = Relay { assembly: &self.assembly, sink, total };
        if relay.traces() {
            relay.traced(TraceEvent::Start {
                parts: self.assembly.parts.iter().map(|p| p.name.clone()).collect(),
                planner: request.planner.name().to_owned(),
                engine: request.engine.name().to_owned(),
            });
        }
        let outcome = search(request.planner, problem, &mut relay);
        recall.remember_plan(question, termination, &outcome, &prepared.overlaps);
        let fields = if hit { self.assembly.shapes.len() as u64 } else { prepared.fields_known };
        let found = Found { fields, pieces: recall.reused(), plan: false };
        let spent = |time: Duration| if hit { Duration::ZERO } else { time };
        let times = Times {
            fields: spent(prepared.sdf_time),
            overlaps: spent(prepared.overlap_time),
            total: started.elapsed(),
        };
        frame.plan(outcome, &times, &found)
    }

    /// Fields and overlaps, if they are there.
    fn at_hand(&self) -> Option<Arc<Prepared>> {
        match self.prepared.try_lock() {
            Ok(slot) => slot.clone(),
            Err(TryLockError::Poisoned(slot)) => slot.into_inner().clone(),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    /// Fields and overlaps, and whether they were there already. Whoever comes while they are
    /// being made waits for them, but not beyond its own termination.
    fn prepared(
        &self,
        termination: &Termination,
        sink: &mut dyn PlanSink,
        recall: &Recall,
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
            let prepared = Arc::new(Prepared::new(&self.assembly, &self.shapes, termination, sink, recall)?);
            *slot = Some(Arc::clone(&prepared));
            return Ok((prepared, false));
        }
    }
}

/// What a search works with.
#[derive(Clone, Copy)]
struct Ready<'a> {
    prepared: &'a Prepared,
    /// It was there already.
    hit: bool,
    recall: &'a Recall,
    question: &'a PlanQuestion<'a>,
}

/// The depth to which paths are verified, and what the reader of a plan should know of it: an engine that
/// lets parts overlap by more than is accepted is held to its own word.
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

fn engine_of(engine: Engine, penalty: PenaltyParameters) -> Box<dyn TransitionFunction> {
    match engine {
        Engine::Sliding => Box::new(SlidingEngine),
        Engine::Penalty => Box::new(PenaltyEngine::new(penalty)),
    }
}

/// What verification finds between the samples of an engine, in the planning frame.
const BETWEEN_SAMPLES: f64 = 1e-3;

/// Parts that a request or a change names, by field.
type Named = [(&'static str, Vec<usize>)];

fn named_parts(request: &PlanRequest) -> [(&'static str, Vec<usize>); 3] {
    let PlanRequest { fixed, removed, targets, .. } = request;
    [("fixed", fixed.clone()), ("removed", removed.clone()), ("targets", targets.clone().unwrap_or_default())]
}

fn revised_parts(revision: &Revision) -> [(&'static str, Vec<usize>); 2] {
    let replaced = revision.replaced.iter().map(|(part, _)| *part).collect();
    let moved = revision.moved.iter().map(|(part, _)| *part).collect();
    [("replaced", replaced), ("moved", moved)]
}

fn check_parts(named: &Named, count: usize) -> Result<(), ServiceError> {
    for (field, list) in named {
        if let Some(&index) = list.iter().find(|&&i| i >= count) {
            return Err(ServiceError::NoSuchPart { field, index, count });
        }
    }
    Ok(())
}
