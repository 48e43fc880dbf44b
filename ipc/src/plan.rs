//! Plan requests, and steps as they stream back.

use std::mem::offset_of;
use std::num::NonZeroU32;

use bytemuck::{Pod, Zeroable};

use crate::bytes::{Malformed, Reader, Writer};

/// `[x, y, z, qw, qx, qy, qz]` in the input's units and frame.
pub type Waypoint = [f64; 7];

/// Neither read nor write the cache.
pub const PLAN_NO_CACHE: u32 = 1;
/// The list of targets is given (it may be empty); without it, all parts must come out.
pub const PLAN_HAS_TARGETS: u32 = 2;

/// Remove parts that leave straight by a sweep, without simulation.
pub const PLAN_SWEEPS: u32 = 4;
/// Simulate parts that leave straight, too. Without this and [`PLAN_SWEEPS`] the daemon decides; both together are
/// malformed.
pub const PLAN_NO_SWEEPS: u32 = 8;

/// No one waits for this plan: requests without this flag come first.
pub const PLAN_BATCH: u32 = 16;

/// Make an assembly plan: the disassembly reversed, with each part's path from where it waits.
pub const PLAN_ASSEMBLY: u32 = 32;
/// The parts of the assembly plan wait nowhere: each begins where its insertion begins. Malformed without
/// [`PLAN_ASSEMBLY`], and with places where parts wait (`staged`).
pub const PLAN_NO_STAGING: u32 = 64;

/// Send the events of the search, too. The search then runs even if the plan is remembered.
pub const PLAN_TRACE: u32 = 128;
/// The header's `end_gap` is given.
pub const PLAN_HAS_END_GAP: u32 = 256;
/// The header's `up` is given.
pub const PLAN_HAS_UP: u32 = 512;
/// Report how the parts stand before the first step and after each step.
pub const PLAN_REPORT_STABILITY: u32 = 1024;
/// Report how near each step passes other parts.
pub const PLAN_REPORT_CLEARANCE: u32 = 2048;
/// Report which tools turn the fasteners that the steps take off.
pub const PLAN_REPORT_TOOLS: u32 = 4096;
/// Put the steps into an order in which few parts have to be held at once, with the header's `hands` as a limit.
pub const PLAN_STEADY: u32 = 8192;

/// Names of the planners; the wire carries the index.
pub const PLANNERS: [&str; 7] = ["sbdp-star", "sbdp", "pdp-t", "pdp-r", "pdp-star", "rrt", "bk-rrt"];
/// Names of the engines; the wire carries the index.
pub const ENGINES: [&str; 2] = ["sliding", "penalty"];
/// Names of the action sets; the wire carries the index.
pub const ACTION_SETS: [&str; 2] = ["paper", "extended"];
/// Names of the rules that begin blocking graphs; the wire carries the index.
pub const STATIC_ANALYSES: [&str; 2] = ["sliding", "paper"];
/// Names of the parameters of the engine `penalty`; the wire carries the index.
pub const PENALTY_PARAMETERS: [&str; 16] = [
    "time-step",
    "planning-time-step",
    "stiffness",
    "damping",
    "penetration-threshold",
    "force",
    "torque-factor",
    "similar-translation",
    "similar-rotation",
    "longest-edge",
    "yielding",
    "share-of-extent",
    "steps-per-waypoint",
    "most-blocks",
    "newton-iterations",
    "newton-tolerance",
];

