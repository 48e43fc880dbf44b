//! The planning service: it knows assemblies by their content, and plans them.
//!
//! The daemon's workers and the command line without a daemon both call it. It knows nothing of shared memory.
//!
//! Data flow of a request: assembly (`geometry`; those in memory: `store`) → fields (`sdf`) and overlaps
//! (`prepared`) → `search` (`entry`), for an assembly plan → `assembling` (`assembly_plan`) → plan in the
//! input's units (`answer`). The `cache` keeps earlier
//! answers, whole or in part.

mod answer;
mod assembly_plan;
mod clearance;
mod entry;
mod pools;
mod prepared;
mod records;
mod relay;
mod shared_shape;
mod statics;
mod steady;
mod store;
#[cfg(test)]
mod tests;
mod tools;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Weak};

use serde::{Deserialize, Serialize};

use crate::blocking_graph::{Analysis, Audit, DirectionalGraph, StaticAnalysis, audit};
use crate::cache::{Cache, CacheStatistics, RequestCache};
use crate::geometry::{
    Assembly, AssemblySource, GeometryError, Pose, Revision, SourceAssembly, content_hash, has_source,
    healed_assembly, recent_sources, remember_healed, source_of,
};
use crate::plan::{Overlap, Plan, Warning};
use crate::scene::{HullStore, JoinedHulls, Scene};
use crate::sdf::{FieldStore, keep_field, keep_rest_of_field};
use crate::search::{Engine, PlanRequest, PlanSink, Staging, axes_of, least_travel};
use crate::simulation::{Action, Axis, PenaltyParameters};
use crate::termination::{Interrupt, Termination};

pub use clearance::{ClearanceQuery, PartClearance, PassingStep, StepClearance};
pub use entry::check_gravity;
use entry::{Entry, check_length, engine_of};
use pools::Pools;
pub use records::RECORD_KINDS;
pub(crate) use records::{AnsweredQuestion, recent_answers, remember_answer, remembered_answer};
use relay::Discard;
pub use statics::{JointKind, StandingSession, StandingState, StaticsAnswer, StaticsQuery, is_screwed_off};
use store::AssemblyStore;
pub use store::StoreStatistics;
pub use tools::FastenerTools;

/// The name of an assembly: the hash of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AssemblyId(pub [u8; 32]);

/// The result of an admission.
#[derive(Debug, Clone, PartialEq)]
pub struct Admission {
    /// Its handle.
    pub id: AssemblyId,
    /// Whether it was known before, so that nothing was done.
    pub known: bool,
    /// What healing found, and duplicate parts.
    pub warnings: Vec<Warning>,
}

/// The memory that a service uses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct MemoryStatistics {
    /// Assemblies, in memory.
    pub assemblies: StoreStatistics,
    /// Records in memory.
    pub records: CacheStatistics,
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
        /// The list in the request.
        field: &'static str,
        /// The index given.
        index: usize,
        /// How many parts the assembly has.
        count: usize,
    },
    /// A target is among the parts that stay.
    #[error("part `{name}` is a target and in `{field}`: name it in one of them")]
    TargetStays {
        /// The part.
        name: String,
        /// The list in the request.
        field: &'static str,
    },
    /// A part is to be kept, and may not move.
    #[error("part `{name}` is in `fixed` and in `keep`: name it in one of them")]
    FixedAndKept {
        /// The part.
        name: String,
    },
    /// A length is negative or not finite.
    #[error("`{field}` is {value}: give a length of at least 0")]
    NoLength {
        /// The field of the request.
        field: &'static str,
        /// The given value.
        value: f64,
    },
    /// A direction has no length, or is not finite.
    #[error("`{field}` is {value:?}: give a finite vector that is not zero")]
    NoDirection {
        /// The field of the request.
        field: &'static str,
        /// The given value.
        value: [f64; 3],
    },
    /// A coefficient of friction is negative or not finite.
    #[error("`friction` is {value}: give a number of at least 0")]
    NoFriction {
        /// The given value.
        value: f64,
    },
    /// Preferred groups were given to a planner that does not support them.
    #[error(
        "`groups` are for the planner sbdp-star with the extended actions, not for {planner} with the {actions} ones"
    )]
    NoGroups {
        /// The planner.
        planner: &'static str,
        /// Its actions.
        actions: &'static str,
    },
    /// The worker threads for the request could not be started.
    #[error("cannot start worker threads: {0}")]
    Threads(String),
    /// The geometry was refused.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}

