//! The result of a search, in the planning frame.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::geometry::Pose;
use crate::plan::PlanStatus;

/// One part taken out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Removal {
    /// The part.
    pub part: usize,
    /// Poses of its shape, the assembled one first; thinned and verified.
    pub path: Vec<Pose>,
    /// Largest depth beyond the pairs' allowed penetrations that verification found.
    pub depth: f64,
    /// Parts that had blocked it and left before.
    pub waited_for: Vec<usize>,
}

/// An action of a part that remains, and the parts that block it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockedAction {
    /// The part.
    pub part: usize,
    /// The action's name.
    pub action: String,
    /// The parts in its way, ascending.
    pub by: Vec<usize>,
}

/// Counts and times of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Transition functions used.
    pub simulations: u64,
    /// Of them, those whose motion was remembered.
    pub recalled: u64,
    /// Removals that a straight sweep showed, without simulation.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Time in static analysis.
    #[serde(skip)]
    pub static_analysis: Duration,
    /// Time in simulation and sweeps.
    #[serde(skip)]
    pub simulation: Duration,
    /// Time in thinning and verification.
    #[serde(skip)]
    pub verification: Duration,
}

/// How a search ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Its status.
    pub status: PlanStatus,
    /// Why it is not complete.
    pub reason: Option<String>,
    /// Removals in order.
    pub removals: Vec<Removal>,
    /// Parts that remain, ascending.
    pub remaining: Vec<usize>,
    /// The blocked actions of the parts that should have come out.
    pub blocked: Vec<BlockedAction>,
    /// Counts and times.
    pub counters: Counters,
}
