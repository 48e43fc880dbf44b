//! Long steps along a motion that stays the same: along a wall, down a hole, off a thread.
//!
//! Steps of equal displacement show a screw (a line, if nothing turns). It is followed as long as the fields show
//! that nothing is entered and that what the part is pressed against is still there, so the part falls into a slot as
//! it would in short steps. At the end of a long step everything is measured exactly. A part that is pressed to a
//! thread of triangles wobbles; it is given clearance, and the mean screw of its steps is followed there. Each long step is twice as long as the one before: at its end, the screw is known twice as well.

use std::f64::consts::TAU;

use nalgebra::{Translation3, UnitQuaternion, Vector3, Vector6};

use crate::budgets::{
    EXTRAPOLATION_STEPS, FREE_STATIONS, HELD_STATIONS, HELIX_EXTRAPOLATION_STEPS,
    SHORTEST_HELIX_EXTRAPOLATION,
};
use crate::contact::sampled::{ContactSet, ContactSource, MovingBody};
use crate::geometry::{Pose, Screw};
use crate::scene::{Scene, StandingParts};
use crate::termination::{Interrupt, try_all};
use crate::tolerances::{
    DEPTH_TOLERANCE, EXTRAPOLATION_ANGLE, LEAST_PITCH, PRESSED_DEPTH, PRESSED_PROBE, PRESSED_PROBE_ON_HELIX,
    SAME_HELIX, SAME_STEP, SCREW_FROM_POSES_ANGLE, SEEN_HELIX_ANGLE,
};

use super::drive::Drive;

/// A long step.
pub(super) struct Extrapolated {
    /// Its poses, the last one at its end.
    pub(super) poses: Vec<Pose>,
    /// The contacts at its end, if they were gathered.
    pub(super) near: Option<ContactSet>,
    /// The angle by which it turns, in radians.
    pub(super) turned: f64,
}

/// A helix that is being followed.
#[derive(Clone)]
struct FollowedHelix {
    /// The displacement of one step.
    screw: Screw,
    /// The number of steps of the next long step.
    length: usize,
    pressing: Vec<Vector6<f64>>,
}

/// Detects a motion that stays the same, and extrapolates it.
pub(super) struct HelixExtrapolation<'a> {
    standing_parts: &'a StandingParts,
    drive: &'a Drive,
    /// The largest distance of a point of the part from its centre of mass.
    radius: f64,
    /// The last step, and the number of steps of the next long step along it.
    last: Option<Screw>,
    length: usize,
    /// The pose where the equal steps began, and their number; long steps count as all of their steps.
    alike: Option<(Pose, usize)>,
    helix: Option<FollowedHelix>,
    /// Whether verification found missing points: then only short steps are safe.
    disabled: bool,
}

