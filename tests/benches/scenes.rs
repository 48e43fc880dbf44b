//! Assemblies as engines see them, and how times are told.

use std::path::Path;
use std::sync::Arc;

use sbdp::files::load_assembly;
use sbdp::geometry::Assembly;
use sbdp::plan::Verifier;
use sbdp::scene::{CongruentPair, Scene};
use sbdp::sdf::Field;
use sbdp::termination::{Interrupt, Termination};

/// Verification's limit, as a share of the longest side.
const DEPTH_LIMIT: f64 = 2e-4;

/// The assembly of a folder with its fields and the overlaps it has.
pub(crate) fn of(folder: &Path, never: &Termination) -> Result<Scene, String> {
    let source = load_assembly(folder).map_err(|e| e.to_string())?;
    let assembly = Assembly::new(&source).map_err(|e| e.to_string())?;
    assembled(&assembly, never).map_err(|e| format!("{e:?}"))
}

fn assembled(assembly: &Assembly, never: &Termination) -> Result<Scene, Interrupt> {
    let fields = assembly.shapes.iter().map(|s| Field::build(&s.surface, never).map(Arc::new));
    let mut scene = Scene::assembled(assembly, &fields.collect::<Result<Vec<_>, _>>()?);
    let shape_of = assembly.parts.iter().map(|p| p.shape).collect();
    let verifier = Verifier::new(&assembly.shapes, shape_of, DEPTH_LIMIT * scene.longest_side);
    for (a, b) in scene.broad_phase.pairs(0.0) {
        let depth = verifier.assembled_depth(&scene, &CongruentPair::turned(&scene, a, b), never)?;
        if depth > 1e-6 * scene.longest_side {
            scene.allowed.allow(a, b, depth);
        }
    }
    Ok(scene)
}

/// How many times there are, their median and their ninetieth percentile, as cells of a table.
pub(crate) fn told(times: &[f64]) -> String {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get((sorted.len() as f64 * share) as usize);
    let [median, high] = [0.5, 0.9].map(|s| at(s).map_or("–".to_owned(), |t| format!("{t:.0}")));
    format!("{} | {median} | {high}", times.len())
}
