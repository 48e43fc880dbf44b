//! The threads that plan and heal. A panic is contained to its request.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::plan::Step;

use super::convert;
use super::request_queue::Owner;
use super::response_cache::CachedResponse;
use super::shared_queue::Queues;
use super::speculation::Speculation;
use crate::geometry::{Pose, Revision, SourceAssembly, load_assembly, remember_given, remember_revised};
use crate::plan::{Plan, PlanStep};
use crate::search::{PlanRequest, PlanSink, Progress, Termination};
use crate::service::{
    Admission, AnsweredQuestion, AssemblyId, Remembered, Service, ServiceError, recent_answers,
    remember_answer, remembered_answer,
};

/// What the workers ask of the planning service; tests script it.
pub trait Planning: Send + Sync + 'static {
    /// See [`Service::admit`]. What was given is remembered.
    ///
    /// # Errors
    /// The geometry was refused, or the termination condition became true.
    fn admit(&self, source: &SourceAssembly, termination: &Termination) -> Result<Admission, ServiceError>;
    /// See [`Service::revise_until`]. The change is remembered.
    ///
    /// # Errors
    /// The base is unknown, the change is refused, or the termination condition became true.
    fn revise(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError>;
    /// The same for a question that brings its change along: nobody will ask for its handle.
    ///
    /// # Errors
    /// As [`Planning::revise`].
    fn revise_for_now(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError> {
        self.revise(base, revision, termination)
    }
    /// See [`Service::knows`]. Called on the port thread: it must not block.
    fn knows(&self, id: AssemblyId) -> bool;
    /// See [`Service::prepare`].
    ///
    /// # Errors
    /// The id is unknown.
    fn prepare(&self, _: AssemblyId, _: &Termination) -> Result<(), ServiceError> {
        Ok(())
    }
    /// See [`Service::foresee`].
    ///
    /// # Errors
    /// Nothing could be planned.
    fn foresee(&self, _: AssemblyId, _: &PlanRequest, _: &Termination) -> Result<Plan, ServiceError> {
        Err(ServiceError::UnknownAssembly)
    }
    /// See [`Service::recall_recent`].
    fn recall_recent(&self) {}
    /// See [`Service::recent`].
    fn recent(&self, _: usize) -> Vec<AssemblyId> {
        Vec::new()
    }
    /// See [`Service::remembered`]. Called on the port thread: it must not block.
    fn remembered(&self) -> Option<Remembered> {
        None
    }
    /// See [`Service::answers_take`]. Called on the port thread: it must not block.
    fn answers_take(&self, _bytes: usize) {}
    /// The messages that answered a question before, also before a restart.
    fn answered(&self, _question: &[u8]) -> Option<Vec<Vec<u8>>> {
        None
    }
    /// The answers that were used last before this process began, with their questions; the last one used comes last.
    fn recent_answers(&self, _most: usize, _bytes: u64) -> Vec<AnsweredQuestion> {
        Vec::new()
    }
    /// Remembers the messages that answered a question.
    fn remember(&self, _question: &[u8], _messages: Vec<Vec<u8>>) {}
    /// See [`Service::plan`].
    ///
    /// # Errors
    /// Nothing could be planned.
    fn plan(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError>;
}

impl Planning for Service {
    fn admit(&self, source: &SourceAssembly, termination: &Termination) -> Result<Admission, ServiceError> {
        let admission = self.admit_until(source, termination)?;
        remember_given(self.cache(), &admission.id.0, source);
        self.keep(admission.id)?;
        Ok(admission)
    }

    fn revise(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError> {
        let admission = self.revise_until(base, revision, termination)?;
        if admission.id != base {
            remember_revised(self.cache(), &admission.id.0, &base.0, revision);
            self.keep(admission.id)?;
        }
        Ok(admission)
    }

    fn revise_for_now(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError> {
        self.revise_until(base, revision, termination)
    }

    fn knows(&self, id: AssemblyId) -> bool {
        Self::knows(self, id)
    }

    fn prepare(&self, id: AssemblyId, termination: &Termination) -> Result<(), ServiceError> {
        Self::prepare(self, id, termination)
    }

    fn foresee(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
    ) -> Result<Plan, ServiceError> {
        Self::foresee(self, id, request, termination)
    }

    fn recall_recent(&self) {
        Self::recall_recent(self);
    }

    fn recent(&self, most: usize) -> Vec<AssemblyId> {
        Self::recent(self, most)
    }

    fn remembered(&self) -> Option<Remembered> {
        Some(Self::remembered(self))
    }

    fn answers_take(&self, bytes: usize) {
        Self::answers_take(self, bytes);
    }

    fn answered(&self, question: &[u8]) -> Option<Vec<Vec<u8>>> {
        remembered_answer(self.cache(), question)
    }

    fn recent_answers(&self, most: usize, bytes: u64) -> Vec<AnsweredQuestion> {
        recent_answers(self.cache(), most, bytes)
    }

    fn remember(&self, question: &[u8], messages: Vec<Vec<u8>>) {
        remember_answer(self.cache(), question, messages);
    }

    fn plan(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
        sink: &mut dyn PlanSink,
    ) -> Result<Plan, ServiceError> {
        Self::plan(self, id, request, termination, sink)
    }
}

/// Which plan request: the client port's id and its number there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct SessionKey {
    pub(crate) client: u128,
    pub(crate) request: u64,
}

/// A plan to make.
#[derive(Debug)]
pub(crate) struct PlanJob {
    pub(crate) key: SessionKey,
    pub(crate) owner: Owner,
    pub(crate) received: Instant,
    pub(crate) assembly: AssemblyId,
    /// What is remembered with its answer, if anything is to be.
    pub(crate) question: Option<Vec<u8>>,
    /// Parts that stand elsewhere than in it.
    pub(crate) moved: Vec<(usize, Pose)>,
    pub(crate) request: PlanRequest,
    pub(crate) termination: Termination,
}

#[cfg(test)]
impl PlanJob {
    /// A request about an assembly by nobody in particular.
    pub(super) fn about(assembly: AssemblyId, request: PlanRequest) -> Self {
        Self {
            key: SessionKey { client: 0, request: 0 },
            owner: Owner::default(),
            received: Instant::now(),
            assembly,
            question: None,
            moved: vec![],
            request,
            termination: Termination::default(),
        }
    }
}

/// What was received with an upload.
#[derive(Debug)]
pub(crate) struct Received {
    pub(crate) number: u64,
    /// A private copy.
    pub(crate) bytes: AlignedBytes,
    /// True once nobody waits for it.
    pub(crate) termination: Termination,
}

/// An assembly to take in.
#[derive(Debug)]
pub(crate) enum AdmitJob {
    /// Received meshes.
    Upload(Received),
    /// The same of what differs from a known assembly.
    Revise(Received),
    /// A file or folder of the configuration.
    Preload(PathBuf),
}

/// What workers report.
#[derive(Debug)]
pub(crate) enum WorkerEvent {
    Started(SessionKey),
    Step(SessionKey, Step),
    Progress(SessionKey, Progress),
    /// A plan's summary, and what to answer when the same is asked again.
    Planned(SessionKey, Arc<Vec<u8>>, Option<(Vec<u8>, CachedResponse)>),
    /// The question was answered before, and is so again.
    Answered(SessionKey, Vec<u8>, CachedResponse),
    Unplanned(SessionKey, WireError),
    Admitted {
        number: u64,
        result: Result<AssemblyId, WireError>,
    },
    Preloaded {
        name: String,
        id: AssemblyId,
    },
}

/// Takes reports to the port thread and wakes it.
pub(crate) type Report = Arc<dyn Fn(WorkerEvent) + Send + Sync>;

/// Starts `count` planning threads, and one that takes assemblies in, so that an upload never
/// waits behind a long plan.
pub(crate) fn start<P: Planning>(
    count: usize,
    queues: &Queues,
    service: &Arc<P>,
    report: &Report,
) -> std::io::Result<()> {
    for number in 0..count {
        let (queues, service, report) = (queues.clone(), Arc::clone(service), Arc::clone(report));
        thread::Builder::new().name(format!("sbdp-plan-{number}")).spawn(move || {
            while let Some((job, _working)) = queues.plans.pop() {
                let _busy = queues.prefetch.busy();
                plan(&*service, &job, &queues, &report);
            }
        })?;
    }
    let (its_queues, its_service, report) = (queues.clone(), Arc::clone(service), Arc::clone(report));
    thread::Builder::new().name("sbdp-admit".to_owned()).spawn(move || {
        while let Some((job, _working)) = its_queues.admissions.pop() {
            let _busy = its_queues.prefetch.busy();
            if let Some(id) = admit(&*its_service, job, &report) {
                its_queues.prefetch.want(id);
            }
        }
    })?;
    Ok(())
}

/// Streams what a plan yields to the port thread.
struct Sink<'r> {
    key: SessionKey,
    report: &'r Report,
    last_progress: Option<Instant>,
}

/// Progress more often than this would only wake people up.
const PROGRESS_PAUSE: Duration = Duration::from_millis(50);

impl PlanSink for Sink<'_> {
    fn progress(&mut self, progress: Progress) {
        if self.last_progress.is_none_or(|last| last.elapsed() >= PROGRESS_PAUSE) {
            self.last_progress = Some(Instant::now());
            (self.report)(WorkerEvent::Progress(self.key, progress));
        }
    }

    fn step(&mut self, step: &PlanStep) {
        (self.report)(WorkerEvent::Step(self.key, convert::step(step)));
    }
}

/// The span of a request: whatever is logged while it is worked on names it.
fn span(job: &PlanJob) -> tracing::Span {
    let waited_ms = job.received.elapsed().as_secs_f64() * 1e3;
    let assembly = format!(
        "{:02x}{:02x}{:02x}{:02x}",
        job.assembly.0[0], job.assembly.0[1], job.assembly.0[2], job.assembly.0[3]
    );
    tracing::info_span!("request", client = job.owner.0, request = job.key.request, assembly, waited_ms)
}

/// Tells how a request's plan came about: its stages, in seconds.
fn log_plan(plan: &Plan) {
    let stats = &plan.stats;
    tracing::info!(
        status = ?plan.status,
        steps = plan.steps.len(),
        simulations = stats.simulations,
        sdf_s = stats.sdf_time_s,
        overlap_s = stats.overlap_time_s,
        static_analysis_s = stats.static_analysis_time_s,
        path_s = stats.path_time_s,
        verify_s = stats.verify_time_s,
        total_s = stats.total_time_s,
        "planned"
    );
}

fn plan<P: Planning>(service: &P, job: &PlanJob, queues: &Queues, report: &Report) {
    let _span = span(job).entered();
    report(WorkerEvent::Started(job.key));
    let before =
        job.question.as_ref().and_then(|q| Some((q, CachedResponse::from_messages(service.answered(q)?)?)));
    if let Some((question, answer)) = before {
        return report(WorkerEvent::Answered(job.key, question.clone(), answer));
    }
    let mut sink = Sink { key: job.key, report, last_progress: None };
    let planned = contained(|| {
        let assembly = with_moved(service, job.assembly, &job.moved, &job.termination)?;
        service.plan(assembly, &job.request, &job.termination, &mut sink)
    });
    report(match planned {
        Ok(Ok(plan)) => {
            log_plan(&plan);
            // Before whoever asked is told, and may ask what is foreseen.
            if let Some(speculation) = Speculation::after(job, &plan, queues.speculation) {
                queues.prefetch.foresee(speculation);
            }
            let again = job.question.clone().zip(CachedResponse::of(&plan));
            if let Some((question, answer)) = &again {
                service.remember(question, answer.messages());
            }
            WorkerEvent::Planned(job.key, Arc::new(convert::summary(&plan, &plan.stats)), again)
        }
        Ok(Err(error)) => {
            tracing::info!(%error, "not planned");
            WorkerEvent::Unplanned(job.key, convert::service_error(&error))
        }
        Err(panic) => WorkerEvent::Unplanned(job.key, panic),
    });
}

/// An assembly with some parts elsewhere.
pub(super) fn with_moved<P: Planning>(
    service: &P,
    assembly: AssemblyId,
    moved: &[(usize, Pose)],
    termination: &Termination,
) -> Result<AssemblyId, ServiceError> {
    if moved.is_empty() {
        return Ok(assembly);
    }
    let revision = Revision { moved: moved.to_vec(), ..Revision::default() };
    Ok(service.revise_for_now(assembly, &revision, termination)?.id)
}

/// Which assembly was taken in, if it was.
fn admit<P: Planning>(service: &P, job: AdmitJob, report: &Report) -> Option<AssemblyId> {
    match job {
        AdmitJob::Upload(Received { number, bytes, termination }) => {
            let result = contained(|| admit_upload(service, bytes, &termination)).unwrap_or_else(Err);
            let id = result.as_ref().ok().copied();
            report(WorkerEvent::Admitted { number, result });
            id
        }
        AdmitJob::Revise(Received { number, bytes, termination }) => {
            let result = contained(|| admit_revision(service, bytes, &termination)).unwrap_or_else(Err);
            let id = result.as_ref().ok().copied();
            report(WorkerEvent::Admitted { number, result });
            id
        }
        AdmitJob::Preload(path) => match contained(|| preload(service, &path)).unwrap_or_else(Err) {
            Ok((name, id)) => {
                report(WorkerEvent::Preloaded { name, id });
                Some(id)
            }
            Err(error) => {
                tracing::warn!(path = %path.display(), "not preloaded: {}", error.message);
                None
            }
        },
    }
}

fn preload<P: Planning>(service: &P, path: &Path) -> Result<(String, AssemblyId), WireError> {
    let source = load_assembly(path).map_err(|e| convert::service_error(&e.into()))?;
    let admission =
        service.admit(&source, &Termination::default()).map_err(|e| convert::service_error(&e))?;
    Ok((source.name, admission.id))
}

fn admit_upload<P: Planning>(
    service: &P,
    bytes: AlignedBytes,
    termination: &Termination,
) -> Result<AssemblyId, WireError> {
    let source = convert::source_assembly(&bytes)?;
    // Healing takes memory of its own: an upload need not be there three times.
    drop(bytes);
    let admission = service.admit(&source, termination).map_err(|e| convert::service_error(&e))?;
    Ok(admission.id)
}

fn admit_revision<P: Planning>(
    service: &P,
    bytes: AlignedBytes,
    termination: &Termination,
) -> Result<AssemblyId, WireError> {
    let (base, revision) = convert::revision(&bytes)?;
    drop(bytes);
    let admission = service.revise(base, &revision, termination).map_err(|e| convert::service_error(&e))?;
    Ok(admission.id)
}

/// Runs one request's work; a panic becomes an answer. The service must stay usable after one:
/// it holds no lock across planning.
pub(super) fn contained<T>(work: impl FnOnce() -> T) -> Result<T, WireError> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let reason = panic
            .downcast_ref::<&str>()
            .map(|s| (*s).to_owned())
            .or_else(|| panic.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "no message".to_owned());
        tracing::error!("a request panicked: {reason}");
        WireError::new(ErrorCode::Failed, format!("the daemon failed on this request: {reason}"))
    })
}
