//! What a plan means where it is carried out: what falls after each step, how near each step passes other parts, and which
//! tools turn the fasteners that it takes off.
//!
//! Data flow: a plan → `states` (what stands after each step; what moves and what stands in each) → [`Service`] →
//! `records` (the answers as the plan's contract has them).

mod records;
mod states;

use nalgebra::{Unit, Vector3};
use sbdp_ipc::plan::{Gravity, Reports};
use sbdp_ipc::summary::report::Report;

use crate::document::PlanDocument;
use crate::plan::{Plan, Warning};
use crate::service::{AssemblyId, ClearanceQuery, Service, ServiceError, StaticsQuery, check_gravity};
use crate::statics::StaticsOptions;
use crate::termination::Termination;

pub use records::{clearance_record, closest_record, fastener_record, stability_record};
pub use states::{passing_steps, screwed_parts, standing_states, staying_parts};

/// What to report about each step of a plan, checked.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReportQuery {
    /// How the parts stand, if wanted.
    pub stability: Option<StaticsOptions>,
    /// How near the step passes other parts.
    pub clearance: bool,
    /// Which tools turn the fastener that it takes off.
    pub tools: bool,
}

impl ReportQuery {
    /// What a request asks for.
    ///
    /// # Errors
    /// The direction against gravity is none, or the friction is negative or not finite.
    pub fn new(reports: &Reports, gravity: &Gravity) -> Result<Self, ServiceError> {
        let stability = reports.stability.then(|| statics_options(gravity)).transpose()?;
        Ok(Self { stability, clearance: reports.clearance, tools: reports.tools })
    }

    /// Whether nothing is to be reported.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

fn statics_options(&Gravity { up, friction }: &Gravity) -> Result<StaticsOptions, ServiceError> {
    check_gravity(up, friction)?;
    let up = Unit::new_normalize(Vector3::from(up));
    Ok(StaticsOptions { up, friction, ..StaticsOptions::default() })
}

/// The report about a plan of an assembly, complete or not. What of it cannot be made is left out, and the plan gets a
/// warning that says why.
///
/// # Errors
/// The assembly is unknown, or is not the one that the plan is about.
pub fn report(
    service: &Service,
    id: AssemblyId,
    plan: &mut Plan,
    query: &ReportQuery,
    termination: &Termination,
) -> Result<Report, ServiceError> {
    let mut report = Report::default();
    if query.is_empty() {
        return Ok(report);
    }
    let document = PlanDocument::from(&*plan);
    let mut left_out = Vec::new();
    if let Some(options) = &query.stability {
        match statics_query(&document, options) {
            Ok(query) => match service.statics(id, &query, termination)? {
                Some(answer) => {
                    report.stability = Some(answer.states.iter().map(stability_record).collect());
                }
                None => left_out.push("stability: the time was over".to_owned()),
            },
            Err(reason) => left_out.push(format!("stability: {reason}")),
        }
    }
    if query.clearance || query.tools {
        match passing_steps(&document) {
            Ok(steps) => {
                if query.tools {
                    match service.tools(id, &steps, termination)? {
                        Some(found) => {
                            let fastener = |f: &Option<_>| f.as_ref().map(fastener_record);
                            report.tools = Some(found.iter().map(fastener).collect());
                        }
                        None => left_out.push("tools: the time was over".to_owned()),
                    }
                }
                if query.clearance {
                    match service.clearance(id, &ClearanceQuery { steps, wanted: None }, termination)? {
                        Some(found) => report.clearance = Some(found.iter().map(clearance_record).collect()),
                        None => left_out.push("clearance: the time was over".to_owned()),
                    }
                }
            }
            Err(reason) => left_out.push(format!("clearance and tools: {reason}")),
        }
    }
    let warning = |reason: String| Warning { part: None, message: format!("not reported: {reason}") };
    plan.warnings.extend(left_out.into_iter().map(warning));
    Ok(report)
}

/// The question how the parts stand in the states of a plan, where what stays is the plan's base and what is fixed.
fn statics_query(plan: &PlanDocument, options: &StaticsOptions) -> Result<StaticsQuery, String> {
    let stays = staying_parts(plan)?;
    Ok(StaticsQuery {
        options: options.clone(),
        states: standing_states(plan, &stays)?,
        screwed: screwed_parts(plan),
        ..StaticsQuery::default()
    })
}
