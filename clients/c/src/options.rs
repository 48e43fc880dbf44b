//! Options of a plan.

use std::num::NonZeroU32;
use std::time::Duration;

use sbdp_client::{
    ActionSet, Engine, Gravity, PenaltyParameter, PlanOptions, Planner, Reports, Staging, StaticAnalysis,
    Steady, Waypoint,
};

use crate::border::Failure;
use crate::input::{Versioned, array, optional, versioned};

/// The search.
#[repr(u32)]
pub enum SbdpPlanner {
    /// `SBDP_PLANNER_SBDP_STAR`.
    Default = 0,
    /// State-based planning guided by directional blocking graphs.
    SbdpStar = 1,
    /// State-based planning without blocking graphs.
    Sbdp = 2,
    /// Breadth-first search per part, translations.
    PdpT = 3,
    /// Breadth-first search per part, translations and rotations.
    PdpR = 4,
    /// `SBDP_PLANNER_PDP_T`, then `SBDP_PLANNER_PDP_R` if that failed.
    PdpStar = 5,
    /// A rapidly-exploring random tree per part, of straight paths.
    Rrt = 6,
    /// A rapidly-exploring random tree per part, of simulated motions.
    BkRrt = 7,
}

/// The simulation that moves the parts.
#[repr(u32)]
pub enum SbdpEngine {
    /// `SBDP_ENGINE_SLIDING`.
    Default = 0,
    /// Contact-constrained sliding without inertia.
    Sliding = 1,
    /// The paper's penalty-based simulation.
    Penalty = 2,
}

/// The actions that the search may use.
#[repr(u32)]
pub enum SbdpActions {
    /// `SBDP_ACTIONS_EXTENDED`.
    Default = 0,
    /// The paper's.
    Paper = 1,
    /// The paper's and pulling while turning.
    Extended = 2,
}

/// How blocking graphs begin, before anything is simulated.
#[repr(u32)]
pub enum SbdpStaticAnalysis {
    /// `SBDP_STATIC_ANALYSIS_SLIDING`.
    Default = 0,
    /// An arc where contact with the other part alone hardly lets a part move.
    Sliding = 1,
    /// The paper's rule, taken literally.
    Paper = 2,
}

/// Yes, no, or the daemon's choice.
#[repr(u32)]
pub enum SbdpChoice {
    /// The daemon chooses.
    Default = 0,
    /// No.
    No = 1,
    /// Yes.
    Yes = 2,
}

/// Disassembly or assembly plan, and where its parts begin.
#[repr(u32)]
pub enum SbdpStaging {
    /// A disassembly plan.
    Disassembly = 0,
    /// An assembly plan. A part is absent before its turn, and begins where its insertion begins.
    None = 1,
    /// An assembly plan. Parts begin laid out beside the assembly, except for those in `staged`.
    Beside = 2,
}

/// A part that stands elsewhere: the rigid motion of its mesh from where it was uploaded.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpMovedPart {
    /// The part.
    pub part: u32,
    /// Zero.
    pub reserved: u32,
    /// The shift x, y, z, then the unit quaternion w, x, y, z.
    pub motion: [f64; 7],
}

/// Several parts.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpGroup {
    /// The parts.
    pub parts: *const u32,
    /// How many.
    pub part_count: usize,
}

/// A parameter of the engine `penalty`.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpPenalty {
    /// Its index among `time-step`, `planning-time-step`, `stiffness`, `damping`, `penetration-threshold`, `force`,
    /// `torque-factor`, `similar-translation`, `similar-rotation`, `longest-edge`, `yielding`, `share-of-extent`,
    /// `steps-per-waypoint`, `most-blocks`, `newton-iterations`, `newton-tolerance`; the first is 0.
    pub parameter: u32,
    /// Zero.
    pub reserved: u32,
    /// Its value.
    pub value: f64,
}

/// What is reported about each step of a plan.
#[repr(u32)]
pub enum SbdpReport {
    /// What falls before the first step and after each step, and what to hold.
    Stability = 1,
    /// How near the step passes other parts.
    Clearance = 2,
    /// Which tools turn the nut or screw that the step takes off.
    Tools = 4,
}

