//! The result of a planning request. All lengths and poses are in the input's units and frame.

use serde::{Deserialize, Serialize};

use crate::geometry::Waypoint;

/// What a plan does with the parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PlanKind {
    /// Takes them apart.
    #[default]
    Disassembly,
    /// Puts them together.
    Assembly,
}

/// How planning ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum PlanStatus {
    /// Every requested part is out (in an assembly plan: in place), or was from the start.
    Complete,
    /// A budget was spent (the reason names it); the steps are the best so far.
    Partial,
    /// It is proved that requested parts cannot come off.
    Infeasible,
    /// The deadline passed.
    Timeout,
    /// The request was cancelled.
    Cancelled,
    /// Nothing more was found to try, and nothing was proved.
    Exhausted,
}

/// Whether a step turns the part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MotionKind {
    /// All waypoints have the rotation of the first.
    Translation,
    /// Some waypoint's rotation differs from the first.
    Rotation,
}

/// Where a step leaves its parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepEnd {
    /// Clear of everything that they stood with.
    Out,
    /// Elsewhere among the others, where they stay until a later step moves them again.
    Aside,
    /// In their places: in assembly plans.
    In,
}

/// Parts that move along a path, as one rigid body.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanStep {
    /// Indices of the parts that move, ascending; all others that stand with them stay where they are.
    pub parts: Vec<usize>,
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts belong;
    /// `None` for parts that leave the assembly. A group is taken apart as it stood in the assembly.
    pub of: Option<usize>,
    /// Where the step leaves the parts.
    pub ends: StepEnd,
    /// Whether the path turns them.
    pub motion: MotionKind,
    /// Rigid transforms x′ = q·x + t of the parts as they stand when the step begins (of an assembly plan: when it
    /// ends), so that the first (the last) is the identity. Between two, the centre of the box of all these parts,
    /// axis-aligned as they stand then, moves on a line, and the rotation slerps.
    pub path: Vec<Waypoint>,
    /// Deepest penetration found by verification beyond the pair's assembled depth.
    pub verified_depth: f64,
    /// Numbers of the steps that must be done before this exact path is free, ascending: necessary, and sufficient with
    /// what these require in turn. All are smaller than the step's own number.
    pub requires: Vec<usize>,
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: usize,
    /// The unit vector along which the middle of the parts' box moves on the last leg of the path; `None` where it does
    /// not.
    pub direction: Option<[f64; 3]>,
}

/// Parts that can begin to move together where nothing leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreeGroup {
    /// The parts, ascending.
    pub parts: Vec<usize>,
    /// The unit vector along which they begin.
    pub direction: [f64; 3],
}

/// The base: the parts that stay, and that the rest is taken off.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Base {
    /// The parts.
    pub parts: Vec<usize>,
    /// Why they were chosen, in a few words; `None` where the request named them.
    pub reason: Option<String>,
}

impl Base {
    /// Those of its parts that are among some, ascending.
    #[must_use]
    pub fn among(&self, parts: &[usize]) -> Self {
        let kept: Vec<usize> =
            self.parts.iter().copied().filter(|part| parts.binary_search(part).is_ok()).collect();
        if kept.is_empty() { Self::default() } else { Self { parts: kept, reason: self.reason.clone() } }
    }
}

/// Why a part that remains did not move.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Blocked {
    /// The part that remains.
    pub part: usize,
    /// The parts that block it.
    pub by: Vec<usize>,
    /// The action that they blocked, as `+x` or `-rz` or `+z+rz`.
    pub action: String,
}

/// A pair that overlaps at the assembled pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlap {
    /// The two parts, smaller index first.
    pub parts: [usize; 2],
    /// How deep one lies in the other.
    pub depth: f64,
}

/// A finding about the input.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// The part that it is about, if any.
    pub part: Option<usize>,
    /// What was found, and what was done about it.
    pub message: String,
}

