//! What a state-based search reports: why it found no more, who blocks what remains, its trace.

use crate::blocking_graph::Blockage;
use crate::simulation::Action;
use crate::tolerances::{SAME_STATE_ROTATION, SAME_STATE_TRAVEL};

use super::action_table::ActionTable;
use super::disassembly::Disassembly;
use super::novelty::Novelty;
use super::order::Order;
use super::outcome::BlockedAction;
use super::states::States;
use super::strategy::Strategy;
use super::trace::{BlockedBy, PlanningPhase, TraceEvent};

/// The name of all actions together, where parts are linked.
const LINKED: &str = "any";

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
    /// A sentence about what was tried before the search gave up.
    pub(super) fn evidence(self, disassembly: &Disassembly<'_, '_>) -> String {
        let (problem, standing) = (&disassembly.problem, disassembly.everything.standing());
        let stuck = problem.wanted(standing);
        let linked = stuck.iter().filter(|p| self.order.linked_with(**p, standing).is_some()).count();
        let mut found = Vec::new();
        if linked > 0 {
            found.push(format!(
                "{linked} of them are linked with others, as links of a chain, which no motion undoes (linking \
                 numbers of curves on their surfaces)"
            ));
        }
        if linked < stuck.len() {
            found.push(self.exhausted(&stuck, disassembly));
        }
        let (stuck, all) = (stuck.len(), problem.present.len());
        format!("{stuck} of {all} parts cannot leave one at a time: {}", found.join("; of the others, "))
    }

    fn exhausted(self, stuck: &[usize], disassembly: &Disassembly<'_, '_>) -> String {
        let most = stuck.iter().map(|&p| self.states.known[p].len()).max().unwrap_or(0);
        let coarse = self.novelty.coarsest(self.strategy, most);
        format!(
            "every state reached was expanded with {} translations and {} actions with rotational freedom ({} \
             states in all, told apart at {:.3} of the longest side and {:.1} rad){}",
            self.actions.translations.all.len(),
            self.actions.rotations.all.len(),
            disassembly.counters.states,
            SAME_STATE_TRAVEL * coarse / disassembly.problem.scene.longest_side,
            SAME_STATE_ROTATION * coarse,
            if self.strategy.guided { ", also where static analysis saw no way" } else { "" },
        )
    }

    /// The actions of the parts that remain, at the assembled pose, and the parts that block them.
    pub(super) fn blocked(self, disassembly: &Disassembly<'_, '_>) -> Vec<BlockedAction> {
        let standing = disassembly.everything.standing();
        let wanted = disassembly.problem.wanted(standing);
        let mut out = Vec::new();
        for node in self.states.nodes.iter().filter(|n| n.alive && n.is_root() && wanted.contains(&n.part)) {
            let part = node.part;
            let linked = self.order.linked_with(part, standing);
            out.extend(linked.map(|by| BlockedAction { part, action: LINKED.to_owned(), by: vec![by] }));
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
