//! Options.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use sbdp_ipc::clock;
use sbdp_ipc::plan::{
    self, Gravity, MovedPart, PENALTY_PARAMETERS, PenaltyRecord, PlanRequest, Reports, Steady, Waypoint,
};
use sbdp_ipc::polling;

use crate::interrupt::Interrupt;

/// The name of an assembly: the hash of its content.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Handle(pub [u8; 32]);

impl fmt::Display for Handle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// How to find the daemon, and how long to wait for it.
#[derive(Debug, Clone)]
pub struct ConnectOptions {
    /// The daemon's runtime folder; by default `$SBDP_RUNTIME_DIR`, else
    /// `$XDG_RUNTIME_DIR/sbdp`, else `/tmp/sbdp-UID`.
    pub runtime_dir: Option<PathBuf>,
    /// How long the daemon may take for an answer that needs no planning.
    pub timeout: Duration,
    /// How long the daemon may take to check and heal an upload.
    pub upload_timeout: Duration,
    /// How long to wait for a new daemon when the one in use goes away. The request is then
    /// sent again automatically: see [`Event::Restarted`](crate::Event::Restarted) and
    /// [`Client::restarts`](crate::Client::restarts). Zero reports the loss at once.
    pub reconnect: Duration,
    /// For how long to repeat a request automatically while the daemon answers `busy`.
    /// Zero (the default) reports `busy` at once; [`ClientError::retry_after`](crate::ClientError::retry_after)
    /// then has the time to wait.
    pub busy_wait: Duration,
    /// How long to poll for an answer before sleeping until the daemon wakes this process: an answer
    /// from memory arrives sooner than a process wakes. Where polling is fruitless, or others need the processors,
    /// it stops automatically ([`sbdp_ipc::polling`]). Zero for never.
    pub poll: Duration,
    /// Interrupts calls that wait for the daemon; without it, only timeouts end them.
    /// [`PlanStream::poll_event`](crate::PlanStream::poll_event) and `next_event` do not check it while the daemon
    /// plans: cancel the plan, or drop its stream, instead.
    pub interrupt: Option<Interrupt>,
}

impl Default for ConnectOptions {
    fn default() -> Self {
        Self {
            runtime_dir: None,
            timeout: Duration::from_secs(10),
            upload_timeout: Duration::from_secs(300),
            reconnect: Duration::from_secs(10),
            busy_wait: Duration::ZERO,
            poll: polling::USUAL,
            interrupt: None,
        }
    }
}

/// The search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Planner {
    /// State-based planning guided by directional blocking graphs.
    #[default]
    SbdpStar,
    /// State-based planning without blocking graphs.
    Sbdp,
    /// Breadth-first search per part, translations.
    PdpT,
    /// Breadth-first search per part, translations and rotations.
    PdpR,
    /// `PdpT`, then `PdpR` if that failed.
    PdpStar,
    /// A rapidly-exploring random tree per part, of straight paths.
    Rrt,
    /// A rapidly-exploring random tree per part, of simulated motions.
    BkRrt,
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

/// The actions that the search may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ActionSet {
    /// The paper's.
    Paper,
    /// The paper's and pulling while turning.
    #[default]
    Extended,
}

/// How blocking graphs begin, before anything is simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StaticAnalysis {
    /// An arc where contact with the other part alone hardly lets a part move.
    #[default]
    Sliding,
    /// The paper's rule, taken literally.
    Paper,
}

/// A parameter of the engine `penalty`. Lengths are of an assembly whose longest side is between 5 and 10, times in
/// seconds of the simulated motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PenaltyParameter {
    /// Time of one step.
    TimeStep,
    /// Time after which the velocity is zeroed and the state compared with earlier ones.
    PlanningTimeStep,
    /// Force per depth at one contact point.
    Stiffness,
    /// Force per depth and speed of approach at one contact point.
    Damping,
    /// Depth beyond that at the assembled pose from which contact acts.
    PenetrationThreshold,
    /// Acceleration that an action's force gives.
    Force,
    /// Angular acceleration that an action's torque gives, as a multiple of `Force`.
    TorqueFactor,
    /// States closer than this in translation may be the same.
    SimilarTranslation,
    /// States closer than this in rotation may be the same, in radians.
    SimilarRotation,
    /// The longest edge between contact points.
    LongestEdge,
    /// How much deeper than `PenetrationThreshold` a pair may get before a motion is stopped.
    Yielding,
    /// The share of a part's smallest extent that the threshold may have.
    ShareOfExtent,
    /// Steps from one waypoint to the next, at most; a whole number.
    StepsPerWaypoint,
    /// Zeroings of the velocity after which a motion is given up; a whole number.
    MostBlocks,
    /// Newton iterations of one step, at most; a whole number.
    NewtonIterations,
    /// A Newton step that moves no point by more than this is the last.
    NewtonTolerance,
}

