//! Plans the likely next questions about a planned assembly: a part does not come off when its turn comes, may not
//! move at all, or is gone already. A robot that carries a plan out asks such a question in the middle of it and cannot
//! wait. So the questions are planned while the workers are idle, in the order of the plan, and the answers are cached.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use super::jobs::PlanJob;
use super::planning::{Planning, contained, with_moved};
use crate::geometry::Pose;
use crate::plan::{Plan, PlanStatus, StepEnd};
use crate::search::{PlanRequest, Planner};
use crate::service::AssemblyId;
use crate::termination::Termination;

/// With less time left than this, no question is planned.
const LEAST_TIME: Duration = Duration::from_millis(1);

/// What may happen to the parts that leave the assembly together, mostly one, by their place in the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Contingency {
    /// They do not move when their turn comes: the parts before them are gone.
    StuckInTurn(usize),
    /// They do not move.
    Stuck(usize),
    /// They are gone.
    Gone(usize),
}

impl Contingency {
    /// All that may happen to them, the earliest first.
    fn all(place: usize) -> impl Iterator<Item = Self> {
        // No part is before the first.
        let in_turn = (place > 0).then_some(Self::StuckInTurn(place));
        in_turn.into_iter().chain([Self::Stuck(place), Self::Gone(place)])
    }

    /// The question that asks about it, for a request whose plan takes parts out of the assembly in `order`.
    fn question(self, request: &PlanRequest, order: &[Vec<usize>]) -> PlanRequest {
        let mut request = request.clone();
        match self {
            Self::StuckInTurn(place) => {
                request.removed.extend(order[..place].iter().flatten());
                request.fixed.extend(&order[place]);
            }
            Self::Stuck(place) => request.fixed.extend(&order[place]),
            Self::Gone(place) => request.removed.extend(&order[place]),
        }
        // What does not move is kept anyway.
        request.keep.retain(|part| !request.fixed.contains(part));
        // What the search finds is remembered for any order.
        request.steady = None;
        request
    }
}

/// The likely questions after a plan that were not planned yet.
#[derive(Debug)]
pub(super) struct Speculation {
    assembly: AssemblyId,
    /// Parts that stand elsewhere than in it.
    moved: Vec<(usize, Pose)>,
    request: PlanRequest,
    /// The parts that its plan takes out of the assembly, in order; those that leave together in one.
    order: Vec<Vec<usize>>,
    left: VecDeque<Contingency>,
    /// The time that is left for them.
    time: Duration,
}

impl Speculation {
    /// The likely questions after a plan, to be planned within `time`. `None` if the plan has no steps, if it was
    /// cancelled, or if its planner serves only for comparison.
    pub(super) fn after(job: &PlanJob, plan: &Plan, time: Duration) -> Option<Self> {
        let PlanRequest { planner, assembly, no_cache, .. } = &job.request;
        let is_for_use = *planner == Planner::SbdpStar && assembly.is_none() && !no_cache;
        let is_wanted = plan.status != PlanStatus::Cancelled;
        if !is_for_use || !is_wanted || plan.steps.is_empty() || time.is_zero() {
            return None;
        }
        // No question is about a group that lies beside the assembly.
        let leaves = plan.steps.iter().filter(|step| step.of.is_none() && step.ends == StepEnd::Out);
        let order: Vec<Vec<usize>> = leaves.map(|step| step.parts.clone()).collect();
        let left = (0..order.len()).flat_map(Contingency::all).collect();
        let (moved, request) = (job.moved.clone(), job.request.clone());
        Some(Self { assembly: job.assembly, moved, request, order, left, time })
    }

    /// Whether both come after plans of the same request.
    pub(super) fn is_as(&self, other: &Self) -> bool {
        (self.assembly, &self.moved, &self.request) == (other.assembly, &other.moved, &other.request)
    }

    /// How many questions are left.
    pub(super) fn left(&self) -> usize {
        self.left.len()
    }