/// Header of a plan request; six lists of u32 part numbers follow: fixed, removed, targets, base, keep, keep_out; then the sizes
/// of the groups (u32) and their parts (u32), group after group; then [`MovedPart`]s: those that stand elsewhere, and
/// those that wait at given places; then [`PenaltyRecord`]s.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PlanRequestHeader {
    /// Handle of the assembly.
    pub handle: [u8; 32],
    /// Index into [`PLANNERS`].
    pub planner: u32,
    /// Index into [`ENGINES`].
    pub engine: u32,
    /// Index into [`ACTION_SETS`].
    pub actions: u32,
    /// [`PLAN_NO_CACHE`], [`PLAN_HAS_TARGETS`], [`PLAN_SWEEPS`], [`PLAN_NO_SWEEPS`], [`PLAN_BATCH`],
    /// [`PLAN_ASSEMBLY`], [`PLAN_NO_STAGING`], [`PLAN_TRACE`], [`PLAN_HAS_END_GAP`], [`PLAN_HAS_UP`],
    /// [`PLAN_REPORT_STABILITY`], [`PLAN_REPORT_CLEARANCE`], [`PLAN_REPORT_TOOLS`], [`PLAN_STEADY`].
    pub flags: u32,
    /// Threads for this request; 0 leaves it to the daemon.
    pub threads: u32,
    /// How many parts may not move.
    pub fixed: u32,
    /// How many parts are already removed.
    pub removed: u32,
    /// How many parts must come out.
    pub targets: u32,
    /// How many parts stay as long as others leave.
    pub base: u32,
    /// How many parts stand elsewhere than in the assembly.
    pub moved: u32,
    /// How many parts of an assembly plan wait at given places; the others are laid out.
    pub staged: u32,
    /// Index into [`STATIC_ANALYSES`].
    pub static_analysis: u32,
    /// How many parameters of the engine `penalty` differ from the paper's.
    pub penalty: u32,
    /// How many groups should leave as wholes.
    pub groups: u32,
    /// How many parts stay unless others cannot leave otherwise.
    pub keep: u32,
    /// With [`PLAN_STEADY`]: how many parts hands can hold at once, the one that moves included; 0 for any number. 0 without
    /// it.
    pub hands: u32,
    /// How many parts are in the way and do not come apart.
    pub keep_out: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// The deadline of the answer, in nanoseconds of CLOCK_MONOTONIC; 0 for none.
    pub deadline_ns: u64,
    /// Simulations after which to give up; `u64::MAX` for no limit.
    pub max_simulations: u64,
    /// Nanoseconds after which one motion, or a baseline's search for one part, is given up; `u64::MAX` for no limit.
    pub path_timeout_ns: u64,
    /// Nanoseconds of planning, verification not counted, after which to answer with the plan so far; `u64::MAX` for no
    /// limit.
    pub planning_timeout_ns: u64,
    /// Seed of the random poses of `rrt` and `bk-rrt`.
    pub seed: u64,
    /// The gap between hulls where a path out ends, in the input's units; ignored without [`PLAN_HAS_END_GAP`].
    pub end_gap: f64,
    /// The direction up, in the input's frame, of any length but 0; ignored without [`PLAN_HAS_UP`].
    pub up: [f64; 3],
    /// The coefficient of friction of all contacts, from 0 up; 0 without [`PLAN_REPORT_STABILITY`] and [`PLAN_STEADY`].
    pub friction: f64,
    /// The direction against gravity, in the input's frame, of any length but 0; 0 without [`PLAN_REPORT_STABILITY`] and
    /// [`PLAN_STEADY`].
    pub against_gravity: [f64; 3],
    /// The distance that parts keep from what they pass, in the input's units; 0 for none.
    pub clearance: f64,
}

/// A parameter of the engine `penalty`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PenaltyRecord {
    /// Index into [`PENALTY_PARAMETERS`].
    pub parameter: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Its value.
    pub value: f64,
}

/// A part that stands elsewhere, or waits somewhere.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct MovedPart {
    /// Number of the part.
    pub part: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// The rigid motion of its mesh (x, y, z, qw, qx, qy, qz; input units and frame): of a part that stands elsewhere
    /// from where the assembly has it, of one that waits from where it was given.
    pub motion: Waypoint,
}

/// `of` of a step whose parts leave the assembly, or enter it.
pub const NO_STEP: u32 = u32::MAX;

