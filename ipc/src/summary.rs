//! The summary that ends a plan: everything but its steps.

pub mod report;

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, Text, TextWriter, Texts, Writer};
use crate::plan::{MovedPart, check_range, slice_of};
use report::{Report, ReportSections, ReportView};

/// Names of the plan statuses; the wire carries the index.
pub const STATUSES: [&str; 6] = ["complete", "partial", "infeasible", "timeout", "cancelled", "exhausted"];

/// The summary has a reason.
pub const SUMMARY_HAS_REASON: u32 = 1;
/// The assembly's unit of length is known.
pub const SUMMARY_HAS_UNITS: u32 = 2;
/// The list of targets is given; without it all parts had to come out.
pub const SUMMARY_HAS_TARGETS: u32 = 4;
/// The plan is an assembly plan.
pub const SUMMARY_ASSEMBLY: u32 = 8;
/// The daemon chose the base, and the reason is given.
pub const SUMMARY_HAS_BASE_REASON: u32 = 16;
/// How the parts stand is reported: there is a [`StabilityRecord`](report::StabilityRecord) for the state before the first
/// step, and one for the state after each step.
pub const SUMMARY_HAS_STABILITY: u32 = 32;
/// How near parts pass each other is reported: there is a [`ClearanceRecord`](report::ClearanceRecord) for each step.
pub const SUMMARY_HAS_CLEARANCE: u32 = 64;
/// The tools are reported: there is a [`FastenerRecord`](report::FastenerRecord) for each step.
pub const SUMMARY_HAS_TOOLS: u32 = 128;

/// A warning about the assembly as a whole, not about a part.
pub const NO_PART: u32 = u32::MAX;

/// Counters and times (in seconds).
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Stats {
    /// Uses of the transition function by the search, cached ones included.
    pub simulations: u64,
    /// Uses of the transition function that were computed.
    pub simulations_run: u64,
    /// Straight sweeps that proved a removal without simulation.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Building or loading distance fields, in seconds.
    pub sdf_time_s: f64,
    /// Building blocking graphs, in seconds.
    pub static_analysis_time_s: f64,
    /// Sweeps and the simulations that were used, in seconds; with several threads, the sum over these.
    pub path_time_s: f64,
    /// Shortening and verification of paths, in seconds.
    pub verify_time_s: f64,
    /// From admission to the last step, in seconds.
    pub total_time_s: f64,
    /// Distance fields found in the cache.
    pub sdf_hits: u64,
    /// Blocking relations found in the cache.
    pub blocking_hits: u64,
    /// States whose blocking graphs were found in the cache.
    pub graph_hits: u64,
    /// Motions found in the cache.
    pub motion_hits: u64,
    /// 1 if the whole plan was found in the cache.
    pub plan_hit: u64,
}

/// Header of a summary message. Sections follow in the order of the counts, then the texts.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct SummaryHeader {
    /// Index into [`STATUSES`].
    pub status: u32,
    /// [`SUMMARY_HAS_REASON`], [`SUMMARY_HAS_UNITS`], [`SUMMARY_HAS_TARGETS`], [`SUMMARY_ASSEMBLY`],
    /// [`SUMMARY_HAS_BASE_REASON`], [`SUMMARY_HAS_STABILITY`], [`SUMMARY_HAS_CLEARANCE`], [`SUMMARY_HAS_TOOLS`].
    pub flags: u32,
    /// How many steps were sent.
    pub steps: u32,
    /// How many part names follow ([`Text`]).
    pub parts: u32,
    /// How many overlaps follow ([`OverlapRecord`]).
    pub overlaps: u32,
    /// How many blocked parts follow ([`BlockedRecord`]).
    pub blocked: u32,
    /// How many warnings follow ([`WarningRecord`]).
    pub warnings: u32,
    /// How many parts were removed before (u32).
    pub removed: u32,
    /// How many targets follow (u32).
    pub targets: u32,
    /// How many fixed parts follow (u32).
    pub fixed: u32,
    /// How many parts remain (u32).
    pub remaining: u32,
    /// How many blockers follow, to which [`BlockedRecord`]s point (u32).
    pub blockers: u32,
    /// Bytes of text.
    pub text_bytes: u32,
    /// How many parts did not begin where their mesh was given ([`MovedPart`]).
    pub poses: u32,
    /// How many parts the base has (u32).
    pub base: u32,
    /// How many groups left together and were not taken apart ([`GroupRecord`]).
    pub kept_together: u32,
    /// How many groups can begin to move ([`GroupRecord`]).
    pub free_together: u32,
    /// How many numbers of parts follow, to which [`GroupRecord`]s point (u32).
    pub group_parts: u32,
    /// How many parts were to be kept (u32).
    pub keep: u32,
    /// How many states follow ([`StabilityRecord`](report::StabilityRecord)).
    pub states: u32,
    /// How many groups of connected parts fall in part ([`UnstableRecord`](report::UnstableRecord)).
    pub unstable: u32,
    /// How many parts fall ([`FallRecord`](report::FallRecord)).
    pub falls: u32,
    /// How many sets of parts to hold follow ([`HoldRecord`](report::HoldRecord)).
    pub holds: u32,
    /// How many steps follow with their clearance ([`ClearanceRecord`](report::ClearanceRecord)).
    pub clearances: u32,
    /// How many steps follow with their fastener ([`FastenerRecord`](report::FastenerRecord)).
    pub fasteners: u32,
    /// How many tools follow ([`ToolRecord`](report::ToolRecord)).
    pub tools: u32,
    /// How many numbers of parts follow, to which the records of the report point (u32).
    pub report_parts: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Why the plan is not complete; empty without [`SUMMARY_HAS_REASON`].
    pub reason: Text,
    /// The planner's name.
    pub planner: Text,
    /// The engine's name.
    pub engine: Text,
    /// The unit of length; empty without [`SUMMARY_HAS_UNITS`].
    pub units: Text,
    /// Why the base was chosen; empty without [`SUMMARY_HAS_BASE_REASON`], as where the request named it.
    pub base_reason: Text,
    /// Counters and times.
    pub stats: Stats,
}