/// What to plan. All zero except `struct_size` is the default, as is a null pointer. Where zero would have a meaning
/// of its own, the field is a pointer, and null is the default.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct SbdpPlanOptions {
    /// `sizeof` this struct. Fields beyond it have their defaults.
    pub struct_size: u32,
    /// A `SbdpPlanner`.
    pub planner: u32,
    /// A `SbdpEngine`.
    pub engine: u32,
    /// A `SbdpActions`.
    pub actions: u32,
    /// A `SbdpStaticAnalysis`.
    pub static_analysis: u32,
    /// A `SbdpChoice`: whether parts that leave straight are removed without simulation.
    pub sweeps: u32,
    /// A `SbdpStaging`.
    pub staging: u32,
    /// The number of threads; 0 leaves it to the daemon.
    pub threads: u32,
    /// Not 0: neither read nor write the cache.
    pub no_cache: u32,
    /// Not 0: other requests come first.
    pub batch: u32,
    /// Not 0: send the events of the search, too. The search then runs even if the plan is remembered.
    pub trace: u32,
    /// Zero.
    pub reserved: u32,
    /// Seed of the random poses of the planners with trees.
    pub seed: u64,
    /// Time from now after which the daemon answers with the plan so far; null for none.
    pub timeout_ns: *const u64,
    /// Time of planning, not counting waiting, after which the daemon answers with the plan so far; null for none.
    pub planning_timeout_ns: *const u64,
    /// Time after which one motion is given up; null for none. The plan is not remembered.
    pub path_timeout_ns: *const u64,
    /// Simulations after which to give up; null for no limit.
    pub max_simulations: *const u64,
    /// The gap with which a path out ends, in the input's units; null for a hundredth of the part's longest side.
    pub end_gap: *const f64,
    /// The direction up, three numbers, of any length but 0; null for the one in which most parts can go at first.
    pub up: *const f64,
    /// Parts that may not move.
    pub fixed: *const u32,
    /// How many.
    pub fixed_count: usize,
    /// Parts that are already removed.
    pub removed: *const u32,
    /// How many.
    pub removed_count: usize,
    /// Parts that must come out; null for all.
    pub targets: *const u32,
    /// How many.
    pub target_count: usize,
    /// Parts that stay as long as others leave. If there are none, the daemon chooses.
    pub base: *const u32,
    /// How many.
    pub base_count: usize,
    /// Groups that should leave as wholes, to be taken apart afterwards.
    pub groups: *const SbdpGroup,
    /// How many.
    pub group_count: usize,
    /// Parts that stand elsewhere than in the assembly.
    pub moved: *const SbdpMovedPart,
    /// How many.
    pub moved_count: usize,
    /// With `SBDP_STAGING_BESIDE`: parts that wait at given poses.
    pub staged: *const SbdpMovedPart,
    /// How many.
    pub staged_count: usize,
    /// Parameters of the engine `penalty` that differ from the paper's.
    pub penalty: *const SbdpPenalty,
    /// How many.
    pub penalty_count: usize,
    /// Parts that stay unless others that are asked for cannot leave otherwise. They are not asked for.
    pub keep: *const u32,
    /// How many.
    pub keep_count: usize,
    /// What to report about each step besides its path: the sum of some `SbdpReport`s. `sbdp_plan_json` has the reports.
    pub reports: u32,
    /// Not 0: put the steps into an order in which few parts have to be held at once. They then come when it is known.
    pub steady: u32,
    /// With `steady`: how many parts hands can hold at once, the one that moves included; 0 for any number. The plan ends
    /// before the first step that needs more.
    pub hands: u32,
    /// Zero.
    pub reserved_hands: u32,
    /// With `SBDP_REPORT_STABILITY` or `steady`: the coefficient of friction of all contacts; null for 0.2.
    pub friction: *const f64,
    /// With `SBDP_REPORT_STABILITY` or `steady`: the direction against gravity, three numbers, of any length but 0; null for `up`, and
    /// without that for +z.
    pub against_gravity: *const f64,
    /// Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base.
    pub keep_out: *const u32,
    /// How many.
    pub keep_out_count: usize,
    /// The distance that parts keep from what they pass on their way, in the input's units, at least 0. Pairs that are nearer as
    /// they stand keep half of what they have; those that touch as they stand may touch.
    pub clearance: f64,
}

// SAFETY: it begins with its size, and has but numbers and pointers.
unsafe impl Versioned for SbdpPlanOptions {}