impl PenaltyParameter {
    /// All parameters, in the order of their numbers on the wire.
    pub const ALL: [Self; 16] = [
        Self::TimeStep,
        Self::PlanningTimeStep,
        Self::Stiffness,
        Self::Damping,
        Self::PenetrationThreshold,
        Self::Force,
        Self::TorqueFactor,
        Self::SimilarTranslation,
        Self::SimilarRotation,
        Self::LongestEdge,
        Self::Yielding,
        Self::ShareOfExtent,
        Self::StepsPerWaypoint,
        Self::MostBlocks,
        Self::NewtonIterations,
        Self::NewtonTolerance,
    ];

    /// The name, as on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        PENALTY_PARAMETERS[self as usize]
    }
}

/// Where the parts of an assembly plan begin.
#[derive(Debug, Clone, PartialEq)]
pub enum Staging {
    /// Each where its insertion begins; it is absent before its turn.
    None,
    /// Laid out beside the assembly, except for those with a given pose: the rigid motion of their mesh from
    /// where it was given, as in paths.
    Beside(Vec<(u32, Waypoint)>),
}

/// What to plan. Part numbers are indices into the uploaded assembly's list of parts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlanOptions {
    /// The search.
    pub planner: Planner,
    /// The simulation.
    pub engine: Engine,
    /// The actions.
    pub actions: ActionSet,
    /// How blocking graphs begin.
    pub static_analysis: StaticAnalysis,
    /// Parameters of the engine `penalty` that differ from the paper's.
    pub penalty: Vec<(PenaltyParameter, f64)>,
    /// Whether parts that leave straight, or are clear already, are removed without simulation; `None`
    /// leaves it to the daemon: yes with extended actions.
    pub sweeps: Option<bool>,
    /// Time from now after which the daemon answers with the plan so far.
    pub timeout: Option<Duration>,
    /// Time of planning, not counting waiting and verification, after which the daemon answers with the plan so far.
    pub planning_timeout: Option<Duration>,
    /// Time after which one motion, or a baseline's search for one part, is given up. The plan then depends on the
    /// clock and is not remembered.
    pub path_timeout: Option<Duration>,
    /// Seed of the random poses of [`Planner::Rrt`] and [`Planner::BkRrt`].
    pub seed: u64,
    /// The gap between a part's hull and that of the rest where its path out ends, in the input's units, at least 0;
    /// `None` for a hundredth of the longest side of the part's box.
    pub end_gap: Option<f64>,
    /// The distance that parts keep from what they pass on their way, in the input's units, at least 0. Pairs that are nearer
    /// as they stand keep half of what they have; those that touch as they stand may touch.
    pub clearance: f64,
    /// The direction up, in the input's frame, of any length but 0: upward paths come before sideways ones, and these
    /// before downward ones. `None` for the direction in which most parts can go at first.
    pub up: Option<[f64; 3]>,
    /// Simulations (steps of a tree, in RRT) after which to give up.
    pub max_simulations: Option<u64>,
    /// The number of threads; 0 leaves it to the daemon.
    pub threads: u32,
    /// Parts that may not move.
    pub fixed: Vec<u32>,
    /// Parts that are already removed.
    pub removed: Vec<u32>,
    /// Parts that must come out; `None` for all.
    pub targets: Option<Vec<u32>>,
    /// Parts that stay as long as others leave: what the rest is taken off. If there are none, the daemon chooses one.
    pub base: Vec<u32>,
    /// Parts that stay unless others that are asked for cannot leave otherwise. They are not asked for: the plan is
    /// complete with them in the assembly.
    pub keep: Vec<u32>,
    /// Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base.
    /// In the plan they are among those that may not move.
    pub keep_out: Vec<u32>,
    /// Groups that should leave as wholes, to be taken apart afterwards. A part may be in several groups if these are
    /// nested.
    pub groups: Vec<Vec<u32>>,
    /// Parts that stand elsewhere than in the assembly, with the rigid motion of their mesh from there
    /// (input units and frame).
    pub moved: Vec<(u32, Waypoint)>,
    /// Make an assembly plan (the disassembly reversed, with each part's path from where it waits), with
    /// parts that begin there.
    pub assembly: Option<Staging>,
    /// What to report about each step besides its path: [`Summary::report`](crate::Summary::report).
    pub reports: Reports,
    /// Put the steps into an order in which few parts have to be held at once. They then come when the order is known.
    pub steady: Option<Steady>,
    /// What it depends on how parts stand: for `reports.stability` and `steady`.
    pub gravity: Gravity,
    /// Neither read nor write the cache.
    pub no_cache: bool,
    /// Other requests come first: no one waits for this plan.
    pub batch: bool,
    /// Send the events of the search, too ([`Event::Trace`](crate::Event::Trace)). The search then runs even if the
    /// plan is remembered.
    pub trace: bool,
}

