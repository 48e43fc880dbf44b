//! The summary that ends a plan, in C.

use std::ffi::c_char;

use sbdp_client::{PlanStatus, Stats, Summary};

use crate::options::{SbdpGroup, SbdpMovedPart};

/// How planning ended.
#[repr(u32)]
pub enum SbdpPlanStatus {
    /// Every requested part is out.
    Complete = 0,
    /// A budget was spent; the steps are the best so far.
    Partial = 1,
    /// It is proved that some parts cannot come off.
    Infeasible = 2,
    /// The deadline passed.
    Timeout = 3,
    /// The request was cancelled.
    Cancelled = 4,
    /// The search found nothing more to try, and nothing was proved.
    Exhausted = 5,
}

/// Parts that can begin to move together where nothing leaves.
#[repr(C)]
pub struct SbdpFreeGroup {
    /// The parts.
    pub parts: *const u32,
    /// How many.
    pub part_count: usize,
    /// The unit vector along which they begin, in the input's frame.
    pub direction: [f64; 3],
}

/// Why a part that remains did not move.
#[repr(C)]
pub struct SbdpBlocked {
    /// The part.
    pub part: u32,
    /// Zero.
    pub reserved: u32,
    /// The parts that block it.
    pub by: *const u32,
    /// How many.
    pub by_count: usize,
    /// The action, as `+x`.
    pub action: *const c_char,
}

/// A pair that overlaps at the assembled pose.
#[repr(C)]
pub struct SbdpOverlap {
    /// The two parts, smaller number first.
    pub parts: [u32; 2],
    /// How deep, in the input's units.
    pub depth: f64,
}

/// A finding about the input.
#[repr(C)]
pub struct SbdpWarning {
    /// The part that it is about; `UINT32_MAX` for none.
    pub part: u32,
    /// Zero.
    pub reserved: u32,
    /// What was found, and what was done about it.
    pub message: *const c_char,
}

/// Counters, and times in seconds.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpStats {
    /// Uses of the transition function by the search, remembered ones included.
    pub simulations: u64,
    /// Uses of the transition function that were computed.
    pub simulations_run: u64,
    /// Straight sweeps that proved a removal without simulation.
    pub sweeps: u64,
    /// States kept.
    pub states: u64,
    /// Building or loading distance fields.
    pub sdf_time_s: f64,
    /// Building blocking graphs.
    pub static_analysis_time_s: f64,
    /// Simulation.
    pub path_time_s: f64,
    /// Shortening and verification.
    pub verify_time_s: f64,
    /// From admission to the last step.
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

/// Everything about a plan except its steps. The library owns it and everything that it points to. Later versions may
/// add fields at its end. Texts are UTF-8.
#[repr(C)]
pub struct SbdpSummary {
    /// A `SbdpPlanStatus`.
    pub status: u32,
    /// How many steps there were.
    pub steps: u32,
    /// Whether it is an assembly plan.
    pub assembly: bool,
    /// Whether the request named targets.
    pub has_targets: bool,
    /// Why it is not complete, or null.
    pub reason: *const c_char,
    /// The planner's name.
    pub planner: *const c_char,
    /// The engine's name.
    pub engine: *const c_char,
    /// The unit of length, or null.
    pub units: *const c_char,
    /// Part names.
    pub parts: *const *const c_char,
    /// How many.
    pub part_count: usize,
    /// Parts that had been removed before.
    pub removed: *const u32,
    /// How many.
    pub removed_count: usize,
    /// Parts that must come out.
    pub targets: *const u32,
    /// How many.
    pub target_count: usize,
    /// Parts that may not move.
    pub fixed: *const u32,
    /// How many.
    pub fixed_count: usize,
    /// Parts that were to stay unless others could not leave otherwise.
    pub keep: *const u32,
    /// How many.
    pub keep_count: usize,
    /// The base: the parts that the rest is taken off.
    pub base: *const u32,
    /// How many.
    pub base_count: usize,
    /// Why the base was chosen; null where the request named it.
    pub base_reason: *const c_char,
    /// Parts that are in the assembly at the end (in an assembly plan: from the start).
    pub remaining: *const u32,
    /// How many.
    pub remaining_count: usize,
    /// Groups that left together and were not taken apart.
    pub kept_together: *const SbdpGroup,
    /// How many.
    pub kept_together_count: usize,
    /// Where nothing leaves any more: groups that can begin to move.
    pub free_together: *const SbdpFreeGroup,
    /// How many.
    pub free_together_count: usize,
    /// Parts that did not begin where their mesh was given.
    pub poses: *const SbdpMovedPart,
    /// How many.
    pub pose_count: usize,
    /// What blocks the parts that should have come off.
    pub blocked: *const SbdpBlocked,
    /// How many.
    pub blocked_count: usize,
    /// Overlaps at the assembled pose.
    pub overlaps: *const SbdpOverlap,
    /// How many.
    pub overlap_count: usize,
    /// Findings about the input.
    pub warnings: *const SbdpWarning,
    /// How many.
    pub warning_count: usize,
    /// Counters and times.
    pub stats: SbdpStats,
}