/// A pair that overlaps at the assembled pose.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct OverlapRecord {
    /// The two parts, smaller first.
    pub parts: [u32; 2],
    /// How deep, in the input's units.
    pub depth: f64,
}

/// Why a part that remains did not move.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct BlockedRecord {
    /// The part.
    pub part: u32,
    /// Index of the first of its blockers.
    pub first_blocker: u32,
    /// How many blockers it has.
    pub blockers: u32,
    /// The blocked action, as `+x`.
    pub action: Text,
}

/// Parts that belong together.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct GroupRecord {
    /// Index of the first of its parts.
    pub first_part: u32,
    /// How many parts it has.
    pub parts: u32,
    /// Of a group that can begin to move, the unit vector along which it begins, in the input's frame; else zero.
    pub direction: [f64; 3],
}

/// Something the user should know about the input.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct WarningRecord {
    /// The part, or [`NO_PART`].
    pub part: u32,
    /// What was found.
    pub message: Text,
}

const _: () = {
    assert!(size_of::<Stats>() == 112 && size_of::<SummaryHeader>() == 264);
    assert!(std::mem::offset_of!(SummaryHeader, reason) == 112);
    assert!(std::mem::offset_of!(SummaryHeader, stats) == 152);
    assert!(size_of::<GroupRecord>() == 32 && std::mem::offset_of!(GroupRecord, direction) == 8);
    assert!(size_of::<OverlapRecord>() == 16 && size_of::<BlockedRecord>() == 20);
    assert!(size_of::<WarningRecord>() == 12);
};

/// A blocked part to be sent, or as received.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Blocked<'a> {
    /// The part.
    pub part: u32,
    /// The parts that block it.
    pub by: &'a [u32],
    /// The action, as `+x`.
    pub action: &'a str,
}

/// Parts that can begin to move together, as received.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeGroup<'a> {
    /// The parts.
    pub parts: &'a [u32],
    /// The unit vector along which they begin, in the input's frame.
    pub direction: [f64; 3],
}

