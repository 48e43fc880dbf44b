//! Parts that leave along their threads, without simulation: a sweep along a helix.
//!
//! What a part touches as assembled shows the helix along which it may turn (its null twist). Turned along it until it
//! is off, and straight on from there, it is out. The way is a claim that is verified; what is refuted is left to
//! simulation.

use std::collections::{BTreeSet, HashMap};

use nalgebra::Unit;
use rayon::prelude::*;

use crate::budgets::POSES_PER_LOOK;
use crate::contact::helix_profile::{ScrewWay, ways_off};
use crate::contact::sampled::MovingBody;
use crate::geometry::{Helix, Pose};
use crate::simulation::{Action, Axis, NullTwist, Sweep, SweepQuestion, straight_sweep};
use crate::termination::Interrupt;
use crate::tolerances::THREAD_REACHES;

use super::disassembly::{Disassembly, Stop, joined};
use super::problem::{Problem, VerifiedPath};
use super::state::least_travel;

/// By part that does not leave along a thread: the parts of which one has to go before it may.
#[derive(Debug, Default)]
pub(super) struct UnscrewingMemory(HashMap<usize, BTreeSet<usize>>);

impl UnscrewingMemory {
    /// Whether a part is known not to leave along a thread while some parts (ascending) stand.
    pub(super) fn holds(&self, part: usize, standing: &[usize]) -> bool {
        self.0.get(&part).is_some_and(|met| met.iter().all(|other| standing.binary_search(other).is_ok()))
    }

    pub(super) fn keep(&mut self, part: usize, met: BTreeSet<usize>) {
        self.0.insert(part, met);
    }
}

/// How a part leaves along a thread.
pub(super) struct Unscrewed {
    pub(super) verified: VerifiedPath,
    /// The pull and turn that it follows.
    pub(super) action: Action,
}

/// The way of a part from its assembled pose off its threads and out, or the parts of which one has to go before it
/// may leave like this.
///
/// # Errors
/// A limit of the search was met.
pub(super) fn unscrewed(
    disassembly: &mut Disassembly<'_, '_>,
    part: usize,
) -> Result<Result<Unscrewed, BTreeSet<usize>>, Stop> {
    let (ways, touched) = ways(&disassembly.problem, part, &disassembly.standing(part))?;
    let mut met: BTreeSet<usize> = touched.into_iter().collect();
    let surroundings = disassembly.surroundings(part);
    for way in ways {
        let Problem { scene, termination, .. } = &disassembly.problem;
        let question = SweepQuestion {
            scene,
            standing_parts: &surroundings,
            part,
            start: &way.path[way.path.len() - 1],
            direction: &way.along,
        };
        let path = match straight_sweep(&question, termination)? {
            Some(Sweep::Clear { path, .. }) => joined(&way.path, &path),
            Some(Sweep::Blocked { by }) => {
                met.insert(by);
                continue;
            }
            None => continue,
        };
        if clearly_enters(&disassembly.problem, part, &surroundings.standing, &path)? {
            let swept = scene.swept_bounds(part, &path);
            met.extend(scene.broad_phase.meeting_of(&surroundings.standing, &swept));
            continue;
        }
        match disassembly.checked_way_as_given(part, &path)? {
            Ok(verified) => return Ok(Ok(Unscrewed { verified, action: action_along(&way) })),
            Err(refuted) => met.extend(refuted.parts()),
        }
    }
    Ok(Err(met))
}

/// Whether a part is seen to be too deep in another at one of some poses of its way, far apart: this takes less time
/// than the verification of a way that leads a head into a nut.
fn clearly_enters(
    problem: &Problem<'_>,
    part: usize,
    standing: &[usize],
    path: &[Pose],
) -> Result<bool, Interrupt> {
    let Problem { scene, termination, verifier, .. } = problem;
    let poses: Vec<&Pose> = path.iter().rev().step_by(POSES_PER_LOOK).collect();
    let entered = poses.par_iter().map(|&pose| {
        MovingBody::new(scene, part, *pose).until(termination).enters_by(verifier.limit(), standing)
    });
    Ok(entered.collect::<Result<Vec<bool>, Interrupt>>()?.contains(&true))
}

/// The ways of a part off its threads, and the parts near it.
fn ways(
    problem: &Problem<'_>,
    part: usize,
    others: &[usize],
) -> Result<(Vec<ScrewWay>, Vec<usize>), Interrupt> {
    let Problem { scene, termination, .. } = problem;
    let pose = scene.bodies[part].planning_from_shape;
    let (mut ways, mut touched) = (Vec::new(), Vec::new());
    for times in THREAD_REACHES {
        let reach = least_travel(scene, part) * times;
        let (twist, near) = NullTwist::of(scene, part, &pose, others, reach, termination)?;
        touched = near;
        if let Some(NullTwist { axis, through, rise }) = twist {
            let guess = Helix::about(&axis, &through, rise.unwrap_or(0.0));
            ways = ways_off(scene, &touched, part, &pose, &guess, termination)?;
        }
        if !ways.is_empty() {
            break;
        }
    }
    Ok((ways, touched))
}

/// The pull and turn that a way off a thread follows.
fn action_along(way: &ScrewWay) -> Action {
    let axis = Axis::along(Unit::new_normalize(way.along));
    let forward = axis.unit().dot(&way.along) > 0.0;
    Action::Screw(axis, forward, forward == way.is_right_handed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_tried_again_once_something_that_it_met_is_gone() {
        let mut memory = UnscrewingMemory::default();
        assert!(!memory.holds(1, &[0, 1, 2]));
        memory.keep(1, BTreeSet::from([0, 2]));
        assert!(memory.holds(1, &[0, 1, 2]) && !memory.holds(1, &[0, 1]) && !memory.holds(0, &[0, 1, 2]));
    }
}