impl PlanOptions {
    pub(crate) fn to_wire(&self, handle: Handle) -> PlanRequest {
        PlanRequest {
            handle: handle.0,
            planner: self.planner as u32,
            engine: self.engine as u32,
            actions: self.actions as u32,
            static_analysis: self.static_analysis as u32,
            penalty: self.penalty.iter().map(penalty_record).collect(),
            sweeps: self.sweeps,
            trace: self.trace,
            no_cache: self.no_cache,
            batch: self.batch,
            threads: self.threads,
            deadline_ns: self.timeout.map(clock::deadline_in),
            seed: self.seed,
            end_gap: self.end_gap,
            clearance: self.clearance,
            up: self.up,
            max_simulations: self.max_simulations,
            path_timeout_ns: self.path_timeout.map(nanoseconds),
            planning_timeout_ns: self.planning_timeout.map(nanoseconds),
            fixed: self.fixed.clone(),
            removed: self.removed.clone(),
            targets: self.targets.clone(),
            base: self.base.clone(),
            keep: self.keep.clone(),
            keep_out: self.keep_out.clone(),
            groups: self.groups.clone(),
            moved: self.moved.iter().map(moved_part).collect(),
            reports: self.reports,
            steady: self.steady,
            gravity: self.gravity,
            assembly: self.assembly.as_ref().map(|staging| match staging {
                Staging::None => plan::Staging::None,
                Staging::Beside(given) => plan::Staging::Beside(given.iter().map(moved_part).collect()),
            }),
        }
    }
}

fn penalty_record(&(parameter, value): &(PenaltyParameter, f64)) -> PenaltyRecord {
    PenaltyRecord { parameter: parameter as u32, reserved: 0, value }
}

/// A time too long for the wire (five hundred years) is shortened.
fn nanoseconds(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).min(u64::MAX - 1)
}

pub(crate) fn moved_part(&(part, motion): &(u32, Waypoint)) -> MovedPart {
    MovedPart { part, reserved: 0, motion }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sbdp_ipc::plan::{ACTION_SETS, ENGINES, PLANNERS, STATIC_ANALYSES};

    #[test]
    fn choices_travel_as_the_index_of_their_name() {
        assert_eq!(PLANNERS[Planner::SbdpStar as usize], "sbdp-star");
        assert_eq!(PLANNERS[Planner::PdpStar as usize], "pdp-star");
        assert_eq!(PLANNERS[Planner::BkRrt as usize], "bk-rrt");
        assert_eq!(ENGINES[Engine::Penalty as usize], "penalty");
        assert_eq!(ACTION_SETS[ActionSet::Extended as usize], "extended");
        assert_eq!(STATIC_ANALYSES[StaticAnalysis::Paper as usize], "paper");
        let named = PenaltyParameter::ALL.map(|p| format!("{p:?}"));
        let names = PENALTY_PARAMETERS.map(|name| name.replace('-', ""));
        for ((parameter, variant), name) in PenaltyParameter::ALL.iter().zip(named).zip(names) {
            assert_eq!(variant.to_lowercase(), name, "{}", parameter.name());
        }
    }
}