/// Counters and times. Times in seconds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanStats {
    /// Uses of the transition function by the search, cached ones included.
    pub simulations: u64,
    /// Uses of the transition function that were computed.
    pub simulations_run: u64,
    /// Straight sweeps that proved a removal without simulation.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Reading, healing and preparing the meshes, before `total_time_s` begins; `None` where it is
    /// unknown, as from the daemon.
    pub load_time_s: Option<f64>,
    /// Building or loading distance fields.
    pub sdf_time_s: f64,
    /// Preparing verification and measuring overlaps; `None` as above.
    pub overlap_time_s: Option<f64>,
    /// Building blocking graphs.
    pub static_analysis_time_s: f64,
    /// Sweeps, and the simulations that were used, each on its thread (the paper's path-planning time).
    pub path_time_s: f64,
    /// Shortening and verification.
    pub verify_time_s: f64,
    /// In an assembly plan, finding and verifying the paths to where insertions begin; `None` where there
    /// are none or it is unknown, as from the daemon.
    pub transfer_time_s: Option<f64>,
    /// From admission to the last step.
    pub total_time_s: f64,
    /// Distance fields found in the cache.
    pub sdf_hits: u64,
    /// Overlaps and blocking relations of pairs, and planes that parts touch, found in the cache.
    pub blocking_hits: u64,
    /// States whose blocking graphs were found in the cache, for all of their pairs.
    pub graph_hits: u64,
    /// Motions found in the cache.
    pub motion_hits: u64,
    /// Verified paths found in the cache; `None` where it is unknown, as from the daemon.
    pub verdict_hits: Option<u64>,
    /// Whether the whole plan was found in the cache.
    pub plan_hit: bool,
}

/// A plan, complete or not.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What it does.
    pub kind: PlanKind,
    /// How planning ended.
    pub status: PlanStatus,
    /// Why it is not complete.
    pub reason: Option<String>,
    /// The planner's name, as `sbdp-star`.
    pub planner: String,
    /// The engine's name, as `sliding`.
    pub engine: String,
    /// The unit of length, if known.
    pub units: Option<String>,
    /// Part names; every index in this plan points here.
    pub parts: Vec<String>,
    /// Parts that had been removed before.
    pub removed: Vec<usize>,
    /// Parts that did not begin where their mesh was given, and where they began.
    pub poses: Vec<(usize, Waypoint)>,
    /// Parts that must come out, or all.
    pub targets: Option<Vec<usize>>,
    /// Parts that may not move.
    pub fixed: Vec<usize>,
    /// Parts that were to stay unless others could not leave otherwise.
    pub keep: Vec<usize>,
    /// The parts that the rest is taken off, or built up on. Empty where parts are fixed and no base was named, or
    /// where all others had to leave too.
    pub base: Base,
    /// The removals, or insertions, in order.
    pub steps: Vec<PlanStep>,
    /// Parts that are in the assembly at the end (in an assembly plan: from the start).
    pub remaining: Vec<usize>,
    /// Groups that left together and were not taken apart: this was not required, or no way was found.
    pub kept_together: Vec<Vec<usize>>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<FreeGroup>,
    /// What blocks the parts that should have come off.
    pub blocked: Vec<Blocked>,
    /// Overlaps at the assembled pose.
    pub overlaps: Vec<Overlap>,
    /// Findings about the input.
    pub warnings: Vec<Warning>,
    /// Counters and times.
    pub stats: PlanStats,
}

impl PlanKind {
    /// The kind as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Disassembly => "disassembly",
            Self::Assembly => "assembly",
        }
    }
}

impl PlanStatus {
    /// The status that the contract names so.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let all = [
            Self::Complete,
            Self::Partial,
            Self::Infeasible,
            Self::Exhausted,
            Self::Timeout,
            Self::Cancelled,
        ];
        all.into_iter().find(|status| status.name() == name)
    }

    /// The status as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Partial => "partial",
            Self::Infeasible => "infeasible",
            Self::Exhausted => "exhausted",
            Self::Timeout => "timeout",
            Self::Cancelled => "cancelled",
        }
    }
}

impl MotionKind {
    /// The kind of motion as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Translation => "translation",
            Self::Rotation => "rotation",
        }
    }
}

impl StepEnd {
    /// The end as the contract names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Out => "out",
            Self::Aside => "aside",
            Self::In => "in",
        }
    }
}

impl Plan {
    /// The name of a part.
    #[must_use]
    pub fn part_name(&self, part: usize) -> &str {
        self.parts.get(part).map_or("?", String::as_str)
    }

    pub(crate) fn names(&self, parts: &[usize]) -> Vec<String> {
        parts.iter().map(|&p| self.part_name(p).to_owned()).collect()
    }
}
