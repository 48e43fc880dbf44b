//! Responses to earlier requests, as the bytes that were sent: the port thread sends them again without waking a
//! worker.

use std::sync::Arc;

use sbdp_ipc::plan::PlanRequest;
use sbdp_ipc::summary::report::Report;
use serde::Serialize;

use super::convert;
use super::outbox::steps_messages;
use super::planning::Planning;
use crate::lru::{self, Lru};
use crate::plan::{Plan, PlanStats, PlanStatus};

/// At most this many responses from before a restart are loaded …
const MOST_RECENT: usize = 64;
/// … of at most this many bytes in all. Loading them delays the first client by a few milliseconds.
const RECENT_BYTES: u64 = 4 << 20;

/// A whole response, ready to be sent.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CachedResponse {
    /// Messages with steps, in order.
    pub(crate) steps: Vec<Arc<Vec<u8>>>,
    /// The message that ends the plan.
    pub(crate) summary: Arc<Vec<u8>>,
}

impl CachedResponse {
    /// The response when the request that led to a plan is repeated. `None` if the plan ended by the clock: another
    /// run may find another plan.
    pub(crate) fn of(plan: &Plan, report: Option<&Report>) -> Option<Self> {
        if matches!(plan.status, PlanStatus::Timeout | PlanStatus::Cancelled) {
            return None;
        }
        let steps: Vec<_> = plan.steps.iter().map(convert::step).collect();
        let PlanStats { simulations, sweeps, states, .. } = plan.stats;
        let stats = PlanStats { simulations, sweeps, states, plan_hit: true, ..PlanStats::default() };
        let summary = convert::summary(plan, report, &stats);
        let mut messages = steps_messages(&steps);
        messages.push(summary);
        // The messages are kept for long, and a vector that grew by doubling has up to half of its memory unused.
        messages.iter_mut().for_each(Vec::shrink_to_fit);
        Self::from_messages(messages)
    }

    /// A response from its messages in order; the last one ends the plan.
    pub(crate) fn from_messages(mut messages: Vec<Vec<u8>>) -> Option<Self> {
        let summary = Arc::new(messages.pop()?);
        Some(Self { steps: messages.into_iter().map(Arc::new).collect(), summary })
    }

    /// The inverse of `from_messages`.
    pub(crate) fn messages(&self) -> Vec<Vec<u8>> {
        self.steps.iter().chain([&self.summary]).map(|message| (**message).clone()).collect()
    }

    /// Approximate bytes in memory.
    fn memory(&self) -> usize {
        let message = |message: &Arc<Vec<u8>>| lru::shared(size_of::<Vec<u8>>()) + message.capacity();
        let steps = self.steps.iter().map(|step| size_of_val(step) + message(step));
        lru::shared(size_of::<Self>()) + message(&self.summary) + steps.sum::<usize>()
    }
}

/// The key of a request: requests that differ only in threads, priority, deadline and planning timeout have the same.
/// `None` if the request forbids caching, wants to see the search, or its plan depends on the clock.
pub(crate) fn question(request: &PlanRequest) -> Option<Vec<u8>> {
    let PlanRequest { no_cache, trace, path_timeout_ns, .. } = *request;
    let is_cached = !no_cache && !trace && path_timeout_ns.is_none();
    let untimed = || PlanRequest {
        threads: 0,
        batch: false,
        deadline_ns: None,
        planning_timeout_ns: None,
        ..request.clone()
    };
    is_cached.then(|| untimed().encode())
}

/// The size of the cache.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(crate) struct ResponseCacheMetrics {
    pub(crate) entries: usize,
    pub(crate) bytes: usize,
}

/// The responses that were used last, within a limit of bytes.
#[derive(Debug, Default)]
pub(crate) struct ResponseCache {
    by_question: Lru<Arc<[u8]>, CachedResponse>,
    bytes: usize,
    limit: usize,
}

impl ResponseCache {
    pub(crate) fn new(limit: usize) -> Self {
        Self { limit, ..Self::default() }
    }

    /// A cache with the responses that were used last before a restart, so that their first use waits neither for
    /// the disk nor for a worker.
    pub(crate) fn recent(service: &impl Planning, limit: usize) -> Self {
        let mut answers = Self::new(limit);
        for (question, messages) in service.recent_answers(MOST_RECENT, RECENT_BYTES) {
            if let Some(answer) = CachedResponse::from_messages(messages) {
                answers.insert(&question, answer);
            }
        }
        answers
    }

    pub(crate) fn metrics(&self) -> ResponseCacheMetrics {
        ResponseCacheMetrics { entries: self.by_question.len(), bytes: self.bytes }
    }

    /// The response to a question.
    pub(crate) fn get(&mut self, question: &[u8]) -> Option<Arc<CachedResponse>> {
        self.by_question.get(question)
    }

