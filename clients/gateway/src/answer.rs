//! What comes of a plan, as messages.

use sbdp_client::{Progress, Stage, Status, Step, StepEnd, Waypoint};

use crate::proto::{self, plan_event::Event, progress, step};

/// An event of a plan's stream.
pub(crate) fn event(event: Event) -> proto::PlanEvent {
    proto::PlanEvent { event: Some(event) }
}

pub(crate) fn progress(progress: &Progress) -> proto::Progress {
    let stage = match progress.stage {
        Stage::Sdf => progress::Stage::Sdf,
        Stage::Search => progress::Stage::Search,
        Stage::Transfer => progress::Stage::Transfer,
    };
    proto::Progress {
        stage: stage.into(),
        done: progress.done,
        total: progress.total,
        simulations: progress.simulations,
        tried_part: progress.tried.map(|tried| tried.part),
        tried_turns: progress.tried.is_some_and(|tried| tried.turns),
    }
}

pub(crate) fn step(step: &Step) -> proto::Step {
    let step = step.view();
    let ends = match step.ends {
        StepEnd::Out => step::End::Out,
        StepEnd::Aside => step::End::Aside,
        StepEnd::In => step::End::In,
    };
    proto::Step {
        number: step.number,
        parts: step.parts.to_vec(),
        of: step.of,
        ends: ends.into(),
        rotates: step.rotates,
        path: step.path.as_flattened().to_vec(),
        verified_depth: step.verified_depth,
        requires: step.requires.to_vec(),
        wave: step.wave,
        direction: step.direction.map(vector),
    }
}

pub(crate) fn vector([x, y, z]: [f64; 3]) -> proto::Vector {
    proto::Vector { x, y, z }
}

pub(crate) fn motion([x, y, z, qw, qx, qy, qz]: Waypoint) -> proto::Motion {
    proto::Motion { x, y, z, qw, qx, qy, qz }
}

/// The state of the daemon; `restarts` and `plans` are the gateway's.
pub(crate) fn status(status: Status, restarts: u32, plans: u32) -> proto::StatusReply {
    let Status { numbers: n, version, preloaded } = status;
    proto::StatusReply {
        pid: n.pid,
        version,
        uptime_s: n.uptime_ns as f64 / 1e9,
        workers: n.workers,
        running: n.running,
        queued: n.queued,
        queue_limit: n.queue_limit,
        requests: n.requests,
        done: n.done,
        remembered: n.remembered,
        cancelled: n.cancelled,
        expired: n.expired,
        refused: n.refused,
        failed: n.failed,
        uploads: n.uploads,
        preloaded: preloaded
            .into_iter()
            .map(|(name, handle)| proto::Preloaded { name, handle: handle.to_vec().into() })
            .collect(),
        restarts,
        plans,
    }
}
