//! Where plans are made: in this process or in the daemon. Both answer with the document of a plan.

use std::sync::Arc;
use std::time::{Duration, Instant};

use sbdp_ipc::plan::{Gravity, Reports};

use super::error::CliError;
use super::listener::Listener;
use crate::cache::Cache;
use crate::document::PlanDocument;
use crate::geometry::{GeometryError, Revision, SourceAssembly};
use crate::plan::{Base, Plan, PlanKind, PlanStats, PlanStatus};
use crate::report::{ReportQuery, report};
use crate::search::{PlanRequest, PlanSink, Termination};
use crate::service::{Service, ServiceError};
use crate::termination::Interrupt;

/// A question, ready to be asked.
pub(super) struct CommandQuestion<'a> {
    /// The assembly.
    pub(super) assembly: &'a SourceAssembly,
    /// What differs from it.
    pub(super) revision: Revision,
    /// The assembly with what differs: what the plan is about.
    pub(super) revised: &'a SourceAssembly,
    /// How long it took to read.
    pub(super) read: Duration,
    /// What to plan.
    pub(super) request: PlanRequest,
    /// What to report about the plan.
    pub(super) reports: Reports,
    /// What it depends on how parts stand.
    pub(super) gravity: Gravity,
    /// When the answer is due.
    pub(super) deadline: Option<Instant>,
    /// Ends the work early; knows the deadline too.
    pub(super) termination: Termination,
}

/// Something that plans.
pub(super) trait Backend {
    /// Plans; blocks until done.
    fn plan(&self, question: &CommandQuestion<'_>, listener: &mut Listener)
    -> Result<PlanDocument, CliError>;
}

/// The service in this process.
pub(super) struct Embedded {
    service: Service,
}

impl Embedded {
    /// A service that remembers in a cache, or not at all.
    pub(super) fn new(cache: Option<Arc<Cache>>) -> Self {
        Self { service: cache.map_or_else(Service::default, Service::remembering) }
    }
}

impl Embedded {
    fn planned(
        &self,
        question: &CommandQuestion<'_>,
        sink: &mut dyn PlanSink,
    ) -> Result<PlanDocument, ServiceError> {
        let started = Instant::now();
        let termination = &question.termination;
        let reports = ReportQuery::new(&question.reports, &question.gravity)?;
        let admission = self.service.admit_until(question.assembly, termination)?;
        let admitted = started.elapsed();
        let revised = self.service.revise_until(admission.id, &question.revision, termination)?;
        let mut plan = self.service.plan(revised.id, &question.request, termination, sink)?;
        plan.stats.load_time_s = Some((question.read + admitted).as_secs_f64());
        let report = report(&self.service, revised.id, &mut plan, &reports, termination)?;
        Ok(PlanDocument::from(&plan).with_report(&report))
    }
}

impl Backend for Embedded {
    fn plan(
        &self,
        question: &CommandQuestion<'_>,
        listener: &mut Listener,
    ) -> Result<PlanDocument, CliError> {
        match self.planned(question, listener) {
            Err(ServiceError::Geometry(GeometryError::Interrupted(Interrupt::Cancelled))) => {
                Ok(unplanned(question, PlanStatus::Cancelled, Interrupt::Cancelled.to_string()))
            }
            Err(ServiceError::Geometry(GeometryError::Interrupted(interrupt))) => {
                Ok(unplanned(question, PlanStatus::Timeout, interrupt.to_string()))
            }
            planned => Ok(planned?),
        }
    }
}

/// The answer to a question that was let go before planning began: everything stands where it stood.
pub(super) fn unplanned(question: &CommandQuestion<'_>, status: PlanStatus, reason: String) -> PlanDocument {
    let request = &question.request;
    let parts: Vec<String> = question.revised.parts.iter().map(|p| p.name.clone()).collect();
    let remaining = (0..parts.len()).filter(|p| !request.removed.contains(p)).collect();
    PlanDocument::from(&Plan {
        kind: if request.assembly.is_some() { PlanKind::Assembly } else { PlanKind::Disassembly },
        status,
        reason: Some(reason),
        planner: request.planner.name().to_owned(),
        engine: request.engine.name().to_owned(),
        units: question.assembly.units.clone(),
        parts,
        removed: request.removed.clone(),
        poses: Vec::new(),
        targets: request.targets.clone(),
        fixed: request.fixed.clone(),
        keep: request.keep.clone(),
        base: Base::default(),
        steps: Vec::new(),
        remaining,
        kept_together: Vec::new(),
        free_together: Vec::new(),
        blocked: Vec::new(),
        overlaps: Vec::new(),
        warnings: Vec::new(),
        stats: PlanStats::default(),
    })
}
