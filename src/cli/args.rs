//! The command line as the user writes it.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use nalgebra::UnitQuaternion;
use sbdp_ipc::plan::FRICTION;

use crate::blocking_graph::StaticAnalysis;
use crate::geometry::Waypoint;
use crate::search;

mod bench;
mod clearance;
mod input;
mod load;
mod poses;
mod standing;
mod through_daemon;
mod tools;
mod view;

use poses::{direction, moved, not_negative, rotation};

pub(super) use bench::{BenchArguments, BenchCommand, BenchReport, BenchRun, BenchScale, BenchUnit};
pub(super) use clearance::ClearanceArguments;
pub(super) use input::Input;
pub(super) use load::{BenchCancel, BenchLoad, BenchLoadClient, BenchSoak};
pub(super) use poses::placed;
pub(super) use standing::{ScheduleArguments, StandingArguments, StaticsArguments};
pub(super) use through_daemon::{BenchChurn, BenchLatency, BenchRawPeer, BenchReplan, BenchRestart};
pub(super) use tools::ToolsArguments;
pub(super) use view::{GraphArguments, PrecedenceArguments, StepsArguments, ViewArguments};

/// Plans how assemblies come apart.
#[derive(Debug, Parser)]
#[command(name = "sbdp", version = crate::BUILD, after_help = EXAMPLES, after_long_help = EXAMPLES)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
}

const EXAMPLES: &str = "\
Examples:
  sbdp plan gearbox/                      the order and the paths, as a table
  sbdp plan gearbox/ --assembly --json -  how it is put together, as JSON
  sbdp view gearbox/ --open               the plan as a page in the browser
  sbdp check gearbox/                     what is wrong with the files

Exit codes: 0 complete, 2 wrong usage or refused input, 3 infeasible, exhausted or partial, 4 timeout, 5 cancelled, \
1 anything else.";

/// What to do.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Plan the order and the paths in which the parts of an assembly come off
    Plan(Box<PlanArguments>),
    /// Check the files of an assembly: healing, sizes, overlaps
    Check(CheckArguments),
    /// Explain in words what a search did, from its trace
    Explain(ExplainArguments),
    /// Show a plan as a page: one HTML file that plays it and needs no network
    View(Box<ViewArguments>),
    /// Draw which part blocks which, for each direction
    Graph(GraphArguments),
    /// Write a plan as instructions
    Steps(StepsArguments),
    /// Say after each step of a plan what stands by itself, what needs friction, and what has to be held
    Statics(StaticsArguments),
    /// Say when which arm carries out which step of a plan, and what it holds
    Schedule(ScheduleArguments),
    /// Write which step of a plan comes before which: for Graphviz, as JSON, or for task planners (PDDL)
    Precedence(PrecedenceArguments),
    /// Say how near the parts that a plan moves pass the others
    Clearance(ClearanceArguments),
    /// Say which wrench, socket or key turns the fasteners that a plan takes off, and how far it can swing
    Tools(ToolsArguments),
    /// Show the state of the running daemon
    Status(super::status::StatusArguments),
    /// Check a configuration of the daemon
    Config(super::config::ConfigArguments),
    /// Manage the cache on disk (all but `stats` need the daemon stopped, which locks the cache)
    Cache(super::cache::CacheArguments),
    /// Run planners over folders of assemblies and compare the results
    Bench(Box<BenchArguments>),
    /// Print the completions of a shell, to be put where it looks for them
    Completions(CompletionsArguments),
    /// Write the manual pages of all commands
    Man(ManArguments),
}

// Headings of the options of `sbdp plan`, as in `src/cli/README.md`.
const WHAT: &str = "What to plan";
const OUTPUT: &str = "Output";
const LIMITS: &str = "Limits";
const PLACE: &str = "Where to plan";
const SEARCH: &str = "The search";

