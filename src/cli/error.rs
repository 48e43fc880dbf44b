//! Why a command ends early, and with which exit code.

use std::process::ExitCode;

use crate::bench::BenchError;
use crate::document::PlanDocument;
use crate::geometry::GeometryError;
use crate::plan::PlanStatus;
use crate::service::ServiceError;

/// Why a command ended without its result.
#[derive(Debug, thiserror::Error)]
pub(super) enum CliError {
    /// The arguments contradict each other, or the geometry is refused.
    #[error("{0}")]
    Refused(String),
    /// Anything else.
    #[error("{0}")]
    Failed(String),
}

impl CliError {
    pub(super) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Refused(_) => ExitCode::from(2),
            Self::Failed(_) => ExitCode::from(1),
        }
    }
}

impl From<GeometryError> for CliError {
    fn from(error: GeometryError) -> Self {
        Self::Refused(error.to_string())
    }
}

impl From<ServiceError> for CliError {
    fn from(error: ServiceError) -> Self {
        match error {
            ServiceError::Geometry(_)
            | ServiceError::NoSuchPart { .. }
            | ServiceError::TargetStays { .. }
            | ServiceError::FixedAndKept { .. }
            | ServiceError::NoLength { .. }
            | ServiceError::NoDirection { .. }
            | ServiceError::NoGroups { .. } => Self::Refused(error.to_string()),
            // The stages behind the service may come to name other failures.
            other => Self::Failed(other.to_string()),
        }
    }
}

impl From<BenchError> for CliError {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Refused(_) => Self::Refused(error.to_string()),
            BenchError::Busy(_) | BenchError::Failed(_) => Self::Failed(error.to_string()),
        }
    }
}

/// The exit code of a plan.
pub(super) fn exit_code(plan: &PlanDocument) -> ExitCode {
    ExitCode::from(match PlanStatus::named(&plan.status) {
        Some(PlanStatus::Complete) => 0,
        Some(PlanStatus::Partial | PlanStatus::Infeasible | PlanStatus::Exhausted) => 3,
        Some(PlanStatus::Timeout) => 4,
        Some(PlanStatus::Cancelled) => 5,
        // A daemon of this version has no other.
        None => 1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::plan_of;

    #[test]
    fn what_ends_without_a_plan_and_what_is_proved_to_have_none_exit_alike() {
        let plan = |status| PlanDocument::from(&plan_of(status, Vec::new()));
        let code = |status| format!("{:?}", exit_code(&plan(status)));
        let three = format!("{:?}", ExitCode::from(3));
        assert_eq!((code(PlanStatus::Exhausted), code(PlanStatus::Infeasible)), (three.clone(), three));
    }
}
