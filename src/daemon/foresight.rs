//! What may be asked next about an assembly that was planned: a part did not come off where the plan has it leave,
//! or is gone already. Whoever carries a plan out asks that in the middle of it, and has no time; so such questions
//! are planned while nothing is asked, in the order of the plan, and what was found is remembered.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::workers::{PlanJob, Planning, contained, with_moved};
use crate::geometry::Pose;
use crate::plan::{Plan, PlanStatus};
use crate::search::{PlanRequest, Planner};
use crate::service::AssemblyId;
use crate::termination::Termination;

/// What may become of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contingency {
    /// It may not move any more.
    Stuck(usize),
    /// It is not there any more.
    Gone(usize),
}

impl Contingency {
    fn of(self, request: &PlanRequest) -> PlanRequest {
        let mut request = request.clone();
        match self {
            Self::Stuck(part) => request.fixed.push(part),
            Self::Gone(part) => request.removed.push(part),
        }
        request
    }
}

/// What may be asked after a question, as far as it was not planned yet.
#[derive(Debug)]
pub(super) struct Foresight {
    assembly: AssemblyId,
    /// Parts that stand elsewhere than in it.
    moved: Vec<(usize, Pose)>,
    request: PlanRequest,
    left: VecDeque<Contingency>,
    /// So much time may go into it yet.
    time: Duration,
}

impl Foresight {
    /// What may be asked after a question that was answered by a plan, with so much time for it; none if nothing
    /// comes off, or if it was asked by a planner that is there to be compared with.
    pub(super) fn after(job: &PlanJob, plan: &Plan, time: Duration) -> Option<Self> {
        let PlanRequest { planner, assembly, no_cache, .. } = &job.request;
        let is_for_use = *planner == Planner::SbdpStar && assembly.is_none() && !no_cache;
        if !is_for_use || plan.steps.is_empty() || time.is_zero() {
            return None;
        }
        let becomes = |part| [Contingency::Stuck(part), Contingency::Gone(part)];
        let left = plan.steps.iter().flat_map(|step| becomes(step.part)).collect();
        let (moved, request) = (job.moved.clone(), job.request.clone());
        Some(Self { assembly: job.assembly, moved, request, left, time })
    }

    /// Whether both come after the same question.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        (self.assembly, &self.moved, &self.request) == (other.assembly, &other.moved, &other.request)
    }

    /// How many questions are left.
    pub(super) fn left(&self) -> usize {
        self.left.len()
    }

    /// Plans the next question; true if that was done. One that was stopped stays the next.
    pub(super) fn plan_next<P: Planning>(&mut self, service: &P, termination: &Termination) -> bool {
        let Some(next) = self.left.pop_front() else { return false };
        let began = Instant::now();
        let request = next.of(&self.request);
        let within = termination.within(self.time);
        // Whoever asks will be told what is wrong.
        let planned = contained(|| {
            let assembly = with_moved(service, self.assembly, &self.moved, &within)?;
            service.foresee(assembly, &request, &within)
        });
        self.time = self.time.saturating_sub(began.elapsed());
        if termination.check().is_err() {
            self.left.push_front(next);
            return false;
        }
        let is_done = planned.is_ok_and(|planned| {
            planned.is_ok_and(|plan| !matches!(plan.status, PlanStatus::Timeout | PlanStatus::Cancelled))
        });
        if !is_done || self.time.is_zero() {
            // Another would fail as this one did, or there is no time for it.
            self.left.clear();
        }
        is_done
    }
}
