//! Groups: parts that leave together, as one rigid body, where none leaves alone.
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
use super::inseparable::InseparablePairs;
use super::outcome::Outcome;
use super::problem::{Effort, VerifiedPath};
use super::state::StateNode;
use super::states::States;
use super::trace::TraceEvent;

/// What was tried in vain.
#[derive(Debug, Default)]
pub(super) struct GroupMemory {
    /// The parts that stood when no group left along a line.
    swept: Option<Vec<usize>>,
    /// Groups that were searched, with what stood beside them.
    searched: HashSet<(Effort, Vec<usize>, Vec<usize>)>,
}

/// Which parts each part takes along in one direction; `None` where it does not leave in that direction at all.
type BlockingGraph = Vec<Option<Vec<usize>>>;

/// A group, smaller ones first, and the number of the translation that it begins with.
type Candidate = (usize, Vec<usize>, usize);

/// Looks for groups among the parts that stand.
pub(super) struct Groups<'s, 'a, 'o> {
    pub(super) disassembly: &'s mut Disassembly<'a, 'o>,
    pub(super) states: &'s States,
    pub(super) inseparable: &'s InseparablePairs,
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
        if self.memory.swept.as_ref() == Some(&standing) {
            return Ok(None);
        }
        let mut candidates = BTreeSet::new();
        for direction in 0..self.translations.len() {
            let graph = self.sweeps(direction)?;
            candidates.extend(self.closures(&graph, direction));
        }
        for (_, group, direction) in candidates {
            let contraction = Contraction::new(&self.disassembly.problem, &standing, &group)?;
            let action = self.translations[direction];
            let way = self.disassembly.timed(|_| contraction.way_out(&[], &action))?;
            self.trace_tried(&group, way.is_some());
            if let Some(way) = way {
                self.disassembly.counters.sweeps += 1;
                return Ok(Some((contraction, way)));
            }
        }
        self.memory.swept = Some(standing);
        Ok(None)
    }

    /// A group that a search with some effort finds a way for, and the way.
    pub(super) fn leave(&mut self, effort: Effort) -> Result<Option<(Contraction<'a>, VerifiedPath)>, Stop> {
        let mut candidates: BTreeSet<Candidate> = BTreeSet::new();
        for direction in 0..self.translations.len() {
            candidates.extend(self.closures(&self.met_in(direction), direction));
            candidates.extend(self.closures(&self.stopped_in(direction), direction));
        }
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
            let mut outcome = self.searched(&contraction, effort)?;
            let way = outcome.removals.pop().map(|r| VerifiedPath { path: r.path, depth: r.depth });
            self.trace_tried(&group, way.is_some());
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

    fn trace_tried(&mut self, group: &[usize], leaves: bool) {
        tracing::debug!(?group, leaves, "group tried");
        self.disassembly.trace(|| TraceEvent::GroupTried { parts: group.to_vec(), leaves });
    }

    /// A search for a way out of a group. It counts as a part of this one.
    fn searched(&mut self, contraction: &Contraction<'_>, effort: Effort) -> Result<Outcome, Stop> {
        let Disassembly { problem, counters, .. } = &mut *self.disassembly;
        let spent = problem.spent + counters.simulations;
        let outcome = contraction.searched(self.search, effort, spent);
        counters.add(&outcome.counters);
        problem.termination.check()?;
        match (outcome.status, problem.max_simulations) {
            (PlanStatus::Partial, Some(most)) => return Err(Stop::Budget(most)),
            (PlanStatus::Timeout, _) => self.disassembly.path_time_ran_out = true,
            _ => {}
        }
        Ok(outcome)
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
        let standing = self.disassembly.everything.standing().to_vec();
        let around = standing.iter().map(|&part| self.disassembly.surroundings(part)).collect::<Vec<_>>();
        let problem = &self.disassembly.problem;
        let along = self.translations[direction].force();
        let swept = standing.par_iter().zip(around).map(|(&part, around)| {
            if !problem.may_move(part) {
                return Ok((part, None));
            }
            let question = SweepQuestion {
                scene: &problem.scene,
                standing_parts: &around,
                part,
                start: &problem.scene.bodies[part].planning_from_shape,
                direction: &along,
            };
            Ok((part, remembered_obstacles(&problem.cache, &question, &problem.termination)?))
        });
        let swept: Vec<(usize, Option<Vec<usize>>)> = swept.collect::<Result<_, Interrupt>>()?;
        let mut graph: BlockingGraph = vec![None; problem.scene.bodies.len()];
        swept.into_iter().for_each(|(part, obstacles)| graph[part] = obstacles);
        Ok(graph)
    }

    /// Per part, what stops it at once along a direction.
    fn stopped_in(&self, direction: usize) -> BlockingGraph {
        self.graph(|node| node.translation.as_ref().map(|b| b.single_blockers(direction).clone()))
    }

    /// The same, and what stopped it in simulations.
    fn met_in(&self, direction: usize) -> BlockingGraph {
        self.graph(|node| node.translation.as_ref().map(|b| b.blockers(direction)))
    }

    /// A graph of the assembled state.
    fn graph(&self, blockers: impl Fn(&StateNode) -> Option<BTreeSet<usize>>) -> BlockingGraph {
        let mut graph = vec![None; self.disassembly.problem.scene.bodies.len()];
        for node in self.states.nodes.iter().filter(|node| node.alive && node.is_root()) {
            graph[node.part] = blockers(node).map(|by| by.into_iter().collect());
        }
        graph
    }

    /// The closures of all parts that are groups, each once.
    fn closures(&self, graph: &BlockingGraph, direction: usize) -> BTreeSet<Candidate> {
        let standing = self.disassembly.everything.standing();
        let closure = |&part: &usize| self.closure(graph, [part]);
        standing.iter().filter_map(closure).filter_map(|group| self.candidate(group, direction)).collect()
    }

    /// A closed set that moves along a direction as a candidate, or else what remains, which moves against it: the smaller
    /// of the two, and the one without the base. None if one of them is a part that may move: it was tried alone.
    fn candidate(&self, group: Vec<usize>, direction: usize) -> Option<Candidate> {
        let Disassembly { problem, everything, .. } = &*self.disassembly;
        let is_rest = |part: &usize| group.binary_search(part).is_err();
        let rest: Vec<usize> = everything.standing().iter().copied().filter(is_rest).collect();
        let has_base = |parts: &[usize]| problem.base.parts.iter().any(|part| parts.contains(part));
        let rank = |parts: &[usize]| (has_base(parts), parts.len(), parts[0]);
        let may_move = |parts: &[usize]| parts.iter().all(|&part| problem.may_move(part));
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
    fn closure(&self, graph: &BlockingGraph, parts: impl IntoIterator<Item = usize>) -> Option<Vec<usize>> {
        let standing = self.disassembly.everything.standing();
        let mut group = BTreeSet::new();
        let mut open: Vec<usize> = parts.into_iter().collect();
        while let Some(part) = open.pop() {
            if !self.disassembly.problem.may_move(part) {
                return None;
            }
            if standing.binary_search(&part).is_err() || !group.insert(part) {
                continue;
            }
            if group.len() == standing.len() {
                return None;
            }
            open.extend(graph[part].as_ref()?);
            open.extend(self.inseparable.held_with(part));
        }
        Some(group.into_iter().collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::outcome::Removal;
    use super::super::problem::Problem;
    use super::super::request::{ActionSet, Planner};
    use super::super::tests::{Recorder, problem};
    use super::super::{Outcome, Reason, TraceEvent, search};
    use crate::fixtures::{cells, cuboid, moved, scene};
    use crate::geometry::{Pose, SourceMesh};
    use crate::plan::PlanStatus;

    /// A box (part 0) that is open at the top, in it a block (part 1) with a hole through it along x, and in the hole a
    /// pin (part 2) as long as the block is wide: the block cannot leave the pin, nor the pin the box.
    fn pinned_block() -> Vec<SourceMesh> {
        let walls: &[f64] = &[-2.0, -1.5, 1.5, 2.0];
        let housing = cells([walls, walls, &[-1.5, -1.0, 1.0]], |c| c[2] == 0 || c[0] != 1 || c[1] != 1);
        let across: &[f64] = &[-1.4, -0.4, 0.4, 1.4];
        let block = cells([&[-1.4, 1.4], across, &[-1.0, -0.4, 0.4, 0.9]], |c| c[1] != 1 || c[2] != 1);
        vec![housing, block, cuboid([-1.4, -0.35, -0.35], [1.4, 0.35, 0.35])]
    }

    /// The same in a sleeve (part 3) that is closed but for its end at +y.
    fn pinned_block_in_sleeve() -> Vec<SourceMesh> {
        let sleeve = cells(
            [&[-3.0, -2.05, 2.05, 3.0], &[-3.0, -2.05, 3.0], &[-2.5, -1.55, 1.05, 2.5]],
            |[x, y, z]| x != 1 || y != 1 || z != 1,
        );
        pinned_block().into_iter().chain([sleeve]).collect()
    }

    fn planned(
        parts: Vec<SourceMesh>,
        change: impl FnOnce(Problem<'_>) -> Problem<'_>,
    ) -> (Outcome, Vec<TraceEvent>) {
        let (scene, verifier) = scene(parts);
        let mut recorder = Recorder::default();
        let problem = Problem { actions: ActionSet::Extended, sweeps: true, ..problem(scene, &verifier) };
        (search(Planner::SbdpStar, change(problem), &mut recorder), recorder.0)
    }

    fn left(outcome: &Outcome) -> Vec<(&[usize], Option<usize>)> {
        outcome.removals.iter().map(|r: &Removal| (&r.parts[..], r.of)).collect()
    }

    #[test]
    fn what_holds_together_leaves_the_base_together_and_is_then_taken_apart() {
        let turn = Pose::rotation(nalgebra::Vector3::new(0.3, -0.5, 0.2));
        let scale = |mesh: SourceMesh| {
            let mut mesh = mesh;
            mesh.vertices.iter_mut().flatten().for_each(|x| *x *= 1.4);
            mesh
        };
        for pose in [Pose::identity(), turn] {
            let parts = pinned_block().into_iter().map(|mesh| moved(scale(mesh), &pose)).collect();
            let (outcome, events) = planned(parts, |problem| problem);
            assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
            assert_eq!(outcome.base.parts, [0]);
            let [group, inner] = &outcome.removals[..] else { panic!("{:?}", left(&outcome)) };
            assert_eq!((&group.parts[..], group.of, group.wave), (&[1, 2][..], None, 0));
            assert_eq!(
                (inner.parts.len(), inner.of, &inner.requires[..], inner.wave),
                (1, Some(0), &[0][..], 1)
            );
            assert_eq!((&outcome.remaining[..], outcome.kept_together().len()), (&[0][..], 0));
            let way = group.motion().translation.vector.normalize();
            assert!(way.dot(&(pose * nalgebra::Vector3::z())) > 0.99, "it leaves along {way}");
            let tried = TraceEvent::GroupTried { parts: vec![1, 2], leaves: true };
            assert!(events.contains(&tried));
        }
    }

    #[test]
    fn groups_are_taken_apart_in_groups() {
        let (outcome, _) = planned(pinned_block_in_sleeve(), |problem| problem);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        let left = left(&outcome);
        assert_eq!(left[..2], [(&[0, 1, 2][..], None), (&[1, 2][..], Some(0))]);
        assert_eq!((left.len(), left[2].0.len(), left[2].1), (3, 1, Some(1)));
        assert_eq!(outcome.removals.iter().map(|r| r.wave).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(outcome.removals[2].requires, [1]);
    }

    #[test]
    fn a_group_in_which_nothing_is_wanted_is_kept_together() {
        let target = |part: usize| {
            let (outcome, _) =
                planned(pinned_block_in_sleeve(), |problem| Problem { targets: Some(vec![part]), ..problem });
            assert_eq!(outcome.status, PlanStatus::Complete, "{part}: {:?}", outcome.reason);
            outcome
        };
        // The sleeve is pulled off the others.
        assert_eq!(left(&target(3)), [(&[3][..], None)]);
        // To get the box out, what is in it is not taken apart.
        let housing = target(0);
        assert!(housing.kept_together().contains(&vec![1, 2]), "{:?}", left(&housing));
        assert_eq!(target(2).removals.len(), 3);
    }

    #[test]
    fn where_nothing_leaves_it_is_said_which_parts_are_free_together() {
        // Over the mouth of the box, with play above the block, lies a lid. Neither holds the block alone.
        let mut parts = pinned_block();
        parts.push(cuboid([-3.0, -2.0, 1.3], [3.0, 2.0, 2.0]));
        let (outcome, _) =
            planned(parts, |problem| Problem { fixed: vec![0, 3], max_simulations: Some(100), ..problem });
        assert_eq!((outcome.status, outcome.removals.len()), (PlanStatus::Partial, 0));
        let free: Vec<_> =
            outcome.free_together.iter().map(|group| (&group.parts[..], group.direction)).collect();
        assert!(free.contains(&(&[1, 2][..], [0.0, 0.0, 1.0])), "{free:?}");
    }

    #[test]
    fn what_never_comes_apart_leaves_together() {
        // A ring about a bar of another ring, both in a box.
        let ring = || {
            let across: &[f64] = &[-1.2, -0.8, 0.8, 1.2];
            cells([across, across, &[-0.2, 0.2]], |c| c[0] != 1 || c[1] != 1)
        };
        let turned = Pose::new(
            nalgebra::Vector3::new(1.0, 0.0, 0.0),
            nalgebra::Vector3::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0),
        );
        let walls: &[f64] = &[-3.0, -2.5, 2.5, 3.0];
        let housing = cells([walls, walls, &[-2.0, -1.5, 1.5]], |c| c[2] == 0 || c[0] != 1 || c[1] != 1);
        let (outcome, _) = planned(vec![housing, ring(), moved(ring(), &turned)], |problem| problem);
        assert_eq!(outcome.status, PlanStatus::Infeasible, "{:?}", outcome.reason);
        assert!(matches!(outcome.reason, Some(Reason::Inseparable(pair)) if pair.parts == [1, 2]));
        assert_eq!(left(&outcome), [(&[1, 2][..], None)]);
        assert_eq!((outcome.kept_together(), outcome.unfinished), (vec![vec![1, 2]], vec![1, 2]));
    }

    #[test]
    fn a_group_leaves_by_several_moves() {
        // A slot that goes up, and then along y: what is in it cannot leave straight.
        let slot = cells(
            [&[-2.0, -1.5, 1.5, 2.0], &[-2.0, -1.5, 1.5, 6.0], &[-1.5, -1.0, 1.0, 3.1, 3.6]],
            |[x, y, z]| {
                let is_shaft = x == 1 && y == 1 && (z == 1 || z == 2);
                let is_exit = x == 1 && y == 2 && z == 2;
                !is_shaft && !is_exit
            },
        );
        let mut parts = pinned_block();
        parts[0] = slot;
        let (outcome, events) = planned(parts, |problem| problem);
        assert_eq!(outcome.status, PlanStatus::Complete, "{:?}", outcome.reason);
        assert_eq!(left(&outcome)[0], (&[1, 2][..], None));
        assert!(outcome.removals[0].path.len() > 2, "it turns a corner");
        assert!(events.iter().any(|e| matches!(e, TraceEvent::GroupTried { leaves: true, .. })));
    }
}
