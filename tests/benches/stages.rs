//! The stages of single steps of the engine `sliding`, on one thread:
//! `cargo bench --bench stages -- FOLDER …` for assemblies in folders (or `SBDP_MESHES=FOLDER:…`), else for
//! the small ones of the tests.
//!
//! All parts stand as assembled, none allowed more overlap than it has. Of each part's motions under the
//! translations and turns of the paper (up to eight poses of each, spread over the way), per assembly and by what
//! tells of contact (see [`PairMethod`]), in microseconds, median and ninetieth percentile: `gather`, `reduce`,
//! `solve` and `advance` (see [`StepCost`]).

mod folders;
mod scenes;

use std::path::{Path, PathBuf};

use sbdp::geometry::Pose;
use sbdp::scene::StandingParts;
use sbdp::simulation::{Action, Axis, PairMethod, SlidingEngine, StepCost, TransitionFunction, step_costs};
use sbdp::termination::Termination;

/// Poses of a motion that are looked at.
const POSES: usize = 8;
/// Those of the tests that are measured if no others are given.
const OWN: [&str; 4] = ["l-slot", "pin-bolt-cover", "bolted-bracket-20", "threaded-bolt-and-nut"];
const TELLING: [PairMethod; 3] = [PairMethod::Shifts, PairMethod::Regions, PairMethod::Samples];

fn main() {
    let mut folders = folders::given();
    if folders.is_empty() {
        let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies");
        folders = OWN.iter().map(|name| own.join(name)).collect();
    }
    println!(
        "| assembly | told by | gather: n | median | p90 | reduce: n | median | p90 | solve: n | median | p90 | advance: n | median | p90 |\n|{}",
        "---|".repeat(14)
    );
    let mut all = Vec::new();
    for folder in folders {
        let name = folders::name(&folder);
        match measured(&folder) {
            Ok(costs) => {
                print(&name, &costs);
                all.extend(costs);
            }
            Err(reason) => println!("| {name} | {reason} |"),
        }
    }
    print("all", &all);
}

fn measured(folder: &Path) -> Result<Vec<StepCost>, String> {
    let never = Termination::default();
    let scene = scenes::of(folder, &never)?;
    let actions: Vec<Action> =
        Action::translations().into_iter().chain(Action::rotations_about(&Axis::WORLD)).collect();
    let mut costs = Vec::new();
    for part in 0..scene.bodies.len() {
        let standing = (0..scene.bodies.len()).filter(|&i| i != part).collect();
        let around = StandingParts::new(&scene, standing);
        let start = scene.bodies[part].planning_from_shape;
        for &action in &actions {
            let motion = SlidingEngine.simulate(&scene, &around, part, &start, action, &never);
            let path = motion.map_err(|e| format!("{e:?}"))?.path;
            let every = path.len().div_ceil(POSES).max(1);
            let poses: Vec<Pose> = path.into_iter().step_by(every).collect();
            let found = step_costs(&scene, &around, (part, &poses), action, &never);
            costs.extend(found.map_err(|e| format!("{e:?}"))?);
        }
    }
    Ok(costs)
}

fn print(name: &str, costs: &[StepCost]) {
    for telling in TELLING {
        let of = |stage: fn(&StepCost) -> f64| -> Vec<f64> {
            costs.iter().filter(|c| c.telling == telling).map(stage).collect()
        };
        let stages = [of(|c| c.gather), of(|c| c.reduce), of(|c| c.solve), of(|c| c.advance)];
        let columns = stages.map(|times| scenes::told(&times));
        println!("| {name} | {telling:?} | {} |", columns.join(" | "));
    }
}
