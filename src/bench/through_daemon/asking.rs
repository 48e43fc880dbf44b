//! Plans asked of a daemon, to the end.

use std::time::Duration;

use nalgebra::Point3;
use sbdp_client::{Client, Event, Handle, PlanOptions, PlanStatus, Step, StepEnd, Summary};

use super::BenchError;
use crate::geometry::{Pose, Waypoint, interpolate, pose_from_waypoint, waypoint_from_pose};

/// What was answered, to the bit.
#[derive(Debug, PartialEq)]
pub(super) struct Answered {
    pub(super) status: PlanStatus,
    pub(super) steps: Vec<AnsweredStep>,
}

/// A step of it.
#[derive(Debug, PartialEq)]
pub(super) struct AnsweredStep {
    parts: Vec<u32>,
    of: Option<u32>,
    ends: StepEnd,
    path: Vec<Waypoint>,
}

impl AnsweredStep {
    fn of(step: &Step) -> Self {
        let step = step.view();
        Self { parts: step.parts.to_vec(), of: step.of, ends: step.ends, path: step.path.to_vec() }
    }

    /// The part that leaves the assembly alone in this step, if it is such a step.
    pub(super) fn leaves_alone(&self) -> Option<usize> {
        match (&self.parts[..], self.of, self.ends) {
            ([part], None, StepEnd::Out) => Some(*part as usize),
            _ => None,
        }
    }
}

/// Plans to the end.
pub(super) fn plan(
    client: &Client,
    handle: Handle,
    options: &PlanOptions,
) -> Result<(Answered, Summary), BenchError> {
    let mut steps = Vec::new();
    let summary = follow(client, handle, options, |event| match event {
        Event::Step(step) => steps.push(AnsweredStep::of(&step)),
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
    mut each: impl FnMut(Event),
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
        let Some([from, to, ..]) = self.path_of(part) else { return waypoint_from_pose(&Pose::identity()) };
        let (from, to) = (pose_from_waypoint(from), pose_from_waypoint(to));
        let length = (to * centre - from * centre).norm();
        waypoint_from_pose(&interpolate(&from, &to, centre, by / length.max(2.0)))
    }

    fn path_of(&self, part: usize) -> Option<&[Waypoint]> {
        let step = self.steps.iter().find(|step| step.leaves_alone() == Some(part));
        step.map(|step| step.path.as_slice())
    }

    /// The unit vector along which a part begins to leave.
    pub(super) fn outward(&self, part: usize) -> [f64; 3] {
        let way =
            self.path_of(part).and_then(|path| path.iter().find(|w| w[..3].iter().any(|x| x.abs() > 1e-9)));
        let [x, y, z] = way.map_or([0.0, 0.0, 1.0], |w| [w[0], w[1], w[2]]);
        let length = (x * x + y * y + z * z).sqrt();
        [x, y, z].map(|x| x / length)
    }
}
