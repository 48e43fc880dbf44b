//! How good static analysis is: every action that it excludes at the assembled pose is simulated
//! all the same.

use rayon::prelude::*;

use crate::scene::{HullTree, Scene};
use crate::simulation::{Action, End, TransitionFunction};
use crate::termination::{Interrupt, Termination};

use super::{Analysis, StaticAnalysis};
use crate::cache::RequestCache;

/// What came of simulating excluded actions.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Audit {
    /// Translations of parts at their assembled poses.
    pub actions: usize,
    /// Of these, excluded by static analysis.
    pub excluded: usize,
    /// Of these, wrongly: part and action, because the part moves that way by more than the
    /// resolution of states.
    pub wrong: Vec<(usize, String)>,
    /// Not excluded, but the part does not move that way either: found by simulation only.
    pub overlooked: usize,
}

/// Audits the initial blocking graphs of some parts.
///
/// # Errors
/// The termination condition became true.
pub fn audit(
    rule: StaticAnalysis,
    scene: &Scene,
    present: &[usize],
    engine: &dyn TransitionFunction,
    least: &(impl Fn(usize) -> f64 + Sync),
    termination: &Termination,
) -> Result<Audit, Interrupt> {
    let translations = Action::translations();
    // Asked about what is computed, not about what is remembered.
    let cache = RequestCache::default();
    let analysis = Analysis { rule, scene, translations: &translations, cache: &cache };
    let graphs = analysis.assembled_graphs(present, least, termination)?;
    let everything = HullTree::new(scene, present.to_vec(), termination)?;
    let questions: Vec<_> =
        present.iter().flat_map(|&p| (0..translations.len()).map(move |a| (p, a))).collect();
    let moves = questions
        .par_iter()
        .map(|&(part, action)| {
            let around = everything.without(scene, part);
            let start = scene.bodies[part].planning_from_shape;
            let motion = engine.simulate(scene, &around, part, &start, translations[action], termination)?;
            let end = motion.path[motion.path.len() - 1];
            let centre = scene.bodies[part].shape.mass.centre;
            let travel = (end * centre - start * centre).norm();
            Ok(matches!(motion.end, End::Disassembled(_)) || travel > least(part))
        })
        .collect::<Result<Vec<bool>, Interrupt>>()?;
    let mut out = Audit { actions: questions.len(), ..Audit::default() };
    for ((part, action), moves) in questions.into_iter().zip(moves) {
        match (graphs[part].blockage.is_open(action), moves) {
            (true, true) => {}
            (true, false) => out.overlooked += 1,
            (false, moves) => {
                out.excluded += 1;
                if moves {
                    out.wrong.push((part, translations[action].to_string()));
                }
            }
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    use crate::fixtures::{block_on_plate, moved, peg_in_hole, scene};
    use crate::geometry::Pose;
    use crate::simulation::SlidingEngine;

    fn audited(rule: StaticAnalysis, scene: &Scene) -> Audit {
        audit(rule, scene, &[0, 1], &SlidingEngine, &|_| 0.05, &Termination::default()).unwrap()
    }

    #[test]
    fn the_literal_rule_holds_a_tilted_peg_that_can_leave() {
        let tilt = Pose::rotation(Vector3::new(0.1, 0.5, 0.0));
        let (scene, _) = scene(peg_in_hole(0.0).map(|m| moved(m, &tilt)));
        let found = audited(StaticAnalysis::Paper, &scene);
        assert!(found.excluded == 12 && !found.wrong.is_empty(), "{found:?}");
        assert!(audited(StaticAnalysis::Sliding, &scene).wrong.is_empty());
    }

    #[test]
    fn nothing_that_can_move_is_excluded() {
        for (meshes, excluded) in [(block_on_plate(), 2), (peg_in_hole(0.0), 10), (peg_in_hole(0.02), 10)] {
            let (scene, _) = scene(meshes);
            let found = audited(StaticAnalysis::Sliding, &scene);
            assert_eq!((found.actions, found.excluded, found.wrong.len()), (12, excluded, 0), "{found:?}");
        }
    }
}