/// Arguments of `sbdp plan`.
#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    pub(super) input: Input,
    /// Rotate the assembly by the quaternion W,X,Y,Z about the origin first; the plan is that of the rotated assembly, in
    /// its frame
    #[arg(long, value_name = "W,X,Y,Z", value_parser = rotation, allow_hyphen_values = true, help_heading = WHAT)]
    pub(super) rotate: Option<UnitQuaternion<f64>>,
    /// Write the plan to a file as JSON (contract sbdp-plan/2); `-` writes it to stdout in place of the table
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) json: Option<PathBuf>,
    /// Indent the JSON
    #[arg(long, requires = "json", help_heading = OUTPUT)]
    pub(super) pretty: bool,
    /// Write the plan to a file as an animated glTF scene (GLB)
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) glb: Option<PathBuf>,
    /// Search
    #[arg(long, value_enum, default_value_t, help_heading = SEARCH)]
    pub(super) planner: PlannerArgument,
    /// Simulation of motions (transition function)
    #[arg(long, value_enum, default_value_t, help_heading = SEARCH)]
    pub(super) engine: EngineArgument,
    /// A parameter of the engine `penalty`, as `stiffness=1e5` (repeatable)
    #[arg(long, value_name = "NAME=VALUE", help_heading = SEARCH)]
    pub(super) penalty: Vec<String>,
    /// Actions of the parts [default: extended for sbdp-star, paper for all other planners]
    #[arg(long, value_enum, help_heading = SEARCH)]
    pub(super) actions: Option<Actions>,
    /// First blocking graphs, before anything is simulated [default: sliding]
    #[arg(long, value_enum, help_heading = SEARCH)]
    pub(super) dbg: Option<Dbg>,
    #[command(flatten)]
    pub(super) sweeps: Sweeps,
    /// Stop after this time, with the plan so far
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true, help_heading = LIMITS)]
    pub(super) timeout: Option<Duration>,
    /// Stop after this time of planning, with the plan so far. Verification does not count: the paper's planners do not
    /// verify
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true, help_heading = LIMITS)]
    pub(super) planning_timeout: Option<Duration>,
    /// Give up one motion, or the search of a baseline for one part, after this time [default: no limit; the paper has
    /// 360]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, help_heading = LIMITS)]
    pub(super) path_timeout: Option<Duration>,
    /// Seed of the random poses of rrt and bk-rrt
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = SEARCH)]
    pub(super) seed: u64,
    /// Stop after this number of simulations (for rrt: steps of a tree), with the plan so far
    #[arg(long, value_name = "N", help_heading = LIMITS)]
    pub(super) max_simulations: Option<u64>,
    /// Distance between the hulls of a part and of the rest where its path ends, in the input's units [default: a
    /// hundredth of the part's longest side]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true, help_heading = WHAT)]
    pub(super) end_gap: Option<f64>,
    /// Distance that parts keep from what they pass on their way, in the input's units. Pairs that are nearer as they stand
    /// keep half of what they have, and those that touch as they stand may touch
    #[arg(long, value_name = "LENGTH", default_value_t = 0.0, hide_default_value = true, allow_negative_numbers = true, help_heading = WHAT)]
    pub(super) clearance: f64,
    /// The direction up, as +z or as a vector: upward paths come before sideways ones, and these before downward ones
    /// [default: the direction in which most parts can go at first]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true, help_heading = WHAT)]
    pub(super) up: Option<[f64; 3]>,
    /// Groups that leave together, to be taken apart afterwards
    #[arg(long, value_enum, default_value_t, help_heading = WHAT)]
    pub(super) groups: GroupsArgument,
    /// What to report about each step of the plan besides its path (repeatable, or separated by commas)
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',', help_heading = WHAT)]
    pub(super) report: Vec<ReportArgument>,
    /// Put the steps into an order in which fewer parts have to be held at once. They then come when the order is known
    #[arg(long, help_heading = WHAT)]
    pub(super) steady: bool,
    /// The same; and end the plan before the first step for which more hands are needed than this, the one that moves the
    /// part included
    #[arg(long, value_name = "N", help_heading = WHAT)]
    pub(super) hands: Option<NonZeroU32>,
    /// With `--report stability`, `--steady` and `--hands`: the coefficient of friction of all contacts. 0.2 is dry machined steel at the lower end,
    /// 0.05 oiled steel, 0.5 rubber
    #[arg(long, value_name = "MU", default_value_t = FRICTION, value_parser = not_negative, allow_negative_numbers = true, help_heading = WHAT)]
    pub(super) friction: f64,
    /// Worker threads; never changes the plan [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, help_heading = LIMITS)]
    pub(super) threads: u32,
    /// A part that may not move (repeatable)
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) fixed: Vec<String>,
    /// A part that stays as long as others leave (repeatable) [default: a large, low part]
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) base: Vec<String>,
    /// A part that stays unless others that are asked for cannot leave otherwise (repeatable)
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) keep: Vec<String>,
    /// A part that is in the way and does not come apart, as a fixture or a table: it may not move, and is no base (repeatable)
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) keep_out: Vec<String>,
    /// Add a floor under the lowest point, as a part `floor` that is in the way: nothing passes below it, and parts stand on it
    #[arg(long, help_heading = WHAT)]
    pub(super) floor: bool,
    /// A part that has been removed already (repeatable)
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) removed: Vec<String>,
    /// A part that must come out (repeatable) [default: all]
    #[arg(long, value_name = "PART", help_heading = WHAT)]
    pub(super) target: Vec<String>,
    /// A part that stands elsewhere: the motion of its mesh, a shift and, if it turns, a quaternion (repeatable)
    #[arg(long, value_name = "PART=X,Y,Z[,W,X,Y,Z]", value_parser = moved, allow_hyphen_values = true, help_heading = WHAT)]
    pub(super) moved: Vec<(String, Waypoint)>,
    /// A part with another mesh, from a file with one mesh (repeatable)
    #[arg(long, value_name = "PART=FILE", value_parser = replaced, help_heading = WHAT)]
    pub(super) replaced: Vec<(String, PathBuf)>,
    /// Further parts from a file or folder (repeatable)
    #[arg(long, value_name = "PATH", help_heading = WHAT)]
    pub(super) added: Vec<PathBuf>,
    /// Plan how the assembly is put together: the disassembly reversed, with the path of each part from where it waits to
    /// where its insertion begins
    #[arg(long = "assembly", help_heading = WHAT)]
    pub(super) together: bool,
    /// Where parts wait in an assembly plan. `auto` lays them out beside the assembly; with `none` each appears where its
    /// insertion begins; a JSON file has {"PART": [X,Y,Z,W,X,Y,Z], …}, a motion of the mesh from where it was given (other
    /// parts are laid out)
    #[arg(long, value_name = "auto|none|FILE", requires = "together", default_value = "auto", help_heading = WHAT)]
    pub(super) staging: PathBuf,
    /// Write what the search did to a file, one JSON object per line (see `sbdp explain`)
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) trace: Option<PathBuf>,
    /// Do not use the cache
    #[arg(long, help_heading = PLACE)]
    pub(super) no_cache: bool,
    /// The folder of the cache [default: $SBDP_CACHE_DIR, else $XDG_CACHE_HOME/sbdp, else ~/.cache/sbdp]; plans in this
    /// process
    #[arg(long, value_name = "DIR", conflicts_with_all = ["no_cache", "daemon"], help_heading = PLACE)]
    pub(super) cache_dir: Option<PathBuf>,
    /// Plan in this process, even if a daemon runs
    #[arg(long, conflicts_with = "daemon", help_heading = PLACE)]
    pub(super) embedded: bool,
    /// Plan in the daemon, which must be running
    #[arg(long, help_heading = PLACE)]
    pub(super) daemon: bool,
    /// In the table, list all overlaps and all blocked actions
    #[arg(short, long, help_heading = OUTPUT)]
    pub(super) verbose: bool,
    /// Show no progress and no table: only files, errors and the exit code
    #[arg(short, long, conflicts_with = "verbose", help_heading = OUTPUT)]
    pub(super) quiet: bool,
}

