//! What a caller chooses for a plan.

use std::num::NonZeroU32;
use std::time::Duration;

use sbdp_client::{
    ActionSet, Engine, Gravity, Handle, PenaltyParameter, PlanOptions, Planner, Reports, Staging,
    StaticAnalysis, Steady, Waypoint,
};
use tonic::Status;

use crate::proto;
use crate::status::argument;

/// A handle has 32 bytes.
pub(crate) fn handle(bytes: &[u8]) -> Result<Handle, Status> {
    let wrong = |_| argument("handle", format!("it has {} bytes, but a handle has 32", bytes.len()));
    bytes.try_into().map(Handle).map_err(wrong)
}

/// The options of a request. Its `timeout` is left out: it counts from when the request came.
///
/// # Errors
/// A field cannot be used; the message names it. What else may be wrong with it, the daemon finds.
pub(crate) fn options(request: &proto::PlanRequest) -> Result<PlanOptions, Status> {
    Ok(PlanOptions {
        planner: planner(request.planner)?,
        engine: match known("engine", request.engine)? {
            proto::Engine::Unspecified => Engine::default(),
            proto::Engine::Sliding => Engine::Sliding,
            proto::Engine::Penalty => Engine::Penalty,
        },
        actions: match known("actions", request.actions)? {
            proto::Actions::Unspecified => ActionSet::default(),
            proto::Actions::Paper => ActionSet::Paper,
            proto::Actions::Extended => ActionSet::Extended,
        },
        static_analysis: match known("static_analysis", request.static_analysis)? {
            proto::StaticAnalysis::Unspecified => StaticAnalysis::default(),
            proto::StaticAnalysis::Sliding => StaticAnalysis::Sliding,
            proto::StaticAnalysis::Paper => StaticAnalysis::Paper,
        },
        penalty: penalty(request)?,
        sweeps: request.sweeps,
        timeout: None,
        planning_timeout: seconds("planning_timeout_s", request.planning_timeout_s)?,
        path_timeout: seconds("path_timeout_s", request.path_timeout_s)?,
        seed: request.seed,
        end_gap: request.end_gap,
        clearance: request.clearance,
        up: request.up.map(|up| [up.x, up.y, up.z]),
        max_simulations: request.max_simulations,
        threads: request.threads,
        fixed: request.fixed.clone(),
        removed: request.removed.clone(),
        targets: request.targets.as_ref().map(|targets| targets.parts.clone()),
        base: request.base.clone(),
        keep: request.keep.clone(),
        keep_out: request.keep_out.clone(),
        groups: request.groups.iter().map(|group| group.parts.clone()).collect(),
        moved: moved("moved", &request.moved)?,
        assembly: staging(request)?,
        reports: reports(request)?,
        steady: steady(request)?,
        gravity: gravity(request),
        no_cache: request.no_cache,
        batch: request.batch,
        trace: request.trace,
    })
}

fn reports(request: &proto::PlanRequest) -> Result<Reports, Status> {
    let kinds = request.reports.iter().map(|&number| known::<proto::Report>("reports", number));
    let kinds = kinds.collect::<Result<Vec<_>, Status>>()?;
    if !kinds.is_empty() && !request.document {
        return Err(argument("reports", "they are in the document: set `document`, too"));
    }
    Ok(Reports {
        stability: kinds.contains(&proto::Report::Stability),
        clearance: kinds.contains(&proto::Report::Clearance),
        tools: kinds.contains(&proto::Report::Tools),
    })
}

fn steady(request: &proto::PlanRequest) -> Result<Option<Steady>, Status> {
    let none = || argument("hands", "one is needed to move a part");
    let hands = request.hands.map(|hands| NonZeroU32::new(hands).ok_or_else(none)).transpose()?;
    Ok((request.steady || hands.is_some()).then_some(Steady { hands }))
}

fn gravity(request: &proto::PlanRequest) -> Gravity {
    let usual = Gravity::default();
    Gravity {
        up: request.up.map_or(usual.up, |up| [up.x, up.y, up.z]),
        friction: request.friction.unwrap_or(usual.friction),
    }
}

fn planner(number: i32) -> Result<Planner, Status> {
    Ok(match known("planner", number)? {
        proto::Planner::Unspecified => Planner::default(),
        proto::Planner::SbdpStar => Planner::SbdpStar,
        proto::Planner::Sbdp => Planner::Sbdp,
        proto::Planner::PdpT => Planner::PdpT,
        proto::Planner::PdpR => Planner::PdpR,
        proto::Planner::PdpStar => Planner::PdpStar,
        proto::Planner::Rrt => Planner::Rrt,
        proto::Planner::BkRrt => Planner::BkRrt,
    })
}

/// The value of a number of an enum; a caller may send any.
fn known<T: TryFrom<i32>>(field: &str, number: i32) -> Result<T, Status> {
    T::try_from(number).map_err(|_| argument(field, format!("this gateway does not know the value {number}")))
}