/// The planning service, shared by all threads.
#[derive(Debug)]
pub struct Service {
    store: AssemblyStore,
    cache: Arc<Cache>,
    pools: Pools,
    /// Bytes of responses that the caller keeps in memory.
    answers: AtomicUsize,
}

/// Bytes of records in memory, in a service without a given cache.
const RECORDS: usize = 64 << 20;
/// Bytes of records and assemblies in memory, in a service without a given budget.
const ASSEMBLIES: usize = 1 << 30;

impl Default for Service {
    /// A service that caches in memory, for as long as it lives.
    fn default() -> Self {
        Self::new(Arc::new(Cache::in_memory(RECORDS, &RECORD_KINDS)), ASSEMBLIES)
    }
}

impl Service {
    /// A service for the requests of its own process, with a cache.
    #[must_use]
    pub fn remembering(cache: Arc<Cache>) -> Self {
        Self::new(cache, ASSEMBLIES)
    }

    /// A service with a cache, which keeps assemblies in memory. `budget` is in bytes and covers assemblies, the
    /// records that the cache has in memory, and the responses of [`Service::set_response_bytes`].
    #[must_use]
    pub fn new(cache: Arc<Cache>, budget: usize) -> Self {
        let hulls = JoinedHulls::stored(Arc::clone(&cache) as Arc<dyn HullStore>);
        let fields = Arc::downgrade(&cache) as Weak<dyn FieldStore>;
        let store = AssemblyStore::new(budget, hulls, fields);
        Self { store, cache, pools: Pools::default(), answers: AtomicUsize::new(0) }
    }

    /// Starts the threads for a first request that asks for `threads` of them (0: all processors).
    ///
    /// # Errors
    /// They could not be started.
    pub fn start_threads(&self, threads: usize) -> Result<(), ServiceError> {
        self.pools.on(threads, || ())
    }

    /// Sets how many bytes of the budget the caller's responses take. Does not block.
    pub fn set_response_bytes(&self, bytes: usize) {
        self.answers.store(bytes, Ordering::Relaxed);
    }

    /// How many assemblies are in memory, and how much memory they take.
    #[must_use]
    pub fn store_statistics(&self) -> StoreStatistics {
        self.store.statistics()
    }

    /// The memory that it uses. Does not block.
    #[must_use]
    pub fn remembered(&self) -> MemoryStatistics {
        MemoryStatistics { assemblies: self.store.statistics(), records: self.cache.statistics() }
    }

    /// The cache.
    #[must_use]
    pub fn cache(&self) -> &Arc<Cache> {
        &self.cache
    }

    /// Validates, heals and registers an assembly. The same content gives the same id, at once.
    ///
    /// # Errors
    /// The geometry was refused; the error names the part and the reason.
    pub fn admit(&self, source: &SourceAssembly) -> Result<Admission, ServiceError> {
        self.admit_until(source, &Termination::default())
    }

    /// The same, unless the termination condition becomes true before it is done: then nothing is registered.
    ///
    /// # Errors
    /// As [`Service::admit`], and the interruption.
    pub fn admit_until(
        &self,
        source: &SourceAssembly,
        termination: &Termination,
    ) -> Result<Admission, ServiceError> {
        let id = AssemblyId(content_hash(source));
        if let Some(entry) = self.kept(id) {
            return Ok(Admission { id, known: true, warnings: answer::warnings(&entry.assembly, |_| false) });
        }
        Ok(self.taken_in(id, Assembly::new_until(source, termination)?))
    }

    /// Registers a revision of a known assembly. An empty revision gives the assembly itself.
    ///
    /// # Errors
    /// The base is unknown, or the change is refused; the error names the part and the reason.
    pub fn revise(&self, base: AssemblyId, revision: &Revision) -> Result<Admission, ServiceError> {
        self.revise_until(base, revision, &Termination::default())
    }

