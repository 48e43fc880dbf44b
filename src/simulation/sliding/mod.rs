//! The engine `sliding`: motion in the limit of no inertia.
//!
//! A translation (`push`) is a shift: the [region cover](crate::contact::region_cover) of the surfaces bounds how far it
//! may go, and names what is in the way. Where nothing bends a push, a shape cast finds what it meets (`free_flight`). For
//! what may turn, and where a region cover cannot answer for a push (open surfaces, deep allowed penetration, points that
//! verification found missing), each step projects the wanted twist onto what contact allows, in the metric of the
//! part's mass (rotation weighed by the squared radius of gyration), and advances the pose by the result (`drive`).
//! Contacts come from the pieces of surface that leave their regions, or, where surfaces are too complicated for that,
//! from samples. In free space the step is the certified clearance; where samples answer and the projected twist stays
//! the same, along a wall or a thread, long steps follow it (`helix_extrapolation`).

mod drive;
mod free_flight;
mod helix_extrapolation;
mod pair;
mod push;
mod step_costs;
mod turning;

use crate::budgets::MOTION_POSES;
use crate::contact::region_cover::Halt;
use crate::contact::region_cover::rigid::RigidCover;
use crate::contact::sampled::MovingBody;
use crate::geometry::Pose;
use crate::scene::{PosedPart, Scene, StandingParts, exit_direction};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::BULGE_TOLERANCE;

use super::{Action, End, Motion, TransitionFunction, asked_again};
use drive::{Drive, Step};
use helix_extrapolation::HelixExtrapolation;
use push::Push;
use turning::Turning;

pub use pair::pair_blocks;
pub use step_costs::{PairMethod, StepCost, step_costs};

/// The engine.
#[derive(Debug, Clone, Copy, Default)]
pub struct SlidingEngine;

impl TransitionFunction for SlidingEngine {
    fn name(&self) -> &'static str {
        "sliding"
    }

    fn depth_tolerance(&self) -> f64 {
        BULGE_TOLERANCE
    }

    fn remembered_as(&self) -> Option<&str> {
        Some("sliding")
    }

    fn simulate(
        &self,
        scene: &Scene,
        standing_parts: &StandingParts,
        part: usize,
        start: &Pose,
        action: Action,
        termination: &Termination,
    ) -> Result<Motion, Interrupt> {
        let is_refined = is_refined(scene, standing_parts, part);
        let at_start = PosedPart::new(part, start);
        if let (Action::Push(..), false) = (action, is_refined) {
            match pushed(scene, standing_parts, at_start, action, termination) {
                Err(Halt::Lost | Halt::Blocked) => {}
                Err(Halt::Interrupted(interrupt)) => return Err(interrupt),
                Ok(motion) => return Ok(motion),
            }
        }
        let drive = Drive::new(scene, part, start, action);
        let mut mover = MovingBody::new(scene, part, *start).until(termination);
        let (mut path, mut asked) = (vec![*start], Vec::new());
        let mut turning = Turning::new(&mover);
        // A push comes here only if regions could not cover it.
        let by_samples = is_refined || !action.turns();
        let mut around =
            RigidCover::new(scene, standing_parts, at_start, drive.reach(), by_samples, termination);
        let mut extrapolation = HelixExtrapolation::new(scene, standing_parts, part, &drive);
        let mut near = None;
        while path.len() < MOTION_POSES {
            termination.check()?;
            let (mut turned, mut touching) = (0.0, Vec::new());
            let mut extrapolated = extrapolation.follow(&mover)?;
            if extrapolated.is_none() {
                let mut here = around.settle(&mover, near.take())?;
                let step = match drive.advance(&mover, &mut here, &mut around)? {
                    Step::Stuck { with } => {
                        return Ok(Motion::simulated(path, asked, End::Collision { with }));
                    }
                    Step::Moved(step) => step,
                };
                let from = std::mem::replace(&mut mover.pose, step.pose);
                let is_straight = step.via.is_empty();
                path.extend(step.via);
                path.push(step.pose);
                // With regions, an ordinary step costs less than checking a long one.
                if is_straight && !here.contacts.is_empty() && around.samples() {
                    extrapolated = extrapolation.extrapolated(&from, &mover, step.pressing, &mut around)?;
                }
                (turned, touching, near) = (step.turned, step.touching, Some(step.near));
            }
            if let Some(extrapolated) = extrapolated {
                path.extend(extrapolated.poses);
                mover.pose = path[path.len() - 1];
                near = extrapolated.near;
                turned += extrapolated.turned;
            }
            termination.check()?;
            let hint = asked_again(&action, asked.len());
            asked.push(path.len() as u32 - 1);
            if let Some(d) = exit_direction(scene, standing_parts, part, &mover.pose, hint) {
                return Ok(Motion::simulated(path, asked, End::Disassembled(d)));
            }
            if turning.is_idle(&mover, turned, &touching) {
                let touched = turning.all_touched;
                let reason = "a whole turn brought neither travel nor new contact".into();
                return Ok(Motion::simulated(path, asked, End::Undecided { reason, touched }));
            }
        }
        let touched = turning.all_touched;
        let reason = "the motion is too long".into();
        Ok(Motion::simulated(path, asked, End::Undecided { reason, touched }))
    }
}

/// Whether verification found missing points around a part: then only short steps are safe.
fn is_refined(scene: &Scene, standing_parts: &StandingParts, part: usize) -> bool {
    let refined = |i: usize| !scene.bodies[i].extra_samples.points().is_empty();
    refined(part) || standing_parts.standing.iter().any(|&i| refined(i))
}

/// A translation by a region cover.
fn pushed(
    scene: &Scene,
    standing_parts: &StandingParts,
    moving: PosedPart<'_>,
    action: Action,
    termination: &Termination,
) -> Result<Motion, Halt> {
    let mut push = Push::new(scene, &standing_parts.standing, moving, action.force(), termination);
    let (mut path, mut asked) = (vec![*moving.pose], Vec::new());
    while path.len() < MOTION_POSES {
        let step = match push.step() {
            // If regions cannot cover the place where a flight landed, the push starts again without flights.
            Err(Halt::Lost) if push.begins_on_foot() => {
                (path, asked) = (vec![*moving.pose], Vec::new());
                continue;
            }
            step => step?,
        };
        match step {
            push::PushStep::Stuck { with } => {
                return Ok(Motion::simulated(path, asked, End::Collision { with }));
            }
            push::PushStep::Moved(pose) => path.push(pose),
        }
        let hint = asked_again(&action, asked.len());
        asked.push(path.len() as u32 - 1);
        if let Some(d) = exit_direction(scene, standing_parts, moving.part, &path[path.len() - 1], hint) {
            return Ok(Motion::simulated(path, asked, End::Disassembled(d)));
        }
    }
    let reason = "the motion is too long".into();
    Ok(Motion::simulated(path, asked, End::Undecided { reason, touched: Vec::new() }))
}
