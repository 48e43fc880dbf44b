//! The contract between search and the engines.

use nalgebra::Vector3;

use crate::geometry::Pose;
use crate::termination::{Interrupt, Termination};

use super::{Action, Scene, Surroundings};

/// How a motion ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// The part's hull is apart from the hull of everything that remains, along this direction.
    Disassembled(Vector3<f64>),
    /// Contact stopped it: no combination of the remaining freedoms follows the action.
    Collision {
        /// The parts whose contacts hold it, ascending.
        with: Vec<usize>,
    },
    /// It neither came out nor got stuck.
    Undecided {
        /// Why the motion was given up.
        reason: &'static str,
        /// Parts it touched on the way, ascending.
        touched: Vec<usize>,
    },
}

/// A part's motion under one action.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Poses of the part's shape in the planning frame, the start first. In contact they are a
    /// contact step apart at most, in free space as far as the clearance allows.
    pub path: Vec<Pose>,
    /// How it ended.
    pub end: End,
}

/// A simulation engine: f(s, a, p).
///
/// Contract (one test suite for all engines): the same input gives the same motion to the bit;
/// the path starts at `start`; no pair is deeper along it than its allowance and the engine's own
/// declared tolerance; `Disassembled` is returned only with a direction that separates the hulls.
pub trait TransitionFunction: Sync {
    /// The engine's name in requests and plans.
    fn name(&self) -> &'static str;

    /// How much deeper than the allowance a pair may get, in the planning frame.
    fn depth_tolerance(&self) -> f64;

    /// Moves `part` from `start` under `action` among the parts that stand.
    ///
    /// # Errors
    /// The termination condition became true.
    fn simulate(
        &self,
        scene: &Scene,
        surroundings: &Surroundings,
        part: usize,
        start: &Pose,
        action: Action,
        termination: &Termination,
    ) -> Result<Motion, Interrupt>;
}
