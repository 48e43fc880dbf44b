//! The command line as the user writes it.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use nalgebra::UnitQuaternion;

use crate::bench::{self, ENGINES, PAPER_PLANNERS, PARTS, PLANNERS, Shard};
use crate::blocking_graph::StaticAnalysis;
use crate::geometry::Waypoint;
use crate::search;

mod input;
mod load;
mod poses;
mod through_daemon;
mod view;

use poses::{direction, moved, rotation};

pub(super) use input::Input;
pub(super) use load::{BenchCancel, BenchLoad, BenchLoadClient, BenchSoak};
pub(super) use poses::placed;
pub(super) use through_daemon::{BenchChurn, BenchLatency, BenchRawPeer, BenchReplan, BenchRestart};
pub(super) use view::{GraphArguments, StepsArguments, ViewArguments};

/// Plans how assemblies come apart.
#[derive(Debug, Parser)]
#[command(name = "sbdp", version = crate::BUILD, about, after_help = EXAMPLES, after_long_help = EXAMPLES)]
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
    /// Show the state of the running daemon
    Status(super::status::StatusArguments),
    /// Check a configuration of the daemon
    Config(super::config::ConfigArguments),
    /// Manage the cache on disk (stop the daemon first: it locks the cache)
    Cache(super::cache::CacheArguments),
    /// Run planners over folders of assemblies and compare the results
    Bench(Box<BenchArguments>),
    /// Print the completions of a shell, to be put where it looks for them
    Completions(CompletionsArguments),
    /// Write the manual pages of all commands
    Man(ManArguments),
}

