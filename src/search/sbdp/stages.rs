//! The stages beyond Algorithm 1: proofs, threads, groups, and cells. Each is tried when those before it found nothing.

use std::time::Instant;

use crate::budgets::{REFINEMENTS, STARTS_TURNED};
use crate::geometry::Pose;
use crate::scene::StandingParts;
use crate::simulation::Sweep;
use crate::termination::Interrupt;
use crate::tolerances::TURNED;

use super::super::action_list::ActionList;
use super::super::cell_decomposition::{CellDecomposition, CellExit};
use super::super::cell_memory::CellStage;
use super::super::contraction::Contraction;
use super::super::critical_turns::TurningPart;
use super::super::disassembly::{Disassembly, Stop, Transition, joined};
use super::super::groups::{Groups, HeldGroup};
use super::super::inseparable::InseparablePairs;
use super::super::problem::{Effort, Problem, VerifiedPath};
use super::super::state::StateNode;
use super::super::trace::{PlanningPhase, TraceEvent};
use super::super::unscrewing::{Unscrewed, unscrewed};
use super::{Sbdp, sbdp};

impl<'a, 'o> Sbdp<'a, 'o> {
    /// Looks for parts that never come apart, by one kind of proof after the other; true if there are new ones.
    pub(super) fn find_inseparable(&mut self) -> Result<bool, Stop> {
        for find in InseparablePairs::PROOFS {
            if self.order.find_inseparable(self.strategy, &self.disassembly, find)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Takes a part out along a thread, if one leaves so; true if one does. Small parts come first: a nut is turned off its
    /// bolt and not the bolt out of the nut, which has the longer way.
    pub(super) fn leave_along_threads(&mut self) -> Result<bool, Stop> {
        if !self.strategy.is_extended() || !self.disassembly.problem.sweeps {
            return Ok(false);
        }
        let mut parts = self.open_parts(false);
        let of = self.of(PlanningPhase::Translation);
        parts.sort_by(|&a, &b| of.reach(a).total_cmp(&of.reach(b)));
        for part in parts {
            if self.unscrewing_memory.holds(part, self.disassembly.everything.standing()) {
                continue;
            }
            let (started, verified) = (Instant::now(), self.disassembly.counters.verification);
            let unscrewed = unscrewed(&mut self.disassembly, part)?;
            let counters = &mut self.disassembly.counters;
            // The verification of the ways counts as such.
            counters.simulation += started.elapsed().saturating_sub(counters.verification - verified);
            match unscrewed {
                Ok(Unscrewed { verified: VerifiedPath { path, depth }, action }) => {
                    self.disassembly.counters.sweeps += 1;
                    let action = action.to_string();
                    self.disassembly.trace(|| TraceEvent::Swept { state: 0, part, action });
                    self.remove(part, path, depth)?;
                    self.take_free_parts()?;
                    return Ok(true);
                }
                Err(met) => self.unscrewing_memory.keep(part, met),
            }
        }
        Ok(false)
    }

    /// The parts of the states that translations may lead on from, in the order of expansion: those that are searched at
    /// their own scale, or the others.
    fn open_parts(&self, small: bool) -> Vec<usize> {
        let open = self.expandable(PlanningPhase::Translation);
        let mut parts = self.order.parts(&self.of(PlanningPhase::Translation), &open, &self.disassembly);
        parts.retain(|&part| self.order.is_small(part) == small);
        parts
    }

    /// Takes a small part out that a search at its own scale finds a way for; true if there is one.
    pub(super) fn leave_at_own_scale(&mut self, effort: Effort) -> Result<bool, Stop> {
        if self.disassembly.problem.is_group {
            return Ok(false);
        }
        for part in self.open_parts(true) {
            let tried = (effort, part, self.disassembly.removals.len());
            if self.small_searched.contains(&tried) {
                continue;
            }
            if let Some(VerifiedPath { path, depth }) = self.groups().leave_alone(part, effort)? {
                self.remove(part, path, depth)?;
                self.take_free_parts()?;
                return Ok(true);
            }
            self.small_searched.insert(tried);
        }
        Ok(false)
    }

    /// Takes a group out as `leave` finds one, or, if the rest is rather what leaves, makes one of the group the base; true
    /// if there is such a group.
    pub(super) fn leave_together(
        &mut self,
        leave: impl FnOnce(&mut Groups<'_, 'a, 'o>) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop>,
    ) -> Result<bool, Stop> {
        if self.disassembly.problem.is_group || !self.strategy.is_extended() || self.disassembly.is_done() {
            return Ok(false);
        }
        let Some((contraction, way)) = leave(&mut self.groups())? else { return Ok(false) };
        if self.becomes_base(contraction.members()) {
            return Ok(true);
        }
        self.disassembly.remove_group(contraction.leaving(), way)?;
        contraction.members().iter().for_each(|&part| self.states.remove(part));
        self.renew_base();
        self.settle_preferred()?;
        self.take_free_parts()?;
        Ok(true)
    }

    /// Takes a member out that holds a preferred group, if one leaves along a line or a thread; true if one does.
    pub(super) fn loosen_preferred(&mut self) -> Result<bool, Stop> {
        if self.disassembly.problem.preferred.is_empty() {
            return Ok(false);
        }
        for HeldGroup { holders, .. } in self.groups().held_preferred() {
            self.disassembly.problem.preferred.loosen(holders);
            let open = self.expandable(PlanningPhase::Translation);
            self.analyse(PlanningPhase::Translation, &open)?;
            if self.sweep_out(PlanningPhase::Translation, &open)? {
                self.take_free_parts()?;
                return Ok(true);
            }
            if self.leave_along_threads()? {
                return Ok(true);
            }
        }
        self.disassembly.problem.preferred.loosen(Vec::new());
        Ok(false)
    }

    /// Gives a preferred group up; false if there is none.
    pub(super) fn give_up_preferred(&mut self) -> bool {
        let held = self.groups().held_preferred();
        let with_base = held.iter().find(|held| held.has_base);
        let Some(HeldGroup { group, .. }) = with_base.or(held.first()) else { return false };
        self.disassembly.problem.preferred.give_up(group);
        true
    }

    /// Makes one of some parts that leave the base together the base, if they are rather what stays.
    fn becomes_base(&mut self, leaving: &[usize]) -> bool {
        let Self { disassembly: Disassembly { problem, everything, .. }, former_bases, order, .. } = self;
        let Some(base) = problem.base_among(leaving, everything.standing(), &order.up) else { return false };
        if base.parts.iter().any(|part| former_bases.contains(part)) {
            return false;
        }
        former_bases.append(&mut problem.base.parts);
        problem.base = base;
        true
    }

    /// After a removal: where a base has left, others stay: those that were given and still stand, or else another one is
    /// chosen.
    pub(super) fn renew_base(&mut self) {
        let Disassembly { problem, everything, .. } = &mut self.disassembly;
        let base = problem.base.among(everything.standing());
        if base != problem.base {
            let is_chosen = base.parts.is_empty() && self.strategy.is_extended();
            problem.base =
                if is_chosen { problem.chosen_base(everything.standing(), &self.order.up) } else { base };
        }
    }

    /// At first, and after a removal: settles which preferred groups there are.
    pub(super) fn settle_preferred(&mut self) -> Result<(), Stop> {
        if self.disassembly.problem.preferred.is_empty() {
            return Ok(());
        }
        self.groups().sweep_first()?;
        let Disassembly { problem, everything, .. } = &mut self.disassembly;
        problem.preferred.retain(everything.standing(), &self.group_memory.links);
        Ok(())
    }

    pub(super) fn groups(&mut self) -> Groups<'_, 'a, 'o> {
        let Self { disassembly, states, order, actions, group_memory, .. } = self;
        let ActionList { all, common, .. } = &actions.translations;
        Groups {
            disassembly,
            states,
            order,
            translations: &all[..*common],
            memory: group_memory,
            search: |problem, observer| sbdp(problem, observer, true),
        }
    }

    /// Takes a part out through the cells of its places, if any leaves them; true if one does.
    pub(super) fn leave_by_cells(&mut self, stage: CellStage) -> Result<bool, Stop> {
        if !self.strategy.is_extended() {
            return Ok(false);
        }
        let open = self.expandable(PlanningPhase::Translation);
        for part in self.open_parts(false) {
            let is_start = |&node: &usize| {
                let node = &self.states.nodes[node];
                node.part == part && (stage == CellStage::Last || !self.is_turned(node))
            };
            let starts: Vec<usize> = open.iter().copied().filter(is_start).collect();
            let known = self.cell_memory.holds(part, stage, &starts, self.disassembly.everything.standing());
            if !known && self.leaves_by_cells(part, stage, starts)? {
                self.take_free_parts()?;
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn is_turned(&self, node: &StateNode) -> bool {
        node.pose().rotation.angle_to(&self.disassembly.assembled(node.part).rotation) > TURNED
    }

    fn leaves_by_cells(&mut self, part: usize, stage: CellStage, starts: Vec<usize>) -> Result<bool, Stop> {
        let started = Instant::now();
        let standing = self.disassembly.surroundings(part);
        let Problem { scene, termination, .. } = &self.disassembly.problem;
        let (scene, termination) = (scene.clone(), termination.clone());
        let ways = self.ways_to_cells(part, stage, &starts, &standing)?;
        let poses = ways.iter().enumerate().map(|(i, way)| (i, way[way.len() - 1]));
        let mut coordinates = std::mem::take(&mut self.cell_memory.coordinates);
        let axes = self.actions.axes();
        let most = stage.most_edges();
        let mut search = CellDecomposition::new(&scene, &standing, part, axes, &mut coordinates, most, poses);
        let (mut leaves, mut tries) = (false, 0);
        while !leaves && tries < REFINEMENTS {
            let Some(CellExit { start, way, action }) = search.next_exit(&termination)? else { break };
            tries += 1;
            let run = Transition { part, start: way[way.len() - 1], action };
            let Some(Sweep::Clear { path, .. }) = self.disassembly.sweep(&[run])?.pop().flatten() else {
                continue;
            };
            let prefix = joined(&ways[start], &way);
            if let Ok(VerifiedPath { path, depth }) = self.disassembly.prove_sweep(&run, &prefix, &path)? {
                self.remove(part, path, depth)?;
                leaves = true;
            }
        }
        let (cells, met) = search.ended();
        self.cell_memory.coordinates = coordinates;
        self.cell_memory.keep(part, stage, starts, met);
        self.disassembly.counters.simulation += started.elapsed();
        tracing::debug!(part, cells, leaves, "cells searched");
        self.disassembly.trace(|| TraceEvent::CellsSearched { part, cells, leaves });
        Ok(leaves)
    }

    /// The paths of a part from its assembled pose to where a search of cells begins.
    fn ways_to_cells(
        &self,
        part: usize,
        stage: CellStage,
        starts: &[usize],
        standing: &StandingParts,
    ) -> Result<Vec<Vec<Pose>>, Interrupt> {
        let paths = starts.iter().map(|&node| &self.states.nodes[node].path);
        if stage != CellStage::AfterCriticalTurn {
            return Ok(paths.cloned().collect());
        }
        let paths: Vec<&Vec<Pose>> = paths.take(STARTS_TURNED).collect();
        let starts: Vec<Pose> = paths.iter().map(|path| path[path.len() - 1]).collect();
        let axes = self.actions.axes();
        let turning = TurningPart::new(&self.disassembly.problem, standing, part, axes, &starts);
        let mut ways = Vec::new();
        for (path, start) in paths.into_iter().zip(&starts) {
            ways.extend(turning.ways_from(start)?.iter().map(|turn| joined(path, turn)));
        }
        Ok(ways)
    }
}
