//! The threads that plan and take assemblies in. A panic ends only its own request.

use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use sbdp_ipc::bytes::AlignedBytes;
use sbdp_ipc::error::WireError;
use sbdp_ipc::plan::Step;

use super::convert;
use super::jobs::{AdmitJob, PlanJob, Received, SessionKey};
use super::planning::{Planning, contained, with_moved};
use super::response_cache::CachedResponse;
use super::shared_queue::Queues;
use super::speculation::Speculation;
use crate::files::load_assembly;
use crate::plan::{Plan, PlanStep};
use crate::search::{PlanSink, Progress, Termination, TraceEvent};
use crate::service::{AssemblyId, ServiceError};

/// What workers report.
#[derive(Debug)]
pub(crate) enum WorkerEvent {
    Started(SessionKey),
    Step(SessionKey, Step),
    /// Events of the search, as lines of JSON.
    Trace(SessionKey, Vec<u8>),
    Progress(SessionKey, Progress),
    Planned {
        key: SessionKey,
        summary: Arc<Vec<u8>>,
        /// The response when the question is repeated.
        again: Option<(Vec<u8>, CachedResponse)>,
        /// States whose blocking graphs were answered from memory.
        graphs_remembered: u64,
    },
    /// The question was answered before: its response comes from the disk.
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

/// Sends a report to the port thread and wakes it.
pub(crate) type Report = Arc<dyn Fn(WorkerEvent) + Send + Sync>;

/// Starts `count` planning threads, and one that takes assemblies in: an upload never waits for a long plan.
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

/// Streams a plan's steps and progress to the port thread.
struct Sink<'r> {
    key: SessionKey,
    report: &'r Report,
    last_progress: Option<Instant>,
    /// Events of the search that are not reported yet, if they are wanted.
    trace: Option<Vec<u8>>,
}

/// Bytes of events that are reported together: a tenth of a chunk, so that a trace is read while the search runs. At
/// half or twice as much, the port thread is woken twice or half as often.
const TRACE_MESSAGE: usize = 24 << 10;

impl Sink<'_> {
    fn report_trace(&mut self) {
        if let Some(trace) = self.trace.as_mut().filter(|trace| !trace.is_empty()) {
            (self.report)(WorkerEvent::Trace(self.key, std::mem::take(trace)));
        }
    }
}

/// Progress is reported at most once in this time: each report wakes the port thread and the client.
const PROGRESS_PAUSE: Duration = Duration::from_millis(50);

impl PlanSink for Sink<'_> {
    fn progress(&mut self, progress: Progress) {
        if self.last_progress.is_none_or(|last| last.elapsed() >= PROGRESS_PAUSE) {
            self.last_progress = Some(Instant::now());
            (self.report)(WorkerEvent::Progress(self.key, progress));
        }
    }

    fn step(&mut self, step: &PlanStep) {
        self.report_trace();
        (self.report)(WorkerEvent::Step(self.key, convert::step(step)));
    }

    fn traces(&self) -> bool {
        self.trace.is_some()
    }

    fn traced(&mut self, event: TraceEvent) {
        let Some(trace) = &mut self.trace else { return };
        // Numbers and texts can always be written.
        if serde_json::to_writer(&mut *trace, &event).is_ok() {
            trace.push(b'\n');
        }
        if trace.len() >= TRACE_MESSAGE {
            self.report_trace();
        }
    }
}

/// The span of a request: log lines written during its work carry these fields.
fn span(job: &PlanJob) -> tracing::Span {
    let waited_ms = job.received.elapsed().as_secs_f64() * 1e3;
    let assembly = format!(
        "{:02x}{:02x}{:02x}{:02x}",
        job.assembly.0[0], job.assembly.0[1], job.assembly.0[2], job.assembly.0[3]
    );
    tracing::info_span!("request", client = job.owner.0, request = job.key.request, assembly, waited_ms)
}

/// Logs the times of a plan's stages, in seconds.
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
    let trace = job.trace.then(Vec::new);
    let mut sink = Sink { key: job.key, report, last_progress: None, trace };
    let planned = contained(|| {
        let assembly = with_moved(service, job.assembly, &job.moved, &job.termination)?;
        let mut plan = service.plan(assembly, &job.request, &job.termination, &mut sink)?;
        let report = service.report(assembly, &mut plan, &job.reports, &job.termination)?;
        Ok::<_, ServiceError>((plan, report))
    });
    sink.report_trace();
    report(match planned {
        Ok(Ok((plan, report))) => {
            log_plan(&plan);
            // Before the client learns of the plan, and may ask one of these questions.
            if let Some(speculation) = Speculation::after(job, &plan, queues.speculation) {
                queues.prefetch.speculate(speculation);
            }
            let report = (!job.reports.is_empty()).then_some(&report);
            // A report that the clock ended is not given again.
            let is_whole = job.termination.check().is_ok();
            let question = job.question.clone().filter(|_| report.is_none() || is_whole);
            let again = question.zip(CachedResponse::of(&plan, report));
            if let Some((question, answer)) = &again {
                service.remember(question, answer.messages());
            }
            WorkerEvent::Planned {
                key: job.key,
                summary: Arc::new(convert::summary(&plan, report, &plan.stats)),
                again,
                graphs_remembered: plan.stats.graph_hits,
            }
        }
        Ok(Err(error)) => {
            tracing::info!(%error, "not planned");
            WorkerEvent::Unplanned(job.key, convert::service_error(&error))
        }
        Err(panic) => WorkerEvent::Unplanned(job.key, panic),
    });
}

/// Takes an assembly in; its id, if that succeeded.
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
    // Healing needs memory of its own: the bytes are freed before.
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
