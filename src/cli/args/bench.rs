//! The arguments of `sbdp bench`, but for those of benchmarks through a daemon.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand, ValueEnum};

use super::load::{BenchCancel, BenchLoad, BenchLoadClient, BenchSoak};
use super::through_daemon::{BenchChurn, BenchLatency, BenchRawPeer, BenchReplan, BenchRestart};
use super::{Actions, Dbg, Sweeps, seconds};
use crate::bench::{self, ENGINES, PAPER_PLANNERS, PARTS, PLANNERS, Shard};

/// Arguments of `sbdp bench`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub(in crate::cli) struct BenchArguments {
    #[command(subcommand)]
    pub(in crate::cli) command: Option<BenchCommand>,
    #[command(flatten)]
    pub(in crate::cli) run: Option<BenchRun>,
}

/// What else to do with a benchmark.
#[derive(Debug, Subcommand)]
pub(in crate::cli) enum BenchCommand {
    /// Plan families of assemblies of growing size: how time and memory grow
    Scale(BenchScale),
    /// Print the runs of a benchmark, one line of JSON each, for `run-unit`
    Units(BenchUnits),
    /// Run one line of `units` and print its record, a line of results.jsonl
    RunUnit(BenchUnit),
    /// Merge results, as those of shards, and evaluate them without running anything
    Report(BenchReport),
    /// Request the same plan repeatedly from a daemon, beside a peer that only copies its bytes
    Latency(BenchLatency),
    /// Request plans after one part changed, from a daemon that planned before and from a new one
    Replan(BenchReplan),
    /// Restart a daemon repeatedly: its first answers with a warm disk, beside answers from memory
    Restart(BenchRestart),
    /// Plan many different assemblies through a daemon with small budgets
    Churn(BenchChurn),
    /// Load a daemon with many clients: no answer may be lost, and its memory may not grow
    Load(BenchLoad),
    /// Kill clients and daemons at random moments: all answers must arrive, and nothing may be left over
    Soak(BenchSoak),
    /// Cancel plans at many moments, and by deadline: how long until the worker is free
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
pub(in crate::cli) struct BenchRun {
    /// Folders of assemblies: every folder below with .obj or .stl files in it is one
    #[arg(value_name = "DIR", required = true)]
    pub(in crate::cli) corpora: Vec<PathBuf>,
    /// Planners; `pdp-star` stands for `pdp-t` and `pdp-r`, from which it is computed
    #[arg(long, value_name = "PLANNER,…", value_delimiter = ',', default_values = PAPER_PLANNERS,
        value_parser = PossibleValuesParser::new(PLANNERS))]
    pub(in crate::cli) planners: Vec<String>,
    /// Engines
    #[arg(long, value_name = "ENGINE,…", value_delimiter = ',', default_value = ENGINES[0],
        value_parser = PossibleValuesParser::new(ENGINES))]
    pub(in crate::cli) engines: Vec<String>,
    /// Longest planning time of a run; verification does not count. A run that does not answer is killed
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "7200",
        allow_negative_numbers = true)]
    pub(in crate::cli) timeout: Duration,
    /// Give up one motion, or the search of a baseline for one part, after this time
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "360",
        allow_negative_numbers = true)]
    pub(in crate::cli) path_timeout: Duration,
    /// Actions of all planners
    #[arg(long, value_enum, default_value = "paper")]
    pub(in crate::cli) actions: Actions,
    /// First blocking graphs, before anything is simulated
    #[arg(long, value_enum, default_value_t)]
    pub(in crate::cli) dbg: Dbg,
    // Not as one flattened group: within an optional group, clap then takes the whole for absent.
    /// Remove parts that leave straight without simulation, with sbdp-star and sbdp [default with extended actions]
    #[arg(long, overrides_with = "no_sweeps")]
    sweeps: bool,
    /// Simulate parts that leave straight, too [default with the paper's actions]
    #[arg(long, overrides_with = "sweeps")]
    no_sweeps: bool,
    /// Folder for results, tables and figures; an interrupted benchmark continues there
    #[arg(long, value_name = "DIR", required = true)]
    pub(in crate::cli) out: Option<PathBuf>,
    /// Run only the K-th of N parts of the corpus, as 2/8; `bench report` puts them together
    #[arg(long, value_name = "K/N")]
    pub(in crate::cli) shard: Option<Shard>,
    /// Leave out assemblies with more parts
    #[arg(long, value_name = "N")]
    pub(in crate::cli) parts_up_to: Option<usize>,
    /// Also run every assembly under this number of random rotations
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(in crate::cli) rotations: u32,
    /// Seed of the rotations
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub(in crate::cli) seed: u64,
    /// Simultaneous runs; more than one disturb each other's times
    #[arg(long, value_name = "N", default_value = "1")]
    pub(in crate::cli) jobs: NonZeroUsize,
    /// Worker threads of each run [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(in crate::cli) threads: u32,
}

impl BenchRun {
    pub(in crate::cli) fn sweeps(&self) -> Sweeps {
        Sweeps { sweeps: self.sweeps, no_sweeps: self.no_sweeps }
    }
}

/// Arguments of `sbdp bench units`: those of a benchmark, without where results go.
#[derive(Debug, Args)]
#[command(mut_arg("out", |out| out.required(false).hide(true)), mut_arg("jobs", |jobs| jobs.hide(true)))]
pub(in crate::cli) struct BenchUnits {
    #[command(flatten)]
    pub(in crate::cli) run: BenchRun,
}

/// Arguments of `sbdp bench run-unit`.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchUnit {
    /// The line [default: stdin's first]
    #[arg(value_name = "UNIT")]
    pub(in crate::cli) unit: Option<String>,
}

/// Arguments of `sbdp bench scale`.
#[derive(Debug, Args)]
pub(in crate::cli) struct BenchScale {
    /// Families of assemblies
    #[arg(long, value_enum, value_name = "FAMILY,…", value_delimiter = ',',
        default_values = ["bolted-frame", "rack", "gear-train"])]
    pub(in crate::cli) families: Vec<FamilyArgument>,
    /// Numbers of parts
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_values_t = PARTS)]
    pub(in crate::cli) parts: Vec<usize>,
    /// Longest planning time of a run; verification does not count. A run that does not answer is killed
    #[arg(long, value_name = "SECONDS", value_parser = seconds, default_value = "7200",
        allow_negative_numbers = true)]
    pub(in crate::cli) timeout: Duration,
    #[command(flatten)]
    pub(in crate::cli) sweeps: Sweeps,
    /// Worker threads of each run [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(in crate::cli) threads: u32,
    /// Folder for assemblies and results; an interrupted benchmark continues there
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) out: PathBuf,
}

/// A kind of assembly.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(in crate::cli) enum FamilyArgument {
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
pub(in crate::cli) struct BenchReport {
    /// Output folders of `sbdp bench`
    #[arg(value_name = "DIR", required = true)]
    pub(in crate::cli) results: Vec<PathBuf>,
    /// Folder for the merged results, tables and figures [default: the results folder, if there is one]
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) out: Option<PathBuf>,
}
