//! What searches answered, by everything that was asked, without names, threads and deadlines.

use serde::{Deserialize, Serialize};

use crate::cache::{Digest, RecordKey, RecordKind, RequestCache, Storage, Validity};
use crate::geometry::{Assembly, add_bounds, add_pose};
use crate::plan::PlanStatus;
use crate::search::{Outcome, PlanRequest, Planner, PreferredGroups, Removal};
use crate::termination::Termination;

/// What a search answered. The service prepares the scene and the limits that it searches with.
pub(crate) static PLAN: RecordKind = RecordKind::of::<PlanAnswer>(6, "plan", Storage::MemoryAndDisk, SOURCES);
const SOURCES: Validity = Validity::Sources(env!("SBDP_SOURCES_SERVICE"));

/// A question about an assembly; lists are ascending.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PlanQuestion<'a> {
    /// The assembly.
    pub assembly: &'a Assembly,
    /// What is asked.
    pub request: &'a PlanRequest,
    /// Parts that may not move, the assembly's own included.
    pub fixed: &'a [usize],
    /// Parts that are gone already.
    pub removed: &'a [usize],
    /// Parts that were given as the base.
    pub base: &'a [usize],
    /// Parts that are to be kept.
    pub keep: &'a [usize],
}

/// A remembered answer, in the planning frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PlanAnswer {
    /// What the search found. Its counters have no times, and all simulations count as recalled.
    pub outcome: Outcome,
    /// Overlaps at the assembled pose.
    pub overlaps: Vec<(usize, usize, f64)>,
}

/// The answer to a question, if it was answered before.
pub(crate) fn remembered_plan(cache: &RequestCache, question: &PlanQuestion<'_>) -> Option<PlanAnswer> {
    let mut answered: PlanAnswer = cache.get(&question.key())?;
    let counters = &mut answered.outcome.counters;
    counters.recalled = counters.simulations;
    answered.names_only(question.assembly.parts.len()).then_some(answered)
}

/// Remembers an answer, unless it depends on the clock.
pub(crate) fn remember_plan(
    cache: &RequestCache,
    question: &PlanQuestion<'_>,
    termination: &Termination,
    outcome: &Outcome,
    overlaps: &[(usize, usize, f64)],
) {
    // The first half of PDP* has half of the time.
    let halved = question.request.planner == Planner::PdpStar && termination.has_deadline();
    let timed = halved || question.request.path_timeout.is_some();
    let ended = matches!(outcome.status, PlanStatus::Timeout | PlanStatus::Cancelled);
    if !timed && !ended {
        cache.put(question.key(), &PlanAnswer { outcome: outcome.clone(), overlaps: overlaps.to_vec() });
    }
}

impl PlanAnswer {
    /// Whether all parts that it names are among the first `count`.
    fn names_only(&self, count: usize) -> bool {
        let Outcome { removals, base, remaining, unfinished, blocked, free_together, .. } = &self.outcome;
        let is_part = |part: &usize| *part < count;
        let are_parts = |list: &[usize]| list.iter().all(is_part);
        let is_step = |(i, r): (usize, &Removal)| {
            let refers = r.requires.iter().chain(&r.of);
            !r.parts.is_empty()
                && are_parts(&r.parts)
                && !r.path.is_empty()
                && refers.into_iter().all(|&j| j < i)
        };
        removals.iter().enumerate().all(is_step)
            && blocked.iter().all(|b| is_part(&b.part) && are_parts(&b.by))
            && self.overlaps.iter().all(|(a, b, _)| is_part(a) && is_part(b))
            && free_together.iter().all(|group| are_parts(&group.parts))
            && are_parts(&base.parts)
            && are_parts(remaining)
            && are_parts(unfinished)
    }
}

impl PlanQuestion<'_> {
    fn key(&self) -> RecordKey {
        let Self { assembly, request, fixed, removed, base, keep } = *self;
        let mut digest = Digest::new();
        digest.integer(assembly.parts.len() as u64);
        for part in &assembly.parts {
            digest.hash(assembly.shapes[part.shape].content());
            add_pose(&mut digest, &part.planning_from_shape);
            add_bounds(&mut digest, &part.bounds);
        }
        digest.text(request.planner.name()).text(request.engine.name()).text(request.actions.name());
        digest.text(request.static_analysis.name()).text(&format!("{:?}", request.penalty));
        digest.integer(u64::from(request.sweeps())).integer(request.seed);
        digest.text(&format!("{:?} {:?}", request.max_simulations, request.end_gap));
        digest.numbers([request.clearance]);
        digest.text(&format!("{:?} {:?}", request.up, PreferredGroups::new(&request.groups)));
        let mut targets = request.targets.clone();
        if let Some(targets) = &mut targets {
            targets.sort_unstable();
            targets.dedup();
        }
        digest.integer(u64::from(targets.is_some()));
        let mut keep_out = request.keep_out.clone();
        keep_out.sort_unstable();
        keep_out.dedup();
        for list in [fixed, removed, base, keep, &keep_out, &targets.unwrap_or_default()] {
            digest.integer(list.len() as u64);
            list.iter().for_each(|&part| {
                digest.integer(part as u64);
            });
        }
        digest.key(&PLAN)
    }
}
