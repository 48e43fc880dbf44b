//! The actions of a search, and which parts have which.
//!
//! All parts have the common actions, which come first in the list of their phase. Behind them come actions that single
//! parts have beside these, from what a part touches as assembled (`rays`, `twists`); they are withheld from all other
//! parts. The evaluation f_a does not count them: parts are compared by the common actions. They are derived again when
//! a part that they came from is gone.

use std::collections::{HashMap, HashSet};
use std::time::Instant;

use rayon::prelude::*;

use crate::blocking_graph::Blockage;
use crate::budgets::{OWN_RAYS, OWN_TWISTS};
use crate::simulation::{Action, Axis};
use crate::termination::Interrupt;
use crate::tolerances::{ONE_AXIS_COSINE, ONE_DIRECTION_COSINE};

use super::directions::Directions;
use super::disassembly::{Disassembly, Stop};
use super::problem::Problem;
use super::state::Phase;
use super::states::States;

/// The own actions of parts in one phase.
#[derive(Debug)]
struct OwnActions {
    /// The number of common actions, which are the first ones.
    common: usize,
    /// The most own actions, of all parts together.
    most: usize,
    /// Cosine of the angle within which two directions are one.
    same: f64,
    /// For each part, the parts that it touched when its actions were derived.
    touched: HashMap<usize, Vec<usize>>,
    /// Parts with their own actions.
    offered: HashSet<(usize, usize)>,
}

impl OwnActions {
    fn new(common: usize, most: usize, same: f64) -> Self {
        Self { common, most, same, touched: HashMap::new(), offered: HashSet::new() }
    }
}

/// The actions of one phase.
#[derive(Debug)]
struct PhaseActions {
    actions: Vec<Action>,
    own: OwnActions,
}

/// The actions of both phases.
pub(super) struct ActionTable {
    pub(super) directions: Directions,
    translations: PhaseActions,
    rotations: PhaseActions,
    /// Whether own translations are simulated, too, and not only swept.
    simulates_rays: bool,
    /// Whether own rotations are derived for parts that are made along a common axis, too.
    twists_all_parts: bool,
}

impl ActionTable {
    pub(super) fn new(directions: Directions, translations: Vec<Action>, rotations: Vec<Action>) -> Self {
        let rays = OwnActions::new(translations.len(), OWN_RAYS, ONE_DIRECTION_COSINE);
        let twists = OwnActions::new(rotations.len(), OWN_TWISTS, ONE_AXIS_COSINE);
        Self {
            directions,
            translations: PhaseActions { actions: translations, own: rays },
            rotations: PhaseActions { actions: rotations, own: twists },
            simulates_rays: false,
            twists_all_parts: false,
        }
    }

    fn phase(&self, phase: Phase) -> &PhaseActions {
        match phase {
            Phase::Translation => &self.translations,
            Phase::Rotation => &self.rotations,
        }
    }

    fn phase_mut(&mut self, phase: Phase) -> &mut PhaseActions {
        match phase {
            Phase::Translation => &mut self.translations,
            Phase::Rotation => &mut self.rotations,
        }
    }

    /// All actions of a phase, the common ones first.
    pub(super) fn of(&self, phase: Phase) -> &[Action] {
        &self.phase(phase).actions
    }

    /// The common actions of a phase.
    pub(super) fn common(&self, phase: Phase) -> &[Action] {
        let PhaseActions { actions, own } = self.phase(phase);
        &actions[..own.common]
    }

    /// The number of actions of a phase that are simulated.
    pub(super) fn simulated(&self, phase: Phase) -> usize {
        match phase {
            Phase::Translation if !self.simulates_rays => self.translations.own.common,
            _ => self.of(phase).len(),
        }
    }

    /// Whether a part has an action beside the common ones.
    pub(super) fn is_own(&self, phase: Phase, part: usize, action: usize) -> bool {
        self.phase(phase).own.offered.contains(&(part, action))
    }

    /// Own translations are simulated from now on; true if there are any and they were not before.
    pub(super) fn simulate_rays(&mut self) -> bool {
        let late = !self.simulates_rays && self.translations.actions.len() > self.translations.own.common;
        self.simulates_rays = late || self.simulates_rays;
        late
    }

    /// Own rotations are derived for all parts from now on; true if they were not before.
    pub(super) fn twist_all_parts(&mut self) -> bool {
        !std::mem::replace(&mut self.twists_all_parts, true)
    }

    /// Whether own rotations are derived for a part.
    pub(super) fn twists(&self, part: usize) -> bool {
        self.twists_all_parts || !self.directions.has_own(part)
    }

    /// The push with the force of an action that also turns a part about the part's own axis.
    pub(super) fn pull_of(&self, part: usize, rotation: usize) -> Option<usize> {
        let action = self.rotations.actions[rotation];
        let Action::Screw(axis, ..) = action else { return None };
        self.is_axis_of(part, axis).then_some(())?;
        self.translations.actions.iter().position(|push| push.force() == action.force())
    }

    fn is_axis_of(&self, part: usize, axis: Axis) -> bool {
        self.directions.is_own(part, axis)
    }