    /// Stores a response in place of the least recently used ones.
    pub(crate) fn insert(&mut self, question: &[u8], answer: CachedResponse) {
        let needed = cost(question, &answer);
        if needed > self.limit {
            return;
        }
        let Self { by_question, bytes, limit } = self;
        if let Some(before) = by_question.remove(question) {
            *bytes -= cost(question, &before);
        }
        if *bytes + needed > *limit {
            by_question.evict(|question, answer| {
                *bytes -= cost(&question, &answer);
                *bytes + needed > *limit
            });
        }
        by_question.insert(question.into(), Arc::new(answer));
        *bytes += needed;
    }
}

fn cost(question: &[u8], answer: &CachedResponse) -> usize {
    Lru::<Arc<[u8]>, CachedResponse>::OVERHEAD + lru::shared(question.len()) + answer.memory()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::plan_of;
    use sbdp_ipc::plan::Reports;

    fn answer(bytes: usize) -> CachedResponse {
        CachedResponse { steps: vec![Arc::new(vec![1; bytes - 8])], summary: Arc::new(vec![0; 8]) }
    }

    #[test]
    fn those_not_asked_for_the_longest_are_forgotten_first() {
        let one = cost(b"a", &answer(10_000));
        let mut answers = ResponseCache::new(3 * one);
        for question in [b"a", b"b", b"c"] {
            answers.insert(question, answer(10_000));
        }
        assert_eq!(*answers.get(b"a").unwrap(), answer(10_000));
        answers.insert(b"d", answer(10_000));
        let known: Vec<bool> = [b"a", b"b", b"c", b"d"].map(|q| answers.get(q).is_some()).into();
        assert_eq!(known, [true, false, true, true]);
        answers.insert(b"e", answer(25_000));
        assert!(answers.get(b"e").is_some() && answers.bytes == one + 15_000);
        assert_eq!(answers.by_question.len(), 1);
        answers.insert(b"f", answer(40_000));
        assert!(answers.get(b"f").is_none() && answers.get(b"e").is_some(), "what never fits takes no room");
    }

    #[test]
    fn what_the_clock_did_not_end_is_repeated_under_its_status() {
        let repeated = |status| {
            let answer = CachedResponse::of(&plan_of(status, vec![]), None)?;
            let bytes = sbdp_ipc::bytes::AlignedBytes::copy_of(&answer.summary);
            Some(sbdp_ipc::summary::SummaryView::new(bytes.as_slice()).unwrap().status())
        };
        for status in
            [PlanStatus::Complete, PlanStatus::Partial, PlanStatus::Infeasible, PlanStatus::Exhausted]
        {
            assert_eq!(repeated(status), Some(status.name()));
        }
        assert_eq!((repeated(PlanStatus::Timeout), repeated(PlanStatus::Cancelled)), (None, None));
    }

    #[test]
    fn an_answer_given_anew_takes_the_place_of_the_old_one() {
        let mut answers = ResponseCache::new(1 << 20);
        answers.insert(b"a", answer(100));
        answers.insert(b"a", answer(200));
        assert_eq!((answers.bytes, answers.by_question.len()), (cost(b"a", &answer(200)), 1));
        assert_eq!(*answers.get(b"a").unwrap(), answer(200));
    }

    #[test]
    fn what_an_answer_has_in_reserve_counts() {
        let mut roomy = Vec::with_capacity(5_000);
        roomy.push(0);
        let costs = [vec![0], roomy]
            .map(|message| cost(b"a", &CachedResponse::from_messages(vec![message]).unwrap()));
        assert!(costs[1] > 4_900 + costs[0], "{costs:?}");
    }

    #[test]
    fn threads_and_deadlines_make_no_other_question() {
        let request = PlanRequest { fixed: vec![1], ..PlanRequest::default() };
        let same = PlanRequest {
            threads: 4,
            batch: true,
            deadline_ns: Some(9),
            planning_timeout_ns: Some(9),
            ..request.clone()
        };
        assert_eq!(question(&request), question(&same));
        assert_ne!(question(&request), question(&PlanRequest { fixed: vec![2], ..request.clone() }));
        assert_ne!(question(&request), question(&PlanRequest { static_analysis: 1, ..request.clone() }));
        let reports = Reports { tools: true, ..Reports::default() };
        assert_ne!(question(&request), question(&PlanRequest { reports, ..request.clone() }));
        assert_eq!(question(&PlanRequest { trace: true, ..request.clone() }), None);
        assert_eq!(question(&PlanRequest { path_timeout_ns: Some(9), ..request.clone() }), None);
        assert_eq!(question(&PlanRequest { no_cache: true, ..request }), None);
    }
}