impl<'a> HelixExtrapolation<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        standing_parts: &'a StandingParts,
        part: usize,
        drive: &'a Drive,
    ) -> Self {
        let disabled = super::is_refined(scene, standing_parts, part);
        Self {
            standing_parts,
            drive,
            radius: scene.bodies[part].shape.reach,
            last: None,
            length: 2,
            alike: None,
            helix: None,
            disabled,
        }
    }

    /// A long step after an ordinary contact step from `from` to the body's pose, if the motion is the same as
    /// before. `pressing` are the directions in which contact held the part back.
    pub(super) fn extrapolated(
        &mut self,
        from: &Pose,
        mover: &MovingBody<'_>,
        pressing: Vec<Vector6<f64>>,
        around: &mut dyn ContactSource,
    ) -> Result<Option<Extrapolated>, Interrupt> {
        if self.disabled {
            return Ok(None);
        }
        let now = Screw::between(from, &mover.pose, 1);
        let apart = self.last.replace(now).map_or(f64::INFINITY, |before| self.apart(&before, &now, from));
        let step = self.drive.step();
        self.alike = match self.alike {
            Some((begin, count)) if apart < SAME_HELIX * step => Some((begin, count + 1)),
            _ => Some((*from, 1)),
        };
        if apart >= SAME_STEP * step {
            self.length = 2;
            self.begin_helix(mover, &now, pressing);
            return self.follow(mover);
        }
        let wanted = self.length.min(longest(&now));
        let holds = |there: &MovingBody<'_>| try_all(&pressing, |push| self.is_pressed(there, push));
        let mut steps = self.free_steps(mover, &now, wanted, &holds)?;
        while steps > 1 {
            let there = MovingBody { pose: now.times(steps as f64) * mover.pose, ..*mover };
            let near = around.near(&there)?;
            if near.contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE) {
                self.length = if steps == wanted { steps * 2 } else { steps };
                self.alike = self.alike.map(|(begin, count)| (begin, count + steps));
                return Ok(Some(extrapolated_by(mover, &now, steps, Some(near))));
            }
            steps /= 2;
        }
        self.length = 2;
        Ok(None)
    }

    /// Starts to follow a helix, if the steps so far show one.
    fn begin_helix(&mut self, mover: &MovingBody<'_>, now: &Screw, pressing: Vec<Vector6<f64>>) {
        let Some((begin, count)) = self.alike else { return };
        if pressing.is_empty() || now.angle() * (count as f64) < SEEN_HELIX_ANGLE {
            return;
        }
        let screw = Screw::between(&begin, &mover.pose, count);
        if screw.lead() < LEAST_PITCH {
            return;
        }
        self.helix = Some(FollowedHelix { screw, length: count, pressing });
    }

    /// The next long step along the helix that is being followed.
    pub(super) fn follow(&mut self, mover: &MovingBody<'_>) -> Result<Option<Extrapolated>, Interrupt> {
        let Some(FollowedHelix { screw, length, pressing }) = self.helix.take() else { return Ok(None) };
        let wanted = telling(&screw, length.min(HELIX_EXTRAPOLATION_STEPS));
        let mut steps = telling(&screw, self.free_on_helix(mover, &screw, wanted, &pressing)?);
        while steps >= SHORTEST_HELIX_EXTRAPOLATION {
            let there = MovingBody { pose: screw.times(steps as f64) * mover.pose, ..*mover };
            if let Some(pose) = self.drive.with_clearance(&there, &screw.axis(), self.standing_parts)? {
                let angle = screw.angle() * steps as f64;
                let screw = Screw::between_turning(&mover.pose, &pose, steps, &screw, angle);
                let length = if steps == wanted { steps * 2 } else { steps };
                self.helix = Some(FollowedHelix { screw, length, pressing });
                return Ok(Some(extrapolated_by(mover, &screw, steps, None)));
            }
            steps = telling(&screw, steps / 2);
        }
        self.alike = None;
        Ok(None)
    }

    /// The number of steps along a helix, of those wanted, that stay on the thread and enter nothing.
    fn free_on_helix(
        &self,
        mover: &MovingBody<'_>,
        screw: &Screw,
        wanted: usize,
        pressing: &[Vector6<f64>],
    ) -> Result<usize, Interrupt> {
        let after = |k: usize| MovingBody { pose: screw.times(k as f64) * mover.pose, ..*mover };
        let is_held = |k: usize| try_all(pressing, |push| self.is_on_thread(&after(k), push));
        let is_free = |k: usize| Ok(!after(k).clearly_enters(&self.standing_parts.standing)?);
        let held = good_until(wanted, &HELD_STATIONS, &is_held)?;
        good_until(held, &FREE_STATIONS, &is_free)
    }

    /// The largest distance between the images of a point of the part under two displacements.
    fn apart(&self, a: &Screw, b: &Screw, from: &Pose) -> f64 {
        let (a, b) = (a.times(1.0) * from, b.times(1.0) * from);
        (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation) * self.radius
    }

    /// The number of steps, of those wanted, that enter nothing and keep the part pressed to the same things.
    fn free_steps(
        &self,
        mover: &MovingBody<'_>,
        screw: &Screw,
        wanted: usize,
        holds: &dyn Fn(&MovingBody<'_>) -> Result<bool, Interrupt>,
    ) -> Result<usize, Interrupt> {
        good_until(wanted, &[1], &|k: usize| {
            let there = MovingBody { pose: screw.times(k as f64) * mover.pose, ..*mover };
            Ok(!there.clearly_enters(&self.standing_parts.standing)? && holds(&there)?)
        })
    }

    /// Whether the fields show that a push still meets what it met. Beside the rim of a slot it does not, and short
    /// steps are needed.
    fn is_pressed(&self, mover: &MovingBody<'_>, push: &Vector6<f64>) -> Result<bool, Interrupt> {
        let (v, w): (Vector3<f64>, Vector3<f64>) =
            (push.fixed_rows::<3>(0).into(), push.fixed_rows::<3>(3).into());
        let scale = PRESSED_PROBE * self.drive.step() / (v.norm() + w.norm() * self.radius);
        let mut pose = mover.pose;
        let turn = UnitQuaternion::from_scaled_axis(w * scale);
        pose.append_rotation_wrt_point_mut(&turn, &mover.centre());
        pose.append_translation_mut(&Translation3::from(v * scale));
        MovingBody { pose, ..*mover }.clearly_enters(&self.standing_parts.standing)
    }

    /// Whether the part, pulled a little as far as its action pulls, still enters a thread: finer than fields show.
    fn is_on_thread(&self, mover: &MovingBody<'_>, push: &Vector6<f64>) -> Result<bool, Interrupt> {
        let pull: Vector3<f64> = push.fixed_rows::<3>(0).into();
        let Some(direction) = pull.try_normalize(0.0) else { return Ok(false) };
        let step = direction * (PRESSED_PROBE_ON_HELIX * self.drive.step());
        let pose = Translation3::from(step) * mover.pose;
        MovingBody { pose, ..*mover }.enters_by(PRESSED_DEPTH, &self.standing_parts.standing)
    }
}