/// Arguments of `sbdp completions`.
#[derive(Debug, Args)]
pub(super) struct CompletionsArguments {
    /// Which shell
    #[arg(value_enum)]
    pub(super) shell: clap_complete::Shell,
}

/// Arguments of `sbdp man`.
#[derive(Debug, Args)]
pub(super) struct ManArguments {
    /// The folder for the pages: sbdp.1, sbdp-plan.1, …
    #[arg(value_name = "DIR")]
    pub(super) folder: PathBuf,
}

/// Arguments of `sbdp check`.
#[derive(Debug, Args)]
pub(super) struct CheckArguments {
    #[command(flatten)]
    pub(super) input: Input,
    /// Also simulate every translation from the assembled pose, and compare with what the blocking
    /// graphs exclude
    #[arg(long)]
    pub(super) graphs: bool,
    /// The blocking graphs to compare
    #[arg(long, value_enum, default_value_t, requires = "graphs")]
    pub(super) dbg: Dbg,
}

/// Arguments of `sbdp explain`.
#[derive(Debug, Args)]
pub(super) struct ExplainArguments {
    /// A file that `sbdp plan --trace` wrote
    pub(super) trace: PathBuf,
}

/// Which search.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(super) enum PlannerArgument {
    /// State-based planning guided by directional blocking graphs
    #[default]
    SbdpStar,
    /// State-based planning without blocking graphs
    Sbdp,
    /// Breadth-first search per part with translations
    PdpT,
    /// Breadth-first search per part with rotational freedom
    PdpR,
    /// pdp-t, then pdp-r if that failed
    PdpStar,
    /// A random tree per part, of straight paths
    Rrt,
    /// A random tree per part, of simulated motions
    BkRrt,
}

