//! The stages of the engine `sliding`, each as a whole and on one thread:
//! `cargo bench --bench simulation -- FOLDER …` for assemblies in folders (or `SBDP_MESHES=FOLDER:…`),
//! else for the small ones of the tests.
//!
//! All parts stand as assembled, none allowed more overlap than it has. Per assembly, in
//! microseconds, median and ninetieth percentile: `pair`, static analysis of one pair of near parts in
//! all six translations; `sweep`, the test whether a part leaves straight along a world axis; `push`,
//! a translation that travels more than one unit of the planning frame; `turn`, a motion under a
//! torque, or a force with freedom to turn, that does; `stopped`, a motion of either kind that ends
//! within that. Fields are warm: what fills their bricks is not counted. With `SBDP_MOTIONS` set, each motion
//! is told in a line of its own.

mod folders;
mod scenes;

use std::path::PathBuf;
use std::time::Instant;

use sbdp::scene::StandingParts;
use sbdp::simulation::{
    Action, Axis, Motion, SlidingEngine, SweepQuestion, TransitionFunction, pair_blocks, straight_sweep,
};
use sbdp::termination::Termination;

/// Static analysis's least travel.
const LEAST_TRAVEL: f64 = 0.05;
/// What a motion travels to count as one that gets somewhere.
const FAR: f64 = 1.0;
/// Those of the tests that are measured if no others are given.
const OWN: [&str; 4] = ["l-slot", "pin-bolt-cover", "bolted-bracket-20", "threaded-bolt-and-nut"];
const COLUMNS: [&str; 5] = ["pair", "sweep", "push", "turn", "stopped"];

fn main() {
    let mut folders = folders::given();
    if folders.is_empty() {
        let own = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/assemblies");
        folders = OWN.iter().map(|name| own.join(name)).collect();
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let head: Vec<_> = COLUMNS.iter().map(|c| format!("{c}: n | median | p90")).collect();
    println!("| assembly | {} |\n|---|{}", head.join(" | "), "---|".repeat(3 * COLUMNS.len()));
    let mut all: [Vec<f64>; 5] = Default::default();
    for folder in folders {
        let measured = match &pool {
            Ok(pool) => pool.install(|| measure(&folder)),
            Err(_) => measure(&folder),
        };
        match measured {
            Ok(times) => {
                print(&folders::name(&folder), &times);
                all.iter_mut().zip(times).for_each(|(all, times)| all.extend(times));
            }
            Err(reason) => println!("| {} | {reason} |", folders::name(&folder)),
        }
    }
    print("all", &all);
}

fn measure(folder: &std::path::Path) -> Result<[Vec<f64>; 5], String> {
    let never = Termination::default();
    let scene = scenes::of(folder, &never)?;
    let mut times: [Vec<f64>; 5] = Default::default();
    let translations = Action::translations();
    for (a, b) in scene.broad_phase.pairs(0.0) {
        let pose = scene.bodies[a].planning_from_shape;
        times[0].push(timed(|| pair_blocks(&scene, a, &pose, b, &translations, LEAST_TRAVEL, &never)).1);
    }
    let turning = Action::rotations_about(&Axis::WORLD);
    let tells_each = std::env::var_os("SBDP_MOTIONS").is_some();
    for part in 0..scene.bodies.len() {
        let standing = (0..scene.bodies.len()).filter(|&i| i != part).collect();
        let around = StandingParts::new(&scene, standing);
        let pose = scene.bodies[part].planning_from_shape;
        for action in &translations {
            let direction = &action.force();
            let question =
                SweepQuestion { scene: &scene, standing_parts: &around, part, start: &pose, direction };
            let sweep = || straight_sweep(&question, &never);
            times[1].push(timed(sweep).1);
        }
        for action in translations.iter().chain(&turning) {
            let simulated = || SlidingEngine.simulate(&scene, &around, part, &pose, *action, &never);
            let (motion, time) = timed(simulated);
            let motion = motion.map_err(|e| format!("{e:?}"))?;
            let column = match travel(&motion) > FAR {
                true => 2 + usize::from(action.turns()),
                false => 4,
            };
            times[column].push(time);
            if tells_each {
                println!(
                    "{part} {action} {time:.0} us, {} poses, {:.2} far: {:?}",
                    motion.path.len(),
                    travel(&motion),
                    motion.end
                );
            }
        }
    }
    Ok(times)
}

/// What a question comes to, and the microseconds it takes the second time.
fn timed<T>(mut question: impl FnMut() -> T) -> (T, f64) {
    question();
    let started = Instant::now();
    let answer = question();
    (answer, started.elapsed().as_secs_f64() * 1e6)
}

fn travel(motion: &Motion) -> f64 {
    let ends = motion.path.first().zip(motion.path.last());
    ends.map_or(0.0, |(a, b)| (b.translation.vector - a.translation.vector).norm())
}

fn print(name: &str, times: &[Vec<f64>; 5]) {
    let columns = times.iter().map(|times| scenes::told(times));
    println!("| {name} | {} |", columns.collect::<Vec<_>>().join(" | "));
}
