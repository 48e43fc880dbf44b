//! A plan with the question how its parts stand during it, for `sbdp statics` and `schedule`.

use nalgebra::{Unit, Vector3};

use super::args::StandingArguments;
use super::error::CliError;
use super::subject::Subject;
use crate::document::{PlanDocument, kind_of};
use crate::files::customary_up;
use crate::plan::{PlanKind, StepEnd};
use crate::report::{screwed_parts, standing_states, staying_parts};
use crate::service::{AssemblyId, Service, StaticsQuery};
use crate::statics::StaticsOptions;

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
        let up =
            Unit::new_normalize(Vector3::from(arguments.up.unwrap_or_else(|| customary_up(&subject.base))));
        let plan = &subject.plan;
        let stays = stays(plan, &arguments.stays)?;
        let query = StaticsQuery {
            options: StaticsOptions { up, friction: arguments.friction, gap: arguments.gap, margin },
            states: standing_states(plan, &stays).map_err(CliError::Refused)?,
            screwed: screwed_parts(plan),
            join: pairs(plan, "--join", &arguments.join)?,
            apart: pairs(plan, "--apart", &arguments.apart)?,
        };
        let (service, id) = subject.admitted_with_parts_of_plan()?;
        Ok(Self { plan: subject.plan, stays, service, id, query })
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
    match named {
        [] => staying_parts(plan)
            .map_err(|reason| CliError::Refused(format!("{reason}; name what stays with --stays"))),
        named => Ok(named.to_vec()),
    }
}