/// # Safety
/// The pointer is null, or points to options whose pointers and counts are valid.
pub(crate) unsafe fn read_plan_options(options: *const SbdpPlanOptions) -> Result<PlanOptions, Failure> {
    // SAFETY: so the caller promises.
    unsafe {
        let given = versioned(options, "options")?;
        let list = |pointer, count, name| array::<u32>(pointer, count, name).map(<[u32]>::to_vec);
        let time = |pointer, name| Ok::<_, Failure>(optional(pointer, name)?.map(Duration::from_nanos));
        let staged = moved_parts(given.staged, given.staged_count, "options->staged")?;
        if !staged.is_empty() && given.staging != SbdpStaging::Beside as u32 {
            return Err(Failure::argument("`options->staged` goes with `SBDP_STAGING_BESIDE` alone"));
        }
        Ok(PlanOptions {
            planner: planner(given.planner)?,
            engine: choose("engine", given.engine, &[Engine::default(), Engine::Sliding, Engine::Penalty])?,
            actions: choose(
                "actions",
                given.actions,
                &[ActionSet::default(), ActionSet::Paper, ActionSet::Extended],
            )?,
            static_analysis: choose(
                "static_analysis",
                given.static_analysis,
                &[StaticAnalysis::default(), StaticAnalysis::Sliding, StaticAnalysis::Paper],
            )?,
            penalty: penalty(array(given.penalty, given.penalty_count, "options->penalty")?)?,
            sweeps: choose("sweeps", given.sweeps, &[None, Some(false), Some(true)])?,
            timeout: time(given.timeout_ns, "options->timeout_ns")?,
            planning_timeout: time(given.planning_timeout_ns, "options->planning_timeout_ns")?,
            path_timeout: time(given.path_timeout_ns, "options->path_timeout_ns")?,
            seed: given.seed,
            end_gap: optional(given.end_gap, "options->end_gap")?,
            clearance: given.clearance,
            up: optional(given.up.cast(), "options->up")?,
            max_simulations: optional(given.max_simulations, "options->max_simulations")?,
            threads: given.threads,
            fixed: list(given.fixed, given.fixed_count, "options->fixed")?,
            removed: list(given.removed, given.removed_count, "options->removed")?,
            targets: match given.targets.is_null() && given.target_count == 0 {
                true => None,
                false => Some(list(given.targets, given.target_count, "options->targets")?),
            },
            base: list(given.base, given.base_count, "options->base")?,
            keep: list(given.keep, given.keep_count, "options->keep")?,
            keep_out: list(given.keep_out, given.keep_out_count, "options->keep_out")?,
            groups: array(given.groups, given.group_count, "options->groups")?
                .iter()
                .map(|group| list(group.parts, group.part_count, "options->groups[].parts"))
                .collect::<Result<_, _>>()?,
            moved: moved_parts(given.moved, given.moved_count, "options->moved")?,
            assembly: choose(
                "staging",
                given.staging,
                &[None, Some(Staging::None), Some(Staging::Beside(staged))],
            )?,
            reports: reports(given.reports)?,
            steady: steady(&given)?,
            gravity: gravity(&given)?,
            no_cache: given.no_cache != 0,
            batch: given.batch != 0,
            trace: given.trace != 0,
        })
    }
}

fn reports(number: u32) -> Result<Reports, Failure> {
    const KNOWN: u32 = SbdpReport::Stability as u32 | SbdpReport::Clearance as u32 | SbdpReport::Tools as u32;
    if number & !KNOWN != 0 {
        let problem =
            format!("`options->reports` is {number}: this library does not know all of these reports");
        return Err(Failure::argument(problem));
    }
    let has = |report: SbdpReport| number & report as u32 != 0;
    Ok(Reports {
        stability: has(SbdpReport::Stability),
        clearance: has(SbdpReport::Clearance),
        tools: has(SbdpReport::Tools),
    })
}

fn steady(given: &SbdpPlanOptions) -> Result<Option<Steady>, Failure> {
    if given.hands != 0 && given.steady == 0 {
        return Err(Failure::argument("`options->hands` goes with `steady` alone"));
    }
    Ok((given.steady != 0).then_some(Steady { hands: NonZeroU32::new(given.hands) }))
}

/// # Safety
/// The pointers of the options are null or valid.
unsafe fn gravity(given: &SbdpPlanOptions) -> Result<Gravity, Failure> {
    // SAFETY: so the caller promises.
    let (friction, against_gravity, up) = unsafe {
        (
            optional(given.friction, "options->friction")?,
            optional(given.against_gravity.cast(), "options->against_gravity")?,
            optional(given.up.cast(), "options->up")?,
        )
    };
    let usual = Gravity::default();
    Ok(Gravity {
        up: against_gravity.or(up).unwrap_or(usual.up),
        friction: friction.unwrap_or(usual.friction),
    })
}

/// # Safety
/// The pointer is null, or leads to as many.
pub(crate) unsafe fn moved_parts(
    pointer: *const SbdpMovedPart,
    count: usize,
    name: &str,
) -> Result<Vec<(u32, Waypoint)>, Failure> {
    // SAFETY: so the caller promises.
    let moved = unsafe { array(pointer, count, name) }?;
    Ok(moved.iter().map(|m| (m.part, m.motion)).collect())
}

fn planner(number: u32) -> Result<Planner, Failure> {
    let planners = [
        Planner::default(),
        Planner::SbdpStar,
        Planner::Sbdp,
        Planner::PdpT,
        Planner::PdpR,
        Planner::PdpStar,
        Planner::Rrt,
        Planner::BkRrt,
    ];
    choose("planner", number, &planners)
}

fn penalty(given: &[SbdpPenalty]) -> Result<Vec<(PenaltyParameter, f64)>, Failure> {
    let parameter =
        |p: &SbdpPenalty| Ok((choose("penalty[].parameter", p.parameter, &PenaltyParameter::ALL)?, p.value));
    given.iter().map(parameter).collect()
}

/// The value of a number from C, where an enum may be anything.
fn choose<T: Clone>(field: &str, number: u32, values: &[T]) -> Result<T, Failure> {
    let value = values.get(number as usize).cloned();
    value.ok_or_else(|| {
        Failure::argument(format!(
            "`options->{field}` is {number}: this library knows 0 to {}",
            values.len() - 1
        ))
    })
}
