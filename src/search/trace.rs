//! The events of a search, for a trace: which state was expanded with which (f_c, f_a), which actions the graphs
//! excluded, how each simulation ended, each update.

use serde::{Deserialize, Serialize};

use super::outcome::{Reason, Removal};

/// The parts that block an action: those that the outgoing edges of one vertex lead to, in the blocking graph of
/// one direction.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockedBy {
    /// The action's name.
    pub action: String,
    /// Parts, ascending.
    pub parts: Vec<usize>,
}

/// Translational or rotational planning: which list of actions is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanningPhase {
    /// Translations.
    Translation,
    /// Actions with rotational freedom.
    Rotation,
}

/// One event. Parts are indices into the list in the first one; state 0 is the assembled one,
/// displaced states count from 1 in the order of their discovery (in PDP and RRT, within the tree of one part,
/// which in PDP begins anew with every depth limit).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum TraceEvent {
    /// The question.
    Start {
        /// Names of all parts.
        parts: Vec<String>,
        /// The planner's name.
        planner: String,
        /// The engine's name.
        engine: String,
    },
    /// Static analysis gave the outgoing edges of a part at a state.
    Analysed {
        /// The state.
        state: usize,
        /// The part.
        part: usize,
        /// Its edges; actions without any are left out.
        blocked: Vec<BlockedBy>,
    },
    /// A run over the open list began.
    Pass {
        /// With which actions.
        phase: PlanningPhase,
        /// The depth limit of a breadth-first planner, or the samples of each tree.
        depth_limit: Option<usize>,
    },
    /// A state was taken off the open list.
    Expanded {
        /// With which actions.
        phase: PlanningPhase,
        /// The state.
        state: usize,
        /// The part that moves.
        part: usize,
        /// (f_c, f_a), where blocking graphs guide the search.
        evaluation: Option<[usize; 2]>,
        /// Actions that the graphs exclude.
        excluded: Vec<BlockedBy>,
    },
    /// The transition function was used.
    Simulated {
        /// From this state.
        state: usize,
        /// The part that moved.
        part: usize,
        /// The action's name.
        action: String,
        /// `disassembled`, `collision` or `undecided`.
        end: String,
        /// The parts that it met: the edges that the graph of this action gets.
        with: Vec<usize>,
        /// Poses of the motion.
        poses: usize,
        /// The new state, unless there was one like it.
        leads_to: Option<usize>,
    },
    /// A straight sweep showed a way out, and the check on the triangles confirmed it.
    Swept {
        /// From this state.
        state: usize,
        /// The part that moved.
        part: usize,
        /// The action whose direction it followed.
        action: String,
    },
    /// The cells of a part's places were searched, the last resort for translations.
    CellsSearched {
        /// The part.
        part: usize,
        /// The number of cells that it reached.
        cells: usize,
        /// Whether a way out of them was found and confirmed.
        leaves: bool,
    },
    /// The check on the triangles refuted a path.
    Refuted {
        /// The part.
        part: usize,
        /// The action's name.
        action: String,
        /// The parts that it entered.
        by: Vec<usize>,
    },
    /// A group of parts was tried as one rigid body.
    GroupTried {
        /// The parts.
        parts: Vec<usize>,
        /// Whether it leaves.
        leaves: bool,
    },
    /// The places of all parts were searched for one after which some leave.
    PlacesSearched {
        /// The number of places.
        places: usize,
        /// Whether such a one was found and confirmed.
        leaves: bool,
    },
    /// Parts were moved aside, where they stay.
    MovedAside {
        /// The parts.
        parts: Vec<usize>,
        /// Parts that their path requires to have moved.
        requires: Vec<usize>,
    },
    /// What follows takes a group apart that has left.
    GroupOpened {
        /// The parts.
        parts: Vec<usize>,
    },
    /// Parts are out: their vertices and edges are deleted from all graphs.
    Removed {
        /// The parts; several left together.
        parts: Vec<usize>,
        /// Parts that their path requires to be out.
        requires: Vec<usize>,
    },
    /// The search ended.
    End {
        /// The plan's status.
        status: String,
        /// Why it is not complete.
        reason: Option<Reason>,
        /// Parts that remain, ascending.
        remaining: Vec<usize>,
        /// Simulations counted.
        simulations: u64,
        /// Removals by a straight sweep, without simulation.
        #[serde(default)]
        sweeps: u64,
    },
}

impl TraceEvent {
    /// The event of a removal after earlier ones.
    pub(super) fn of(removal: &Removal, earlier: &[Removal]) -> Self {
        let Removal { parts, aside, requires, .. } = removal;
        let mut required: Vec<usize> = requires.iter().flat_map(|&i| &earlier[i].parts).copied().collect();
        required.sort_unstable();
        required.dedup();
        let (parts, requires) = (parts.clone(), required);
        if *aside { Self::MovedAside { parts, requires } } else { Self::Removed { parts, requires } }
    }
}