/// Arguments of `sbdp plan`.
#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    pub(super) input: Input,
    /// Turn the assembly by the quaternion W,X,Y,Z about the origin before anything else; the plan
    /// is that of the turned assembly, in its frame
    #[arg(long, value_name = "W,X,Y,Z", value_parser = rotation, allow_hyphen_values = true)]
    pub(super) rotate: Option<UnitQuaternion<f64>>,
    /// Write the plan there as JSON (contract sbdp-plan/2); `-` writes it to stdout in place of the table
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Indent the JSON
    #[arg(long, requires = "json")]
    pub(super) pretty: bool,
    /// Also write the plan there as a glTF scene in motion (GLB)
    #[arg(long, value_name = "FILE")]
    pub(super) glb: Option<PathBuf>,
    /// Which search
    #[arg(long, value_enum, default_value_t)]
    pub(super) planner: PlannerArgument,
    /// Which transition function
    #[arg(long, value_enum, default_value_t)]
    pub(super) engine: EngineArgument,
    /// A parameter of the engine `penalty`, as `stiffness=1e5` (repeatable)
    #[arg(long, value_name = "NAME=VALUE")]
    pub(super) penalty: Vec<String>,
    /// Which actions [default: extended for sbdp-star, paper for all other planners]
    #[arg(long, value_enum)]
    pub(super) actions: Option<Actions>,
    /// How blocking graphs are begun, before anything is simulated [default: sliding]
    #[arg(long, value_enum)]
    pub(super) dbg: Option<Dbg>,
    #[command(flatten)]
    pub(super) sweeps: Sweeps,
    /// Stop after this time, with the plan so far
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(super) timeout: Option<Duration>,
    /// Stop after this time of planning, with the plan so far. Verification does not count: the paper's planners do not
    /// verify
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(super) planning_timeout: Option<Duration>,
    /// Give up one motion, or a baseline's search for one part, after this time [default: no limit; the paper
    /// has 360]
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(super) path_timeout: Option<Duration>,
    /// Seed of the random poses of rrt and bk-rrt
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Give up after this number of simulations (of rrt: steps of a tree)
    #[arg(long, value_name = "N")]
    pub(super) max_simulations: Option<u64>,
    /// How far a part's hull is from that of the rest where its way ends, in the input's units [default: a hundredth of the
    /// part's longest side]
    #[arg(long, value_name = "LENGTH", allow_negative_numbers = true)]
    pub(super) clearance: Option<f64>,
    /// The direction up, as +z or as a vector: ways up come before ways sideways, and those before ways down [default:
    /// where most parts can go at first]
    #[arg(long, value_name = "X,Y,Z", value_parser = direction, allow_hyphen_values = true)]
    pub(super) up: Option<[f64; 3]>,
    /// When parts leave together, to be taken apart then
    #[arg(long, value_enum, default_value_t)]
    pub(super) groups: GroupsArgument,
    /// Worker threads; never changes the plan [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(super) threads: u32,
    /// A part that may not move (repeatable)
    #[arg(long, value_name = "PART")]
    pub(super) fixed: Vec<String>,
    /// A part that stays as long as others leave: what the rest is taken off (repeatable) [default: chosen]
    #[arg(long, value_name = "PART")]
    pub(super) base: Vec<String>,
    /// A part that has been removed already (repeatable)
    #[arg(long, value_name = "PART")]
    pub(super) removed: Vec<String>,
    /// A part that must come out (repeatable) [default: all]
    #[arg(long, value_name = "PART")]
    pub(super) target: Vec<String>,
    /// A part that stands elsewhere: the motion of its mesh, a shift and (if it turns) a quaternion
    /// (repeatable)
    #[arg(long, value_name = "PART=X,Y,Z[,W,X,Y,Z]", value_parser = moved, allow_hyphen_values = true)]
    pub(super) moved: Vec<(String, Waypoint)>,
    /// A part with another mesh, from a file that has just one (repeatable)
    #[arg(long, value_name = "PART=FILE", value_parser = replaced)]
    pub(super) replaced: Vec<(String, PathBuf)>,
    /// Further parts from a file or folder (repeatable)
    #[arg(long, value_name = "PATH")]
    pub(super) added: Vec<PathBuf>,
    /// Plan how the assembly is put together: the disassembly reversed, and each part's way from where it
    /// waits to where its insertion begins
    #[arg(long = "assembly")]
    pub(super) together: bool,
    /// Where parts wait in an assembly plan: `auto` lays them out beside the assembly; with `none` each
    /// appears where its insertion begins; a JSON file says {"PART": [X,Y,Z,W,X,Y,Z], …}, a motion of
    /// the mesh from where it was given, turned or not (parts that it does not name are laid out)
    #[arg(long, value_name = "auto|none|FILE", requires = "together", default_value = "auto")]
    pub(super) staging: PathBuf,
    /// Write there what the search did, one JSON object per line (see `sbdp explain`)
    #[arg(long, value_name = "FILE")]
    pub(super) trace: Option<PathBuf>,
    /// Do not use the cache
    #[arg(long)]
    pub(super) no_cache: bool,
    /// The folder of what is remembered on disk [default: $SBDP_CACHE_DIR, else
    /// $XDG_CACHE_HOME/sbdp, else ~/.cache/sbdp]; plans in this process
    #[arg(long, value_name = "DIR", conflicts_with_all = ["no_cache", "daemon"])]
    pub(super) cache_dir: Option<PathBuf>,
    /// Plan in this process, even if a daemon runs
    #[arg(long, conflicts_with = "daemon")]
    pub(super) embedded: bool,
    /// Plan in the daemon, which must be running
    #[arg(long)]
    pub(super) daemon: bool,
    /// In the table, list all overlaps and all blocked actions
    #[arg(short, long)]
    pub(super) verbose: bool,
    /// Show no progress and no table: only files, errors and the exit code
    #[arg(short, long, conflicts_with = "verbose")]
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
    /// Of which blocking graphs
    #[arg(long, value_enum, default_value_t, requires = "graphs")]
    pub(super) dbg: Dbg,
}

/// Arguments of `sbdp explain`.
#[derive(Debug, Args)]
pub(super) struct ExplainArguments {
    /// A file that `sbdp plan --trace` wrote
    pub(super) trace: PathBuf,
}

