//! What a state-based search reports: what it tried, who blocks what remains, its trace.

use crate::blocking_graph::Blockage;
use crate::simulation::Action;
use crate::tolerances::{SAME_STATE_ROTATION, SAME_STATE_TRAVEL};

use super::action_table::ActionTable;
use super::blocked_actions::ANY;
use super::disassembly::Disassembly;
use super::novelty::Novelty;
use super::order::Order;
use super::outcome::BlockedAction;
use super::states::States;
use super::strategy::Strategy;
use super::trace::{BlockedBy, PlanningPhase, TraceEvent};

/// The parts of a search that its report is about.
#[derive(Clone, Copy)]
pub(super) struct SearchReport<'s> {
    pub(super) strategy: Strategy,
    pub(super) states: &'s States,
    pub(super) actions: &'s ActionTable,
    pub(super) order: &'s Order,
    pub(super) novelty: &'s Novelty,
}

impl SearchReport<'_> {
    /// What was tried, for the log: a plan's reason leaves it out.
    pub(super) fn log(self, disassembly: &Disassembly<'_, '_>) {
        let stuck = disassembly.problem.wanted(disassembly.everything.standing());
        let coarse = self.novelty.coarsest();
        tracing::debug!(
            stuck = stuck.len(),
            translations = self.actions.translations.all.len(),
            rotations = self.actions.rotations.all.len(),
            states = disassembly.counters.states,
            share_of_longest_side = SAME_STATE_TRAVEL * coarse / disassembly.problem.scene.longest_side,
            radians = SAME_STATE_ROTATION * coarse,
            distrusts_static = self.strategy.distrust_static,
            "the search has ended"
        );
    }

    /// The actions of the parts that remain, at the assembled pose, and the parts that block them.
    pub(super) fn blocked(self, disassembly: &Disassembly<'_, '_>) -> Vec<BlockedAction> {
        let standing = disassembly.everything.standing();
        let wanted = disassembly.problem.wanted(standing);
        let mut out = Vec::new();
        for node in self.states.nodes.iter().filter(|n| n.alive && n.is_root() && wanted.contains(&n.part)) {
            let part = node.part;
            if let Some(by) = self.order.holder(part, standing) {
                out.push(BlockedAction { part, action: ANY.to_owned(), by: vec![by] });
                continue;
            }
            for phase in [PlanningPhase::Translation, PlanningPhase::Rotation] {
                let Some(b) = node.blockage(phase) else { continue };
                out.extend(
                    edges(&self.actions.of(phase).all, b).map(|BlockedBy { action, parts }| BlockedAction {
                        part,
                        action,
                        by: parts,
                    }),
                );
            }
        }
        out
    }

    /// Static analysis gave a state its blockage.
    pub(super) fn trace_analysis(self, node: usize, disassembly: &mut Disassembly<'_, '_>) {
        let (state, part) = (self.states.number(node), self.states.nodes[node].part);
        if self.strategy.guided
            && let Some(b) = &self.states.nodes[node].translation
        {
            let blocked = || edges(&self.actions.translations.all, b).collect();
            disassembly.trace(|| TraceEvent::Analysed { state, part, blocked: blocked() });
        }
    }

    /// A state was taken off the open list.
    pub(super) fn trace_expansion(
        self,
        phase: PlanningPhase,
        node: usize,
        disassembly: &mut Disassembly<'_, '_>,
    ) {
        disassembly.trace(|| {
            let (mut evaluation, mut excluded) = (None, Vec::new());
            if let (true, Some(b)) = (self.strategy.guided, self.states.nodes[node].blockage(phase)) {
                let e = b.evaluation();
                evaluation = Some([e.colliding_parts, e.open_actions]);
                excluded = edges(&self.actions.of(phase).all, b).collect();
            }
            let (state, part) = (self.states.number(node), self.states.nodes[node].part);
            TraceEvent::Expanded { phase, state, part, evaluation, excluded }
        });
    }
}

fn edges<'s>(actions: &'s [Action], b: &'s Blockage) -> impl Iterator<Item = BlockedBy> + 's {
    actions.iter().enumerate().filter_map(|(i, action)| {
        let parts: Vec<_> = b.blockers(i).into_iter().collect();
        (!parts.is_empty()).then(|| BlockedBy { action: action.to_string(), parts })
    })
}