fn penalty(request: &proto::PlanRequest) -> Result<Vec<(PenaltyParameter, f64)>, Status> {
    let parameter = |(name, value): (&String, &f64)| {
        let known = PenaltyParameter::ALL.into_iter().find(|parameter| parameter.name() == name);
        let unknown = || {
            let names = PenaltyParameter::ALL.map(PenaltyParameter::name).join(", ");
            argument("penalty", format!("there is no parameter `{name}`; there are {names}"))
        };
        Ok((known.ok_or_else(unknown)?, *value))
    };
    request.penalty.iter().map(parameter).collect()
}

/// A time in seconds.
pub(crate) fn seconds(field: &str, seconds: Option<f64>) -> Result<Option<Duration>, Status> {
    let Some(seconds) = seconds else { return Ok(None) };
    let time = Duration::try_from_secs_f64(seconds);
    time.map(Some).map_err(|_| argument(field, format!("{seconds} is no time in seconds")))
}

fn moved(field: &str, moved: &[proto::MovedPart]) -> Result<Vec<(u32, Waypoint)>, Status> {
    let read = |(place, moved): (usize, &proto::MovedPart)| {
        let missing = || argument(&format!("{field}[{place}].motion"), "it is not set");
        let m = moved.motion.ok_or_else(missing)?;
        Ok((moved.part, [m.x, m.y, m.z, m.qw, m.qx, m.qy, m.qz]))
    };
    moved.iter().enumerate().map(read).collect()
}

fn staging(request: &proto::PlanRequest) -> Result<Option<Staging>, Status> {
    let staging = known("staging", request.staging)?;
    if staging != proto::Staging::Beside && !request.staged.is_empty() {
        return Err(argument("staged", "only STAGING_BESIDE has places of parts"));
    }
    Ok(match staging {
        proto::Staging::Disassembly => None,
        proto::Staging::None => Some(Staging::None),
        proto::Staging::Beside => Some(Staging::Beside(moved("staged", &request.staged)?)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::PlanRequest;

    #[test]
    fn a_request_of_nothing_is_the_default() {
        assert_eq!(options(&PlanRequest::default()).unwrap(), PlanOptions::default());
    }

    #[test]
    fn what_cannot_be_used_is_refused_by_name() {
        let nowhere = proto::MovedPart { part: 0, motion: None };
        let penalty = [("stiff".to_owned(), 1.0)].into();
        for (field, request) in [
            ("planner", PlanRequest { planner: 8, ..PlanRequest::default() }),
            ("engine", PlanRequest { engine: -1, ..PlanRequest::default() }),
            ("actions", PlanRequest { actions: 3, ..PlanRequest::default() }),
            ("static_analysis", PlanRequest { static_analysis: i32::MAX, ..PlanRequest::default() }),
            ("reports", PlanRequest { reports: vec![4], document: true, ..PlanRequest::default() }),
            ("reports", PlanRequest { reports: vec![1], ..PlanRequest::default() }),
            ("hands", PlanRequest { hands: Some(0), ..PlanRequest::default() }),
            ("staging", PlanRequest { staging: 3, ..PlanRequest::default() }),
            ("staged", PlanRequest { staged: vec![nowhere], ..PlanRequest::default() }),
            ("moved[0].motion", PlanRequest { moved: vec![nowhere], ..PlanRequest::default() }),
            ("penalty", PlanRequest { penalty, ..PlanRequest::default() }),
            ("planning_timeout_s", PlanRequest { planning_timeout_s: Some(-1.0), ..PlanRequest::default() }),
            ("path_timeout_s", PlanRequest { path_timeout_s: Some(f64::NAN), ..PlanRequest::default() }),
        ] {
            let refused = options(&request).unwrap_err();
            assert_eq!(refused.code(), tonic::Code::InvalidArgument);
            assert!(refused.message().starts_with(&format!("`{field}`: ")), "{refused}");
        }
        assert!(handle(&[0; 31]).unwrap_err().message().contains("31 bytes"));
    }

    #[test]
    fn every_planner_and_penalty_parameter_has_a_place() {
        let planners: Vec<Planner> = (1..=7).map(|number| planner(number).unwrap()).collect();
        let names = planners.iter().map(|p| sbdp_ipc::plan::PLANNERS[*p as usize]);
        for (number, name) in (1..).zip(names) {
            let named = proto::Planner::try_from(number).unwrap().as_str_name();
            assert_eq!(named, format!("PLANNER_{}", name.replace('-', "_").to_uppercase()));
        }
        let proto = include_str!("../../../ipc/proto/sbdp/v1/planner.proto");
        for parameter in PenaltyParameter::ALL {
            assert!(proto.contains(&format!("`{}`", parameter.name())), "{}", parameter.name());
        }
    }
}