/// One step's entry in the table.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct StepRecord {
    /// Index of the first of the parts that move, in the message's parts.
    pub first_part: u32,
    /// How many parts move in this step, at least one.
    pub parts: u32,
    /// Number of the step that removes, or inserts, the group to which these parts belong; or [`NO_STEP`].
    pub of: u32,
    /// Where the step leaves its parts: a [`StepEnd`].
    pub ends: u32,
    /// 0 if the path only translates the parts, 1 if it turns them.
    pub motion: u32,
    /// Index of the first waypoint in the message's waypoints.
    pub first_waypoint: u32,
    /// How many waypoints this step has.
    pub waypoints: u32,
    /// Index of the first number of a step in the message's requirements.
    pub first_requirement: u32,
    /// How many requirements this step has.
    pub requirements: u32,
    /// The earliest round, from 0, in which the step can be done, if every step is done as soon as possible.
    pub wave: u32,
    /// Deepest penetration found by verification beyond the assembled depth, in the input's units.
    pub verified_depth: f64,
    /// The unit vector of the path's last leg, in the input's frame; zero where that only turns, or there is none.
    pub direction: [f64; 3],
}

/// Header of a steps message; records, waypoints, requirements and parts follow.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct StepsHeader {
    /// How many steps the message has.
    pub steps: u32,
    /// Number of the first of them: its place in the plan, from 0.
    pub first_step: u32,
    /// How many waypoints the message has.
    pub waypoints: u32,
    /// How many requirements the message has.
    pub requirements: u32,
    /// How many numbers of parts the message has; a part that moves in several steps counts for each.
    pub parts: u32,
    /// Reserved, 0.
    pub reserved: u32,
}

const _: () = {
    assert!(size_of::<PlanRequestHeader>() == 216 && align_of::<PlanRequestHeader>() == 8);
    assert!(offset_of!(PlanRequestHeader, planner) == 32);
    assert!(offset_of!(PlanRequestHeader, moved) == 68);
    assert!(offset_of!(PlanRequestHeader, static_analysis) == 76);
    assert!(offset_of!(PlanRequestHeader, deadline_ns) == 104);
    assert!(offset_of!(PlanRequestHeader, up) == 152 && offset_of!(PlanRequestHeader, friction) == 176);
    assert!(size_of::<PenaltyRecord>() == 16 && offset_of!(PenaltyRecord, value) == 8);
    assert!(size_of::<MovedPart>() == 64 && offset_of!(MovedPart, motion) == 8);
    assert!(size_of::<StepRecord>() == 72 && align_of::<StepRecord>() == 8);
    assert!(offset_of!(StepRecord, of) == 8);
    assert!(offset_of!(StepRecord, first_requirement) == 28);
    assert!(offset_of!(StepRecord, verified_depth) == 40);
    assert!(offset_of!(StepRecord, direction) == 48);
    assert!(size_of::<StepsHeader>() == 24 && offset_of!(StepsHeader, parts) == 16);
    assert!(size_of::<Waypoint>() == 56);
};

/// Where the parts of an assembly plan begin.
#[derive(Debug, Clone, PartialEq)]
pub enum Staging {
    /// Each where its insertion begins; it is not there before its turn.
    None,
    /// Laid out beside the assembly, except for these.
    Beside(Vec<MovedPart>),
}

/// What to report about each step of a plan besides its path.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reports {
    /// What falls before the first step and after each step, and what to hold.
    pub stability: bool,
    /// How near it passes other parts.
    pub clearance: bool,
    /// Which tools turn the fastener that it takes off.
    pub tools: bool,
}

/// An order of steps in which few parts have to be held at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Steady {
    /// How many parts hands can hold at once, the one that moves included; `None` for any number. A plan ends before the
    /// first step that needs more.
    pub hands: Option<NonZeroU32>,
}

