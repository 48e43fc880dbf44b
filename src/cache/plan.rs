//! Plans: what a search answered, by everything that was asked, without names, threads and deadlines.

use super::motion::add_bounds;
use super::pair::add_pose;
use super::records::{BlockedRecord, PlanRecord, RemovalRecord, StatusRecord, pose_of, pose_record};
use super::{Digest, Key, Kind, Recall};
use crate::geometry::Assembly;
use crate::plan::PlanStatus;
use crate::search::{BlockedAction, Counters, Outcome, PlanRequest, Planner, Removal};
use crate::termination::Termination;

/// A question about an assembly; lists are ascending.
#[derive(Debug, Clone, Copy)]
pub struct PlanQuestion<'a> {
    /// The assembly.
    pub assembly: &'a Assembly,
    /// What is asked.
    pub request: &'a PlanRequest,
    /// Parts that may not move, the assembly's own included.
    pub fixed: &'a [usize],
    /// Parts that are gone already.
    pub removed: &'a [usize],
}

/// What is remembered of an answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Answered {
    /// What the search found. Its counters have no times; every simulation counts as recalled.
    pub outcome: Outcome,
    /// Overlaps at the assembled pose, in the planning frame.
    pub overlaps: Vec<(usize, usize, f64)>,
}

impl Recall {
    /// The answer to a question, if it was answered before.
    #[must_use]
    pub fn plan(&self, question: &PlanQuestion<'_>) -> Option<Answered> {
        if !self.remembers() {
            return None;
        }
        answered(self.get(&question.key())?, question.assembly.parts.len())
    }

    /// Remembers an answer, unless it depends on the clock.
    pub fn remember_plan(
        &self,
        question: &PlanQuestion<'_>,
        termination: &Termination,
        outcome: &Outcome,
        overlaps: &[(usize, usize, f64)],
    ) {
        // The first half of PDP* has half of the time.
        let halved = question.request.planner == Planner::PdpStar && termination.has_deadline();
        let timed = halved || question.request.path_timeout.is_some();
        let status = match outcome.status {
            PlanStatus::Complete => StatusRecord::Complete,
            PlanStatus::Partial => StatusRecord::Partial,
            PlanStatus::Infeasible => StatusRecord::Infeasible,
            PlanStatus::Timeout | PlanStatus::Cancelled => return,
        };
        if self.remembers() && !timed {
            self.put(question.key(), &record(status, outcome, overlaps));
        }
    }
}

impl PlanQuestion<'_> {
    fn key(&self) -> Key {
        let Self { assembly, request, fixed, removed } = *self;
        let mut digest = Digest::new();
        digest.integer(assembly.parts.len() as u64);
        for part in &assembly.parts {
            digest.hash(assembly.shapes[part.shape].content());
            add_pose(&mut digest, &part.planning_from_shape);
            add_bounds(&mut digest, &part.bounds);
        }
        digest.text(request.planner.name()).text(request.engine.name()).text(request.actions.name());
        digest.text(request.static_analysis.name()).text(&format!("{:?}", request.penalty));
        digest.integer(u64::from(request.sweeps()));
        digest.text(&format!("{:?}", request.max_simulations));
        let mut targets = request.targets.clone();
        if let Some(targets) = &mut targets {
            targets.sort_unstable();
            targets.dedup();
        }
        digest.integer(u64::from(targets.is_some()));
        for list in [fixed, removed, &targets.unwrap_or_default()] {
            digest.integer(list.len() as u64);
            list.iter().for_each(|&part| {
                digest.integer(part as u64);
            });
        }
        digest.key(Kind::Plan)
    }
}

fn numbers(parts: &[usize]) -> Vec<u32> {
    parts.iter().map(|&part| part as u32).collect()
}

fn record(status: StatusRecord, outcome: &Outcome, overlaps: &[(usize, usize, f64)]) -> PlanRecord {
    let removal = |r: &Removal| RemovalRecord {
        part: r.part as u32,
        path: r.path.iter().map(pose_record).collect(),
        depth: r.depth,
        waited_for: numbers(&r.waited_for),
    };
    let blocked = |b: &BlockedAction| BlockedRecord {
        part: b.part as u32,
        action: b.action.clone(),
        by: numbers(&b.by),
    };
    PlanRecord {
        status,
        reason: outcome.reason.clone(),
        removals: outcome.removals.iter().map(removal).collect(),
        remaining: numbers(&outcome.remaining),
        blocked: outcome.blocked.iter().map(blocked).collect(),
        simulations: outcome.counters.simulations,
        sweeps: outcome.counters.sweeps,
        states: outcome.counters.states,
        overlaps: overlaps.iter().map(|&(a, b, depth)| (a as u32, b as u32, depth)).collect(),
    }
}

/// The answer that a record holds, unless it names parts that an assembly of `count` does not have.
fn answered(record: PlanRecord, count: usize) -> Option<Answered> {
    let part = |number: u32| Some(number as usize).filter(|&part| part < count);
    let parts = |list: Vec<u32>| list.into_iter().map(part).collect::<Option<Vec<usize>>>();
    let removal = |r: RemovalRecord| {
        let (part, waited_for) = (part(r.part)?, parts(r.waited_for)?);
        Some(Removal { part, path: r.path.iter().map(pose_of).collect(), depth: r.depth, waited_for })
    };
    let blocked =
        |b: BlockedRecord| Some(BlockedAction { part: part(b.part)?, action: b.action, by: parts(b.by)? });
    let outcome = Outcome {
        status: match record.status {
            StatusRecord::Complete => PlanStatus::Complete,
            StatusRecord::Partial => PlanStatus::Partial,
            StatusRecord::Infeasible => PlanStatus::Infeasible,
        },
        reason: record.reason,
        removals: record.removals.into_iter().map(removal).collect::<Option<_>>()?,
        remaining: parts(record.remaining)?,
        blocked: record.blocked.into_iter().map(blocked).collect::<Option<_>>()?,
        counters: Counters {
            simulations: record.simulations,
            recalled: record.simulations,
            sweeps: record.sweeps,
            states: record.states,
            ..Counters::default()
        },
    };
    let overlap = |(a, b, depth): (u32, u32, f64)| Some((part(a)?, part(b)?, depth));
    Some(Answered { outcome, overlaps: record.overlaps.into_iter().map(overlap).collect::<Option<_>>()? })
}
