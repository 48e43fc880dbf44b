//! Plans asked of a daemon, to the end.

use std::time::Duration;

use nalgebra::Point3;
use sbdp_client::{Client, Event, Handle, PlanOptions, PlanStatus, Summary};

use super::BenchError;
use crate::geometry::{Pose, Waypoint, interpolate, pose_from_waypoint, waypoint_from_pose};

/// What was answered, to the bit.
#[derive(Debug, PartialEq)]
pub(super) struct Answered {
    pub(super) status: PlanStatus,
    pub(super) steps: Vec<(usize, Vec<[f64; 7]>)>,
}

/// Plans to the end.
pub(super) fn plan(
    client: &Client,
    handle: Handle,
    options: &PlanOptions,
) -> Result<(Answered, Summary), BenchError> {
    let mut steps = Vec::new();
    let summary = follow(client, handle, options, |event| match event {
        Event::Step(step) => steps.push((step.part as usize, step.path.to_vec())),
        Event::Restarted => steps.clear(),
        _ => {}
    })?;
    Ok((Answered { status: summary.status, steps }, summary))
}

/// The same, of which nothing but the summary is kept.
pub(super) fn summary(client: &Client, handle: Handle, options: &PlanOptions) -> Result<Summary, BenchError> {
    follow(client, handle, options, |_| {})
}

fn follow(
    client: &Client,
    handle: Handle,
    options: &PlanOptions,
    mut each: impl FnMut(Event<'_>),
) -> Result<Summary, BenchError> {
    let mut stream = client.plan(handle, options).map_err(BenchError::failed)?;
    while let Some(event) = stream.next_event().map_err(BenchError::failed)? {
        match event {
            Event::Done(summary) => return Ok(summary),
            event => each(event),
        }
    }
    Err(BenchError::Failed("a plan ended without its summary".to_owned()))
}

/// All that the daemon tells of itself.
pub(super) fn figures(client: &Client) -> Result<serde_json::Value, BenchError> {
    let figures = client.metrics().map_err(BenchError::failed)?;
    serde_json::from_str(&figures).map_err(BenchError::failed)
}

/// Between two looks at whether the daemon makes anything ready.
const LOOK: Duration = Duration::from_millis(100);

/// Waits until the daemon has made ready all that it wants to.
pub(super) fn leave_alone(client: &Client) -> Result<(), BenchError> {
    let waits = |ahead: &serde_json::Value| ["assemblies", "questions"].iter().any(|what| ahead[what] != 0);
    // One of an older build tells nothing of it.
    while figures(client)?.get("ahead").is_some_and(waits) {
        std::thread::sleep(LOOK);
    }
    Ok(())
}

impl Answered {
    /// Where a part is that begins to leave, when the middle of its box has gone so far; of a short first stretch
    /// of its way, when it has done half as large a share. One in a thread turns with that.
    pub(super) fn on_its_way(&self, part: usize, centre: &Point3<f64>, by: f64) -> Waypoint {
        let path = self.steps.iter().find(|(p, _)| *p == part).map(|(_, path)| path.as_slice());
        let Some([from, to, ..]) = path else { return waypoint_from_pose(&Pose::identity()) };
        let (from, to) = (pose_from_waypoint(from), pose_from_waypoint(to));
        let length = (to * centre - from * centre).norm();
        waypoint_from_pose(&interpolate(&from, &to, centre, by / length.max(2.0)))
    }

    /// The unit vector along which a part begins to leave.
    pub(super) fn outward(&self, part: usize) -> [f64; 3] {
        let path = self.steps.iter().find(|(p, _)| *p == part).map(|(_, path)| path.as_slice());
        let way = path.and_then(|path| path.iter().find(|w| w[..3].iter().any(|x| x.abs() > 1e-9)));
        let [x, y, z] = way.map_or([0.0, 0.0, 1.0], |w| [w[0], w[1], w[2]]);
        let length = (x * x + y * y + z * z).sqrt();
        [x, y, z].map(|x| x / length)
    }
}
