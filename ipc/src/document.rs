//! Plans as JSON: the contract `sbdp-plan/2`, written by `sbdp plan ASSEMBLY --json FILE` and
//! described in `src/document/JSON.md`. Parts go by their names. Later versions may add fields; those that
//! are here keep their meaning.

mod report;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::plan::Waypoint;

pub use report::{
    ClearanceDocument, ClosestDocument, FallDocument, PartNames, StabilityDocument, ToolDocument,
    UnstableDocument,
};

/// The name and version of the contract.
pub const SCHEMA: &str = "sbdp-plan/2";

/// A plan as the contract describes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanDocument {
    /// Always [`SCHEMA`].
    pub schema: String,
    /// `disassembly` or `assembly`.
    #[serde(default = "disassembly")]
    pub kind: String,
    /// Where the meshes are, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<SourceDocument>,
    /// `complete`, `partial`, `infeasible`, `timeout`, `cancelled` or `exhausted`.
    pub status: String,
    /// Why it is not complete.
    pub reason: Option<String>,
    /// The planner, as `sbdp-star`.
    pub planner: String,
    /// The engine, as `sliding`.
    pub engine: String,
    /// The unit of all lengths, if known.
    pub units: Option<String>,
    /// All parts, in natural order.
    pub parts: Vec<String>,
    /// Groups that the input names, outer ones before inner ones.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub groups: Vec<GroupDocument>,
    /// The state at the start.
    pub initial: InitialDocument,
    /// Parts that must come out, or all.
    pub targets: Option<Vec<String>>,
    /// Parts that may not move.
    pub fixed: Vec<String>,
    /// Parts that were to stay unless others could not leave otherwise.
    #[serde(default)]
    pub keep: Vec<String>,
    /// The part that the rest is taken off, or built up on; empty where parts are fixed, or where it had to leave.
    pub base: Vec<String>,
    /// Why it was chosen.
    pub base_reason: Option<String>,
    /// The removals, or insertions, in order.
    pub steps: Vec<StepDocument>,
    /// Parts that are in the assembly at the end (in an assembly plan: from the start).
    pub remaining: Vec<String>,
    /// Groups that left together and were not taken apart: this was not required, or no way was found.
    pub kept_together: Vec<Vec<String>>,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: Vec<FreeGroupDocument>,
    /// What blocks the parts that should have come off.
    pub blocked: Vec<BlockedDocument>,
    /// Overlaps at the assembled pose.
    pub overlaps: Vec<OverlapDocument>,
    /// Findings about the input.
    pub warnings: Vec<WarningDocument>,
    /// Counters and times.
    pub stats: StatsDocument,
}

/// The kind of a document without one.
fn disassembly() -> String {
    "disassembly".to_owned()
}

/// The files of the meshes, and what was done to them before planning, except `initial.poses`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SourceDocument {
    /// The file or folder of the assembly.
    pub assembly: String,
    /// A hash of all meshes as they were read, to recognise them.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub content: String,
    /// The quaternion `[w, x, y, z]` by which everything was rotated about the origin (`--rotate`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<[f64; 4]>,
    /// Parts with the mesh of another file (`--replaced`).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub replaced: BTreeMap<String, String>,
    /// Files and folders of further parts (`--added`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<String>,
    /// The floor that the assembly stands on (`--floor`): the part `floor`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<FloorDocument>,
    /// What counted as a part in files that hold several (`--split`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub split: Option<String>,
    /// Patterns of the names of parts and files that were left out (`--ignore`).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ignore: Vec<String>,
    /// mm: how far triangles made of STEP files may be from the surfaces (`--deflection`).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deflection: Option<f64>,
}

/// A square plate under an assembly. Lengths are in the plan's units and frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FloorDocument {
    /// The direction up, a unit vector.
    pub up: [f64; 3],
    /// The middle of its upper face.
    pub centre: [f64; 3],
    /// The side of the square.
    pub side: f64,
}

/// A group that the input names.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroupDocument {
    /// The group's name; for nested groups, after the names of the outer ones, separated by slashes.
    pub name: String,
    /// All parts in it, including those of nested groups.
    pub parts: Vec<String>,
}

/// The state that planning began with, where it differs from the assembly as given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct InitialDocument {
    /// Parts that were removed before.
    pub removed: Vec<String>,
    /// Parts that stood elsewhere, and where. In an assembly plan also those that waited for their turn.
    pub poses: BTreeMap<String, Waypoint>,
    /// How the parts stand before the first step, if the request asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityDocument>,
}