/// Texts that end with a zero byte, in one piece of memory.
#[derive(Default)]
struct Texts {
    bytes: Vec<u8>,
}

impl Texts {
    /// The place of a text. A zero byte in it would end it: it is replaced.
    fn add(&mut self, text: &str) -> usize {
        let place = self.bytes.len();
        match text.contains('\0') {
            true => self.bytes.extend_from_slice(text.replace('\0', "\u{fffd}").as_bytes()),
            false => self.bytes.extend_from_slice(text.as_bytes()),
        }
        self.bytes.push(0);
        place
    }

    /// A text by its place: once all are there, for they move.
    fn at(&self, place: usize) -> *const c_char {
        self.bytes.get(place..).map_or(std::ptr::null(), |text| text.as_ptr().cast())
    }
}

/// What the fields of a `SbdpSummary` point to.
pub(crate) struct HeldSummary {
    fields: SbdpSummary,
    held: (Summary, Texts, Lists),
}

struct Lists {
    parts: Vec<*const c_char>,
    kept_together: Vec<SbdpGroup>,
    free_together: Vec<SbdpFreeGroup>,
    poses: Vec<SbdpMovedPart>,
    blocked: Vec<SbdpBlocked>,
    overlaps: Vec<SbdpOverlap>,
    warnings: Vec<SbdpWarning>,
}

