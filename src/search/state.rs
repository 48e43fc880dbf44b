//! States: one displaced part among the others at their assembled poses.

use crate::blocking_graph::Blockage;
use crate::budgets::{STATE_LEVELS, STATES_PER_LEVEL};
use crate::geometry::Pose;
use crate::scene::Scene;
use crate::tolerances::{SAME_STATE_TRAVEL, SHARE_OF_EXTENT};

use super::trace::PlanningPhase;

/// An action from a state, the pair (s, a) of the transition function.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct StateAction {
    /// The number of the state's node.
    pub(super) node: usize,
    /// Which list the action is in.
    pub(super) phase: PlanningPhase,
    /// The action's number in that list.
    pub(super) action: usize,
}

/// A state to expand.
#[derive(Debug, Clone)]
pub(super) struct StateNode {
    pub(super) part: usize,
    /// The path from the assembled pose to this state's.
    pub(super) path: Vec<Pose>,
    /// Blockage under translations; none until it is analysed.
    pub(super) translation: Option<Blockage>,
    /// Blockage under actions with rotational freedom; filled by simulations alone.
    pub(super) rotation: Blockage,
    /// The parent's node and the action that led here; none for an assembled pose.
    pub(super) origin: Option<StateAction>,
    /// The distance to the nearest earlier state of the part, in units of the resolution; 0 as assembled.
    pub(super) novelty: f64,
    /// False once its part is gone or its path was refuted.
    pub(super) alive: bool,
}

impl StateNode {
    pub(super) fn pose(&self) -> &Pose {
        // A path always holds its start.
        &self.path[self.path.len() - 1]
    }

    pub(super) fn is_root(&self) -> bool {
        self.origin.is_none()
    }

    pub(super) fn blockage(&self, phase: PlanningPhase) -> Option<&Blockage> {
        match phase {
            PlanningPhase::Translation => self.translation.as_ref(),
            PlanningPhase::Rotation => Some(&self.rotation),
        }
    }

    pub(super) fn blockage_mut(&mut self, phase: PlanningPhase) -> Option<&mut Blockage> {
        match phase {
            PlanningPhase::Translation => self.translation.as_mut(),
            PlanningPhase::Rotation => Some(&mut self.rotation),
        }
    }
}

/// The least travel that makes a new state of a part.
#[must_use]
pub fn least_travel(scene: &Scene, part: usize) -> f64 {
    SAME_STATE_TRAVEL.min(scene.bodies[part].shape.bounds().extents().max() / SHARE_OF_EXTENT)
}

/// The factor by which the resolution of a part with `states` states is coarser than the first.
pub(super) fn coarseness(states: usize) -> f64 {
    2f64.powi((states / STATES_PER_LEVEL).min(STATE_LEVELS) as i32)
}