/// What it depends on how parts stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gravity {
    /// The direction against gravity, in the input's frame, of any length but 0.
    pub up: [f64; 3],
    /// The coefficient of friction of all contacts, from 0 up.
    pub friction: f64,
}

impl Default for Gravity {
    /// Up is +z, and dry machined steel at the lower end slides.
    fn default() -> Self {
        Self { up: [0.0, 0.0, 1.0], friction: FRICTION }
    }
}

/// The coefficient of friction where none is given: dry machined steel at the lower end; 0.05 is oiled steel, 0.5 rubber.
pub const FRICTION: f64 = 0.2;

/// A plan request, owned.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanRequest {
    /// The assembly's handle.
    pub handle: [u8; 32],
    /// Index into [`PLANNERS`].
    pub planner: u32,
    /// Index into [`ENGINES`].
    pub engine: u32,
    /// Index into [`ACTION_SETS`].
    pub actions: u32,
    /// Index into [`STATIC_ANALYSES`].
    pub static_analysis: u32,
    /// Parameters of the engine `penalty` that differ from the paper's.
    pub penalty: Vec<PenaltyRecord>,
    /// Whether parts that leave straight are removed without simulation; `None` leaves it to the
    /// daemon.
    pub sweeps: Option<bool>,
    /// Send the events of the search, too.
    pub trace: bool,
    /// Neither read nor write the cache.
    pub no_cache: bool,
    /// Other requests come first: no one waits for this plan.
    pub batch: bool,
    /// The number of threads; 0 leaves it to the daemon.
    pub threads: u32,
    /// The deadline, in nanoseconds of CLOCK_MONOTONIC.
    pub deadline_ns: Option<u64>,
    /// Seed of the random poses of `rrt` and `bk-rrt`.
    pub seed: u64,
    /// The gap between a part's hull and that of the rest where its path out ends, in the input's units; `None` leaves
    /// it to the daemon.
    pub end_gap: Option<f64>,
    /// The distance that parts keep from what they pass on their way, in the input's units, at least 0. Pairs that are nearer as
    /// they stand keep half of what they have.
    pub clearance: f64,
    /// The direction up, in the input's frame, of any length but 0; `None` leaves it to the daemon.
    pub up: Option<[f64; 3]>,
    /// Simulations after which to give up.
    pub max_simulations: Option<u64>,
    /// Nanoseconds after which one motion, or a baseline's search for one part, is given up.
    pub path_timeout_ns: Option<u64>,
    /// Nanoseconds of planning, verification not counted, after which to answer with the plan so far.
    pub planning_timeout_ns: Option<u64>,
    /// Parts that may not move.
    pub fixed: Vec<u32>,
    /// Parts that are already removed.
    pub removed: Vec<u32>,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<u32>>,
    /// Parts that stay as long as others leave; if there are none, the daemon chooses one.
    pub base: Vec<u32>,
    /// Parts that stay unless others that are asked for cannot leave otherwise; they are not asked for.
    pub keep: Vec<u32>,
    /// Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base.
    pub keep_out: Vec<u32>,
    /// Groups that should leave as wholes, to be taken apart afterwards.
    pub groups: Vec<Vec<u32>>,
    /// Parts that stand elsewhere than in the assembly.
    pub moved: Vec<MovedPart>,
    /// Make an assembly plan, with parts that begin there.
    pub assembly: Option<Staging>,
    /// What to report about each step.
    pub reports: Reports,
    /// Put the steps into an order in which few parts have to be held at once.
    pub steady: Option<Steady>,
    /// What it depends on how parts stand: for `reports.stability` and `steady`.
    pub gravity: Gravity,
}