/// Parts that move as one rigid body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepDocument {
    /// The parts that move.
    pub parts: Vec<String>,
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts belong;
    /// null for parts that leave the assembly. A group is taken apart as it stood in the assembly.
    pub of: Option<usize>,
    /// `out`: clear of everything that they stood with; `aside`: elsewhere among the others; `in`: in their places
    /// (assembly plans).
    pub ends: String,
    /// `translation`, or `rotation` if any waypoint is turned against the first.
    pub motion: String,
    /// Rigid transforms x′ = q·x + t, `[x, y, z, qw, qx, qy, qz]`, of the parts as they stand when the step begins (of
    /// an assembly plan: when it ends), so that the first (the last) is the identity; between two, the centre of the
    /// box of all these parts, axis-aligned as they stand then, moves on a line, and the rotation slerps.
    pub path: Vec<Waypoint>,
    /// Deepest penetration along the path beyond the pair's assembled depth.
    pub verified_depth: f64,
    /// Numbers of the steps, from 0, that must be done before this exact path is free, ascending: necessary, and
    /// sufficient with what these require in turn.
    pub requires: Vec<usize>,
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: usize,
    /// The unit vector along which the middle of the part's box moves on the last leg of the path; null where it does
    /// not.
    pub direction: Option<[f64; 3]>,
    /// How the parts that are in the assembly after the step stand, if the request asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stability: Option<StabilityDocument>,
    /// How near the step passes other parts, if the request asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clearance: Option<ClearanceDocument>,
    /// The tools for the fastener that the step takes off, if the request asks for them; none if it takes no fastener off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tools: Option<Vec<ToolDocument>>,
}

/// Parts that can begin to move together where nothing leaves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreeGroupDocument {
    /// The parts.
    pub parts: Vec<String>,
    /// The unit vector along which they begin.
    pub direction: [f64; 3],
}

/// A part that remains and what blocks it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BlockedDocument {
    /// The part.
    pub part: String,
    /// The parts that block it.
    pub by: Vec<String>,
    /// The action that they blocked, as `+x`.
    pub action: String,
}

/// An overlap at the assembled pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverlapDocument {
    /// The pair.
    pub parts: [String; 2],
    /// Its depth.
    pub depth: f64,
}

/// A finding.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct WarningDocument {
    /// The part that it is about, if any.
    pub part: Option<String>,
    /// What was found, and what was done about it.
    pub message: String,
}

/// Counters, and times in seconds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StatsDocument {
    /// Uses of the transition function, remembered ones included.
    pub simulations: u64,
    /// Uses of the transition function that were computed.
    pub simulations_run: u64,
    /// Straight sweeps that proved a removal.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Reading and healing, before the total begins; null where the daemon planned.
    #[serde(default)]
    pub load_time_s: Option<f64>,
    /// Distance fields.
    pub sdf_time_s: f64,
    /// Overlaps at the assembled pose; null where the daemon planned.
    #[serde(default)]
    pub overlap_time_s: Option<f64>,
    /// Blocking graphs.
    pub static_analysis_time_s: f64,
    /// Simulation.
    pub path_time_s: f64,
    /// Shortening and verification.
    pub verify_time_s: f64,
    /// Paths to where insertions begin; null where there are none, or the daemon planned.
    #[serde(default)]
    pub transfer_time_s: Option<f64>,
    /// The total.
    pub total_time_s: f64,
    /// What was remembered.
    pub cache: CacheDocument,
}

/// What was found in the cache.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CacheDocument {
    /// Distance fields.
    pub sdf_hits: u64,
    /// Overlaps and blocking relations of pairs, and planes that parts touch.
    pub blocking_hits: u64,
    /// States whose blocking graphs needed no analysis.
    #[serde(default)]
    pub graph_hits: u64,
    /// Motions.
    pub motion_hits: u64,
    /// Verified paths; null where the daemon planned.
    #[serde(default)]
    pub verdict_hits: Option<u64>,
    /// The whole plan.
    pub plan_hit: bool,
}

impl PlanDocument {
    /// The document as JSON, on one line.
    ///
    /// # Errors
    /// None that is known: all keys are text.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string(self)
    }

    /// The same, indented.
    ///
    /// # Errors
    /// As [`Self::to_json`].
    pub fn to_pretty_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }

    /// Reads a document.
    ///
    /// # Errors
    /// It is no JSON, or does not fit the contract.
    pub fn from_json(text: &str) -> serde_json::Result<Self> {
        serde_json::from_str(text)
    }
}