impl HeldSummary {
    pub(crate) fn new(summary: Summary) -> Self {
        let mut texts = Texts::default();
        let [planner, engine] = [&summary.planner, &summary.engine].map(|text| texts.add(text));
        let optional = [&summary.reason, &summary.units, &summary.base.reason];
        let [reason, units, base_reason] = optional.map(|text| text.as_ref().map(|text| texts.add(text)));
        let parts: Vec<usize> = summary.parts.iter().map(|name| texts.add(name)).collect();
        let actions: Vec<usize> = summary.blocked.iter().map(|b| texts.add(&b.action)).collect();
        let messages: Vec<usize> = summary.warnings.iter().map(|w| texts.add(&w.message)).collect();
        let at = |place: Option<usize>| place.map_or(std::ptr::null(), |place| texts.at(place));

        let lists = Lists {
            parts: parts.into_iter().map(|place| texts.at(place)).collect(),
            kept_together: summary.kept_together.iter().map(|parts| group(parts)).collect(),
            free_together: summary.free_together.iter().map(free_group).collect(),
            poses: summary
                .poses
                .iter()
                .map(|&(part, motion)| SbdpMovedPart { part, reserved: 0, motion })
                .collect(),
            blocked: summary
                .blocked
                .iter()
                .zip(actions)
                .map(|(b, action)| blocked(b, texts.at(action)))
                .collect(),
            overlaps: summary
                .overlaps
                .iter()
                .map(|o| SbdpOverlap { parts: o.parts, depth: o.depth })
                .collect(),
            warnings: (summary.warnings.iter().zip(messages))
                .map(|(w, message)| SbdpWarning {
                    part: w.part.unwrap_or(u32::MAX),
                    reserved: 0,
                    message: texts.at(message),
                })
                .collect(),
        };
        let targets = summary.targets.as_deref().unwrap_or_default();
        let fields = SbdpSummary {
            status: status(summary.status) as u32,
            steps: summary.steps,
            assembly: summary.assembly,
            has_targets: summary.targets.is_some(),
            reason: at(reason),
            planner: texts.at(planner),
            engine: texts.at(engine),
            units: at(units),
            parts: lists.parts.as_ptr(),
            part_count: lists.parts.len(),
            removed: summary.removed.as_ptr(),
            removed_count: summary.removed.len(),
            targets: targets.as_ptr(),
            target_count: targets.len(),
            fixed: summary.fixed.as_ptr(),
            fixed_count: summary.fixed.len(),
            keep: summary.keep.as_ptr(),
            keep_count: summary.keep.len(),
            base: summary.base.parts.as_ptr(),
            base_count: summary.base.parts.len(),
            base_reason: at(base_reason),
            remaining: summary.remaining.as_ptr(),
            remaining_count: summary.remaining.len(),
            kept_together: lists.kept_together.as_ptr(),
            kept_together_count: lists.kept_together.len(),
            free_together: lists.free_together.as_ptr(),
            free_together_count: lists.free_together.len(),
            poses: lists.poses.as_ptr(),
            pose_count: lists.poses.len(),
            blocked: lists.blocked.as_ptr(),
            blocked_count: lists.blocked.len(),
            overlaps: lists.overlaps.as_ptr(),
            overlap_count: lists.overlaps.len(),
            warnings: lists.warnings.as_ptr(),
            warning_count: lists.warnings.len(),
            stats: stats(&summary.stats),
        };
        // What is pointed to lies in vectors, and stays where it is when these move.
        Self { fields, held: (summary, texts, lists) }
    }

    pub(crate) fn summary(&self) -> &Summary {
        &self.held.0
    }

    pub(crate) fn to_c(&self) -> *const SbdpSummary {
        &raw const self.fields
    }
}

fn group(parts: &[u32]) -> SbdpGroup {
    SbdpGroup { parts: parts.as_ptr(), part_count: parts.len() }
}

fn free_group(group: &sbdp_client::FreeGroup) -> SbdpFreeGroup {
    SbdpFreeGroup { parts: group.parts.as_ptr(), part_count: group.parts.len(), direction: group.direction }
}

fn blocked(blocked: &sbdp_client::Blocked, action: *const c_char) -> SbdpBlocked {
    SbdpBlocked {
        part: blocked.part,
        reserved: 0,
        by: blocked.by.as_ptr(),
        by_count: blocked.by.len(),
        action,
    }
}

fn status(status: PlanStatus) -> SbdpPlanStatus {
    match status {
        PlanStatus::Complete => SbdpPlanStatus::Complete,
        PlanStatus::Partial => SbdpPlanStatus::Partial,
        PlanStatus::Infeasible => SbdpPlanStatus::Infeasible,
        PlanStatus::Timeout => SbdpPlanStatus::Timeout,
        PlanStatus::Cancelled => SbdpPlanStatus::Cancelled,
        PlanStatus::Exhausted => SbdpPlanStatus::Exhausted,
    }
}

fn stats(s: &Stats) -> SbdpStats {
    SbdpStats {
        simulations: s.simulations,
        simulations_run: s.simulations_run,
        sweeps: s.sweeps,
        states: s.states,
        sdf_time_s: s.sdf_time_s,
        static_analysis_time_s: s.static_analysis_time_s,
        path_time_s: s.path_time_s,
        verify_time_s: s.verify_time_s,
        total_time_s: s.total_time_s,
        sdf_hits: s.sdf_hits,
        blocking_hits: s.blocking_hits,
        graph_hits: s.graph_hits,
        motion_hits: s.motion_hits,
        plan_hit: s.plan_hit,
    }
}
