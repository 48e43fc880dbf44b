//! What asks how the parts of a plan stand: the arguments of `sbdp statics` and `schedule`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::Args;

use sbdp_ipc::plan::FRICTION;

use super::poses::{direction as vector, not_negative};

/// A plan, and how its parts stand.
#[derive(Debug, Args)]
pub(in crate::cli) struct StandingArguments {
    /// A plan that `sbdp plan --json` wrote
    pub(in crate::cli) plan: PathBuf,
    /// Its assembly [default: the one that the plan names]
    #[arg(long, value_name = "ASSEMBLY")]
    pub(in crate::cli) meshes: Option<PathBuf>,
    /// Coefficient of friction of all contacts: 0.2 is dry machined steel at the lower end, 0.05 oiled steel, 0.5 rubber
    #[arg(long, value_name = "MU", default_value_t = FRICTION, value_parser = not_negative, allow_negative_numbers = true)]
    pub(in crate::cli) friction: f64,
    /// Gap up to which two surfaces count as touching, in the input's units [default: a hundredth of the longest side of
    /// the smaller part]
    #[arg(long, value_name = "LENGTH", value_parser = not_negative, allow_negative_numbers = true)]
    pub(in crate::cli) gap: Option<f64>,
    /// The direction against gravity, as +z or as a vector [default: +z; +y for glTF scenes]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub(in crate::cli) up: Option<[f64; 3]>,
    /// A part that stays where it is whatever happens (repeatable) [default: the plan's base and fixed parts]
    #[arg(long, value_name = "PART")]
    pub(in crate::cli) stays: Vec<String>,
    /// Two parts that are one body while both stand, as if glued (repeatable) [default: what overlaps, shares a thread, or is
    /// a nut or screw by its shape]
    #[arg(long, value_names = ["PART", "OTHER"], num_args = 2)]
    pub(in crate::cli) join: Vec<String>,
    /// Two parts that are not, though their shapes look so (repeatable)
    #[arg(long, value_names = ["PART", "OTHER"], num_args = 2)]
    pub(in crate::cli) apart: Vec<String>,
}

/// Arguments of `sbdp statics`.
#[derive(Debug, Args)]
pub(in crate::cli) struct StaticsArguments {
    #[command(flatten)]
    pub(in crate::cli) standing: StandingArguments,
    /// Also find out how much of the weight may act sideways until something falls; it takes many times as long
    #[arg(long)]
    pub(in crate::cli) margin: bool,
    /// Write the states as JSON to this file (`-`: to stdout, instead of the table)
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}

/// Arguments of `sbdp schedule`.
#[derive(Debug, Args)]
pub(in crate::cli) struct ScheduleArguments {
    #[command(flatten)]
    pub(in crate::cli) standing: StandingArguments,
    /// Number of arms (workers' hands, robots), each of which moves one part or group, or holds one part
    #[arg(long, value_name = "N", default_value = "2")]
    pub(in crate::cli) arms: NonZero<usize>,
    /// Instead, divide the steps in the plan's order among this many stations of a line, so that the slowest is as fast as
    /// possible
    #[arg(long, value_name = "N", conflicts_with = "arms")]
    pub(in crate::cli) stations: Option<NonZero<usize>>,
    /// Do without regard to what falls: no arm has to hold
    #[arg(long)]
    pub(in crate::cli) weightless: bool,
    /// A TOML file with the times `grasp`, `put_down` and `turn` in s, and the `speed` in mm/s [default: 2, 2, 2, 100]
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) times: Option<PathBuf>,
    /// Write the schedule as JSON to this file (`-`: to stdout, instead of the table)
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) json: Option<PathBuf>,
}
