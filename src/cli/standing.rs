//! A plan with the question how its parts stand during it, for `sbdp statics` and `schedule`.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Unit, Vector3};

use super::args::StandingArguments;
use super::error::CliError;
use super::subject::Subject;
use crate::document::{Placements, PlanDocument, StepDocument, reordered};
use crate::geometry::{Pose, pose_from_waypoint};
use crate::plan::{PlanKind, StepEnd};
use crate::service::{AssemblyId, Service, StandingState, StaticsQuery};
use crate::statics::StaticsOptions;
use crate::view::{Up, kind_of};

/// A plan with its assembly, and the query about its states.
pub(super) struct StandingPlan {
    pub(super) plan: PlanDocument,
    /// The names of what stays.
    pub(super) stays: Vec<String>,
    pub(super) service: Service,
    pub(super) id: AssemblyId,
    pub(super) query: StaticsQuery,
}

impl StandingPlan {
    pub(super) fn read(arguments: &StandingArguments, margin: bool) -> Result<Self, CliError> {
        let subject = Subject::read(&arguments.plan, arguments.meshes.as_deref())?;
        let up = match (arguments.up, subject.up()) {
            (Some(up), _) => Unit::new_normalize(Vector3::from(up)),
            (None, Up::Y) => Vector3::y_axis(),
            (None, Up::Z) => Vector3::z_axis(),
        };
        let plan = &subject.plan;
        let stays = stays(plan, &arguments.stays)?;
        let query = StaticsQuery {
            options: StaticsOptions { up, friction: arguments.friction, gap: arguments.gap, margin },
            states: states(plan, &stays)?,
            screwed: screwed(plan),
            join: pairs(plan, "--join", &arguments.join)?,
            apart: pairs(plan, "--apart", &arguments.apart)?,
        };
        let (service, id) = subject.admitted_with_parts_of_plan()?;
        Ok(Self { plan: subject.plan, stays, service, id, query })
    }

    /// Puts the steps into another order, in which each comes after those that it requires.
    pub(super) fn reorder(&mut self, order: &[usize]) -> Result<(), CliError> {
        self.plan = reordered(&self.plan, order);
        self.query.states = states(&self.plan, &self.stays)?;
        Ok(())
    }
}

/// Refuses a plan whose steps cannot be carried out in another order that `requires` allows.
pub(super) fn check_order_is_free(plan: &PlanDocument, what: &str) -> Result<(), CliError> {
    let reason = if kind_of(plan) == PlanKind::Assembly {
        "parts of an assembly plan wait for their turn in the way of others; plan the disassembly"
    } else if plan.steps.iter().any(|step| step.ends == StepEnd::Aside.name()) {
        "the plan moves parts aside, where they are in the way of others"
    } else {
        return Ok(());
    };
    Err(CliError::Refused(format!("{what}: {reason}")))
}

/// Pairs of parts that an option names.
fn pairs(plan: &PlanDocument, option: &str, named: &[String]) -> Result<Vec<[usize; 2]>, CliError> {
    let number = |name: &String| {
        let number = plan.parts.iter().position(|part| part == name);
        number.ok_or_else(|| CliError::Refused(format!("{option}: the plan has no part `{name}`")))
    };
    let pair = |pair: &[String; 2]| Ok([number(&pair[0])?, number(&pair[1])?]);
    named.as_chunks().0.iter().map(pair).collect()
}

/// What stays: as named, or as the plan has it.
fn stays(plan: &PlanDocument, named: &[String]) -> Result<Vec<String>, CliError> {
    if let Some(unknown) = named.iter().find(|name| !plan.parts.contains(name)) {
        return Err(CliError::Refused(format!("--stays: the plan has no part `{unknown}`")));
    }
    let stays: Vec<String> = match named {
        [] => {
            plan.parts.iter().filter(|p| plan.fixed.contains(p) || plan.base.contains(p)).cloned().collect()
        }
        named => named.to_vec(),
    };
    if stays.is_empty() {
        let reason = "the plan has neither a base nor fixed parts; name what stays with --stays";
        return Err(CliError::Refused(reason.to_owned()));
    }
    Ok(stays)
}

/// The parts that a step turns by more than half a turn: threads, as far as their contacts show one.
fn screwed(plan: &PlanDocument) -> BTreeSet<usize> {
    let turned = |step: &&StepDocument| {
        let turns = step.path.windows(2).map(|pair| {
            let [from, to] = [&pair[0], &pair[1]].map(pose_from_waypoint);
            from.rotation.angle_to(&to.rotation)
        });
        turns.sum::<f64>() > std::f64::consts::PI
    };
    let steps = plan.steps.iter().filter(turned);
    let number = |name: &String| plan.parts.iter().position(|part| part == name);
    steps.flat_map(|step| &step.parts).filter_map(number).collect()
}

/// The states of what stands in the assembly: at first, and after each step.
fn states(plan: &PlanDocument, stays: &[String]) -> Result<Vec<StandingState>, CliError> {
    let kind = kind_of(plan);
    let placements = Placements::new(kind, plan).map_err(CliError::Refused)?;
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
