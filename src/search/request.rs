//! A planning request, independent of any transport.

use std::num::NonZeroU32;
use std::time::Duration;

use crate::blocking_graph::StaticAnalysis;
use crate::geometry::Waypoint;
use crate::simulation::PenaltyParameters;

/// The search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Planner {
    /// State-based planning guided by directional blocking graphs (the paper's SBDP*).
    #[default]
    SbdpStar,
    /// State-based planning without blocking graphs (the paper's SBDP).
    Sbdp,
    /// Breadth-first search per part with translations (PDP_t).
    PdpT,
    /// Breadth-first search per part with rotational freedom (PDP_r).
    PdpR,
    /// PDP_t, then PDP_r from the start if that failed (PDP*).
    PdpStar,
    /// A rapidly-exploring random tree per part, of straight paths (RRT).
    Rrt,
    /// A rapidly-exploring random tree per part, of motions of the transition function (BK-RRT).
    BkRrt,
}

impl Planner {
    /// All planners, in the order of their numbers on the wire.
    pub const ALL: [Self; 7] =
        [Self::SbdpStar, Self::Sbdp, Self::PdpT, Self::PdpR, Self::PdpStar, Self::Rrt, Self::BkRrt];

    /// The name in requests and plans.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SbdpStar => "sbdp-star",
            Self::Sbdp => "sbdp",
            Self::PdpT => "pdp-t",
            Self::PdpR => "pdp-r",
            Self::PdpStar => "pdp-star",
            Self::Rrt => "rrt",
            Self::BkRrt => "bk-rrt",
        }
    }

    /// The actions that it uses by default: the paper's for all but SBDP*.
    #[must_use]
    pub fn default_actions(self) -> ActionSet {
        match self {
            Self::SbdpStar => ActionSet::Extended,
            _ => ActionSet::Paper,
        }
    }
}

/// The simulation that moves the parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Engine {
    /// Contact-constrained sliding without inertia.
    #[default]
    Sliding,
    /// The paper's penalty-based simulation.
    Penalty,
}

impl Engine {
    /// All engines, in the order of their numbers on the wire.
    pub const ALL: [Self; 2] = [Self::Sliding, Self::Penalty];

    /// The name in requests and plans.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sliding => "sliding",
            Self::Penalty => "penalty",
        }
    }
}

/// The actions that the search may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ActionSet {
    /// The paper's: six translations; six translations and six rotations.
    Paper,
    /// The paper's and pulling while turning about the same axis.
    #[default]
    Extended,
}

impl ActionSet {
    /// All sets, in the order of their numbers on the wire.
    pub const ALL: [Self; 2] = [Self::Paper, Self::Extended];

    /// Whether a request with these actions sweeps by default.
    #[must_use]
    pub fn default_sweeps(self) -> bool {
        self == Self::Extended
    }

    /// The name in requests.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Extended => "extended",
        }
    }
}

/// Where the parts of an assembly plan begin.
#[derive(Debug, Clone, PartialEq)]
pub enum Staging {
    /// Each where its insertion begins; it is absent before its turn.
    None,
    /// Laid out beside the assembly, except for those with a given pose: the rigid motion of their mesh from
    /// where it was given, in the input's units and frame.
    Beside(Vec<(usize, Waypoint)>),
}

/// An order of the steps in which few parts have to be held at once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyOrder {
    /// The direction against gravity, in the input's frame, of any length but 0.
    pub up: [f64; 3],
    /// The coefficient of friction of all contacts, at least 0.
    pub friction: f64,
    /// How many parts hands can hold at once, the one that moves included; `None` for any number. A plan ends before the
    /// first step that needs more.
    pub hands: Option<NonZeroU32>,
}

