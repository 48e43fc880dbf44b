//! The cost of each stage of a step, for benchmarks.
//!
//! All three methods have the same stages: contacts are gathered and reduced, the wanted motion is projected onto
//! what they allow, and the pose advances.

use std::time::Instant;

use nalgebra::Vector3;

use crate::contact::region_cover::Halt;
use crate::contact::region_cover::rigid::RigidCover;
use crate::contact::region_cover::shift::ShiftCover;
use crate::contact::sampled::MovingBody;
use crate::geometry::Pose;
use crate::scene::{Memo, PosedPart, Scene, StandingParts};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::FREE_STEP;

use super::super::Action;
use super::drive::Drive;
use super::push::projected;

/// The method that finds contacts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PairMethod {
    /// A region cover for shifts.
    Shifts,
    /// A region cover for motions that turn.
    Regions,
    /// Samples near the other surface.
    Samples,
}

/// The microseconds of each stage of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepCost {
    /// The method.
    pub telling: PairMethod,
    /// Gathering contacts, without cached regions, as at the start of a motion.
    pub gather: f64,
    /// Reducing them: constraints, and of nearly equal ones the tightest.
    pub reduce: f64,
    /// Projecting the wanted motion onto the constraints.
    pub solve: f64,
    /// Making the step; for motions that may turn this is the whole step, with all trials.
    pub advance: f64,
}

/// The costs of steps from the poses of a motion of a part under an action, without those that are near nothing.
///
/// # Errors
/// The termination condition became true.
pub fn step_costs(
    scene: &Scene,
    standing_parts: &StandingParts,
    (part, poses): (usize, &[Pose]),
    action: Action,
    termination: &Termination,
) -> Result<Vec<StepCost>, Interrupt> {
    let mut costs = Vec::new();
    if !action.turns() {
        for pose in poses {
            costs.extend(of_shift(
                scene,
                standing_parts,
                PosedPart::new(part, pose),
                action.force(),
                termination,
            )?);
        }
        return Ok(costs);
    }
    let Some(start) = poses.first() else { return Ok(costs) };
    let drive = Drive::new(scene, part, start, action);
    for by_samples in [false, true] {
        let at_start = PosedPart::new(part, start);
        let mut around =
            RigidCover::new(scene, standing_parts, at_start, drive.reach(), by_samples, termination);
        for pose in poses {
            termination.check()?;
            // From some way on these would be the others.
            if around.samples() != by_samples {
                break;
            }
            let mover = MovingBody::new(scene, part, *pose).until(termination);
            let (near, gather) = timed(|| around.settle(&mover, None));
            let mut near = near?;
            if near.contacts.is_empty() && near.clearance >= drive.step() {
                continue;
            }
            let (known, reduce) = timed(|| drive.constraints(&mover, &near));
            let known = known?;
            let (_, solve) = timed(|| drive.solved(&known));
            let (step, advance) = timed(|| drive.advance(&mover, &mut near, &mut around));
            step?;
            let telling = if around.samples() { PairMethod::Samples } else { PairMethod::Regions };
            costs.push(StepCost { telling, gather, reduce, solve, advance });
        }
    }
    Ok(costs)
}

/// Of a translation; `None` where nothing is near, or regions cannot cover it.
fn of_shift(
    scene: &Scene,
    standing_parts: &StandingParts,
    moving: PosedPart<'_>,
    force: Vector3<f64>,
    termination: &Termination,
) -> Result<Option<StepCost>, Interrupt> {
    let scene = Scene { memo: Memo::default(), ..scene.clone() };
    let bounds = scene.bodies[moving.part].shape.bounds().transformed(moving.pose).grown(FREE_STEP);
    let near = scene.broad_phase.meeting_of(&standing_parts.standing, &bounds);
    if near.is_empty() {
        return Ok(None);
    }
    let mut cover = ShiftCover::new(&scene, moving, termination);
    let (here, mut obstacles) = (Vector3::zeros(), Vec::new());
    let cost = (|| {
        let (gathered, gather) = timed(|| near.iter().try_for_each(|&other| cover.add(other, &here)));
        gathered?;
        let (made, reduce) = timed(|| cover.make_way(&here, &force, &mut obstacles));
        made?;
        let (along, solve) = timed(|| projected(&force, &obstacles));
        let along = along.and_then(|(along, _)| along.try_normalize(1e-9));
        let (length, advance) = timed(|| along.map(|u| cover.advance(&here, &u, FREE_STEP)).transpose());
        length?;
        Ok(StepCost { telling: PairMethod::Shifts, gather, reduce, solve, advance })
    })();
    match cost {
        Ok(cost) => Ok(Some(cost)),
        Err(Halt::Interrupted(interrupt)) => Err(interrupt),
        Err(Halt::Lost | Halt::Blocked) => Ok(None),
    }
}

/// The result of a function, and its microseconds.
fn timed<T>(question: impl FnOnce() -> T) -> (T, f64) {
    let started = Instant::now();
    let answer = question();
    (answer, started.elapsed().as_secs_f64() * 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{block_on_plate, scene};
    use crate::simulation::{Axis, SlidingEngine, TransitionFunction};

    #[test]
    fn all_ways_to_see_contact_are_told_apart() {
        let (scene, _) = scene(block_on_plate());
        let around = StandingParts::new(&scene, vec![0]);
        let (start, t) = (scene.bodies[1].planning_from_shape, Termination::default());
        let costs = |action: Action| {
            let motion = SlidingEngine.simulate(&scene, &around, 1, &start, action, &t).unwrap();
            step_costs(&scene, &around, (1, &motion.path), action, &t).unwrap()
        };
        let count = |costs: &[StepCost], telling| costs.iter().filter(|c| c.telling == telling).count();
        let pushed = costs(Action::Push(Axis::X, true));
        assert!(!pushed.is_empty() && count(&pushed, PairMethod::Shifts) == pushed.len());
        let turned = costs(Action::Turn(Axis::Z, true));
        assert!(count(&turned, PairMethod::Regions) > 0 && count(&turned, PairMethod::Samples) > 0);
        for cost in pushed.iter().chain(&turned) {
            assert!([cost.gather, cost.reduce, cost.solve, cost.advance].iter().all(|c| *c >= 0.0));
        }
        // The whole of a step is more than its parts.
        let sum = |of: fn(&StepCost) -> f64| turned.iter().map(of).sum::<f64>();
        assert!(sum(|c| c.advance) > sum(|c| c.solve));
    }
}
