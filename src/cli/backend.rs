//! Where plans are made: in this process or in the daemon. Both speak the planning modules'
//! own types.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::error::CliError;
use crate::cache::Cache;
use crate::geometry::{Revision, SourceAssembly};
use crate::plan::Plan;
use crate::search::{PlanRequest, PlanSink, Termination};
use crate::service::Service;

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
    /// When the answer is due.
    pub(super) deadline: Option<Instant>,
    /// Ends the work early; knows the deadline too.
    pub(super) termination: Termination,
}

/// Something that plans.
pub(super) trait Backend {
    /// Plans; blocks until done.
    fn plan(&self, question: &CommandQuestion<'_>, sink: &mut dyn PlanSink) -> Result<Plan, CliError>;
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

impl Backend for Embedded {
    fn plan(&self, question: &CommandQuestion<'_>, sink: &mut dyn PlanSink) -> Result<Plan, CliError> {
        let started = Instant::now();
        let admission = self.service.admit(question.assembly)?;
        let admitted = started.elapsed();
        let revised = self.service.revise(admission.id, &question.revision)?;
        let mut plan = self.service.plan(revised.id, &question.request, &question.termination, sink)?;
        plan.stats.load_time_s = Some((question.read + admitted).as_secs_f64());
        Ok(plan)
    }
}