impl From<PlannerArgument> for search::Planner {
    fn from(planner: PlannerArgument) -> Self {
        match planner {
            PlannerArgument::SbdpStar => Self::SbdpStar,
            PlannerArgument::Sbdp => Self::Sbdp,
            PlannerArgument::PdpT => Self::PdpT,
            PlannerArgument::PdpR => Self::PdpR,
            PlannerArgument::PdpStar => Self::PdpStar,
            PlannerArgument::Rrt => Self::Rrt,
            PlannerArgument::BkRrt => Self::BkRrt,
        }
    }
}

/// When parts leave together.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum GroupsArgument {
    /// Only where no part leaves alone
    #[default]
    Needed,
    /// Also the groups that the input names
    Prefer,
}

/// What is reported about each step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ReportArgument {
    /// What falls before the first step and after each step, and what to hold. Up is `--up`, else +z (+y for glTF scenes)
    Stability,
    /// How near the step passes other parts
    Clearance,
    /// Which tools turn the nut or screw that the step takes off
    Tools,
}

/// Which transition function.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(super) enum EngineArgument {
    /// Contact-constrained sliding without inertia
    #[default]
    Sliding,
    /// The paper's simulation: rigid-body dynamics with penalty forces
    Penalty,
}

impl From<EngineArgument> for search::Engine {
    fn from(engine: EngineArgument) -> Self {
        match engine {
            EngineArgument::Sliding => Self::Sliding,
            EngineArgument::Penalty => Self::Penalty,
        }
    }
}

/// Which actions.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum Actions {
    /// Six translations, six rotations
    Paper,
    /// The paper's and pulling while turning
    Extended,
}

impl From<Actions> for search::ActionSet {
    fn from(actions: Actions) -> Self {
        match actions {
            Actions::Paper => Self::Paper,
            Actions::Extended => Self::Extended,
        }
    }
}

/// How blocking graphs are begun.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(super) enum Dbg {
    /// An edge where contact with the other part alone lets a part hardly move
    #[default]
    Sliding,
    /// The paper's rule, taken literally: an edge where a vertex, pushed a little, gets inside
    Paper,
}

impl From<Dbg> for StaticAnalysis {
    fn from(dbg: Dbg) -> Self {
        match dbg {
            Dbg::Sliding => Self::Sliding,
            Dbg::Paper => Self::Paper,
        }
    }
}

/// Whether parts that leave straight are simulated.
#[derive(Debug, Clone, Copy, Args)]
pub(super) struct Sweeps {
    /// Remove parts that leave straight without simulation, with sbdp-star and sbdp [default with extended actions]
    #[arg(long, overrides_with = "no_sweeps", help_heading = SEARCH)]
    sweeps: bool,
    /// Simulate parts that leave straight, too [default with the paper's actions]
    #[arg(long, overrides_with = "sweeps", help_heading = SEARCH)]
    no_sweeps: bool,
}

impl Sweeps {
    /// The choice of the user, if any.
    pub(super) fn asked(self) -> Option<bool> {
        (self.sweeps || self.no_sweeps).then_some(self.sweeps)
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "not a number of seconds from 0 on".to_owned())
}

fn replaced(text: &str) -> Result<(String, PathBuf), String> {
    let (part, file) = text.rsplit_once('=').ok_or_else(|| "not PART=FILE".to_owned())?;
    Ok((part.to_owned(), file.into()))
}

#[cfg(test)]
mod tests;
