//! In which order a state-based search expands states and tries actions.

use std::collections::{BTreeSet, HashMap};

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::blocking_graph::Blockage;
use crate::budgets::SHORT_STEPS_PER_POLL;
use crate::contact::obstruction;
use crate::termination::{Interrupt, Poll};
use crate::tolerances::TOUCHED;

use super::action_table::ActionTable;
use super::ball::is_ball;
use super::disassembly::{Disassembly, SceneVersion, Stop};
use super::inseparable::{FindPairs, InseparablePairs};
use super::own_scale::scale_of;
use super::problem::Problem;
use super::state::{StateAction, StateNode, least_travel};
use super::states::{PhaseStates, States};
use super::strategy::Strategy;
use super::trace::PlanningPhase;

/// Cosine of the angle to the direction up within which a direction is upward (45 degrees): half of the way to sideways.
/// From 60 degrees on, at half, parts go askew that a fitter takes out sideways; at 1 only exactly up is.
const UPWARD: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// How much is in the way of a push from a state.
#[derive(Debug, Clone, Copy)]
struct Obstruction {
    /// The scene for which it holds.
    version: SceneVersion,
    /// The logarithm to base 2 of its length along the push, rounded down.
    doublings: i32,
}

/// The order of states and actions, and the parts that need not be tried at all.
pub(super) struct Order {
    /// Per part: whether it is a ball, which no action has to turn.
    balls: Vec<bool>,
    /// Per part: whether it is searched at its own scale, and here only swept.
    small: Vec<bool>,
    /// Parts that need not be tried while others stand.
    inseparable: InseparablePairs,
    /// By state and push.
    obstructions: HashMap<StateAction, Obstruction>,
    /// The direction in which most parts can go at first.
    pub(super) up: Vector3<f64>,
}

impl Order {
    pub(super) fn new(problem: &Problem<'_>, strategy: Strategy, up: Vector3<f64>) -> Self {
        let Problem { scene, .. } = problem;
        let bodies = scene.bodies.iter().enumerate();
        let is_small = |part| strategy.is_extended() && scale_of(problem, part).is_some();
        let is_ball = |(part, shape)| strategy.is_extended() && is_ball(shape, least_travel(scene, part));
        Self {
            balls: bodies.map(|(part, b)| is_ball((part, &*b.shape))).collect(),
            small: (0..scene.bodies.len()).map(is_small).collect(),
            inseparable: InseparablePairs::default(),
            obstructions: HashMap::new(),
            up,
        }
    }

