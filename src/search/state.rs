//! States: one displaced part among the others at their assembled poses.

use crate::blocking_graph::Blockage;
use crate::budgets::STATES_PER_LEVEL;
use crate::geometry::Pose;
use crate::scene::Scene;
use crate::tolerances::SAME_STATE_TRAVEL;

use super::trace::TracePhase;

/// The kind of planning: translations, or actions with rotational freedom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Phase {
    Translation,
    Rotation,
}

impl From<Phase> for TracePhase {
    fn from(phase: Phase) -> Self {
        match phase {
            Phase::Translation => Self::Translation,
            Phase::Rotation => Self::Rotation,
        }
    }
}

/// An action from a state: what a search expands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Expansion {
    /// The index of the state's node.
    pub(super) node: usize,
    pub(super) phase: Phase,
    /// The index in the list of actions of the phase.
    pub(super) action: usize,
}

/// A state of the search: a part at a pose, with the path there.
#[derive(Debug, Clone)]
pub(super) struct StateNode {
    pub(super) part: usize,
    /// Path so far, from the assembled pose to this state's.
    pub(super) path: Vec<Pose>,
    /// Blockage under translations; filled when first needed.
    pub(super) translation: Option<Blockage>,
    /// Blockage under actions with rotational freedom; starts empty.
    pub(super) rotation: Blockage,
    /// The expansion that led here; `None` for an assembled part.
    pub(super) origin: Option<Expansion>,
    /// How far it is from the part's states known before, in units of the resolution; 0 assembled.
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

    pub(super) fn blockage(&self, phase: Phase) -> Option<&Blockage> {
        match phase {
            Phase::Translation => self.translation.as_ref(),
            Phase::Rotation => Some(&self.rotation),
        }
    }

    pub(super) fn blockage_mut(&mut self, phase: Phase) -> Option<&mut Blockage> {
        match phase {
            Phase::Translation => self.translation.as_mut(),
            Phase::Rotation => Some(&mut self.rotation),
        }
    }
}

/// Least travel that makes a new state of a part: bounded by its own size.
#[must_use]
pub fn least_travel(scene: &Scene, part: usize) -> f64 {
    SAME_STATE_TRAVEL.min(scene.bodies[part].shape.bounds().extents().max() / 20.0)
}

/// The factor by which the resolution of a part's states is coarser once it has `states` of them.
pub(super) fn coarseness(states: usize) -> f64 {
    2f64.powi((states / STATES_PER_LEVEL).min(10) as i32)
}