    /// The same, unless the termination condition becomes true before it is done: then nothing is registered.
    ///
    /// # Errors
    /// As [`Service::revise`], and the interruption.
    pub fn revise_until(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError> {
        let entry = self.entry(base, termination)?;
        check_parts(&revised_parts(revision), entry.assembly.parts.len())?;
        let id = if revision.is_empty() { base } else { AssemblyId(revision.content_hash(&base.0)) };
        if let Some(entry) = self.kept(id) {
            return Ok(Admission { id, known: true, warnings: answer::warnings(&entry.assembly, |_| false) });
        }
        Ok(self.taken_in(id, entry.assembly.revised_until(revision, termination)?))
    }

    fn taken_in(&self, id: AssemblyId, assembly: Assembly) -> Admission {
        let entry = self.store.insert(id, assembly);
        Admission { id, known: false, warnings: answer::warnings(&entry.assembly, |_| false) }
    }

    /// Writes a healed assembly to the cache's disk, if there is one: after a restart it is loaded without healing.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn keep(&self, id: AssemblyId) -> Result<(), ServiceError> {
        remember_healed(&self.cache, &id.0, &self.entry(id, &Termination::default())?.assembly);
        Ok(())
    }

    /// Whether an assembly is known, in memory or on disk. If it is, it counts as used: the caller is about to use it.
    #[must_use]
    pub fn knows(&self, id: AssemblyId) -> bool {
        self.store.get(id).is_some() || has_source(&self.cache, &id.0)
    }

    /// The handles of the assemblies that were used last before this process began, if the cache is on disk.
    #[must_use]
    pub fn recent(&self, most: usize) -> Vec<AssemblyId> {
        recent_sources(&self.cache, most).into_iter().map(AssemblyId).collect()
    }

    /// Reads the records that were used last before this process began into memory, if the cache is on disk.
    pub fn recall_recent(&self) {
        self.store.recall_hulls();
        self.cache.recall_recent();
    }