/// A planning request about one assembly. Part numbers are indices into its parts.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanRequest {
    /// The search.
    pub planner: Planner,
    /// The simulation.
    pub engine: Engine,
    /// Parameters of the engine `penalty`.
    pub penalty: PenaltyParameters,
    /// The actions.
    pub actions: ActionSet,
    /// The rule that fills blocking graphs before anything is simulated.
    pub static_analysis: StaticAnalysis,
    /// Whether parts that leave straight, or are clear already, are removed by a geometric test,
    /// without simulation, by the planners `sbdp-star` and `sbdp`; `None` for the default of the actions: the paper
    /// simulates all.
    pub sweeps: Option<bool>,
    /// The gap between a part's hull and that of the rest where its path out ends, in the input's units, at least 0;
    /// `None` for a hundredth of the longest side of the part's box.
    pub end_gap: Option<f64>,
    /// The distance that parts keep from what they pass on their way, in the input's units, at least 0. Pairs that are nearer
    /// as they stand keep half of what they have; those that touch as they stand may touch.
    pub clearance: f64,
    /// The direction up, in the input's frame, of any length but 0: upward paths come before sideways ones, and these
    /// before downward ones. `None` for the direction in which most parts can go at first.
    pub up: Option<[f64; 3]>,
    /// Seed of the random poses of the planners `rrt` and `bk-rrt`.
    pub seed: u64,
    /// Simulations (steps of a tree, in RRT) after which the search gives up with `partial`.
    pub max_simulations: Option<u64>,
    /// Time after which one motion, or PDP's or RRT's search for one part, is given up (the paper's path
    /// planning timeout). Plans then depend on the clock.
    pub path_timeout: Option<Duration>,
    /// Time after which the search ends as at its deadline, not counting thinning and verification: the
    /// paper's timeout, as its planners do not verify.
    pub planning_timeout: Option<Duration>,
    /// Worker threads for this request; 0 stands for all. Never changes the plan.
    pub threads: usize,
    /// Parts that may not move.
    pub fixed: Vec<usize>,
    /// Parts that are already removed.
    pub removed: Vec<usize>,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<usize>>,
    /// Parts that stay as long as others leave: what the rest is taken off. With the extended actions, SBDP and SBDP*
    /// choose one if there are none; the other planners treat them as fixed.
    pub base: Vec<usize>,
    /// Parts that stay unless others that are asked for cannot leave otherwise. They are not asked for.
    pub keep: Vec<usize>,
    /// Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base.
    /// In the plan they are among those that may not move.
    pub keep_out: Vec<usize>,
    /// Groups that should leave as wholes, to be taken apart afterwards. A part may be in several groups if these are
    /// nested. Only SBDP* with the extended actions supports them.
    pub groups: Vec<Vec<usize>>,
    /// Set for an order of the steps in which few parts have to be held at once.
    pub steady: Option<SteadyOrder>,
    /// Set for an assembly plan (the disassembly reversed): where its parts begin.
    pub assembly: Option<Staging>,
    /// Whether the cache is neither read nor written.
    pub no_cache: bool,
}

impl PlanRequest {
    /// Whether its search supports preferred groups.
    #[must_use]
    pub fn prefers_groups(&self) -> bool {
        self.planner == Planner::SbdpStar && self.actions == ActionSet::Extended
    }

    /// Whether its search sweeps.
    #[must_use]
    pub fn sweeps(&self) -> bool {
        let state_based = matches!(self.planner, Planner::SbdpStar | Planner::Sbdp);
        state_based && self.sweeps.unwrap_or_else(|| self.actions.default_sweeps())
    }
}

/// The progress of a request; lossy, for display only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// The stage that runs.
    pub stage: Stage,
    /// Units of this stage done.
    pub done: u32,
    /// Units of this stage in all (fields to build; parts to remove).
    pub total: u32,
    /// Simulations so far.
    pub simulations: u64,
    /// What the search tries.
    pub tried: Option<Tried>,
}

/// A motion that a search tries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tried {
    /// The part; of several side by side, the first.
    pub part: usize,
    /// Whether the part is turned, and not only pushed.
    pub turns: bool,
}

/// The stages of a request, named like the folders that do them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Building distance fields.
    Sdf,
    /// Searching and verifying.
    Search,
    /// Finding the paths to where insertions begin.
    Transfer,
}

/// Receives the results of a request while it runs.
pub trait PlanSink: Send {
    /// A stage made progress.
    fn progress(&mut self, progress: Progress);
    /// A verified step, in order.
    fn step(&mut self, step: &crate::plan::PlanStep);
    /// Whether the receiver wants every event of the search.
    fn traces(&self) -> bool {
        false
    }
    /// An event of the search, if the receiver wants them.
    fn traced(&mut self, _event: super::TraceEvent) {}
}

/// Ignores everything: for callers that need only the plan.
impl PlanSink for () {
    fn progress(&mut self, _: Progress) {}
    fn step(&mut self, _: &crate::plan::PlanStep) {}
}
