//! The planning service as the daemon uses it.

use std::panic::{AssertUnwindSafe, catch_unwind};

use sbdp_ipc::error::{ErrorCode, WireError};
use sbdp_ipc::summary::report::Report;

use crate::geometry::{Pose, Revision, SourceAssembly, remember_given, remember_revised};
use crate::plan::Plan;
use crate::report::{ReportQuery, report};
use crate::search::{PlanRequest, PlanSink, Termination};
use crate::service::{
    Admission, AnsweredQuestion, AssemblyId, MemoryStatistics, Service, ServiceError, recent_answers,
    remember_answer, remembered_answer,
};

/// The operations of the planning service that the daemon uses. Tests implement it with scripted answers.
pub trait Planning: Send + Sync + 'static {
    /// See [`Service::admit`]. The meshes as given are recorded.
    ///
    /// # Errors
    /// The geometry was refused, or the termination condition became true.
    fn admit(&self, source: &SourceAssembly, termination: &Termination) -> Result<Admission, ServiceError>;
    /// See [`Service::revise_until`]. The revision is recorded.
    ///
    /// # Errors
    /// The base is unknown, the change is refused, or the termination condition became true.
    fn revise(
        &self,
        base: AssemblyId,
        revision: &Revision,
        termination: &Termination,
    ) -> Result<Admission, ServiceError>;
    /// The same for a plan request with moved parts: no client gets the handle, so nothing is recorded.
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
    /// See [`Service::speculate`].
    ///
    /// # Errors
    /// Nothing could be planned.
    fn speculate(&self, _: AssemblyId, _: &PlanRequest, _: &Termination) -> Result<Plan, ServiceError> {
        Err(ServiceError::UnknownAssembly)
    }
    /// See [`Service::recall_recent`].
    fn recall_recent(&self) {}
    /// See [`Service::recent`].
    fn recent(&self, _: usize) -> Vec<AssemblyId> {
        Vec::new()
    }
    /// See [`Service::remembered`]. Called on the port thread: it must not block.
    fn remembered(&self) -> Option<MemoryStatistics> {
        None
    }
    /// See [`Service::set_response_bytes`]. Called on the port thread: it must not block.
    fn set_response_bytes(&self, _bytes: usize) {}
    /// The messages that answered a question before, also before a restart of the daemon.
    fn answered(&self, _question: &[u8]) -> Option<Vec<Vec<u8>>> {
        None
    }
    /// The answers that were used last before this process began, with their questions; the most recent comes last.
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
    /// See [`report`].
    ///
    /// # Errors
    /// The assembly is unknown, or is not the one that the plan is about.
    fn report(
        &self,
        _id: AssemblyId,
        _plan: &mut Plan,
        _query: &ReportQuery,
        _termination: &Termination,
    ) -> Result<Report, ServiceError> {
        Ok(Report::default())
    }
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

    fn speculate(
        &self,
        id: AssemblyId,
        request: &PlanRequest,
        termination: &Termination,
    ) -> Result<Plan, ServiceError> {
        Self::speculate(self, id, request, termination)
    }

    fn recall_recent(&self) {
        Self::recall_recent(self);
    }

    fn recent(&self, most: usize) -> Vec<AssemblyId> {
        Self::recent(self, most)
    }

    fn remembered(&self) -> Option<MemoryStatistics> {
        Some(Self::remembered(self))
    }

    fn set_response_bytes(&self, bytes: usize) {
        Self::set_response_bytes(self, bytes);
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

    fn report(
        &self,
        id: AssemblyId,
        plan: &mut Plan,
        query: &ReportQuery,
        termination: &Termination,
    ) -> Result<Report, ServiceError> {
        report(self, id, plan, query, termination)
    }
}

/// The assembly with some parts moved.
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

/// Runs the work of one request; a panic becomes an error. The service stays usable after a panic because it
/// holds no lock while it plans.
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