impl PlanRequest {
    /// The message's bytes.
    #[must_use]
    pub fn encode(&self) -> Vec<u8> {
        let targets = self.targets.as_deref().unwrap_or(&[]);
        let flag = |set: bool, bit: u32| if set { bit } else { 0 };
        let staged = match &self.assembly {
            Some(Staging::Beside(staged)) => &staged[..],
            _ => &[],
        };
        let gravity = (self.reports.stability || self.steady.is_some()).then_some(self.gravity);
        let mut writer = Writer::default();
        writer.value(PlanRequestHeader {
            handle: self.handle,
            planner: self.planner,
            engine: self.engine,
            actions: self.actions,
            flags: flag(self.no_cache, PLAN_NO_CACHE)
                | flag(self.batch, PLAN_BATCH)
                | flag(self.trace, PLAN_TRACE)
                | flag(self.end_gap.is_some(), PLAN_HAS_END_GAP)
                | flag(self.up.is_some(), PLAN_HAS_UP)
                | flag(self.steady.is_some(), PLAN_STEADY)
                | flag(self.reports.stability, PLAN_REPORT_STABILITY)
                | flag(self.reports.clearance, PLAN_REPORT_CLEARANCE)
                | flag(self.reports.tools, PLAN_REPORT_TOOLS)
                | flag(self.targets.is_some(), PLAN_HAS_TARGETS)
                | flag(self.assembly.is_some(), PLAN_ASSEMBLY)
                | flag(matches!(self.assembly, Some(Staging::None)), PLAN_NO_STAGING)
                | self.sweeps.map_or(0, |s| if s { PLAN_SWEEPS } else { PLAN_NO_SWEEPS }),
            threads: self.threads,
            fixed: self.fixed.len() as u32,
            removed: self.removed.len() as u32,
            targets: targets.len() as u32,
            base: self.base.len() as u32,
            moved: self.moved.len() as u32,
            staged: staged.len() as u32,
            static_analysis: self.static_analysis,
            penalty: self.penalty.len() as u32,
            groups: self.groups.len() as u32,
            keep: self.keep.len() as u32,
            hands: self.steady.and_then(|steady| steady.hands).map_or(0, NonZeroU32::get),
            keep_out: self.keep_out.len() as u32,
            reserved: 0,
            deadline_ns: self.deadline_ns.unwrap_or(0),
            max_simulations: self.max_simulations.unwrap_or(u64::MAX),
            path_timeout_ns: self.path_timeout_ns.unwrap_or(u64::MAX),
            planning_timeout_ns: self.planning_timeout_ns.unwrap_or(u64::MAX),
            seed: self.seed,
            end_gap: self.end_gap.unwrap_or(0.0),
            up: self.up.unwrap_or_default(),
            friction: gravity.map_or(0.0, |gravity| gravity.friction),
            against_gravity: gravity.map_or([0.0; 3], |gravity| gravity.up),
            clearance: self.clearance,
        });
        let sizes: Vec<u32> = self.groups.iter().map(|group| group.len() as u32).collect();
        writer.array(&self.fixed).array(&self.removed).array(targets).array(&self.base);
        writer.array(&self.keep).array(&self.keep_out);
        writer.array(&sizes).array(&self.groups.concat());
        writer.array(&self.moved).array(staged).array(&self.penalty);
        writer.finish()
    }