    /// Computes what any plan of an assembly with default options needs: fields, overlaps, hulls, and the blocking
    /// graph of the assembled state.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn prepare(&self, id: AssemblyId, termination: &Termination) -> Result<(), ServiceError> {
        let entry = self.entry(id, termination)?;
        let cache = RequestCache::of(Arc::clone(&self.cache));
        entry.prepare(termination, &cache);
        self.settle(id, &entry);
        // It may have been loaded from its source, because another build had healed it.
        remember_healed(&self.cache, &id.0, &entry.assembly);
        Ok(())
    }

    /// The overlaps at the assembled pose, in the input's units.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn overlaps(&self, id: AssemblyId) -> Result<Vec<Overlap>, ServiceError> {
        let entry = self.entry(id, &Termination::default())?;
        let cache = RequestCache::of(Arc::clone(&self.cache));
        let found = entry.prepared(&Termination::default(), &cache);
        Ok(found.map_or_else(|_| Vec::new(), |(p, _)| answer::overlaps(&entry.assembly, &p.overlaps)))
    }

    /// Plans. Blocks until done. `termination` ends it early; the plan's status then says so.
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
        self.planned(id, request, termination, sink, Some(&self.pools))
    }

    /// Plans a likely request on the caller's threads. The plan is cached.
    ///
    /// # Errors
    /// As [`Service::plan`].
    pub fn speculate(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
    ) -> Result<Plan, ServiceError> {
        self.planned(id, request, termination, &mut Discard, None)
    }

    fn planned(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
        pools: Option<&Pools>,
    ) -> Result<Plan, ServiceError> {
        let entry = self.entry(id, termination)?;
        check_parts(&named_parts(request), entry.assembly.parts.len())?;
        let cache = if request.no_cache {
            RequestCache::default()
        } else {
            RequestCache::of(Arc::clone(&self.cache))
        };
        let plan = entry.plan(request, termination, sink, &cache, pools);
        self.settle(id, &entry);
        plan
    }

    /// After a request: measures the memory of its assembly, and writes the new bricks of its fields.
    fn settle(&self, id: AssemblyId, entry: &Entry) {
        self.store.leave(self.cache.memory_bytes() + self.answers.load(Ordering::Relaxed));
        self.store.settle(id, entry);
        for shared in &entry.shapes {
            keep_field(&self.cache, shared.shape.content(), &shared.field);
        }
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
        let entry = self.entry(id, termination)?;
        let cache = RequestCache::of(Arc::clone(&self.cache));
        let Ok((prepared, _)) = entry.prepared(termination, &cache) else { return Ok(None) };
        let scene = &prepared.scene;
        let present: Vec<usize> = (0..scene.bodies.len()).collect();
        let least = |part| least_travel(scene, part);
        let engine = engine_of(engine, PenaltyParameters::default());
        Ok(audit(rule, scene, &present, &*engine, &least, termination).ok())
    }

    /// How near the parts that move in some steps pass those that stand.
    ///
    /// # Errors
    /// The assembly is unknown, a part does not exist, the distance that is wanted is no length, or the termination condition
    /// became true (`Ok(None)`).
    pub fn clearance(
        &self,
        id: AssemblyId,
        query: &ClearanceQuery,
        termination: &Termination,
    ) -> Result<Option<Vec<StepClearance>>, ServiceError> {
        let entry = self.entry(id, termination)?;
        check_steps(&query.steps, entry.assembly.parts.len())?;
        check_length("wanted", query.wanted)?;
        Ok(clearance::answer(&entry.assembly, query, termination).ok())
    }

    /// For each of some steps, the fastener that it moves by itself, if it does, and the tools that turn it.
    ///
    /// # Errors
    /// As of [`Self::clearance`].
    pub fn tools(
        &self,
        id: AssemblyId,
        steps: &[PassingStep],
        termination: &Termination,
    ) -> Result<Option<Vec<Option<FastenerTools>>>, ServiceError> {
        let entry = self.entry(id, termination)?;
        check_steps(steps, entry.assembly.parts.len())?;
        Ok(tools::answer(&entry.assembly, steps, termination).ok())
    }

    /// How the parts of an assembly stand under gravity in each of some states.
    ///
    /// # Errors
    /// The assembly is unknown, a part does not exist, or the termination condition became true (`Ok(None)`).
    pub fn statics(
        &self,
        id: AssemblyId,
        query: &StaticsQuery,
        termination: &Termination,
    ) -> Result<Option<StaticsAnswer>, ServiceError> {
        self.with_scene(id, query, termination, |assembly, scene| {
            statics::answer(assembly, scene, query, termination)
        })
    }

    /// Asks how parts stand in one state after another: what stays is that of the first state of a query, and no part is
    /// moved aside.
    ///
    /// # Errors
    /// As of [`Self::statics`].
    pub fn with_standing<T>(
        &self,
        id: AssemblyId,
        query: &StaticsQuery,
        termination: &Termination,
        ask: impl FnOnce(&mut StandingSession<'_>) -> T,
    ) -> Result<Option<T>, ServiceError> {
        self.with_scene(id, query, termination, |assembly, scene| {
            Ok(ask(&mut StandingSession::new(assembly, scene, query, termination)?))
        })
    }

    /// An answer about the scene of an assembly that has all parts of a query.
    fn with_scene<T>(
        &self,
        id: AssemblyId,
        query: &StaticsQuery,
        termination: &Termination,
        answer: impl FnOnce(&Assembly, &Scene) -> Result<T, Interrupt>,
    ) -> Result<Option<T>, ServiceError> {
        let entry = self.entry(id, termination)?;
        let count = entry.assembly.parts.len();
        check_parts(&[("screwed", query.screwed.iter().copied().collect())], count)?;
        check_parts(&[("join", query.join.concat()), ("apart", query.apart.concat())], count)?;
        for state in &query.states {
            check_parts(&[("parts", state.parts.iter().map(|(part, _)| *part).collect())], count)?;
            check_parts(&[("stays", state.stays.clone())], count)?;
        }
        let cache = RequestCache::of(Arc::clone(&self.cache));
        let Ok((prepared, _)) = entry.prepared(termination, &cache) else { return Ok(None) };
        Ok(answer(&entry.assembly, &prepared.scene).ok())
    }

    /// The blocking graphs of the assembled state along some axes, both ways each, without the `removed` parts
    /// (ascending). `None`: the axes of the search.
    ///
    /// # Errors
    /// The assembly is unknown, a part does not exist, or the termination condition became true (`Ok(None)`).
    pub fn blocking_graphs(
        &self,
        id: AssemblyId,
        axes: Option<&[Axis]>,
        removed: &[usize],
        termination: &Termination,
    ) -> Result<Option<Vec<DirectionalGraph>>, ServiceError> {
        let entry = self.entry(id, termination)?;
        check_parts(&[("removed", removed.to_vec())], entry.assembly.parts.len())?;
        let cache = RequestCache::of(Arc::clone(&self.cache));
        let Ok((prepared, _)) = entry.prepared(termination, &cache) else { return Ok(None) };
        let scene = &prepared.scene;
        let there = |part: &usize| removed.binary_search(part).is_err();
        let present: Vec<usize> = (0..scene.bodies.len()).filter(there).collect();
        let found = axes.map_or_else(|| axes_of(scene, &present, termination), |axes| Ok(axes.to_vec()));
        let Ok(axes) = found else { return Ok(None) };
        let translations = &Action::translations_along(&axes);
        let analysis = Analysis { rule: StaticAnalysis::default(), scene, translations, cache: &cache };
        let graphs = analysis.assembled_graphs(&present, &|part| least_travel(scene, part), termination);
        let blockages = graphs.ok().map(|g| g.into_iter().map(|g| g.blockage).collect::<Vec<_>>());
        Ok(blockages.map(|b| DirectionalGraph::of(&b, translations)))
    }

    /// A known assembly, healed and in the planning frame.
    ///
    /// # Errors
    /// The id is unknown.
    pub fn assembly(&self, id: AssemblyId) -> Result<Assembly, ServiceError> {
        Ok(self.entry(id, &Termination::default())?.assembly.clone())
    }

    fn entry(&self, id: AssemblyId, termination: &Termination) -> Result<Arc<Entry>, ServiceError> {
        self.kept(id).map_or_else(|| self.reloaded(id, termination), Ok)
    }

    /// An assembly that is in memory, or healed on disk.
    fn kept(&self, id: AssemblyId) -> Option<Arc<Entry>> {
        let on_disk = || healed_assembly(&self.cache, &id.0, |content| self.store.shape(content));
        self.store.get(id).or_else(|| Some(self.store.insert(id, on_disk()?)))
    }

    /// An assembly that is healed anew from its source: the meshes as given, and the revisions.
    fn reloaded(&self, id: AssemblyId, termination: &Termination) -> Result<Arc<Entry>, ServiceError> {
        let (mut at, mut revisions) = (id, Vec::new());
        let mut entry = loop {
            if let Some(entry) = self.kept(at) {
                break entry;
            }
            match source_of(&self.cache, &at.0).ok_or(ServiceError::UnknownAssembly)? {
                AssemblySource::Given(source) => {
                    break self.store.insert(at, Assembly::new_until(&source, termination)?);
                }
                AssemblySource::Revised(base, revision) => {
                    revisions.push((at, revision));
                    at = AssemblyId(base);
                }
            }
        };
        while let Some((at, revision)) = revisions.pop() {
            entry = self.store.insert(at, entry.assembly.revised_until(&revision, termination)?);
        }
        Ok(entry)
    }
}

