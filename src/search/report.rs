//! What a state-based search reports: why it found no more, who blocks what remains, its trace.

use crate::blocking_graph::Blockage;

use super::outcome::BlockedAction;
use super::search_view::SearchView;
use super::state::Phase;
use super::trace::{BlockedBy, TraceEvent};

/// What stands for every action where parts are linked.
const LINKED: &str = "any";

impl SearchView<'_, '_, '_> {
    /// What was tried before the search gave up.
    pub(super) fn evidence(&self) -> String {
        let (problem, standing) = (&self.disassembly.problem, self.disassembly.everything.standing());
        let stuck = problem.wanted(standing);
        let linked = stuck.iter().filter(|p| self.linked_with(**p).is_some()).count();
        let mut found = Vec::new();
        if linked > 0 {
            found.push(format!(
                "{linked} of them are linked with others, as links of a chain, which no motion undoes (linking \
                 numbers of curves on their surfaces)"
            ));
        }
        if linked < stuck.len() {
            found.push(self.exhausted(&stuck));
        }
        let (stuck, all) = (stuck.len(), problem.present.len());
        format!("{stuck} of {all} parts cannot leave one at a time: {}", found.join("; of the others, "))
    }

    fn exhausted(&self, stuck: &[usize]) -> String {
        let most = stuck.iter().map(|&p| self.states.of_part(p)).max().unwrap_or(0);
        let coarse = self.states.coarsest(most);
        format!(
            "every state reached was expanded with {} translations and {} actions with rotational freedom ({} \
             states in all, told apart at {:.3} of the longest side and {:.1} rad){}",
            self.actions.of(Phase::Translation).len(),
            self.actions.of(Phase::Rotation).len(),
            self.disassembly.counters.states,
            0.05 * coarse / self.disassembly.problem.scene.longest_side,
            0.5 * coarse,
            if self.rules.guided { ", also where static analysis saw no way" } else { "" },
        )
    }

    /// Who blocks the parts that remain, at the assembled pose.
    pub(super) fn blocked(&self) -> Vec<BlockedAction> {
        let wanted = self.disassembly.problem.wanted(self.disassembly.everything.standing());
        let mut out = Vec::new();
        for node in self.states.iter().filter(|n| n.alive && n.is_root() && wanted.contains(&n.part)) {
            out.extend(self.linked_with(node.part).map(|by| BlockedAction {
                part: node.part,
                action: LINKED.to_owned(),
                by: vec![by],
            }));
            for phase in [Phase::Translation, Phase::Rotation] {
                let Some(b) = node.blockage(phase) else { continue };
                out.extend(self.edges(phase, b).map(|BlockedBy { action, parts }| BlockedAction {
                    part: node.part,
                    action,
                    by: parts,
                }));
            }
        }
        out
    }

    fn edges<'s>(&'s self, phase: Phase, b: &'s Blockage) -> impl Iterator<Item = BlockedBy> + 's {
        self.actions.of(phase).iter().enumerate().filter_map(|(i, action)| {
            let parts: Vec<_> = b.blockers(i).into_iter().collect();
            (!parts.is_empty()).then(|| BlockedBy { action: action.to_string(), parts })
        })
    }

    /// The event for the static analysis of a state.
    pub(super) fn analysed(&self, node: usize) -> Option<TraceEvent> {
        let b = self.states[node].translation.as_ref().filter(|_| self.rules.guided)?;
        let blocked = self.edges(Phase::Translation, b).collect();
        Some(TraceEvent::Analysed { state: self.states.number(node), part: self.states[node].part, blocked })
    }

    /// The event for the expansion of a state.
    pub(super) fn expanded(&self, phase: Phase, node: usize) -> TraceEvent {
        let (mut evaluation, mut excluded) = (None, Vec::new());
        if let (true, Some(b)) = (self.rules.guided, self.states[node].blockage(phase)) {
            let e = b.evaluation();
            evaluation = Some([e.colliding_parts, e.open_actions]);
            excluded = self.edges(phase, b).collect();
        }
        let (state, part) = (self.states.number(node), self.states[node].part);
        TraceEvent::Expanded { phase: phase.into(), state, part, evaluation, excluded }
    }
}