    /// Finds, once for each kind of proof `find`, which of the parts that stand never come apart; true if there are new
    /// pairs. Beyond the paper.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn find_inseparable(
        &mut self,
        strategy: Strategy,
        disassembly: &Disassembly<'_, '_>,
        find: FindPairs,
    ) -> Result<bool, Interrupt> {
        let (problem, standing) = (&disassembly.problem, disassembly.everything.standing());
        Ok(strategy.is_extended() && !problem.is_group && find(&mut self.inseparable, problem, standing)?)
    }

    /// Whether a part is searched at its own scale, and here only swept.
    pub(super) fn is_small(&self, part: usize) -> bool {
        self.small[part]
    }

    /// The pairs that were found.
    pub(super) fn inseparable(&self) -> &InseparablePairs {
        &self.inseparable
    }

    /// The pairs that were found.
    pub(super) fn into_inseparable(self) -> InseparablePairs {
        self.inseparable
    }

    /// One of the parts that stand (ascending) from which a part is proved never to come away.
    pub(super) fn holder(&self, part: usize, standing: &[usize]) -> Option<usize> {
        self.inseparable.holder(part, standing)
    }

    /// The states to expand, the initial one included. Of two last parts it does not matter which one moves
    /// against the other: beyond the first push, only the smaller one does, or the one that may leave
    /// earlier. A part that is
    /// proved to stay is not moved, and a ball not turned, nor here a part that is searched at its own scale.
    pub(super) fn expandable(&self, of: &PhaseStates<'_>, disassembly: &Disassembly<'_, '_>) -> Vec<usize> {
        let PhaseStates { strategy, phase, states, .. } = *of;
        let (problem, standing) = (&disassembly.problem, disassembly.everything.standing());
        let still = match standing[..] {
            [a, b] if !strategy.separate_lists && problem.may_move(a) && problem.may_move(b) => {
                let size = |part: usize| (problem.release_of(part), of.reach(part));
                Some(if size(a) < size(b) { b } else { a })
            }
            _ => None,
        };
        let is_rotation = phase == PlanningPhase::Rotation;
        let skipped = |n: &StateNode| Some(n.part) == still && (is_rotation || !n.is_root());
        let not_turned = |part: usize| is_rotation && (self.balls[part] || self.small[part]);
        let in_vain = |n: &StateNode| not_turned(n.part) || self.holder(n.part, standing).is_some();
        let waits = |n: &StateNode| strategy.waits(phase, n);
        let may = |n: &StateNode| n.alive && problem.may_move(n.part);
        let wanted = |n: &StateNode| may(n) && of.lists(n) && !waits(n) && !skipped(n) && !in_vain(n);
        (0..states.nodes.len()).filter(|&i| wanted(&states.nodes[i])).collect()
    }

    /// The parts of open states, in the order in which they are expanded as assembled.
    pub(super) fn parts(
        &self,
        of: &PhaseStates<'_>,
        open: &[usize],
        disassembly: &Disassembly<'_, '_>,
    ) -> Vec<usize> {
        let roots = self.ordered_roots(of, &mut open.to_vec(), disassembly);
        roots.into_iter().map(|node| of.states.nodes[node].part).collect()
    }

    /// Takes the best displaced state off the open list (smaller f_c, then smaller f_a; beyond the paper, then
    /// the larger distance from earlier states), or else the initial state, which comes last (its f_c and f_a
    /// count as infinite) and stands for all its parts in their order. Without guidance the first comes first:
    /// the initial state, then displaced ones by age. Where actions have an order of their own, all states are
    /// taken at once.
    pub(super) fn extract(
        &self,
        of: &PhaseStates<'_>,
        open: &mut Vec<usize>,
        disassembly: &Disassembly<'_, '_>,
    ) -> Vec<usize> {
        let PhaseStates { strategy, phase, states, .. } = *of;
        if strategy.orders_actions(phase) {
            return self.ranked(of, std::mem::take(open), disassembly);
        }
        let displaced = |i: &usize| !states.nodes[*i].is_root();
        let next = if strategy.guided {
            open.iter().copied().filter(displaced).min_by_key(|&i| of.rank(i))
        } else {
            open.first().copied().filter(displaced)
        };
        match next {
            Some(best) => {
                open.retain(|&i| i != best);
                vec![best]
            }
            None => self.ordered_roots(of, open, disassembly),
        }
    }

    /// Open states in the order of expansion.
    fn ranked(
        &self,
        of: &PhaseStates<'_>,
        mut open: Vec<usize>,
        disassembly: &Disassembly<'_, '_>,
    ) -> Vec<usize> {
        let roots = self.ordered_roots(of, &mut open, disassembly);
        if of.strategy.guided {
            open.sort_by_cached_key(|&i| of.rank(i));
        }
        open.extend(roots);
        open
    }

    fn ordered_roots(
        &self,
        of: &PhaseStates<'_>,
        open: &mut Vec<usize>,
        disassembly: &Disassembly<'_, '_>,
    ) -> Vec<usize> {
        let PhaseStates { strategy, phase, states, .. } = *of;
        let (mut roots, rest) = open.iter().partition::<Vec<usize>, _>(|&&i| states.nodes[i].is_root());
        *open = rest;
        if !strategy.guided {
            return roots;
        }
        // Before anything was turned, the parts that stop pushes show which part is held least; of equal
        // ones the smallest is the likeliest fastener and the cheapest to simulate.
        let other = |i: usize| states.nodes[i].blockage(PlanningPhase::Translation).map(Blockage::evaluation);
        let reach = |i: usize| of.reach(states.nodes[i].part).to_bits();
        roots.sort_by_key(|&i| match phase {
            PlanningPhase::Translation => (of.evaluation(i), None, 0, i),
            PlanningPhase::Rotation => (of.evaluation(i), other(i), reach(i), i),
        });
        let late = disassembly.leaving_late();
        roots.sort_by_key(|&i| late(states.nodes[i].part));
        roots
    }

    /// The sweeps along translations from some open states, in the order of expansion: displaced states first, then all parts as
    /// assembled; each along the shorter ways out first: such a plan takes less room, and less is to be verified. Of ways of
    /// about one length, those upward come first, then those sideways.
    pub(super) fn sweeps(
        &self,
        of: &PhaseStates<'_>,
        open: &[usize],
        actions: &ActionTable,
        disassembly: &Disassembly<'_, '_>,
    ) -> Vec<StateAction> {
        let PhaseStates { phase, states, .. } = *of;
        let hull = disassembly.everything.hull();
        let forces: Vec<_> = actions.translations.all.iter().map(|action| action.force()).collect();
        let reach =
            |force: &Vector3<f64>| hull.iter().map(|p| p.coords.dot(force)).fold(f64::NEG_INFINITY, f64::max);
        let reaches: Vec<f64> = forces.iter().map(reach).collect();
        let sweeps = |node: usize| {
            let StateNode { part, .. } = states.nodes[node];
            let bounds = disassembly.problem.scene.bodies[part].shape.bounds();
            let bounds = bounds.transformed(states.nodes[node].pose());
            let way = |action: &usize| reaches[*action] + bounds.support(&-forces[*action]);
            let mut actions: Vec<usize> = (0..forces.len()).collect();
            // Lengths are compared in half powers of two: rounding of the input must not change the order.
            let length = |action: &usize| (way(action).max(TOUCHED).log2() * 2.0).floor() as i32;
            actions.sort_by_cached_key(|action| {
                // A way sideways counts as half a power of two longer than it is, and one downward as twice as long.
                (length(action) + self.tier(&forces[*action]), length(action))
            });
            actions.into_iter().map(move |action| StateAction { node, phase, action })
        };
        self.ranked(of, open.to_vec(), disassembly).into_iter().flat_map(sweeps).collect()
    }

    /// The place of a direction in the order of preference: upward, sideways, downward.
    pub(super) fn tier(&self, direction: &Vector3<f64>) -> i32 {
        match direction.dot(&self.up) {
            up if up > UPWARD => 0,
            up if up < -UPWARD => 2,
            _ => 1,
        }
    }

    /// Measures what is in the way of some actions along their parts' own axes, unless it is known.
    pub(super) fn measure_obstructions(
        &mut self,
        jobs: &[StateAction],
        states: &States,
        actions: &ActionTable,
        disassembly: &Disassembly<'_, '_>,
    ) -> Result<(), Stop> {
        let version = disassembly.version();
        let asked: BTreeSet<StateAction> = jobs
            .iter()
            .filter_map(|&job| pull(job, states, actions))
            .filter(|push| self.obstructions.get(push).is_none_or(|known| known.version != version))
            .collect();
        let standing = |push: &StateAction| disassembly.standing(states.nodes[push.node].part);
        let asked: Vec<_> = asked.into_iter().map(|push| (push, standing(&push))).collect();
        let problem = &disassembly.problem;
        let lengths = asked.par_iter().map(|(push, standing)| {
            let node = &states.nodes[push.node];
            let force = actions.translations.all[push.action].force();
            let poll = Poll::every(SHORT_STEPS_PER_POLL, Some(&problem.termination));
            obstruction(&problem.scene, standing, node.part, node.pose(), &force, &poll)
        });
        let lengths: Vec<f64> = lengths.collect::<Result<_, Interrupt>>()?;
        for ((push, _), length) in asked.into_iter().zip(lengths) {
            let doublings = if length > 0.0 { length.log2().floor() as i32 } else { i32::MIN };
            self.obstructions.insert(push, Obstruction { version, doublings });
        }
        Ok(())
    }

    /// Where an action that may turn a part stands among the others, over all parts. First those that pull a
    /// part along its own axis, or that are its own; of these, those that fewer parts block, as far as pushes
    /// show, and then those with less in their way: a nut is not turned towards the head of its bolt.
    pub(super) fn action_rank(
        &self,
        at: StateAction,
        states: &States,
        actions: &ActionTable,
    ) -> (bool, usize, i32) {
        let node = &states.nodes[at.node];
        let Some(push) = pull(at, states, actions) else {
            return (!actions.is_own(PlanningPhase::Rotation, node.part, at.action), 0, 0);
        };
        let against = node.translation.as_ref().map_or(0, |b| b.blockers(push.action).len());
        (false, against, self.obstructions.get(&push).map_or(0, |known| known.doublings))
    }
}

/// The push from the same state that pulls as an action does that also turns a part about its own axis.
fn pull(at: StateAction, states: &States, actions: &ActionTable) -> Option<StateAction> {
    let action = actions.pull(states.nodes[at.node].part, at.action)?;
    Some(StateAction { phase: PlanningPhase::Translation, action, ..at })
}