    /// The blockage of a new state of a part, with own actions; `blockage` knows only the common ones.
    pub(super) fn with_own(&self, phase: Phase, part: usize, mut blockage: Blockage) -> Blockage {
        for action in self.phase(phase).own.common..self.of(phase).len() {
            blockage.add_withheld();
            if self.is_own(phase, part, action) {
                blockage.reopen(action);
            }
        }
        blockage
    }

    /// Derives the own actions of open parts as assembled for which `is_asked`; true if any was added. `derive` gets a
    /// part and the parts that stand beside it, and returns actions and the parts that they came from.
    pub(super) fn derive_own(
        &mut self,
        disassembly: &mut Disassembly<'_, '_>,
        states: &mut States,
        (phase, open): (Phase, &[usize]),
        is_asked: impl Fn(&Self, usize) -> bool,
        derive: impl Fn(&Problem<'_>, usize, &[usize]) -> Result<(Vec<Action>, Vec<usize>), Interrupt> + Sync,
    ) -> Result<bool, Stop> {
        let started = Instant::now();
        let standing = disassembly.everything.standing();
        let stands = |part: &usize| standing.binary_search(part).is_ok();
        let own = &self.phase(phase).own;
        let is_known = |part: &usize| own.touched.get(part).is_some_and(|t| t.iter().all(stands));
        let roots = open.iter().map(|&i| &states[i]).filter(|n| n.is_root());
        let parts: Vec<usize> =
            roots.map(|n| n.part).filter(|p| is_asked(self, *p) && !is_known(p)).collect();
        let problem = &disassembly.problem;
        let found = parts.par_iter().map(|&part| {
            problem.termination.check()?;
            let others: Vec<usize> = standing.iter().copied().filter(|&p| p != part).collect();
            derive(problem, part, &others)
        });
        let found = found.collect::<Result<Vec<_>, Interrupt>>()?;
        let mut added = false;
        for (part, (actions, touched)) in parts.into_iter().zip(found) {
            self.phase_mut(phase).own.touched.insert(part, touched);
            for action in actions {
                added |= self.offer(states, phase, part, action);
            }
        }
        disassembly.counters.static_analysis += started.elapsed();
        Ok(added)
    }

    /// Gives an action to a part, unless a common one is as good; true if the part did not have it.
    fn offer(&mut self, states: &mut States, phase: Phase, part: usize, wanted: Action) -> bool {
        let PhaseActions { actions, own } = self.phase_mut(phase);
        let action = match actions.iter().position(|a| a.is_like(&wanted, own.same)) {
            Some(common) if common < own.common => return false,
            Some(known) => known,
            None if actions.len() - own.common == own.most => return false,
            None => {
                actions.push(wanted);
                states.iter_mut().filter_map(|n| n.blockage_mut(phase)).for_each(Blockage::add_withheld);
                actions.len() - 1
            }
        };
        let is_new = own.offered.insert((part, action));
        if is_new {
            tracing::debug!(part, action = %actions[action], "own action");
            let of_part = states.iter_mut().filter(|n| n.part == part);
            of_part.filter_map(|n| n.blockage_mut(phase)).for_each(|b| b.reopen(action));
        }
        is_new
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::super::request::ActionSet;
    use super::super::rules::Rules;
    use super::super::state::StateNode;
    use super::*;
    use crate::fixtures::{block_on_plate, scene};

    const PUSH: Phase = Phase::Translation;

    #[test]
    fn an_own_action_is_open_to_its_part_alone_and_never_repeats_a_common_one() {
        let (scene, _) = scene(block_on_plate());
        let directions = Directions::of_world(&scene);
        let common = Action::translations_along(&directions.axes);
        let mut table = ActionTable::new(directions, common.clone(), Vec::new());
        let mut states = States::new(&scene, Rules::new(ActionSet::Extended, true));
        for part in [0, 1] {
            let blockage = || Blockage::open(common.len());
            let (path, origin) = (vec![scene.bodies[part].planning_from_shape], None);
            let (translation, rotation) = (Some(blockage()), Blockage::open(0));
            states.add(StateNode { part, path, translation, rotation, origin, novelty: 0.0, alive: true });
        }
        let slanted =
            Action::Push(Axis::along(nalgebra::Unit::new_normalize(Vector3::new(1.0, 2.0, 3.0))), true);
        assert!(!table.offer(&mut states, PUSH, 1, common[0]), "all parts have it");
        assert!(table.offer(&mut states, PUSH, 1, slanted));
        assert!(!table.offer(&mut states, PUSH, 1, slanted), "the part has it already");
        let own = common.len();
        assert_eq!((table.of(PUSH).len(), table.common(PUSH).len()), (own + 1, own));
        let open = |states: &States, node: usize| states[node].translation.as_ref().unwrap().is_open(own);
        assert!(open(&states, 1) && !open(&states, 0));
        let of_new_state = |part| table.with_own(PUSH, part, Blockage::open(own)).is_open(own);
        assert!(of_new_state(1) && !of_new_state(0));
        assert_eq!(table.simulated(PUSH), own, "it is only swept");
        assert!(table.simulate_rays() && !table.simulate_rays());
        assert_eq!(table.simulated(PUSH), own + 1);
    }
}
