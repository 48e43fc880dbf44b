//! The actions of a search: those of all parts, and behind them those of single parts.
//!
//! Actions of single parts are drawn from what a part touches as assembled: the extreme rays of its contacts
//! and its null twist. They are withheld from all other parts. The evaluation f_a does not count them: parts
//! are compared by what is open to all. They are drawn again when a part that they came from is gone.

use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::Blockage;
use crate::budgets::{OWN_RAYS, OWN_TWISTS};
use crate::simulation::{Action, Axis};
use crate::termination::Interrupt;
use crate::tolerances::{ONE_AXIS_COSINE, ONE_DIRECTION_COSINE};

use super::action_list::{ActionList, DrawnActions};
use super::directions::Directions;
use super::disassembly::{Disassembly, Stop};
use super::problem::Problem;
use super::rays::extreme_ray_actions;
use super::state::StateNode;
use super::states::States;
use super::strategy::Strategy;
use super::trace::PlanningPhase;
use super::twists::null_twist_actions;

/// The actions of both phases.
#[derive(Debug)]
pub(super) struct ActionTable {
    directions: Directions,
    pub(super) translations: ActionList,
    pub(super) rotations: ActionList,
    /// Extreme rays are simulated, too, not only swept.
    simulates_rays: bool,
    /// Null twists are drawn for parts that are made along an axis of all, too.
    draws_all_twists: bool,
}

impl ActionTable {
    pub(super) fn new(directions: Directions, translations: Vec<Action>, rotations: Vec<Action>) -> Self {
        Self {
            directions,
            translations: ActionList::new(translations, OWN_RAYS, ONE_DIRECTION_COSINE),
            rotations: ActionList::new(rotations, OWN_TWISTS, ONE_AXIS_COSINE),
            simulates_rays: false,
            draws_all_twists: false,
        }
    }

    /// The axes along and about which all parts are moved.
    pub(super) fn axes(&self) -> &[Axis] {
        &self.directions.axes
    }

    pub(super) fn of(&self, phase: PlanningPhase) -> &ActionList {
        match phase {
            PlanningPhase::Translation => &self.translations,
            PlanningPhase::Rotation => &self.rotations,
        }
    }

    /// Number of actions that are simulated.
    pub(super) fn simulated(&self, phase: PlanningPhase) -> usize {
        match phase {
            PlanningPhase::Translation if !self.simulates_rays => self.translations.common,
            _ => self.of(phase).all.len(),
        }
    }

    /// Whether an action is only this part's.
    pub(super) fn is_own(&self, phase: PlanningPhase, part: usize, action: usize) -> bool {
        self.of(phase).is_own(part, action)
    }

    /// The push that pulls as an action does that also turns a part about its own axis.
    pub(super) fn pull(&self, part: usize, rotation: usize) -> Option<usize> {
        let action = self.rotations.all[rotation];
        let Action::Screw(axis, ..) = action else { return None };
        self.directions.is_own(part, axis).then_some(())?;
        self.translations.all.iter().position(|push| push.force() == action.force())
    }

    /// Lets extreme rays be simulated; true if there are any and they were not before.
    pub(super) fn simulate_rays(&mut self) -> bool {
        let late = !self.simulates_rays && self.translations.all.len() > self.translations.common;
        self.simulates_rays |= late;
        late
    }

    /// Lets null twists be drawn for all parts; true if they were not before.
    pub(super) fn draw_all_twists(&mut self, strategy: Strategy) -> bool {
        strategy.is_extended() && !std::mem::replace(&mut self.draws_all_twists, true)
    }

    /// Draws the own actions of open parts as assembled, unless they are current; true if any was added.
    pub(super) fn draw(
        &mut self,
        strategy: Strategy,
        phase: PlanningPhase,
        open: &[usize],
        states: &mut States,
        disassembly: &mut Disassembly<'_, '_>,
    ) -> Result<bool, Stop> {
        type Draw = fn(&Problem<'_>, usize, &[usize]) -> Result<DrawnActions, Interrupt>;
        let (is_drawn, draw): (_, Draw) = match phase {
            PlanningPhase::Translation => (!strategy.separate_lists, extreme_ray_actions),
            PlanningPhase::Rotation => (strategy.is_extended(), null_twist_actions),
        };
        if !is_drawn {
            return Ok(false);
        }
        let started = Instant::now();
        let standing = disassembly.everything.standing();
        let is_asked = |part: usize| {
            let by_kind = phase == PlanningPhase::Translation || self.draws_all_twists;
            (by_kind || !self.directions.has_own(part)) && !self.of(phase).is_current(part, standing)
        };
        let roots = open.iter().map(|&i| &states.nodes[i]).filter(|n| n.is_root());
        let parts: Vec<usize> = roots.map(|n| n.part).filter(|&part| is_asked(part)).collect();
        let problem = &disassembly.problem;
        let drawn = parts.par_iter().map(|&part| {
            problem.termination.check()?;
            let others: Vec<usize> = standing.iter().copied().filter(|&p| p != part).collect();
            draw(problem, part, &others)
        });
        let drawn = drawn.collect::<Result<Vec<_>, Interrupt>>()?;
        let mut added = false;
        for (part, DrawnActions { actions, touched }) in parts.into_iter().zip(drawn) {
            self.of_mut(phase).touched.insert(part, touched);
            for action in actions {
                added |= self.add_own(phase, part, action, states);
            }
        }
        disassembly.counters.static_analysis += started.elapsed();
        Ok(added)
    }

    fn of_mut(&mut self, phase: PlanningPhase) -> &mut ActionList {
        match phase {
            PlanningPhase::Translation => &mut self.translations,
            PlanningPhase::Rotation => &mut self.rotations,
        }
    }

    /// Makes an action a part's own and opens it in the part's states; whether it was not its own yet.
    fn add_own(&mut self, phase: PlanningPhase, part: usize, wanted: Action, states: &mut States) -> bool {
        let list = self.of_mut(phase);
        let before = list.all.len();
        let action = list.add_own(part, wanted);
        if list.all.len() > before {
            states.nodes.iter_mut().filter_map(|n| n.blockage_mut(phase)).for_each(Blockage::add_withheld);
        }
        let Some(action) = action else { return false };
        tracing::debug!(part, action = %list.all[action], "own action");
        let of_part = |n: &&mut StateNode| n.part == part;
        let blockages = states.nodes.iter_mut().filter(of_part).filter_map(|n| n.blockage_mut(phase));
        blockages.for_each(|b| b.reopen(action));
        true
    }
}
