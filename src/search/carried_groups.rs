//! Groups that leave before what carries them, so that nothing is left in the air (see `support.rs`).

use std::collections::{BTreeSet, HashMap};

use super::contraction::Contraction;
use super::disassembly::Stop;
use super::groups::{BlockingGraph, Candidate, Groups, stopped_at};
use super::problem::VerifiedPath;

impl<'a> Groups<'_, 'a, '_> {
    /// A group that leaves along a line before a part that alone carries something in it, so that nothing else is left in the
    /// air.
    pub(super) fn leave_carried(
        &mut self,
        carrier: usize,
    ) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let standing = self.disassembly.everything.standing().to_vec();
        let carried = self.disassembly.left_in_air(&[carrier]);
        let roots: HashMap<usize, usize> = self.roots().map(|(node, root)| (root.part, node)).collect();
        let free: BlockingGraph = vec![Some(Vec::new()); self.disassembly.problem.scene.bodies.len()];
        let mut candidates: BTreeSet<Candidate> = BTreeSet::new();
        for direction in 0..self.translations.len() {
            let (mut stopped, mut swept) = (free.clone(), free.clone());
            let mut known = [BTreeSet::new(), BTreeSet::new()];
            for &part in &carried {
                // What stops parts at once is known: mostly something that stays.
                let begins =
                    self.grown_closure(part, &mut stopped, &mut known[0], |groups, parts, graph| {
                        for part in parts {
                            let root = roots.get(part).map(|&node| &groups.states.nodes[node]);
                            graph[*part] = root.and_then(|root| stopped_at(root, direction));
                        }
                        Ok(())
                    })?;
                if begins.is_none() {
                    continue;
                }
                let group = self.grown_closure(part, &mut swept, &mut known[1], |groups, parts, graph| {
                    groups.sweep(direction, parts, graph)
                })?;
                candidates.extend(group.and_then(|group| self.candidate(group, direction)));
            }
        }
        for (_, group, direction) in candidates {
            // A carrier that leaves with what it carries may as well leave first: single parts are preferred.
            if group.contains(&carrier) {
                continue;
            }
            // What would rather stay is no group that leaves here.
            let stays = self.disassembly.problem.base_among(&group, &standing, &self.order.up).is_some();
            if !stays
                && self.disassembly.left_in_air(&group).is_empty()
                && let Some(found) = self.leaves_along(&standing, &group, direction)?
            {
                return Ok(Some(found));
            }
        }
        Ok(None)
    }

    /// The closure of a part in a graph that `look` completes for the parts that it needs and that are not `known`.
    fn grown_closure(
        &mut self,
        part: usize,
        graph: &mut BlockingGraph,
        known: &mut BTreeSet<usize>,
        mut look: impl FnMut(&mut Self, &[usize], &mut BlockingGraph) -> Result<(), Stop>,
    ) -> Result<Option<Vec<usize>>, Stop> {
        loop {
            let Some(group) = self.closure(graph, [part]) else { return Ok(None) };
            let unknown: Vec<usize> = group.iter().copied().filter(|&part| known.insert(part)).collect();
            if unknown.is_empty() {
                return Ok(Some(group));
            }
            look(self, &unknown, graph)?;
        }
    }
}
