//! What must be done before a part's very path is free.
//!
//! A path was verified past the parts that stood. Here it is verified past each part that had left, too, where that
//! stood assembled: the path requires those that it enters to be out, and no other. For this to say something, the
//! path leads out of all parts that were there at the start, and not only of those that still stand.

use nalgebra::{Translation3, Vector3};

use crate::geometry::{Pose, transformed};
use crate::scene::{StandingParts, exit_direction};
use crate::termination::Interrupt;
use crate::tolerances::HULL_MARGIN;

use super::outcome::{Outcome, Removal};
use super::problem::Problem;

/// A body that leaves what stands.
#[derive(Clone, Copy)]
pub(super) struct Leaving<'p, 'a> {
    /// The question about the scene in which the body is.
    pub(super) problem: &'p Problem<'a>,
    /// A part, or the body of a group.
    pub(super) body: usize,
    /// All that stands beside it.
    pub(super) around: &'p StandingParts,
}

impl Leaving<'_, '_> {
    /// Its removal, after some others, along a path past all that stands: led on until it is out of everything, with
    /// what it requires.
    ///
    /// # Errors
    /// The termination condition became true.
    pub(super) fn removal(
        self,
        earlier: &[Removal],
        path: Vec<Pose>,
        depth: f64,
    ) -> Result<Removal, Interrupt> {
        let Self { problem, body, .. } = self;
        let path = self.led_out(earlier, path);
        let mut gone: Vec<usize> = earlier.iter().flat_map(|r| &r.parts).copied().collect();
        gone.sort_unstable();
        let past = problem.depths_past(&gone, body, &path)?;
        let blocks = |gone: &usize| past.contains(&(*gone, None));
        let requires: Vec<usize> = (0..earlier.len()).filter(|&i| earlier[i].parts.iter().any(blocks)).collect();
        let depth = past.iter().filter_map(|(_, depth)| *depth).fold(depth, f64::max);
        let wave = requires.iter().map(|&i| earlier[i].wave + 1).max().unwrap_or(0);
        Ok(Removal { parts: problem.scene.members(&body).to_vec(), of: None, path, depth, requires, wave })
    }

    /// A path that ends apart from the hull of all that stands, continued until it is apart from all that was there at
    /// the start. Away from that hull, nothing stands in the way.
    fn led_out(self, earlier: &[Removal], mut path: Vec<Pose>) -> Vec<Pose> {
        if earlier.is_empty() {
            return path;
        }
        let Self { problem: Problem { scene, .. }, body, around } = self;
        let Some(&end) = path.last() else { return path };
        let along = last_leg(&path);
        // It tells where the others lie.
        let Some(towards) = exit_direction(scene, around, body, &end, along.map(|d| -d)) else {
            return path;
        };
        let direction = -towards;
        let hull = transformed(&scene.bodies[body].shape.hull, &end);
        let near = hull.iter().map(|p| p.coords.dot(&direction)).fold(f64::INFINITY, f64::min);
        let gone = earlier.iter().flat_map(|r| &r.parts).map(|&p| scene.bodies[p].bounds.support(&direction));
        let further = gone.fold(f64::NEG_INFINITY, f64::max) + HULL_MARGIN - near;
        if further > 0.0 {
            if along == Some(direction) {
                path.pop();
            }
            path.push(Translation3::from(direction * further) * end);
        }
        path
    }
}

/// The unit vector of the last leg of a path, if that does not turn.
fn last_leg(path: &[Pose]) -> Option<Vector3<f64>> {
    let [.., from, to] = path else { return None };
    let shift = to.translation.vector - from.translation.vector;
    (from.rotation == to.rotation).then(|| shift.try_normalize(0.0)).flatten()
}

/// A complete outcome without the removals that no target requires: what is left stands as verified as before.
pub(super) fn without_needless(outcome: Outcome, targets: &[usize]) -> Outcome {
    let Outcome { mut removals, mut remaining, .. } = outcome;
    let mut needed: Vec<bool> = removals.iter().map(|removal| frees(removal, &removals, targets)).collect();
    for i in (0..removals.len()).rev() {
        if needed[i] {
            removals[i].requires.iter().for_each(|&j| needed[j] = true);
        }
    }
    // The numbers that the needed ones get.
    let numbers: Vec<usize> =
        needed.iter().scan(0, |next, &is| Some(std::mem::replace(next, *next + usize::from(is)))).collect();
    let needless = removals.iter().zip(&needed).filter(|(r, is)| !**is && r.of.is_none());
    remaining.extend(needless.flat_map(|(r, _)| &r.parts));
    remaining.sort_unstable();
    let mut is_needed = needed.into_iter();
    removals.retain(|_| is_needed.next() == Some(true));
    let referred = removals.iter_mut().flat_map(|r| r.requires.iter_mut().chain(&mut r.of));
    referred.for_each(|number| *number = numbers[*number]);
    Outcome { removals, remaining, ..outcome }
}

/// Whether a removal takes a target out, or is one of those that leave a target behind alone.
fn frees(removal: &Removal, removals: &[Removal], targets: &[usize]) -> bool {
    let takes_alone = |r: &Removal, target: usize| r.parts[..] == [target];
    let of_same_body = |r: &&Removal| r.of == removal.of;
    targets.iter().any(|&target| {
        let stands_there = match removal.of {
            Some(group) => removals[group].parts.contains(&target),
            None => true,
        };
        let leaves = |r: &Removal| r.parts.contains(&target);
        takes_alone(removal, target) || stands_there && !removals.iter().filter(of_same_body).any(leaves)
    })
}