/// Arguments of `sbdp bench`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(super) struct BenchArguments {
    #[command(subcommand)]
    pub(super) command: Option<BenchCommand>,
    #[command(flatten)]
    pub(super) run: Option<BenchRun>,
}

/// What else to do with a benchmark.
#[derive(Debug, Subcommand)]
pub(super) enum BenchCommand {
    /// Plan families of assemblies with ever more parts, and see how time and memory grow
    Scale(BenchScale),
    /// Print the runs of a benchmark, one line of JSON each, for `run-unit`
    Units(BenchUnits),
    /// Run one line of `units` and print its record, a line of results.jsonl
    RunUnit(BenchUnit),
    /// Put results together, as those of shards, and evaluate them without running anything
    Report(BenchReport),
    /// Ask a daemon for the same plan again and again, beside a peer that only copies its bytes
    Latency(BenchLatency),
    /// Plan again through a daemon when one part changed, beside a daemon that planned nothing before
    Replan(BenchReplan),
    /// Start a daemon again and again: its first answers with a warm disk, beside answers from memory
    Restart(BenchRestart),
    /// Plan many different assemblies, one after the other, through a daemon with small budgets
    Churn(BenchChurn),
    /// Put a daemon under the load of many clients at once: nothing may be lost, and it may not grow
    Load(BenchLoad),
    /// Kill clients and daemons at random moments: in the end all answers are there, and nothing is left over
    Soak(BenchSoak),
    /// End plans at moments all over them, by cancelling and by deadline: how long until the worker is free
    Cancel(BenchCancel),
    /// A client of `load`
    #[command(hide = true)]
    LoadClient(BenchLoadClient),
    /// The peer of `latency`
    #[command(hide = true)]
    RawPeer(BenchRawPeer),
}

/// A benchmark to be run.
#[derive(Debug, Args)]
pub(super) struct BenchRun {
    /// Folders of assemblies: every folder below with .obj or .stl files in it is one
    #[arg(value_name = "DIR", required = true)]
    pub(super) corpora: Vec<PathBuf>,
    /// Which searches; `pdp-star` stands for `pdp-t` and `pdp-r`, which it is put together from
    #[arg(long, value_name = "PLANNER,…", value_delimiter = ',', default_values = PAPER_PLANNERS,
        value_parser = PossibleValuesParser::new(PLANNERS))]
    pub(super) planners: Vec<String>,
    /// Which simulations
    #[arg(long, value_name = "ENGINE,…", value_delimiter = ',', default_value = ENGINES[0],
        value_parser = PossibleValuesParser::new(ENGINES))]
    pub(super) engines: Vec<String>,
    /// A run must answer after this time of planning. Verification does not count. A run that does not answer is
    /// ended
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "7200",
        allow_negative_numbers = true)]
    pub(super) timeout: Duration,
    /// One motion, or a baseline's search for one part, is given up after this time
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "360",
        allow_negative_numbers = true)]
    pub(super) path_timeout: Duration,
    /// Which actions all planners have
    #[arg(long, value_enum, default_value = "paper")]
    pub(super) actions: Actions,
    /// How blocking graphs are begun, before anything is simulated
    #[arg(long, value_enum, default_value_t)]
    pub(super) dbg: Dbg,
    // Not as one flattened group: within an optional group, clap then takes the whole for absent.
    /// Take parts that leave straight out without simulation, with sbdp-star and sbdp [default with
    /// extended actions]
    #[arg(long, overrides_with = "no_sweeps")]
    sweeps: bool,
    /// Simulate parts that leave straight, too [default with the paper's actions]
    #[arg(long, overrides_with = "sweeps")]
    no_sweeps: bool,
    /// Where results, tables and figures go; a benchmark that was interrupted goes on there
    #[arg(long, value_name = "DIR", required = true)]
    pub(super) out: Option<PathBuf>,
    /// Run only the K-th of N parts of the corpus, as 2/8; `bench report` puts them together
    #[arg(long, value_name = "K/N")]
    pub(super) shard: Option<Shard>,
    /// Leave out assemblies of more parts
    #[arg(long, value_name = "N")]
    pub(super) parts_up_to: Option<usize>,
    /// Run every assembly as it is, and then under this number of random rotations of its own
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(super) rotations: u32,
    /// Which rotations: the same seed gives the same ones
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(super) seed: u64,
    /// Runs at a time; more than one disturb each other's times
    #[arg(long, value_name = "N", default_value = "1")]
    pub(super) jobs: NonZeroUsize,
    /// Worker threads of each run [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(super) threads: u32,
}