    /// Reads a request.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn decode(bytes: &[u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let h: PlanRequestHeader = reader.value("plan request header")?;
        let fixed = reader.array::<u32>("fixed", u64::from(h.fixed))?.to_vec();
        let removed = reader.array::<u32>("removed", u64::from(h.removed))?.to_vec();
        let targets = reader.array::<u32>("targets", u64::from(h.targets))?.to_vec();
        let base = reader.array::<u32>("base", u64::from(h.base))?.to_vec();
        let keep = reader.array::<u32>("keep", u64::from(h.keep))?.to_vec();
        let keep_out = reader.array::<u32>("keep_out", u64::from(h.keep_out))?.to_vec();
        let sizes = reader.array::<u32>("groups", u64::from(h.groups))?;
        let in_groups = sizes.iter().map(|&size| u64::from(size)).sum();
        let mut in_groups = reader.array::<u32>("parts of groups", in_groups)?;
        let groups = sizes.iter().map(|&size| {
            let (group, rest) = in_groups.split_at(size as usize);
            in_groups = rest;
            group.to_vec()
        });
        let groups = groups.collect();
        let moved = reader.array::<MovedPart>("moved", u64::from(h.moved))?.to_vec();
        let staged = reader.array::<MovedPart>("staged", u64::from(h.staged))?.to_vec();
        let penalty = reader.array::<PenaltyRecord>("penalty", u64::from(h.penalty))?.to_vec();
        const KNOWN: u32 = PLAN_NO_CACHE
            | PLAN_HAS_TARGETS
            | PLAN_SWEEPS
            | PLAN_NO_SWEEPS
            | PLAN_BATCH
            | PLAN_ASSEMBLY
            | PLAN_NO_STAGING
            | PLAN_TRACE
            | PLAN_HAS_END_GAP
            | PLAN_HAS_UP
            | PLAN_REPORT_STABILITY
            | PLAN_REPORT_CLEARANCE
            | PLAN_REPORT_TOOLS
            | PLAN_STEADY;
        let limit = |value: u64| (value != u64::MAX).then_some(value);
        let set = |bit: u32| h.flags & bit != 0;
        let astray = (set(PLAN_NO_STAGING) || !staged.is_empty()) && !set(PLAN_ASSEMBLY);
        let both = set(PLAN_NO_STAGING) && !staged.is_empty();
        if h.hands != 0 && !set(PLAN_STEADY) {
            return Err(Malformed::OutOfRange { field: "hands", value: u64::from(h.hands) });
        }
        if set(!KNOWN) || (set(PLAN_SWEEPS) && set(PLAN_NO_SWEEPS)) || astray || both {
            return Err(Malformed::OutOfRange { field: "flags", value: u64::from(h.flags) });
        }
        Ok(Self {
            handle: h.handle,
            planner: h.planner,
            engine: h.engine,
            actions: h.actions,
            static_analysis: h.static_analysis,
            penalty,
            sweeps: (set(PLAN_SWEEPS) || set(PLAN_NO_SWEEPS)).then_some(set(PLAN_SWEEPS)),
            no_cache: set(PLAN_NO_CACHE),
            batch: set(PLAN_BATCH),
            trace: set(PLAN_TRACE),
            threads: h.threads,
            deadline_ns: (h.deadline_ns != 0).then_some(h.deadline_ns),
            max_simulations: limit(h.max_simulations),
            path_timeout_ns: limit(h.path_timeout_ns),
            planning_timeout_ns: limit(h.planning_timeout_ns),
            seed: h.seed,
            end_gap: set(PLAN_HAS_END_GAP).then_some(h.end_gap),
            clearance: h.clearance,
            up: set(PLAN_HAS_UP).then_some(h.up),
            fixed,
            removed,
            targets: set(PLAN_HAS_TARGETS).then_some(targets),
            base,
            keep,
            keep_out,
            groups,
            moved,
            assembly: set(PLAN_ASSEMBLY).then_some(if set(PLAN_NO_STAGING) {
                Staging::None
            } else {
                Staging::Beside(staged)
            }),
            steady: set(PLAN_STEADY).then_some(Steady { hands: NonZeroU32::new(h.hands) }),
            gravity: if set(PLAN_REPORT_STABILITY) || set(PLAN_STEADY) {
                Gravity { up: h.against_gravity, friction: h.friction }
            } else {
                Gravity::default()
            },
            reports: Reports {
                stability: set(PLAN_REPORT_STABILITY),
                clearance: set(PLAN_REPORT_CLEARANCE),
                tools: set(PLAN_REPORT_TOOLS),
            },
        })
    }
}

/// Where a step leaves its parts; the wire carries the number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u32)]
pub enum StepEnd {
    /// Clear of everything that they stood with.
    #[default]
    Out = 0,
    /// Elsewhere among the others, where they stay until a later step moves them again.
    Aside = 1,
    /// In their places: in assembly plans.
    In = 2,
}

