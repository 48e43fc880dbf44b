//! Static analysis: blocking relations of pairs, before anything is simulated.
//!
//! The paper tests whether vertices that are pushed a few steps along a direction come to lie
//! inside another part. Taken literally that blocks tilted pegs and press fits in all six
//! directions. Here an edge is added only if contact with the other part alone lets the wanted motion
//! come to almost nothing, so nothing that could slide is excluded. The relation is symmetric:
//! p is blocked by o along d exactly if o is blocked by p along −d.

use rayon::prelude::*;

use crate::geometry::Pose;
use crate::simulation::{Action, Scene, pair_blocks};
use crate::termination::{Interrupt, Termination};

use super::Blockage;

/// Blockages of all present parts at their assembled poses, for the six translations (in opposite
/// pairs: action `a ^ 1` is the reverse of `a`). One entry per part; absent parts stay open.
///
/// # Errors
/// The termination condition became true.
pub fn initial_blockages(
    scene: &Scene,
    present: &[usize],
    translations: &[Action],
    least: &(impl Fn(usize) -> f64 + Sync),
    termination: &Termination,
) -> Result<Vec<Blockage>, Interrupt> {
    let pairs: Vec<_> = present
        .iter()
        .enumerate()
        .flat_map(|(k, &p)| present[k + 1..].iter().map(move |&o| (p, o)))
        .filter(|&(p, o)| boxes_near(scene, p, o))
        .collect();
    let relations = pairs
        .par_iter()
        .map(|&(p, o)| {
            termination.check()?;
            // The smaller part moves: its steps are adapted to its size.
            let smaller = scene.bodies[p].bounds.extents().max() <= scene.bodies[o].bounds.extents().max();
            let (mover, other) = if smaller { (p, o) } else { (o, p) };
            let pose = scene.bodies[mover].planning_from_shape;
            Ok((mover, other, pair_blocks(scene, mover, &pose, other, translations, least(mover))))
        })
        .collect::<Result<Vec<_>, Interrupt>>()?;
    let mut out = vec![Blockage::open(translations.len()); scene.bodies.len()];
    for (mover, other, blocked) in relations {
        for a in (0..translations.len()).filter(|&a| blocked[a]) {
            out[mover].block_single(a, other);
            out[other].block_single(a ^ 1, mover);
        }
    }
    Ok(out)
}

/// The blockage of one displaced part among the parts that stand.
#[must_use]
pub fn blocked_from(
    scene: &Scene,
    standing: &[usize],
    part: usize,
    pose: &Pose,
    translations: &[Action],
    least: f64,
) -> Blockage {
    let mut out = Blockage::open(translations.len());
    let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(NEAR);
    for &other in standing.iter().filter(|&&o| scene.bodies[o].bounds.meets(&bounds)) {
        let blocked = pair_blocks(scene, part, pose, other, translations, least);
        for a in (0..translations.len()).filter(|&a| blocked[a]) {
            out.block_single(a, other);
        }
    }
    out
}

/// Boxes further apart than this cannot touch within the look-ahead.
const NEAR: f64 = 0.2;

fn boxes_near(scene: &Scene, a: usize, b: usize) -> bool {
    scene.bodies[a].bounds.grown(NEAR).meets(&scene.bodies[b].bounds)
}
