//! What shows plans: the arguments of `sbdp view`, `graph` and `steps`.

use std::path::PathBuf;

use clap::Args;
use nalgebra::{Unit, Vector3};

use super::{Input, PlanArguments};
use crate::simulation::{Action, Axis};

/// Arguments of `sbdp view`.
#[derive(Debug, Args)]
#[command(mut_arg("assembly", |a| a.value_name("ASSEMBLY|PLAN.json").help(
    "An assembly, to be planned first, or a plan that `sbdp plan --json` wrote"
)))]
pub(in crate::cli) struct ViewArguments {
    #[command(flatten)]
    pub(in crate::cli) plan: PlanArguments,
    /// File for the page [default: beside the assembly or plan, by its name, with `.html`]
    #[arg(short, long, value_name = "FILE")]
    pub(in crate::cli) output: Option<PathBuf>,
    /// Open the page in the browser (by `xdg-open`)
    #[arg(long)]
    pub(in crate::cli) open: bool,
    /// For a PLAN.json: its assembly [default: the one that it names]
    #[arg(long, value_name = "ASSEMBLY")]
    pub(in crate::cli) meshes: Option<PathBuf>,
}

/// Arguments of `sbdp graph`.
#[derive(Debug, Args)]
pub(in crate::cli) struct GraphArguments {
    #[command(flatten)]
    pub(in crate::cli) input: Input,
    /// +x, -x, +y, -y, +z, -z or X,Y,Z (repeatable) [default: both ways along the axes that a search of
    /// this assembly uses]
    #[arg(long, value_name = "DIRECTION", value_parser = direction, allow_hyphen_values = true)]
    pub(in crate::cli) direction: Vec<Action>,
    /// A part that has been removed already (repeatable)
    #[arg(long, value_name = "PART")]
    pub(in crate::cli) removed: Vec<String>,
    /// Where the picture goes: .svg, with equal parts as one box, or .dot for Graphviz, with all parts. Of several
    /// directions, each gets an .svg of its own: `graph.svg` becomes `graph+x.svg`, `graph-x.svg` …
    #[arg(short, long, value_name = "FILE")]
    pub(in crate::cli) output: PathBuf,
}

/// Arguments of `sbdp precedence`.
#[derive(Debug, Args)]
pub(in crate::cli) struct PrecedenceArguments {
    /// A plan that `sbdp plan --json` wrote
    pub(in crate::cli) plan: PathBuf,
    /// Where it goes: .dot for Graphviz; .json; .pddl for the problem of a task planner, whose domain goes beside it
    /// (`order.pddl`: `order-domain.pddl`)
    #[arg(short, long, value_name = "FILE")]
    pub(in crate::cli) output: PathBuf,
}

/// Arguments of `sbdp steps`.
#[derive(Debug, Args)]
pub(in crate::cli) struct StepsArguments {
    /// A plan that `sbdp plan --json` wrote
    pub(in crate::cli) plan: PathBuf,
    /// Its assembly, from which equal parts are found [default: the one that the plan names; where that is missing, parts
    /// are equal if their names differ only in a number]
    #[arg(long, value_name = "ASSEMBLY")]
    pub(in crate::cli) meshes: Option<PathBuf>,
    /// Draw a PNG picture per instruction into this folder, which is made if it is not there: `step-3.png`, or
    /// `steps-1-4.png` for equal parts; and an exploded view, `overview.png`. Not together with words on stdout
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) pictures: Option<PathBuf>,
    /// Write the instructions with their pictures as one HTML file, for the screen and for paper
    #[arg(long, value_name = "FILE")]
    pub(in crate::cli) html: Option<PathBuf>,
}

fn direction(text: &str) -> Result<Action, String> {
    let wrong = || "not +x, -x, +y, -y, +z, -z, nor three numbers X,Y,Z of which one is not 0".to_owned();
    let unit = match text.split_at_checked(1) {
        Some((sign @ ("+" | "-"), axis @ ("x" | "y" | "z"))) => {
            let axis = Axis::WORLD["xyz".find(axis).unwrap_or(0)].unit();
            if sign == "+" { axis } else { -axis }
        }
        _ => {
            let numbers: Vec<f64> =
                text.split(',').map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
            let numbers: [f64; 3] = numbers.try_into().map_err(|_| wrong())?;
            Unit::try_new(Vector3::from(numbers), f64::MIN_POSITIVE)
                .filter(|u| u.iter().all(|x| x.is_finite()))
                .ok_or_else(wrong)?
        }
    };
    let axis = Axis::along(unit);
    Ok(Action::Push(axis, axis.unit().dot(&unit) > 0.0))
}

#[cfg(test)]
mod tests {
    use super::direction;

    #[test]
    fn directions_are_axes_or_numbers() {
        for (text, name) in [("+x", "+x"), ("-z", "-z"), ("0,-2,0", "-y"), ("0.6,0,0.8", "+[0.60,0.00,0.80]")]
        {
            assert_eq!(direction(text).unwrap().to_string(), name);
        }
        for text in ["", "x", "+w", "+xy", "0,0,0", "1,2", "1,2,nan", "é"] {
            assert!(direction(text).unwrap_err().contains("+x"), "{text}");
        }
    }
}