/// A summary to be sent. Part numbers are indices into `parts`.
#[derive(Debug, Clone, Default)]
pub struct SummaryParts<'a> {
    /// The plan is an assembly plan.
    pub assembly: bool,
    /// Index into [`STATUSES`].
    pub status: u32,
    /// Steps that were sent.
    pub steps: u32,
    /// Why the plan is not complete.
    pub reason: Option<&'a str>,
    /// The planner's name.
    pub planner: &'a str,
    /// The engine's name.
    pub engine: &'a str,
    /// The unit of length.
    pub units: Option<&'a str>,
    /// Part names.
    pub parts: Vec<&'a str>,
    /// Overlaps.
    pub overlaps: Vec<OverlapRecord>,
    /// Blocked parts.
    pub blocked: Vec<(u32, Vec<u32>, &'a str)>,
    /// Warnings: part or [`NO_PART`], and text.
    pub warnings: Vec<(u32, &'a str)>,
    /// Parts removed before.
    pub removed: Vec<u32>,
    /// Targets; `None` for all.
    pub targets: Option<Vec<u32>>,
    /// Fixed parts.
    pub fixed: Vec<u32>,
    /// Parts that were to be kept.
    pub keep: Vec<u32>,
    /// The base, and why it was chosen; without a reason where the request named it.
    pub base: (Vec<u32>, Option<&'a str>),
    /// Parts that remain.
    pub remaining: Vec<u32>,
    /// Groups that left together and were not taken apart.
    pub kept_together: Vec<Vec<u32>>,
    /// Where nothing leaves any more: groups that can begin to move, and along which unit vectors.
    pub free_together: Vec<(Vec<u32>, [f64; 3])>,
    /// Parts that did not begin where their mesh was given, and where they began: the rigid motion of the mesh.
    pub poses: Vec<MovedPart>,
    /// What the plan means where it is carried out, if the request asks for it.
    pub report: Option<Report>,
    /// Counters and times.
    pub stats: Stats,
}

impl SummaryParts<'_> {
    /// The message's bytes.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let mut texts = TextWriter::default();
        let names: Vec<Text> = self.parts.iter().map(|n| texts.add(n)).collect();
        let mut blockers = Vec::new();
        let mut blocked = Vec::new();
        for (part, by, action) in &self.blocked {
            let (first, count) = (blockers.len() as u32, by.len() as u32);
            let action = texts.add(action);
            blocked.push(BlockedRecord { part: *part, first_blocker: first, blockers: count, action });
            blockers.extend_from_slice(by);
        }
        let warnings: Vec<WarningRecord> =
            self.warnings.iter().map(|(p, m)| WarningRecord { part: *p, message: texts.add(m) }).collect();
        let targets = self.targets.as_deref().unwrap_or(&[]);
        let mut group_parts = Vec::new();
        let mut group = |parts: &[u32], direction| {
            let first_part = group_parts.len() as u32;
            group_parts.extend_from_slice(parts);
            GroupRecord { first_part, parts: parts.len() as u32, direction }
        };
        let kept: Vec<_> = self.kept_together.iter().map(|parts| group(parts, [0.0; 3])).collect();
        let free: Vec<_> = self.free_together.iter().map(|(parts, along)| group(parts, *along)).collect();
        let header = SummaryHeader {
            status: self.status,
            flags: self.flags(),
            steps: self.steps,
            parts: names.len() as u32,
            overlaps: self.overlaps.len() as u32,
            blocked: blocked.len() as u32,
            warnings: warnings.len() as u32,
            removed: self.removed.len() as u32,
            targets: targets.len() as u32,
            fixed: self.fixed.len() as u32,
            remaining: self.remaining.len() as u32,
            blockers: blockers.len() as u32,
            poses: self.poses.len() as u32,
            base: self.base.0.len() as u32,
            kept_together: kept.len() as u32,
            free_together: free.len() as u32,
            group_parts: group_parts.len() as u32,
            keep: self.keep.len() as u32,
            reason: texts.add(self.reason.unwrap_or("")),
            planner: texts.add(self.planner),
            engine: texts.add(self.engine),
            units: texts.add(self.units.unwrap_or("")),
            base_reason: texts.add(self.base.1.unwrap_or("")),
            text_bytes: texts.bytes().len() as u32,
            stats: self.stats,
            ..SummaryHeader::default()
        };
        let report = self.report.as_ref().map(ReportSections::of).unwrap_or_default();
        let mut writer = Writer::default();
        writer
            .value(report.counted(header))
            .array(&names)
            .array(&self.overlaps)
            .array(&blocked)
            .array(&warnings);
        writer.array(&self.removed).array(targets).array(&self.fixed).array(&self.keep);
        writer.array(&self.base.0).array(&self.remaining);
        writer.array(&blockers).array(&self.poses).array(&kept).array(&free).array(&group_parts);
        report.write(&mut writer);
        writer.array(texts.bytes());
        writer.finish()
    }

    fn flags(&self) -> u32 {
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        flag(self.reason.is_some(), SUMMARY_HAS_REASON)
            | flag(self.units.is_some(), SUMMARY_HAS_UNITS)
            | flag(self.targets.is_some(), SUMMARY_HAS_TARGETS)
            | flag(self.base.1.is_some(), SUMMARY_HAS_BASE_REASON)
            | self.report.as_ref().map_or(0, Report::flags)
            | flag(self.assembly, SUMMARY_ASSEMBLY)
    }
}

