//! What records hold, as plain data: changing a field changes the bytes on disk, so the version of the
//! kind's algorithm must change with it.

use nalgebra::{Quaternion, UnitQuaternion};
use serde::{Deserialize, Serialize};

use super::format::Record;
use crate::geometry::Pose;

/// x, y, z, and the quaternion w, x, y, z.
pub(super) type PoseRecord = [f64; 7];

/// A pose, bit by bit.
pub(super) fn pose_record(pose: &Pose) -> PoseRecord {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.w, q.x, q.y, q.z]
}

/// The pose of a record, bit by bit: so it is not normalised again.
pub(super) fn pose_of([x, y, z, w, i, j, k]: &PoseRecord) -> Pose {
    let rotation = UnitQuaternion::new_unchecked(Quaternion::new(*w, *i, *j, *k));
    Pose::from_parts([*x, *y, *z].into(), rotation)
}

/// How deep two parts overlap, in the planning frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct OverlapRecord {
    pub(super) depth: f64,
}

/// For each action, whether one part keeps the other from following it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct BlockingRecord {
    pub(super) blocked: Vec<bool>,
}

/// Where motions with one key looked, and the hashes of what stood there.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct WitnessRecord {
    /// The one used last comes last.
    pub(super) variants: Vec<WitnessVariant>,
}

/// One motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct WitnessVariant {
    /// Least and greatest corner of the box that holds all that was looked at.
    pub(super) looked_at: [[f64; 3]; 2],
    /// The hash of the parts whose boxes meet it.
    pub(super) witnesses: [u8; 32],
}

/// A motion; parts are given by their place among its witnesses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct MotionRecord {
    pub(super) path: Vec<PoseRecord>,
    /// The indices in the path at which it was asked whether the part is out.
    pub(super) asked: Vec<u32>,
    pub(super) end: MotionEnd,
}

/// How the contact motion ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum MotionEnd {
    /// It was out: how it would have gone on is not known.
    Out,
    Collision {
        with: Vec<u32>,
    },
    Undecided {
        reason: String,
        touched: Vec<u32>,
    },
}

/// What verification found past one part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct VerdictRecord {
    pub(super) depth: f64,
    pub(super) entries: Vec<EntryRecord>,
}

/// A point that got too deep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct EntryRecord {
    pub(super) on_moving: bool,
    pub(super) point: [f64; 3],
    pub(super) over: f64,
}

/// What a search answered, in the planning frame; parts by their numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PlanRecord {
    /// As in [`crate::plan::PlanStatus`]; only ends that do not depend on the clock.
    pub(super) status: StatusRecord,
    pub(super) reason: Option<String>,
    pub(super) removals: Vec<RemovalRecord>,
    pub(super) remaining: Vec<u32>,
    pub(super) blocked: Vec<BlockedRecord>,
    pub(super) simulations: u64,
    pub(super) sweeps: u64,
    pub(super) states: u64,
    /// At the assembled pose.
    pub(super) overlaps: Vec<(u32, u32, f64)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum StatusRecord {
    Complete,
    Partial,
    Infeasible,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RemovalRecord {
    pub(super) part: u32,
    pub(super) path: Vec<PoseRecord>,
    pub(super) depth: f64,
    pub(super) waited_for: Vec<u32>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct BlockedRecord {
    pub(super) part: u32,
    pub(super) action: String,
    pub(super) by: Vec<u32>,
}

/// Normals of planes, in the planning frame; none if they were too many.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TouchingRecord {
    pub(super) normals: Option<Vec<[f64; 3]>>,
}

/// An assembly by its handle: all that it was made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) enum SourceRecord {
    Given(AssemblyRecord),
    Revised(RevisionRecord),
}

/// As it was given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct AssemblyRecord {
    pub(super) name: String,
    pub(super) units: Option<String>,
    pub(super) parts: Vec<PartRecord>,
    pub(super) fixed: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct PartRecord {
    pub(super) name: String,
    pub(super) origin: String,
    pub(super) mesh: MeshRecord,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct MeshRecord {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// What differs from another assembly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct RevisionRecord {
    /// The handle of the other one.
    pub(super) base: [u8; 32],
    pub(super) replaced: Vec<(u32, MeshRecord)>,
    pub(super) moved: Vec<(u32, PoseRecord)>,
    pub(super) added: Vec<PartRecord>,
}

/// A healed mesh in its own frame, in lengths of the planning frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ShapeRecord {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// Inside is told by winding number.
    pub(super) winding: bool,
    /// Vertices of the convex hull.
    pub(super) hull: Vec<[f64; 3]>,
}

/// An assembly as it was taken in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct HealedRecord {
    pub(super) name: String,
    pub(super) units: Option<String>,
    pub(super) scale: f64,
    pub(super) parts: Vec<HealedPartRecord>,
    /// The contents of the distinct shapes.
    pub(super) shapes: Vec<[u8; 32]>,
    pub(super) fixed: Vec<u32>,
    pub(super) findings: Vec<(u32, String)>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct HealedPartRecord {
    pub(super) name: String,
    /// Its place among the shapes.
    pub(super) shape: u32,
    pub(super) planning_from_shape: PoseRecord,
    /// Least and greatest corner.
    pub(super) bounds: [[f64; 3]; 2],
    pub(super) moved: PoseRecord,
}

/// Vertices of a convex hull, and the hash of the points that it is of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct HullRecord {
    pub(super) points: [u8; 32],
    pub(super) vertices: Vec<[f64; 3]>,
}

/// Of the parts that one passed along a line, by hashes of how they stand and how far it went: whether it
/// entered them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct SweptRecord {
    /// Those that were looked at last come last.
    pub(super) past: Vec<([u8; 16], bool)>,
}

/// A plan in the messages that it was sent in; the last one ends it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct AnswerRecord {
    /// The request that asked, as it is encoded without what makes no other question.
    pub(super) question: Vec<u8>,
    pub(super) messages: Vec<Vec<u8>>,
}

impl Record for SourceRecord {}
impl Record for AnswerRecord {}
impl Record for ShapeRecord {}
impl Record for HealedRecord {}
impl Record for HullRecord {}
impl Record for SweptRecord {}
impl Record for OverlapRecord {}
impl Record for BlockingRecord {}
impl Record for WitnessRecord {}
impl Record for MotionRecord {}
impl Record for VerdictRecord {}
impl Record for PlanRecord {}
impl Record for TouchingRecord {}
