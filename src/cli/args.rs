//! The command line as the user writes it.

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::search;

/// Plans how assemblies come apart.
#[derive(Debug, Parser)]
#[command(name = "sbdp", version, about, after_help = EXIT_CODES)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 complete, 2 wrong usage or refused input, 3 infeasible or partial, \
4 timeout, 5 cancelled, 1 anything else.";

/// What to do.
#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Plan in which order and along which paths the parts of an assembly come off
    Plan(Box<PlanArguments>),
    /// Say what is found in an assembly's files: healing, sizes, overlaps
    Check(CheckArguments),
    /// Tell in words what a search did, from its trace
    Explain(ExplainArguments),
    /// Say how the running daemon is
    Status,
}

/// Arguments of `sbdp plan`.
#[derive(Debug, Args)]
pub(super) struct PlanArguments {
    /// A folder of OBJ and STL files in assembled pose, one such file, or a glTF or GLB scene
    pub(super) assembly: PathBuf,
    /// Write the plan there as JSON (contract sbdp-plan/1); `-` writes it to stdout in place of the table
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
    /// Which search
    #[arg(long, value_enum, default_value_t)]
    pub(super) planner: Planner,
    /// Which transition function
    #[arg(long, value_enum, default_value_t)]
    pub(super) engine: Engine,
    /// A parameter of the engine `penalty`, as `stiffness=1e5` (repeatable); plans in this process
    #[arg(long, value_name = "NAME=VALUE", conflicts_with = "daemon")]
    pub(super) penalty: Vec<String>,
    /// Which actions [default: extended for sbdp-star, paper for all other planners]
    #[arg(long, value_enum)]
    pub(super) actions: Option<Actions>,
    /// Answer after so many seconds with what is there
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    pub(super) timeout: Option<Duration>,
    /// Give one motion, or one part's search of a pdp planner, up after so many seconds; plans in
    /// this process [default: no limit; the paper has 360]
    #[arg(long, value_name = "SECONDS", value_parser = seconds, conflicts_with = "daemon")]
    pub(super) path_timeout: Option<Duration>,
    /// Give up after so many simulations
    #[arg(long, value_name = "N")]
    pub(super) max_simulations: Option<u64>,
    /// Worker threads; never changes the plan [default: all processors]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    pub(super) threads: u32,
    /// A part that may not move (repeatable)
    #[arg(long, value_name = "PART")]
    pub(super) fixed: Vec<String>,
    /// A part that is gone already (repeatable)
    #[arg(long, value_name = "PART")]
    pub(super) removed: Vec<String>,
    /// A part that must come out (repeatable) [default: all]
    #[arg(long, value_name = "PART")]
    pub(super) target: Vec<String>,
    /// Write there what the search did, one JSON object per line (see `sbdp explain`); plans in
    /// this process
    #[arg(long, value_name = "FILE", conflicts_with = "daemon")]
    pub(super) trace: Option<PathBuf>,
    /// Neither read nor write anything remembered
    #[arg(long)]
    pub(super) no_cache: bool,
    /// Plan in this process, even if a daemon runs
    #[arg(long, conflicts_with = "daemon")]
    pub(super) embedded: bool,
    /// Plan in the daemon, which must be running
    #[arg(long)]
    pub(super) daemon: bool,
}

/// Arguments of `sbdp check`.
#[derive(Debug, Args)]
pub(super) struct CheckArguments {
    /// A folder of OBJ and STL files in assembled pose, one such file, or a glTF or GLB scene
    pub(super) assembly: PathBuf,
    /// Also simulate every translation from the assembled pose, and compare with what the blocking
    /// graphs exclude
    #[arg(long)]
    pub(super) graphs: bool,
}

/// Arguments of `sbdp explain`.
#[derive(Debug, Args)]
pub(super) struct ExplainArguments {
    /// A file that `sbdp plan --trace` wrote
    pub(super) trace: PathBuf,
}

/// Which search.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(super) enum Planner {
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
}

impl From<Planner> for search::Planner {
    fn from(planner: Planner) -> Self {
        match planner {
            Planner::SbdpStar => Self::SbdpStar,
            Planner::Sbdp => Self::Sbdp,
            Planner::PdpT => Self::PdpT,
            Planner::PdpR => Self::PdpR,
            Planner::PdpStar => Self::PdpStar,
        }
    }
}

/// Which transition function.
#[derive(Debug, Clone, Copy, Default, ValueEnum)]
pub(super) enum Engine {
    /// Contact-constrained sliding without inertia
    #[default]
    Sliding,
    /// The paper's simulation: rigid-body dynamics with penalty forces
    Penalty,
}

impl From<Engine> for search::Engine {
    fn from(engine: Engine) -> Self {
        match engine {
            Engine::Sliding => Self::Sliding,
            Engine::Penalty => Self::Penalty,
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

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "not a number of seconds from 0 on".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        use clap::CommandFactory;
        Arguments::command().debug_assert();
    }

    #[test]
    fn seconds_are_from_zero_on() {
        assert_eq!(seconds("1.5"), Ok(Duration::from_millis(1500)));
        assert_eq!(seconds("0"), Ok(Duration::ZERO));
        for wrong in ["-1", "nan", "inf", "x", ""] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
