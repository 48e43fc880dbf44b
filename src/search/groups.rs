//! Groups: parts that leave together, as one rigid body, where none leaves alone, or before a part that carries them
//! (`carried_groups.rs`).
//!
//! In each direction, the parts that a part takes along are its closure under the edges of a directional blocking graph
//! (R. Wilson and J.-C. Latombe 1994). Two graphs give candidates. In the graph of sweeps, an edge leads from a part to
//! each one that it enters on its way out along the direction: its closures are just the groups that leave straight. In
//! the graph of the assembled state, an edge leads to what stops the part at once, or in a simulation: its closures can
//! begin to move, and a search finds out whether they leave. What they meet then joins them.
//!
//! Small groups come first. Fixed parts are in none, nor is the base as long as the other half of the split may move
//! instead: only the relative motion of the two counts. So no half is tried after the other.

use std::collections::{BTreeSet, HashSet};

use rayon::prelude::*;

use crate::budgets::{GROUPS_SEARCHED, GROUPS_TURNED};
use crate::plan::{FreeGroup, PlanStatus};
use crate::simulation::{Action, SweepQuestion, remembered_obstacles};
use crate::termination::Interrupt;

use super::contraction::{Contraction, Search};
use super::disassembly::{Disassembly, Stop};
use super::order::Order;
use super::outcome::Outcome;
use super::preferred::PreferredGroups;
use super::problem::{Effort, Problem, VerifiedPath};
use super::state::StateNode;
use super::states::States;
use super::trace::TraceEvent;

/// What was tried in vain.
#[derive(Debug, Default)]
pub(super) struct GroupMemory {
    /// The parts that stood when no group left along a line.
    swept: Option<(Vec<usize>, PreferredGroups)>,
    /// By translation: what the parts entered on their way out when preferred groups were looked at first. What stands
    /// later is fewer.
    first_swept: Vec<BlockingGraph>,
    /// By part: those that it hangs together with.
    pub(super) links: Vec<BTreeSet<usize>>,
    /// Preferred groups whose way along a translation was refused, with what stood.
    refused: HashSet<(Vec<usize>, usize, Vec<usize>)>,
    /// Groups that were searched, with what stood beside them.
    searched: HashSet<(Effort, Vec<usize>, Vec<usize>)>,
}

/// Which parts each part takes along in one direction; `None` where it does not leave in that direction at all.
pub(super) type BlockingGraph = Vec<Option<Vec<usize>>>;

/// A group, smaller ones first, and the number of the translation that it begins with.
pub(super) type Candidate = (usize, Vec<usize>, usize);

/// A preferred group, and members that hold it in some direction.
#[derive(Debug, PartialEq)]
pub(super) struct HeldGroup {
    pub(super) group: Vec<usize>,
    pub(super) holders: Vec<usize>,
    /// Whether a base or a fixed part is in it.
    pub(super) has_base: bool,
}

/// Looks for groups among the parts that stand.
pub(super) struct Groups<'s, 'a, 'o> {
    pub(super) disassembly: &'s mut Disassembly<'a, 'o>,
    pub(super) states: &'s States,
    pub(super) order: &'s Order,
    /// The translations that all parts have.
    pub(super) translations: &'s [Action],
    pub(super) memory: &'s mut GroupMemory,
    /// Searches for a way out of the body of a group.
    pub(super) search: Search,
}