impl StepEnd {
    /// The end with a number, if it is known.
    #[must_use]
    pub fn from_wire(number: u32) -> Option<Self> {
        [Self::Out, Self::Aside, Self::In].into_iter().find(|end| *end as u32 == number)
    }
}

/// A step to be sent.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Step {
    /// The parts that move, as one rigid body; at least one.
    pub parts: Vec<u32>,
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts belong;
    /// `None` for parts that leave the assembly, or enter it.
    pub of: Option<u32>,
    /// Where the step leaves them.
    pub ends: StepEnd,
    /// The path turns the parts.
    pub rotates: bool,
    /// The path.
    pub path: Vec<Waypoint>,
    /// Deepest penetration beyond the assembled depth.
    pub verified_depth: f64,
    /// Numbers of the steps that must be done before this exact path is free, ascending.
    pub requires: Vec<u32>,
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: u32,
    /// The unit vector of the path's last leg, in the input's frame; `None` where that only turns, or there is none.
    pub direction: Option<[f64; 3]>,
}

impl Step {
    /// An upper bound of the bytes that this step adds to a steps message.
    #[must_use]
    pub fn wire_bytes(&self) -> usize {
        let numbers = self.requires.len() + self.parts.len();
        size_of::<StepRecord>() + self.path.len() * size_of::<Waypoint>() + numbers * 4 + 16
    }
}

/// The bytes of a steps message; `first_step` is the place of its first step in the plan.
#[must_use]
pub fn encode_steps<'s>(first_step: u32, steps: impl IntoIterator<Item = &'s Step>) -> Vec<u8> {
    let (mut records, mut waypoints) = (Vec::new(), Vec::<Waypoint>::new());
    let (mut requirements, mut parts) = (Vec::<u32>::new(), Vec::<u32>::new());
    for step in steps {
        records.push(StepRecord {
            first_part: parts.len() as u32,
            parts: step.parts.len() as u32,
            of: step.of.unwrap_or(NO_STEP),
            ends: step.ends as u32,
            motion: u32::from(step.rotates),
            first_waypoint: waypoints.len() as u32,
            waypoints: step.path.len() as u32,
            first_requirement: requirements.len() as u32,
            requirements: step.requires.len() as u32,
            wave: step.wave,
            verified_depth: step.verified_depth,
            direction: step.direction.unwrap_or_default(),
        });
        waypoints.extend_from_slice(&step.path);
        requirements.extend_from_slice(&step.requires);
        parts.extend_from_slice(&step.parts);
    }
    let mut writer = Writer::default();
    writer.value(StepsHeader {
        steps: records.len() as u32,
        first_step,
        waypoints: waypoints.len() as u32,
        requirements: requirements.len() as u32,
        parts: parts.len() as u32,
        reserved: 0,
    });
    writer.array(&records).array(&waypoints).array(&requirements).array(&parts);
    writer.finish()
}

/// Steps read in place; borrows the received bytes.
#[derive(Debug, Clone, Copy, Default)]
pub struct StepsView<'a> {
    first_step: u32,
    records: &'a [StepRecord],
    waypoints: &'a [Waypoint],
    requirements: &'a [u32],
    parts: &'a [u32],
}

/// One step read in place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepView<'a> {
    /// Its place in the plan.
    pub number: u32,
    /// The parts that move, as one rigid body, in shared memory; all others that stand with them stay where they are.
    pub parts: &'a [u32],
    /// The number of the step that removes (in an assembly plan: inserts) the group to which these parts belong;
    /// `None` for parts that leave the assembly, or enter it. A group is taken apart as it stood in the assembly.
    pub of: Option<u32>,
    /// Where the step leaves them.
    pub ends: StepEnd,
    /// The path turns the parts.
    pub rotates: bool,
    /// The path, in shared memory: rigid transforms of the parts as they stand when the step begins (of an assembly
    /// plan: when it ends), so that the first (the last) is the identity.
    pub path: &'a [Waypoint],
    /// Deepest penetration beyond the assembled depth.
    pub verified_depth: f64,
    /// Numbers of the steps that must be done before this exact path is free, ascending.
    pub requires: &'a [u32],
    /// The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
    pub wave: u32,
    /// The unit vector of the path's last leg, in the input's frame; `None` where that only turns, or there is none.
    pub direction: Option<[f64; 3]>,
}

