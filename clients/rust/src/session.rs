//! Planning again while an assembly is being taken apart.

use std::collections::BTreeMap;

use sbdp_ipc::plan::{StepEnd, Waypoint};

use crate::client::Client;
use crate::error::ClientError;
use crate::options::PlanOptions;
use crate::plan::part_named;
use crate::step::Step;
use crate::stream::PlanStream;
use crate::subject::Subject;

/// An assembly that is being taken apart: what has happened to it, and plans for the rest. What is recorded here
/// becomes the changes of the next request ([`PlanOptions`]), so that the daemon computes again only what depends on
/// them.
#[derive(Debug)]
pub struct Session {
    client: Client,
    subject: Subject,
    options: PlanOptions,
    moved: BTreeMap<u32, Waypoint>,
}

impl Client {
    /// Begins a session about an assembly in the state that `options` describe. Sends nothing yet.
    ///
    /// # Errors
    /// `options` ask for an assembly plan.
    pub fn session(&self, subject: impl Into<Subject>, options: PlanOptions) -> Result<Session, ClientError> {
        if options.assembly.is_some() {
            return Err(ClientError::NoAssemblySession);
        }
        let moved = options.moved.iter().copied().collect();
        Ok(Session { client: self.clone(), subject: subject.into(), options, moved })
    }
}

impl Session {
    /// The number of a part, if the session is about meshes.
    ///
    /// # Errors
    /// There is no part of this name, or the session is about a handle, which has no names.
    pub fn part(&self, name: &str) -> Result<u32, ClientError> {
        match &self.subject {
            Subject::Handle(_) => Err(ClientError::NoSuchPart { name: name.to_owned() }),
            Subject::Meshes(meshes) => part_named(meshes.assembly().parts.iter().map(|p| p.name), name),
        }
    }

    /// Records that these parts are out.
    pub fn executed(&mut self, parts: &[u32]) {
        for &part in parts {
            if !self.options.removed.contains(&part) {
                self.options.removed.push(part);
            }
            self.moved.remove(&part);
        }
        let is_out = |part: &u32| parts.contains(part);
        self.options.fixed.retain(|p| !is_out(p));
        self.options.base.retain(|p| !is_out(p));
        self.options.keep.retain(|p| !is_out(p));
        self.options.keep_out.retain(|p| !is_out(p));
        if let Some(targets) = &mut self.options.targets {
            targets.retain(|p| !is_out(p));
        }
    }

    /// Records that a step of the last plan was done: its parts are out, or stand where the step left them. A step
    /// within a group that is out changes nothing.
    pub fn performed(&mut self, step: &Step) {
        let step = step.view();
        match (step.of, step.ends) {
            (Some(_), _) => {}
            (None, StepEnd::Out | StepEnd::In) => self.executed(step.parts),
            (None, StepEnd::Aside) => {
                let Some(way) = step.path.last() else { return };
                for &part in step.parts {
                    let pose = self.moved.get(&part).map_or(*way, |before| after(way, before));
                    self.moved(part, pose);
                }
            }
        }
    }

    /// Records that this part does not move: until it is [`freed`](Self::freed), plans leave it in place.
    pub fn stuck(&mut self, part: u32) {
        if !self.options.fixed.contains(&part) {
            self.options.fixed.push(part);
        }
        // A target that may not move would be refused.
        if let Some(targets) = &mut self.options.targets {
            targets.retain(|p| *p != part);
        }
    }

    /// Records that this part moves again. If it was a target before it got stuck, it is no longer one.
    pub fn freed(&mut self, part: u32) {
        self.options.fixed.retain(|p| *p != part);
    }

    /// Records that this part stands elsewhere: the rigid motion of its mesh from where the assembly has it (input
    /// units and frame).
    pub fn moved(&mut self, part: u32, pose: Waypoint) {
        self.moved.insert(part, pose);
    }

    /// The options of the next request: a timeout, for example, may change between two plans.
    pub fn options_mut(&mut self) -> &mut PlanOptions {
        &mut self.options
    }

    /// Plans how the rest comes apart from how it stands now.
    ///
    /// # Errors
    /// As [`Client::plan`].
    pub fn replan(&mut self) -> Result<PlanStream, ClientError> {
        self.options.moved = self.moved.iter().map(|(part, pose)| (*part, *pose)).collect();
        self.client.plan(self.subject.clone(), &self.options)
    }
}

/// One rigid motion after another.
fn after(second: &Waypoint, first: &Waypoint) -> Waypoint {
    let [x, y, z, w, i, j, k] = *second;
    let [fx, fy, fz, fw, fi, fj, fk] = *first;
    // The first shift, turned: v + 2 w (q × v) + 2 q × (q × v).
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let (axis, shift) = ([i, j, k], [fx, fy, fz]);
    let once = cross(axis, shift);
    let twice = cross(axis, once);
    let turned: [f64; 3] = std::array::from_fn(|n| shift[n] + 2.0 * (w * once[n] + twice[n]));
    [
        x + turned[0],
        y + turned[1],
        z + turned[2],
        w * fw - i * fi - j * fj - k * fk,
        w * fi + i * fw + j * fk - k * fj,
        w * fj - i * fk + j * fw + k * fi,
        w * fk + i * fj - j * fi + k * fw,
    ]
}

#[cfg(test)]
mod tests {
    use super::after;

    #[test]
    fn motions_follow_each_other() {
        // A quarter turn about z, after a shift along x: the shift is turned to y.
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turn = [0.0, 0.0, 5.0, half, 0.0, 0.0, half];
        let both = after(&turn, &[2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
        let expected = [0.0, 2.0, 5.0, half, 0.0, 0.0, half];
        assert!(both.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{both:?}");
        let half_turn = after(&turn, &turn);
        let expected = [0.0, 0.0, 10.0, 0.0, 0.0, 0.0, 1.0];
        assert!(half_turn.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{half_turn:?}");
    }
}
