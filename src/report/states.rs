//! The states of a plan: what stands in the assembly after each step, and what passes what in each.

use std::collections::{BTreeMap, BTreeSet};

use crate::document::{Placements, PlanDocument, StepDocument, StepParts, kind_of};
use crate::geometry::{Pose, pose_from_waypoint};
use crate::plan::{PlanKind, StepEnd};
use crate::service::{PassingStep, StandingState, is_screwed_off};

/// The names of what stays whatever happens: the base and what is fixed, else what is never taken off.
///
/// # Errors
/// There is nothing of the kind, in words.
pub fn staying_parts(plan: &PlanDocument) -> Result<Vec<String>, String> {
    let named = |p: &&String| plan.fixed.contains(p) || plan.base.contains(p);
    let stays: Vec<String> = plan.parts.iter().filter(named).cloned().collect();
    let stays = if stays.is_empty() { plan.remaining.clone() } else { stays };
    if stays.is_empty() {
        return Err("the plan has neither a base nor fixed parts, and takes all parts off".to_owned());
    }
    Ok(stays)
}

/// The parts that the steps screw off.
#[must_use]
pub fn screwed_parts(plan: &PlanDocument) -> BTreeSet<usize> {
    let is_screwed = |step: &&StepDocument| {
        is_screwed_off(&step.path.iter().map(pose_from_waypoint).collect::<Vec<Pose>>())
    };
    let steps = plan.steps.iter().filter(is_screwed);
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    steps.flat_map(|step| &step.parts).filter_map(number).collect()
}

/// The states of what stands in the assembly: before the first step, and after each step.
///
/// # Errors
/// The steps contradict each other, in words that name the step.
pub fn standing_states(plan: &PlanDocument, stays: &[String]) -> Result<Vec<StandingState>, String> {
    let kind = kind_of(plan);
    let placements = Placements::new(kind, plan)?;
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    let mut standing: BTreeMap<usize, Pose> = (0..plan.parts.len()).map(|p| (p, Pose::identity())).collect();
    plan.initial.removed.iter().filter_map(number).for_each(|part| _ = standing.remove(&part));
    let stays: Vec<usize> = stays.iter().filter_map(number).collect();
    let state = |standing: &BTreeMap<usize, Pose>| StandingState {
        parts: standing.iter().map(|(part, pose)| (*part, *pose)).collect(),
        stays: stays.clone(),
    };
    let mut states = vec![state(&standing)];
    for turn in 0..plan.steps.len() {
        // An assembly plan is walked backwards.
        let step = match kind {
            PlanKind::Disassembly => turn,
            PlanKind::Assembly => plan.steps.len() - 1 - turn,
        };
        let (step, frame) = (&plan.steps[step], &placements.steps[step]);
        if step.of.is_none() {
            let far = match kind {
                PlanKind::Disassembly => step.path.last(),
                PlanKind::Assembly => step.path.first(),
            };
            let far = far.map(pose_from_waypoint).unwrap_or_default();
            for (name, pose) in step.parts.iter().zip(&frame.standing) {
                let Some(part) = number(name) else { continue };
                match frame.ends {
                    StepEnd::Aside => _ = standing.insert(part, far * pose),
                    StepEnd::Out | StepEnd::In => _ = standing.remove(&part),
                }
            }
        }
        states.push(state(&standing));
    }
    if kind == PlanKind::Assembly {
        states.reverse();
    }
    Ok(states)
}

/// The steps of a plan with what moves and what stands in each.
///
/// # Errors
/// The steps contradict each other, in words that name the step.
pub fn passing_steps(plan: &PlanDocument) -> Result<Vec<PassingStep>, String> {
    let parts = Placements::parts_of_steps(kind_of(plan), plan)?;
    let step = |(StepParts { moving, standing }, step): (StepParts, &StepDocument)| PassingStep {
        moving,
        standing,
        path: step.path.iter().map(pose_from_waypoint).collect(),
    };
    Ok(parts.into_iter().zip(&plan.steps).map(step).collect())
}