    /// Plans the next question; whether a plan was found. A question that was interrupted stays the next. A question
    /// that takes more than half of the time is dropped, but the motions found for it stay cached.
    pub(super) fn plan_next<P: Planning>(&mut self, service: &P, termination: &Termination) -> bool {
        let Some(next) = self.left.pop_front() else { return false };
        let began = Instant::now();
        let request = next.question(&self.request, &self.order);
        let within = termination.within(self.time / 2);
        // An error is reported to the client that asks the question.
        let planned = contained(|| {
            let assembly = with_moved(service, self.assembly, &self.moved, &within)?;
            service.speculate(assembly, &request, &within)
        });
        self.time = self.time.saturating_sub(began.elapsed());
        if termination.check().is_err() {
            self.left.push_front(next);
            return false;
        }
        let plan = planned.ok().and_then(Result::ok);
        if plan.is_none() || self.time < LEAST_TIME {
            // The others would fail in the same way, or there is no time for them.
            self.left.clear();
        }
        plan.is_some_and(|plan| !matches!(plan.status, PlanStatus::Timeout | PlanStatus::Cancelled))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::sync::atomic::Ordering;

    use super::*;
    use crate::fixtures::{plan_of, step_of};
    use crate::geometry::{Revision, SourceAssembly};
    use crate::plan::PlanStep;
    use crate::search::{PlanSink, Staging};
    use crate::service::{Admission, ServiceError};

    const TIME: Duration = Duration::from_secs(1000);

    /// Of which assembly, with which parts stuck, and with which gone.
    type Asked = (AssemblyId, Vec<usize>, Vec<usize>);

    /// Writes down what it is asked to speculate.
    #[derive(Default)]
    struct Scripted {
        asked: Mutex<Vec<Asked>>,
        /// What the first of the questions ends as.
        first: Option<fn(&Termination) -> PlanStatus>,
    }

    impl Planning for Scripted {
        fn admit(&self, _: &SourceAssembly, _: &Termination) -> Result<Admission, ServiceError> {
            Err(ServiceError::UnknownAssembly)
        }

        fn revise(
            &self,
            base: AssemblyId,
            revision: &Revision,
            _: &Termination,
        ) -> Result<Admission, ServiceError> {
            let id = AssemblyId([base.0[0] + revision.moved.len() as u8; 32]);
            Ok(Admission { id, known: false, warnings: vec![] })
        }

        fn knows(&self, _: AssemblyId) -> bool {
            true
        }

        fn plan(
            &self,
            _: AssemblyId,
            _: &PlanRequest,
            _: &Termination,
            _: &mut dyn PlanSink,
        ) -> Result<Plan, ServiceError> {
            Err(ServiceError::UnknownAssembly)
        }

        fn speculate(
            &self,
            id: AssemblyId,
            request: &PlanRequest,
            termination: &Termination,
        ) -> Result<Plan, ServiceError> {
            let mut asked = self.asked.lock().unwrap();
            asked.push((id, request.fixed.clone(), request.removed.clone()));
            let first = self.first.filter(|_| asked.len() == 1);
            drop(asked);
            Ok(plan_of(first.map_or(PlanStatus::Infeasible, |status| status(termination)), vec![]))
        }
    }

    impl Scripted {
        fn asked(&self) -> Vec<Asked> {
            self.asked.lock().unwrap().clone()
        }
    }

    fn job(request: PlanRequest) -> PlanJob {
        PlanJob::about(AssemblyId([1; 32]), request)
    }

    fn plan() -> Plan {
        plan_of(PlanStatus::Complete, vec![step_of(2), step_of(0)])
    }

    fn speculation(request: PlanRequest) -> Speculation {
        Speculation::after(&job(request), &plan(), TIME).unwrap()
    }

    #[test]
    fn each_part_is_stuck_in_its_turn_or_before_and_gone_in_the_order_of_the_plan() {
        let (service, t) = (Scripted::default(), Termination::default());
        let mut speculation =
            speculation(PlanRequest { fixed: vec![7], removed: vec![5], ..PlanRequest::default() });
        let mut planned = 0;
        while speculation.plan_next(&service, &t) {
            planned += 1;
        }
        let id = AssemblyId([1; 32]);
        let of = |fixed: &[usize], removed: &[usize]| (id, fixed.to_vec(), removed.to_vec());
        let first = [of(&[7, 2], &[5]), of(&[7], &[5, 2])];
        let second = [of(&[7, 0], &[5, 2]), of(&[7, 0], &[5]), of(&[7], &[5, 0])];
        assert_eq!((service.asked(), planned, speculation.left()), ([&first[..], &second].concat(), 5, 0));
    }

    #[test]
    fn a_group_is_stuck_or_gone_as_a_whole() {
        let group = PlanStep { parts: vec![1, 2], ..step_of(1) };
        let inner = PlanStep { of: Some(0), ..step_of(2) };
        let aside = PlanStep { ends: StepEnd::Aside, ..step_of(3) };
        let plan = plan_of(PlanStatus::Complete, vec![group, inner, aside, step_of(3)]);
        let (service, t) = (Scripted::default(), Termination::default());
        let mut speculation = Speculation::after(&job(PlanRequest::default()), &plan, TIME).unwrap();
        while speculation.plan_next(&service, &t) {}
        let asked: Vec<_> = service.asked().into_iter().map(|(_, fixed, removed)| (fixed, removed)).collect();
        let of = |fixed: &[usize], removed: &[usize]| (fixed.to_vec(), removed.to_vec());
        assert_eq!(
            asked,
            [of(&[1, 2], &[]), of(&[], &[1, 2]), of(&[3], &[1, 2]), of(&[3], &[]), of(&[], &[3])]
        );
    }

    #[test]
    fn parts_that_stood_elsewhere_do_so_there_too() {
        let service = Scripted::default();
        let job = PlanJob { moved: vec![(0, Pose::identity())], ..job(PlanRequest::default()) };
        let mut speculation = Speculation::after(&job, &plan(), TIME).unwrap();
        assert!(speculation.plan_next(&service, &Termination::default()));
        assert_eq!(service.asked()[0].0, AssemblyId([2; 32]));
    }

    #[test]
    fn what_was_stopped_is_the_next_again() {
        let stopped = |t: &Termination| {
            t.cancel_flag().store(true, Ordering::Relaxed);
            PlanStatus::Cancelled
        };
        let service = Scripted { first: Some(stopped), ..Scripted::default() };
        let mut speculation = speculation(PlanRequest::default());
        assert!(!speculation.plan_next(&service, &Termination::default()));
        assert_eq!(speculation.left(), 5);
        assert!(speculation.plan_next(&service, &Termination::default()));
        let asked = service.asked();
        assert_eq!((asked[0] == asked[1], speculation.left()), (true, 4));
    }

    #[test]
    fn what_takes_too_long_is_left_out() {
        let out_of_time = |t: &Termination| {
            assert!(t.has_deadline());
            PlanStatus::Timeout
        };
        let service = Scripted { first: Some(out_of_time), ..Scripted::default() };
        let mut speculation = speculation(PlanRequest::default());
        assert!(!speculation.plan_next(&service, &Termination::default()));
        assert!(speculation.plan_next(&service, &Termination::default()));
        assert_eq!((speculation.left(), service.asked().len()), (3, 2));
    }

    #[test]
    fn what_cannot_be_planned_or_took_all_the_time_is_the_last() {
        let service = Scripted { first: Some(|_| panic!("scripted panic")), ..Scripted::default() };
        let mut failing = speculation(PlanRequest::default());
        assert!(!failing.plan_next(&service, &Termination::default()));
        assert_eq!((failing.left(), service.asked().len()), (0, 1));
        let mut speculation =
            Speculation { time: Duration::from_nanos(1), ..speculation(PlanRequest::default()) };
        assert!(speculation.plan_next(&Scripted::default(), &Termination::default()));
        assert_eq!(speculation.left(), 0, "the time is over");
    }

    #[test]
    fn nothing_is_speculated_where_nobody_carries_a_plan_out() {
        let none = |request: PlanRequest, plan: &Plan, time| {
            assert!(Speculation::after(&job(request), plan, time).is_none());
        };
        let default = PlanRequest::default;
        none(default(), &plan_of(PlanStatus::Infeasible, vec![]), TIME);
        none(default(), &plan_of(PlanStatus::Cancelled, vec![step_of(2)]), TIME);
        none(default(), &plan(), Duration::ZERO);
        none(PlanRequest { planner: Planner::Sbdp, ..default() }, &plan(), TIME);
        none(PlanRequest { assembly: Some(Staging::None), ..default() }, &plan(), TIME);
        none(PlanRequest { no_cache: true, ..default() }, &plan(), TIME);
        assert!(speculation(default()).is_as(&speculation(default())));
        assert!(!speculation(default()).is_as(&speculation(PlanRequest { fixed: vec![1], ..default() })));
    }
}