impl BenchRun {
    pub(super) fn sweeps(&self) -> Sweeps {
        Sweeps { sweeps: self.sweeps, no_sweeps: self.no_sweeps }
    }
}

/// Arguments of `sbdp bench units`: those of a benchmark, without where results go.
#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.required(false).hide(true)), mut_arg("jobs", |jobs| jobs.hide(true)))]
pub(super) struct BenchUnits {
    #[command(flatten)]
    pub(super) run: BenchRun,
}

/// Arguments of `sbdp bench run-unit`.
#[derive(Debug, Args)]
pub(super) struct BenchUnit {
    /// The line [default: stdin's first]
    #[arg(value_name = "UNIT")]
    pub(super) unit: Option<String>,
}

/// Arguments of `sbdp bench scale`.
#[derive(Debug, Args)]
pub(super) struct BenchScale {
    /// Which kinds of assemblies
    #[arg(long, value_enum, value_name = "FAMILY,…", value_delimiter = ',',
        default_values = ["bolted-frame", "rack", "gear-train"])]
    pub(super) families: Vec<FamilyArgument>,
    /// With how many parts
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = PARTS)]
    pub(super) parts: Vec<usize>,
    /// A run must answer after this time of planning. Verification does not count. A run that does not answer is
    /// ended
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "7200",
        allow_negative_numbers = true)]
    pub(super) timeout: Duration,
    #[command(flatten)]
    pub(super) sweeps: Sweeps,
    /// Worker threads of each run [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(super) threads: u32,
    /// Where assemblies and results go; a benchmark that was interrupted goes on there
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
}

/// A kind of assembly.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(super) enum FamilyArgument {
    /// Two layers of beams, bolted where they cross
    BoltedFrame,
    /// Uprights, shelves, trays and what lies in them
    Rack,
    /// Meshing gears on shafts between two plates
    GearTrain,
}

impl From<FamilyArgument> for bench::Family {
    fn from(family: FamilyArgument) -> Self {
        match family {
            FamilyArgument::BoltedFrame => Self::BoltedFrame,
            FamilyArgument::Rack => Self::Rack,
            FamilyArgument::GearTrain => Self::GearTrain,
        }
    }
}

/// Arguments of `sbdp bench report`.
#[derive(Debug, Args)]
pub(super) struct BenchReport {
    /// Output folders of `sbdp bench`
    #[arg(value_name = "DIR", required = true)]
    pub(super) results: Vec<PathBuf>,
    /// Where the merged results, tables and figures go [default: the folder, if it is one]
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
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
    /// A random tree per part, of straight ways
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
    /// Where none leaves alone
    #[default]
    Needed,
    /// Also those that belong together where the assembly comes from, as long as anything else leaves
    Prefer,
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
    /// Take parts that leave straight out without simulation, with sbdp-star and sbdp [default with
    /// extended actions]
    #[arg(long, overrides_with = "no_sweeps")]
    sweeps: bool,
    /// Simulate parts that leave straight, too [default with the paper's actions]
    #[arg(long, overrides_with = "sweeps")]
    no_sweeps: bool,
}

impl Sweeps {
    /// What was asked for, if anything.
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