impl<'a> Groups<'_, 'a, '_> {
    /// A group that leaves along a line, and its way.
    pub(super) fn leave_straight(&mut self) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let standing = self.disassembly.everything.standing().to_vec();
        let preferred = self.disassembly.problem.preferred.clone();
        let asked = Some((standing.clone(), preferred));
        if self.memory.swept == asked {
            return Ok(None);
        }
        let mut candidates = BTreeSet::new();
        for direction in 0..self.translations.len() {
            let graph = self.sweeps(direction)?;
            candidates.extend(self.closures(&graph, direction));
        }
        for (_, group, direction) in candidates {
            if let Some(found) = self.leaves_along(&standing, &group, direction)? {
                return Ok(Some(found));
            }
        }
        self.memory.swept = asked;
        Ok(None)
    }

    /// A group and its way along a translation, if it leaves so.
    pub(super) fn leaves_along(
        &mut self,
        standing: &[usize],
        group: &[usize],
        direction: usize,
    ) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let contraction = Contraction::new(&self.disassembly.problem, standing, group)?;
        let action = self.translations[direction];
        let way = self.disassembly.timed(|_| contraction.way_out(&[], &action))?;
        self.trace_tried(group, way.is_some());
        self.disassembly.counters.sweeps += u64::from(way.is_some());
        Ok(way.map(|way| (contraction, way)))
    }

    /// A preferred group that leaves along a line, and its way. Up comes before sideways, and that before down.
    pub(super) fn leave_preferred(&mut self) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let groups = self.leaving_preferred();
        if groups.is_empty() {
            return Ok(None);
        }
        let standing = self.disassembly.everything.standing().to_vec();
        let mut directions: Vec<usize> = (0..self.translations.len()).collect();
        directions.sort_by_key(|&direction| self.order.tier(&self.translations[direction].force()));
        for group in groups {
            for &direction in &directions {
                if !self.holders(&group, direction).is_empty() {
                    continue;
                }
                let key = (group.clone(), direction, standing.clone());
                if self.memory.refused.contains(&key) {
                    continue;
                }
                if let Some(found) = self.leaves_along(&standing, &group, direction)? {
                    return Ok(Some(found));
                }
                self.memory.refused.insert(key);
            }
        }
        Ok(None)
    }

    /// The outermost preferred groups that may leave.
    fn leaving_preferred(&self) -> Vec<Vec<usize>> {
        let problem = &self.disassembly.problem;
        problem.preferred.outermost().filter(|group| problem.may_all_join(group)).cloned().collect()
    }

    /// The preferred groups, each with the members that hold it in one direction or another, and with all members. Those
    /// that few hold come first, of these those that small ones do (the nut is taken off the bolt), and those with a base
    /// last.
    pub(super) fn held_preferred(&self) -> Vec<HeldGroup> {
        let problem = &self.disassembly.problem;
        let held = |group: &Vec<usize>| {
            let has_base = !problem.may_all_join(group);
            let directions = if has_base { 0 } else { self.translations.len() };
            let holders = (0..directions).map(|direction| self.holders(group, direction));
            // All together are tried anyway: the others where one seems to leave.
            let leaves = |holders: &Vec<usize>| holders.iter().any(|&part| self.seems_free(part));
            let holders = holders.filter(leaves).chain([group.clone()]);
            holders.map(|holders| HeldGroup { has_base, group: group.clone(), holders }).collect::<Vec<_>>()
        };
        let mut held: Vec<_> = problem.preferred.outermost().flat_map(held).collect();
        let sides = problem.scene.bodies.iter().map(|body| body.bounds.extents().max()).collect::<Vec<f64>>();
        let size = |h: &HeldGroup| h.holders.iter().map(|&part| sides[part]).sum::<f64>().to_bits();
        held.sort_by_cached_key(|h| {
            (h.has_base, h.holders.len(), size(h), h.group.clone(), h.holders.clone())
        });
        held.dedup();
        held
    }

    /// The members of a group that enter others on their way along a translation, or that do not leave along it at all.
    fn holders(&self, group: &[usize], direction: usize) -> Vec<usize> {
        let standing = self.disassembly.everything.standing();
        let is_in_way =
            |part: &usize| standing.binary_search(part).is_ok() && group.binary_search(part).is_err();
        let holds = |part: &usize| {
            let obstacles = self.memory.first_swept[direction][*part].as_ref();
            obstacles.is_none_or(|obstacles| obstacles.iter().any(is_in_way))
        };
        group.iter().copied().filter(holds).collect()
    }

    /// Whether a part enters none of those that stand on its way along some translation.
    fn seems_free(&self, part: usize) -> bool {
        (0..self.translations.len()).any(|direction| self.holders(&[part], direction).is_empty())
    }

    /// Sweeps all parts along all translations, once, and finds which hang together.
    pub(super) fn sweep_first(&mut self) -> Result<(), Stop> {
        for direction in self.memory.first_swept.len()..self.translations.len() {
            let graph = self.sweeps(direction)?;
            self.memory.first_swept.push(graph);
        }
        if self.memory.links.is_empty() {
            self.memory.links = self.links();
        }
        Ok(())
    }

    /// Per part, those that stop it at once along some translation, and those that it enters on its way both along one and
    /// against it: they enclose it.
    fn links(&self) -> Vec<BTreeSet<usize>> {
        let mut links = vec![BTreeSet::new(); self.disassembly.problem.scene.bodies.len()];
        for direction in 0..self.translations.len() {
            let stopped = self.stopped_in(direction);
            // Opposite translations are neighbours.
            let [along, against] = [direction, direction ^ 1].map(|d| self.memory.first_swept.get(d));
            for (part, links) in links.iter_mut().enumerate() {
                links.extend(stopped[part].iter().flatten());
                let [along, against] =
                    [along, against].map(|graph| graph.and_then(|graph| graph[part].as_ref()));
                let (Some(along), Some(against)) = (along, against) else { continue };
                links.extend(along.iter().filter(|other| against.contains(other)));
            }
        }
        links
    }

    /// A group that a search with some effort finds a way for, and the way.
    pub(super) fn leave(&mut self, effort: Effort) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let mut candidates: BTreeSet<Candidate> = BTreeSet::new();
        for direction in 0..self.translations.len() {
            candidates.extend(self.closures(&self.met_in(direction), direction));
            candidates.extend(self.closures(&self.stopped_in(direction), direction));
        }
        // Of the translations any does: a search tries all.
        let preferred = self.leaving_preferred().into_iter();
        candidates.extend(preferred.map(|group| (group.len(), group, 0)));
        let mut seen: HashSet<Vec<usize>> = HashSet::new();
        let most = match effort {
            Effort::Pushes => GROUPS_SEARCHED,
            Effort::All => GROUPS_TURNED,
        };
        while let Some((_, group, direction)) = candidates.pop_first() {
            let standing = self.disassembly.everything.standing().to_vec();
            let rest: Vec<usize> = standing.iter().copied().filter(|p| !group.contains(p)).collect();
            if !seen.insert(group.clone()) {
                continue;
            }
            if seen.len() > most {
                break;
            }
            let key = (effort, group.clone(), rest);
            if self.memory.searched.contains(&key) {
                continue;
            }
            let contraction = Contraction::new(&self.disassembly.problem, &standing, &group)?;
            let (outcome, way) = self.searched(&contraction, effort)?;
            if let Some(way) = way {
                return Ok(Some((contraction, way)));
            }
            self.memory.searched.insert(key);
            let free: BlockingGraph = vec![Some(Vec::new()); self.disassembly.problem.scene.bodies.len()];
            for graph in [self.met_in(direction), free] {
                let grown = outcome.blocked.iter().filter_map(|blocked| {
                    let grown = self.closure(&graph, group.iter().chain(&blocked.by).copied())?;
                    self.candidate(grown, direction)
                });
                candidates.extend(grown);
            }
        }
        Ok(None)
    }

    /// The way that a search with some effort finds for a part alone.
    pub(super) fn leave_alone(&mut self, part: usize, effort: Effort) -> Result<Option<VerifiedPath>, Stop> {
        let standing = self.disassembly.everything.standing().to_vec();
        let contraction = Contraction::new(&self.disassembly.problem, &standing, &[part])?;
        Ok(self.searched(&contraction, effort)?.1)
    }

    fn trace_tried(&mut self, group: &[usize], leaves: bool) {
        tracing::debug!(?group, leaves, "group tried");
        self.disassembly.trace(|| TraceEvent::GroupTried { parts: group.to_vec(), leaves });
    }

    /// A search for a way out of a group, and the way. It counts as a part of this one.
    fn searched(
        &mut self,
        contraction: &Contraction<'_>,
        effort: Effort,
    ) -> Result<(Outcome, Option<VerifiedPath>), Stop> {
        let Disassembly { problem, counters, .. } = &mut *self.disassembly;
        let spent = problem.spent + counters.simulations;
        let mut outcome = contraction.searched(self.search, effort, spent);
        counters.add(&outcome.counters);
        problem.termination.check()?;
        match (outcome.status, problem.max_simulations) {
            (PlanStatus::Partial, Some(most)) => return Err(Stop::Budget(most)),
            (PlanStatus::Timeout, _) => self.disassembly.path_time_ran_out = true,
            _ => {}
        }
        let way = outcome.removals.pop().map(|r| VerifiedPath { path: r.path, depth: r.depth });
        self.trace_tried(contraction.members(), way.is_some());
        Ok((outcome, way))
    }

    /// The groups that can begin to move, the smallest of each direction.
    pub(super) fn free_together(&self) -> Vec<FreeGroup> {
        let mut free: Vec<FreeGroup> = Vec::new();
        for (direction, action) in self.translations.iter().enumerate() {
            let closures = self.closures(&self.stopped_in(direction), direction);
            if let Some((_, parts, _)) = closures.into_iter().next()
                && free.iter().all(|known| known.parts != parts)
            {
                free.push(FreeGroup { parts, direction: action.force().into() });
            }
        }
        free
    }

    /// Per part, the parts that it enters on its way out along a direction.
    fn sweeps(&mut self, direction: usize) -> Result<BlockingGraph, Stop> {
        let mut graph: BlockingGraph = vec![None; self.disassembly.problem.scene.bodies.len()];
        let standing = self.disassembly.everything.standing().to_vec();
        self.sweep(direction, &standing, &mut graph)?;
        Ok(graph)
    }

    /// The same for some parts.
    pub(super) fn sweep(
        &mut self,
        direction: usize,
        parts: &[usize],
        graph: &mut BlockingGraph,
    ) -> Result<(), Stop> {
        let around = parts.iter().map(|&part| self.disassembly.surroundings(part)).collect::<Vec<_>>();
        let problem = &self.disassembly.problem;
        let along = self.translations[direction].force();
        let swept = parts.par_iter().zip(around).map(|(&part, around)| {
            if !problem.may_join(part) {
                return Ok(None);
            }
            let question = SweepQuestion {
                scene: &problem.scene,
                standing_parts: &around,
                part,
                start: &problem.scene.bodies[part].planning_from_shape,
                direction: &along,
            };
            remembered_obstacles(&problem.cache, &question, &problem.termination)
        });
        let swept: Vec<Option<Vec<usize>>> = swept.collect::<Result<_, Interrupt>>()?;
        parts.iter().zip(swept).for_each(|(&part, obstacles)| graph[part] = obstacles);
        Ok(())
    }

    /// Per part, what stops it at once along a direction.
    fn stopped_in(&self, direction: usize) -> BlockingGraph {
        self.graph(|node| stopped_at(node, direction))
    }

    /// The same, and what stopped it in simulations.
    fn met_in(&self, direction: usize) -> BlockingGraph {
        self.graph(|node| Some(node.translation.as_ref()?.blockers(direction).into_iter().collect()))
    }

    /// A graph of the assembled state.
    fn graph(&self, blockers: impl Fn(&StateNode) -> Option<Vec<usize>>) -> BlockingGraph {
        let mut graph = vec![None; self.disassembly.problem.scene.bodies.len()];
        self.roots().for_each(|(_, root)| graph[root.part] = blockers(root));
        graph
    }

    /// The assembled states of the parts that stand, with their places among all states.
    pub(super) fn roots(&self) -> impl Iterator<Item = (usize, &StateNode)> {
        self.states.nodes.iter().enumerate().filter(|(_, node)| node.alive && node.is_root())
    }

    /// The closures of all parts that are groups, each once.
    fn closures(&self, graph: &BlockingGraph, direction: usize) -> BTreeSet<Candidate> {
        let standing = self.disassembly.everything.standing();
        let closure = |&part: &usize| self.closure(graph, [part]);
        standing.iter().filter_map(closure).filter_map(|group| self.candidate(group, direction)).collect()
    }

    /// A closed set that moves along a direction as a candidate, or else what remains, which moves against it: the one
    /// that may leave earlier, and of equal ones the smaller. None if one of them is a part that may move: it was tried alone.
    pub(super) fn candidate(&self, group: Vec<usize>, direction: usize) -> Option<Candidate> {
        let Disassembly { problem, everything, .. } = &*self.disassembly;
        let is_rest = |part: &usize| group.binary_search(part).is_err();
        let rest: Vec<usize> = everything.standing().iter().copied().filter(is_rest).collect();
        let release = |parts: &[usize]| parts.iter().map(|&part| problem.release_of(part)).max();
        let rank = |parts: &[usize]| (release(parts), parts.len(), parts[0]);
        let may_move = |parts: &[usize]| problem.may_all_join(parts);
        let is_tried = |parts: &[usize]| parts.len() == 1 && may_move(parts);
        if rest.is_empty() || is_tried(&group) || is_tried(&rest) {
            return None;
        }
        Some(if may_move(&rest) && rank(&rest) < rank(&group) {
            // Opposite translations are neighbours.
            (rest.len(), rest, direction ^ 1)
        } else {
            (group.len(), group, direction)
        })
    }

    /// All that some parts take along, themselves included, in order; `None` if that is everything, or may not move.
    pub(super) fn closure(
        &self,
        graph: &BlockingGraph,
        parts: impl IntoIterator<Item = usize>,
    ) -> Option<Vec<usize>> {
        let standing = self.disassembly.everything.standing();
        let mut group = BTreeSet::new();
        let mut open: Vec<usize> = parts.into_iter().collect();
        while let Some(part) = open.pop() {
            let Problem { preferred, .. } = &self.disassembly.problem;
            if !self.disassembly.problem.may_join(part) {
                return None;
            }
            if standing.binary_search(&part).is_err() || !group.insert(part) {
                continue;
            }
            if group.len() == standing.len() {
                return None;
            }
            open.extend(graph[part].as_ref()?);
            if preferred.keeps(part) {
                open.extend(preferred.around(part).into_iter().flatten());
            }
            open.extend(self.order.inseparable().held_with(part));
        }
        Some(group.into_iter().collect())
    }
}

/// What stops a state's part at once along a direction.
pub(super) fn stopped_at(node: &StateNode, direction: usize) -> Option<Vec<usize>> {
    Some(node.translation.as_ref()?.single_blockers(direction).iter().copied().collect())
}