/// The largest number of steps along a screw.
fn longest(screw: &Screw) -> usize {
    let most = if screw.angle() > 0.0 {
        (EXTRAPOLATION_ANGLE / screw.angle()) as usize
    } else {
        EXTRAPOLATION_STEPS
    };
    most.min(EXTRAPOLATION_STEPS)
}

/// The step up to which all stations are good. Stations are a number of steps apart; beyond the last good one they
/// are tried more closely, down to every step.
fn good_until(
    last: usize,
    every: &[usize],
    is_good: &dyn Fn(usize) -> Result<bool, Interrupt>,
) -> Result<usize, Interrupt> {
    let mut good = 0;
    for every in every {
        while good + every <= last && is_good(good + every)? {
            good += every;
        }
    }
    Ok(good)
}

/// The largest number of steps along a helix, of those wanted, whose two ends determine the screw.
fn telling(screw: &Screw, wanted: usize) -> usize {
    let tells = |steps: &usize| {
        let angle = screw.angle() * *steps as f64;
        angle < EXTRAPOLATION_ANGLE
            || (SCREW_FROM_POSES_ANGLE..=TAU - SCREW_FROM_POSES_ANGLE).contains(&angle.rem_euclid(TAU))
    };
    (1..=wanted).rev().find(tells).unwrap_or(0)
}

fn extrapolated_by(
    mover: &MovingBody<'_>,
    screw: &Screw,
    steps: usize,
    near: Option<ContactSet>,
) -> Extrapolated {
    let poses = (1..=steps).map(|k| screw.times(k as f64) * mover.pose).collect();
    Extrapolated { poses, near, turned: screw.angle() * steps as f64 }
}

#[cfg(test)]
mod tests {
    use super::super::SlidingEngine;
    use super::*;
    use crate::fixtures::{scene, thread};
    use crate::simulation::{Action, Axis, End, TransitionFunction};
    use crate::termination::Termination;

    #[test]
    fn the_last_good_step_is_found() {
        for last in 0..70 {
            for good in 0..=last {
                for every in [&HELD_STATIONS[..], &FREE_STATIONS] {
                    assert_eq!(good_until(last, every, &|k| Ok(k <= good)), Ok(good), "of {last}");
                }
            }
        }
    }

    #[test]
    fn extrapolations_along_a_helix_do_not_end_near_whole_turns() {
        let turn = Pose::new(Vector3::z() * 0.01, Vector3::z() * 0.1);
        let screw = Screw::between(&Pose::identity(), &turn, 1);
        assert_eq!(telling(&screw, 20), 20, "within the first turn");
        for wanted in 30..400 {
            let steps = telling(&screw, wanted);
            let left = (0.1 * steps as f64).rem_euclid(TAU);
            assert!(
                (SCREW_FROM_POSES_ANGLE..=TAU - SCREW_FROM_POSES_ANGLE).contains(&left) || steps < 24,
                "{steps} of {wanted}"
            );
            assert!(steps <= wanted && wanted - steps < 33, "{steps} of {wanted}");
        }
    }

    #[test]
    fn a_nut_is_followed_off_its_thread() {
        let (turns, pitch) = (4.0, 0.5);
        let (scene, verifier) = scene(thread(turns, pitch));
        let start = scene.bodies[1].planning_from_shape;
        let around = StandingParts::new(&scene, vec![0]);
        let off = Action::Screw(Axis::Z, true, true);
        let t = Termination::default();
        let motion = SlidingEngine.simulate(&scene, &around, 1, &start, off, &t).unwrap();
        assert!(matches!(motion.end, End::Disassembled(_)), "{:?}", motion.end);
        let angle: f64 = motion.path.windows(2).map(|w| w[0].rotation.angle_to(&w[1].rotation)).sum();
        assert!(angle > 0.6 * turns * TAU, "{angle}");
        let verdict = verifier.check(&scene, &scene.allowed, &[0], 1, &motion.path, &t).unwrap();
        assert!(verdict.depth < 2e-3, "{}", verdict.depth);
    }
}