impl Drop for Service {
    /// Writes the rest of the fields.
    fn drop(&mut self) {
        for shared in self.store.shapes() {
            keep_rest_of_field(&self.cache, shared.shape.content(), &shared.field);
        }
    }
}

/// Parts that a request or a revision names, by field.
type Named = [(&'static str, Vec<usize>)];

fn named_parts(request: &PlanRequest) -> [(&'static str, Vec<usize>); 8] {
    let PlanRequest { fixed, removed, targets, base, keep, keep_out, groups, assembly, .. } = request;
    let staged = match assembly {
        Some(Staging::Beside(given)) => given.iter().map(|(part, _)| *part).collect(),
        _ => Vec::new(),
    };
    let targets = targets.clone().unwrap_or_default();
    [
        ("fixed", fixed.clone()),
        ("removed", removed.clone()),
        ("targets", targets),
        ("base", base.clone()),
        ("keep", keep.clone()),
        ("keep_out", keep_out.clone()),
        ("groups", groups.concat()),
        ("staged", staged),
    ]
}

fn revised_parts(revision: &Revision) -> [(&'static str, Vec<usize>); 2] {
    let replaced = revision.replaced.iter().map(|(part, _)| *part).collect();
    let moved = revision.moved.iter().map(|(part, _)| *part).collect();
    [("replaced", replaced), ("moved", moved)]
}

fn check_steps(steps: &[PassingStep], count: usize) -> Result<(), ServiceError> {
    let parts = |of: &[(usize, Pose)]| of.iter().map(|(part, _)| *part).collect();
    steps.iter().try_for_each(|PassingStep { moving, standing, .. }| {
        check_parts(&[("moving", parts(moving)), ("standing", parts(standing))], count)
    })
}

fn check_parts(named: &Named, count: usize) -> Result<(), ServiceError> {
    for (field, list) in named {
        if let Some(&index) = list.iter().find(|&&i| i >= count) {
            return Err(ServiceError::NoSuchPart { field, index, count });
        }
    }
    Ok(())
}
