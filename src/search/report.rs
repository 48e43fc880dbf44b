//! What a search answers when it ends.

use crate::plan::PlanStatus;
use crate::termination::Interrupt;

use super::outcome::{BlockedAction, Outcome};
use super::sbdp::{Search, Stop};
use super::state::{Phase, coarseness};

impl Search<'_, '_> {
    pub(super) fn outcome(self, stop: Option<Stop>) -> Outcome {
        let (status, reason) = match stop {
            _ if self.is_done() => (PlanStatus::Complete, None),
            None => (PlanStatus::Infeasible, Some(self.evidence())),
            Some(Stop::Interrupted(Interrupt::Cancelled)) => {
                (PlanStatus::Cancelled, Some("cancelled".to_owned()))
            }
            Some(Stop::Interrupted(Interrupt::DeadlinePassed)) => {
                (PlanStatus::Timeout, Some("the deadline passed".to_owned()))
            }
            Some(Stop::Budget(n)) => {
                (PlanStatus::Partial, Some(format!("the budget of {n} simulations is used up")))
            }
        };
        let blocked = if status == PlanStatus::Complete { Vec::new() } else { self.blocked() };
        Outcome {
            status,
            reason,
            remaining: self.everything.standing.clone(),
            blocked,
            removals: self.removals,
            counters: self.counters,
        }
    }

    /// What was tried before the search gave up.
    fn evidence(&self) -> String {
        let stuck = self.problem.wanted(&self.everything.standing);
        let most = stuck.iter().map(|&p| self.states_of[p]).max().unwrap_or(0);
        let coarse = coarseness(most);
        format!(
            "{} of {} parts cannot leave one at a time: every state reached was expanded with {} translations \
             and {} actions with rotational freedom ({} states in all, told apart at {:.3} of the longest side \
             and {:.1} rad), also where static analysis saw no way",
            stuck.len(),
            self.problem.present.len(),
            self.translations.len(),
            self.rotations.len(),
            self.counters.states,
            0.05 * coarse / self.problem.scene.longest_side,
            0.5 * coarse,
        )
    }

    fn blocked(&self) -> Vec<BlockedAction> {
        let wanted = self.problem.wanted(&self.everything.standing);
        let mut out = Vec::new();
        for node in self.nodes.iter().filter(|n| n.alive && n.is_root() && wanted.contains(&n.part)) {
            for phase in [Phase::Translation, Phase::Rotation] {
                let Some(b) = node.blockage(phase) else { continue };
                for (i, action) in self.actions(phase).iter().enumerate() {
                    let by: Vec<_> = b.blockers(i).into_iter().collect();
                    if !by.is_empty() {
                        out.push(BlockedAction { part: node.part, action: action.to_string(), by });
                    }
                }
            }
        }
        out
    }
}