impl<'a> StepsView<'a> {
    /// Checks all bounds, and that each step moves a part, is not its own group, and ends in a known way.
    ///
    /// # Errors
    /// The message is malformed.
    pub fn new(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let view = Self::sections(bytes)?;
        for (number, record) in (u64::from(view.first_step)..).zip(view.records) {
            check_range("step waypoints", record.first_waypoint, record.waypoints, view.waypoints.len())?;
            let (first, count) = (record.first_requirement, record.requirements);
            check_range("step requirements", first, count, view.requirements.len())?;
            check_range("step parts", record.first_part, record.parts, view.parts.len())?;
            let illegal = |field, value: u32| Err(Malformed::OutOfRange { field, value: u64::from(value) });
            if record.parts == 0 {
                return illegal("parts of a step", 0);
            }
            if record.of != NO_STEP && u64::from(record.of) == number {
                return illegal("of", record.of);
            }
            if StepEnd::from_wire(record.ends).is_none() {
                return illegal("ends", record.ends);
            }
        }
        Ok(view)
    }

    /// The same over bytes that were checked before. If the sender has changed them since, steps may be missing.
    #[must_use]
    pub fn checked(bytes: &'a [u8]) -> Self {
        Self::sections(bytes).unwrap_or_default()
    }

    fn sections(bytes: &'a [u8]) -> Result<Self, Malformed> {
        let mut reader = Reader::new(bytes)?;
        let h: StepsHeader = reader.value("steps header")?;
        Ok(Self {
            first_step: h.first_step,
            records: reader.array("step records", u64::from(h.steps))?,
            waypoints: reader.array("waypoints", u64::from(h.waypoints))?,
            requirements: reader.array("requirements", u64::from(h.requirements))?,
            parts: reader.array("step parts", u64::from(h.parts))?,
        })
    }

    /// How many steps.
    #[must_use]
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// A step. Its slices are empty if the sender has changed the bytes since the check.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<StepView<'a>> {
        let r = *self.records.get(index)?;
        Some(StepView {
            number: self.first_step.saturating_add(index as u32),
            parts: slice_of(self.parts, r.first_part, r.parts),
            of: (r.of != NO_STEP).then_some(r.of),
            ends: StepEnd::from_wire(r.ends).unwrap_or_default(),
            rotates: r.motion != 0,
            path: slice_of(self.waypoints, r.first_waypoint, r.waypoints),
            verified_depth: r.verified_depth,
            requires: slice_of(self.requirements, r.first_requirement, r.requirements),
            wave: r.wave,
            direction: (r.direction != [0.0; 3]).then_some(r.direction),
        })
    }

    /// All steps in order.
    pub fn iter(&self) -> impl Iterator<Item = StepView<'a>> + '_ {
        (0..self.len()).filter_map(|i| self.get(i))
    }
}

pub(crate) fn check_range(
    section: &'static str,
    first: u32,
    count: u32,
    length: usize,
) -> Result<(), Malformed> {
    let needed = u64::from(first) + u64::from(count);
    if needed > length as u64 {
        return Err(Malformed::Truncated { section, needed, length: length as u64 });
    }
    Ok(())
}

pub(crate) fn slice_of<T>(all: &[T], first: u32, count: u32) -> &[T] {
    let first = first as usize;
    all.get(first..first.saturating_add(count as usize)).unwrap_or(&[])
}
