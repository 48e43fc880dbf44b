//! What must be done before a part's very path is free.
//!
//! A path was verified past the parts that stood. Here it is verified past each part that had left, too, where that
//! stood assembled: the path requires those that it enters to be out, and no other. For this to say something, the
//! path leads out of all parts that were there at the start, and not only of those that still stand.

use nalgebra::{Translation3, Vector3};

use crate::geometry::{Pose, transformed};
use crate::scene::exit_direction;
use crate::tolerances::HULL_MARGIN;

use super::disassembly::{Disassembly, Stop};
use super::outcome::{Outcome, Removal};

impl Disassembly<'_, '_> {
    /// A part's removal along a path past all that stands: led on until it is out of everything, with what it
    /// requires.
    pub(super) fn removal(&mut self, part: usize, path: Vec<Pose>, depth: f64) -> Result<Removal, Stop> {
        let path = self.led_out(part, path);
        let mut gone: Vec<usize> = self.removals.iter().map(|r| r.part).collect();
        gone.sort_unstable();
        let past = self.timed(|problem| problem.depths_past(&gone, part, &path))?;
        let blocks = |gone: usize| past.contains(&(gone, None));
        let requires: Vec<usize> =
            (0..self.removals.len()).filter(|&i| blocks(self.removals[i].part)).collect();
        let depth = past.iter().filter_map(|(_, depth)| *depth).fold(depth, f64::max);
        let wave = requires.iter().map(|&i| self.removals[i].wave + 1).max().unwrap_or(0);
        Ok(Removal { part, path, depth, requires, wave })
    }

    /// A path that ends apart from the hull of all that stands, continued until it is apart from all that was there at
    /// the start. Away from that hull, nothing stands in the way.
    fn led_out(&mut self, part: usize, mut path: Vec<Pose>) -> Vec<Pose> {
        if self.removals.is_empty() {
            return path;
        }
        let around = self.surroundings(part);
        let scene = &self.problem.scene;
        let Some(&end) = path.last() else { return path };
        let along = last_leg(&path);
        // It tells where the others lie.
        let Some(towards) = exit_direction(scene, &around, part, &end, along.map(|d| -d)) else {
            return path;
        };
        let direction = -towards;
        let hull = transformed(&scene.bodies[part].shape.hull, &end);
        let near = hull.iter().map(|p| p.coords.dot(&direction)).fold(f64::INFINITY, f64::min);
        let gone = self.removals.iter().map(|r| scene.bodies[r.part].bounds.support(&direction));
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
    let mut needed = vec![false; removals.len()];
    for i in (0..removals.len()).rev() {
        needed[i] |= targets.contains(&removals[i].part);
        if needed[i] {
            removals[i].requires.iter().for_each(|&j| needed[j] = true);
        }
    }
    // The numbers that the needed ones get.
    let numbers: Vec<usize> =
        needed.iter().scan(0, |next, &is| Some(std::mem::replace(next, *next + usize::from(is)))).collect();
    remaining.extend(removals.iter().zip(&needed).filter(|(_, is)| !**is).map(|(r, _)| r.part));
    remaining.sort_unstable();
    let mut is_needed = needed.into_iter();
    removals.retain(|_| is_needed.next() == Some(true));
    removals.iter_mut().flat_map(|r| &mut r.requires).for_each(|number| *number = numbers[*number]);
    Outcome { removals, remaining, ..outcome }
}