/// A summary read in place.
#[derive(Debug, Clone, Copy)]
pub struct SummaryView<'a> {
    header: SummaryHeader,
    names: &'a [Text],
    overlaps: &'a [OverlapRecord],
    blocked: &'a [BlockedRecord],
    warnings: &'a [WarningRecord],
    removed: &'a [u32],
    targets: &'a [u32],
    fixed: &'a [u32],
    keep: &'a [u32],
    base: &'a [u32],
    remaining: &'a [u32],
    blockers: &'a [u32],
    poses: &'a [MovedPart],
    kept_together: &'a [GroupRecord],
    free_together: &'a [GroupRecord],
    group_parts: &'a [u32],
    texts: Texts<'a>,
    report: ReportView<'a>,
}

impl<'a> SummaryView<'a> {
    /// Checks all bounds and texts.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let header: SummaryHeader = reader.value("summary header")?;
        let view = Self {
            header,
            names: reader.array("part names", u64::from(header.parts))?,
            overlaps: reader.array("overlaps", u64::from(header.overlaps))?,
            blocked: reader.array("blocked", u64::from(header.blocked))?,
            warnings: reader.array("warnings", u64::from(header.warnings))?,
            removed: reader.array("removed", u64::from(header.removed))?,
            targets: reader.array("targets", u64::from(header.targets))?,
            fixed: reader.array("fixed", u64::from(header.fixed))?,
            keep: reader.array("keep", u64::from(header.keep))?,
            base: reader.array("base", u64::from(header.base))?,
            remaining: reader.array("remaining", u64::from(header.remaining))?,
            blockers: reader.array("blockers", u64::from(header.blockers))?,
            poses: reader.array("poses", u64::from(header.poses))?,
            kept_together: reader.array("kept together", u64::from(header.kept_together))?,
            free_together: reader.array("free together", u64::from(header.free_together))?,
            group_parts: reader.array("parts of groups", u64::from(header.group_parts))?,
            report: ReportView::read(&mut reader, &header)?,
            texts: Texts(reader.array("texts", u64::from(header.text_bytes))?),
        };
        view.check()?;
        Ok(view)
    }

    fn check(&self) -> Result<(), Malformed> {
        let h = &self.header;
        if h.status as usize >= STATUSES.len() {
            return Err(Malformed::OutOfRange { field: "status", value: u64::from(h.status) });
        }
        for text in [h.reason, h.planner, h.engine, h.units, h.base_reason].iter().chain(self.names) {
            self.texts.get(*text, "summary text")?;
        }
        for b in self.blocked {
            check_range("blockers", b.first_blocker, b.blockers, self.blockers.len())?;
            self.texts.get(b.action, "blocked action")?;
        }
        for w in self.warnings {
            self.texts.get(w.message, "warning")?;
        }
        for g in self.kept_together.iter().chain(self.free_together) {
            check_range("parts of a group", g.first_part, g.parts, self.group_parts.len())?;
        }
        self.check_part_numbers()
    }

    fn check_part_numbers(&self) -> Result<(), Malformed> {
        let count = self.names.len();
        let Self { removed, targets, fixed, keep, base, remaining, blockers, group_parts, .. } = *self;
        let lists = [removed, targets, fixed, keep, base, remaining, blockers, group_parts];
        let pairs = self.overlaps.iter().flat_map(|o| o.parts);
        let singles = self.blocked.iter().map(|b| b.part).chain(self.poses.iter().map(|p| p.part));
        let warned = self.warnings.iter().map(|w| w.part).filter(|p| *p != NO_PART);
        let listed = lists.into_iter().flatten().copied();
        match listed.chain(pairs).chain(singles).chain(warned).find(|p| *p as usize >= count) {
            Some(part) => Err(Malformed::OutOfRange { field: "part", value: u64::from(part) }),
            None => Ok(()),
        }
    }

    fn optional(&self, flag: u32, text: Text) -> Option<&'a str> {
        (self.header.flags & flag != 0).then(|| self.texts.get_checked(text))
    }

    /// Whether it is an assembly plan.
    #[must_use]
    pub fn is_assembly(&self) -> bool {
        self.header.flags & SUMMARY_ASSEMBLY != 0
    }

    /// `complete`, `partial`, `infeasible`, `timeout`, `cancelled` or `exhausted`.
    #[must_use]
    pub fn status(&self) -> &'static str {
        STATUSES.get(self.header.status as usize).copied().unwrap_or("partial")
    }

    /// Steps that were sent.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.header.steps
    }

    /// Why the plan is not complete.
    #[must_use]
    pub fn reason(&self) -> Option<&'a str> {
        self.optional(SUMMARY_HAS_REASON, self.header.reason)
    }

    /// The planner's name.
    #[must_use]
    pub fn planner(&self) -> &'a str {
        self.texts.get_checked(self.header.planner)
    }

    /// The engine's name.
    #[must_use]
    pub fn engine(&self) -> &'a str {
        self.texts.get_checked(self.header.engine)
    }

    /// The unit of length.
    #[must_use]
    pub fn units(&self) -> Option<&'a str> {
        self.optional(SUMMARY_HAS_UNITS, self.header.units)
    }

    /// Parts that were to be kept.
    #[must_use]
    pub fn keep(&self) -> &'a [u32] {
        self.keep
    }

    /// The base: the parts that the rest is taken off.
    #[must_use]
    pub fn base(&self) -> &'a [u32] {
        self.base
    }

    /// Why the base was chosen; `None` where the request named it.
    #[must_use]
    pub fn base_reason(&self) -> Option<&'a str> {
        self.optional(SUMMARY_HAS_BASE_REASON, self.header.base_reason)
    }

    /// How many parts the assembly has.
    #[must_use]
    pub fn part_count(&self) -> usize {
        self.names.len()
    }

    /// A part's name.
    #[must_use]
    pub fn part_name(&self, part: u32) -> Option<&'a str> {
        self.names.get(part as usize).map(|t| self.texts.get_checked(*t))
    }

    /// All part names; every part number points here.
    pub fn part_names(&self) -> impl Iterator<Item = &'a str> + '_ {
        self.names.iter().map(|t| self.texts.get_checked(*t))
    }

    /// Parts that had been removed before.
    #[must_use]
    pub fn removed(&self) -> &'a [u32] {
        self.removed
    }

    /// Parts that must come out; `None` for all.
    #[must_use]
    pub fn targets(&self) -> Option<&'a [u32]> {
        (self.header.flags & SUMMARY_HAS_TARGETS != 0).then_some(self.targets)
    }

    /// Parts that may not move.
    #[must_use]
    pub fn fixed(&self) -> &'a [u32] {
        self.fixed
    }

    /// Parts that remain in the assembly.
    #[must_use]
    pub fn remaining(&self) -> &'a [u32] {
        self.remaining
    }

    /// Parts that did not begin where their mesh was given, and where they began: the rigid motion of the mesh.
    #[must_use]
    pub fn poses(&self) -> &'a [MovedPart] {
        self.poses
    }

    fn group(&self, group: &GroupRecord) -> &'a [u32] {
        slice_of(self.group_parts, group.first_part, group.parts)
    }

    /// Groups that left together and were not taken apart: this was not required, or no way was found.
    pub fn kept_together(&self) -> impl Iterator<Item = &'a [u32]> + '_ {
        self.kept_together.iter().map(|group| self.group(group))
    }

    /// Where nothing leaves any more: groups that can begin to move.
    pub fn free_together(&self) -> impl Iterator<Item = FreeGroup<'a>> + '_ {
        self.free_together.iter().map(|g| FreeGroup { parts: self.group(g), direction: g.direction })
    }

    /// What blocks the parts that should have come off.
    pub fn blocked(&self) -> impl Iterator<Item = Blocked<'a>> + '_ {
        self.blocked.iter().map(|b| Blocked {
            part: b.part,
            by: slice_of(self.blockers, b.first_blocker, b.blockers),
            action: self.texts.get_checked(b.action),
        })
    }

    /// Overlaps at the assembled pose.
    #[must_use]
    pub fn overlaps(&self) -> &'a [OverlapRecord] {
        self.overlaps
    }

    /// Findings about the input: the part, if one, and the text.
    pub fn warnings(&self) -> impl Iterator<Item = (Option<u32>, &'a str)> + '_ {
        self.warnings
            .iter()
            .map(|w| ((w.part != NO_PART).then_some(w.part), self.texts.get_checked(w.message)))
    }

    /// What the plan means where it is carried out, as far as the request asks for it.
    #[must_use]
    pub fn report(&self) -> ReportView<'a> {
        self.report
    }

    /// Counters and times.
    #[must_use]
    pub fn stats(&self) -> Stats {
        self.header.stats
    }
}
