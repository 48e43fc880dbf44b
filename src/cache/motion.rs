//! Motions: f(s, a, p) is remembered with what it met, and not with the rest of the assembly.
//!
//! What is kept is the motion in contact, to where contact stops it, it is given up, or it was out. Its
//! *witnesses* are the standing parts whose boxes meet the box that holds everything the engine looked
//! at: nothing else had a say in its steps. So it holds today if the same test gives the same parts again,
//! in the same order: same meshes, poses, boxes, allowances and added samples. A part gone or put
//! elsewhere beyond that box changes nothing; any change inside does. Whether and where the part is out
//! depends on the hull of everything that stands, so that is asked afresh at every pose where the engine
//! had asked. A motion that had ended because it was out, and is not today, is simulated again.
//!
//! The box is known only after the motion, so finding takes two steps: what the motion starts from leads to
//! the boxes and witnesses of the motions that are known ([`Kind::Witness`]), and these to a motion.

use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Point3;

use super::pair::{add_action, add_pose, add_samples};
use super::recall::About;
use super::records::{MotionEnd, MotionRecord, WitnessRecord, WitnessVariant, pose_of, pose_record};
use super::{Digest, Kind, Recall};
use crate::geometry::{Bounds, Pose};
use crate::scene::{Scene, Surroundings, exit_direction};
use crate::simulation::{Action, End, Motion, TransitionFunction, asked_again};
use crate::termination::{Interrupt, Termination};

/// Of so many motions that start alike, each among other parts, the last ones are kept.
const MOST_VARIANTS: usize = 8;

/// One use of a transition function.
#[derive(Clone, Copy)]
pub struct MotionQuestion<'a> {
    /// The engine.
    pub engine: &'a dyn TransitionFunction,
    /// The bodies.
    pub scene: &'a Scene,
    /// What stands.
    pub surroundings: &'a Surroundings,
    /// What moves.
    pub part: usize,
    /// From where.
    pub start: Pose,
    /// How it is moved.
    pub action: Action,
}

impl Recall {
    /// The motion that answers a question, as remembered, or else as simulated, which is then
    /// remembered.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn motion(
        &self,
        question: &MotionQuestion<'_>,
        termination: &Termination,
    ) -> Result<Motion, Interrupt> {
        let MotionQuestion { engine, scene, surroundings, part, start, action } = *question;
        let Some(name) = engine.remembered_as().filter(|_| self.remembers()) else {
            return engine.simulate(scene, surroundings, part, &start, action, termination);
        };
        let digest = question.digest(name);
        let mut known: WitnessRecord = self.get(&digest.key(Kind::Witness)).unwrap_or_default();
        if let Some(motion) = known.variants.iter().rev().find_map(|v| self.found(question, &digest, v)) {
            self.count(About::Motion);
            return Ok(motion);
        }
        let looked_at = Arc::new(Mutex::new(Bounds::EMPTY));
        let watched = Arc::new(scene.broad_phase.watched(Arc::clone(&looked_at)));
        let seen = Scene { broad_phase: watched, ..scene.clone() };
        let motion = engine.simulate(&seen, surroundings, part, &start, action, termination)?;
        let looked_at = *looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(record) = question.record(&motion, &looked_at) {
            let looked_at = [looked_at.min, looked_at.max].map(Into::into);
            let variant = WitnessVariant { witnesses: question.witnesses(&looked_at).1, looked_at };
            self.put(variant_digest(&digest, &variant).key(Kind::Motion), &record);
            known.variants.retain(|v| *v != variant);
            known.variants.push(variant);
            let surplus = known.variants.len().saturating_sub(MOST_VARIANTS);
            known.variants.drain(..surplus);
            self.put(digest.key(Kind::Witness), &known);
        }
        Ok(motion)
    }

    /// A motion that is known, if it holds among what stands today.
    fn found(
        &self,
        question: &MotionQuestion<'_>,
        digest: &Digest,
        variant: &WitnessVariant,
    ) -> Option<Motion> {
        let (parts, witnesses) = question.witnesses(&variant.looked_at);
        if witnesses != variant.witnesses {
            return None;
        }
        let record: MotionRecord = self.get(&variant_digest(digest, variant).key(Kind::Motion))?;
        question.motion(record, &parts)
    }
}

impl MotionQuestion<'_> {
    /// All that a motion starts from, but for what stands around.
    fn digest(&self, engine: &str) -> Digest {
        let body = &self.scene.bodies[self.part];
        let mut digest = Digest::new();
        digest.text(engine).hash(body.shape.content());
        add_pose(&mut digest, &body.planning_from_shape);
        add_bounds(&mut digest, &body.bounds);
        add_samples(&mut digest, body);
        add_pose(&mut digest, &self.start);
        add_action(&mut digest, &self.action);
        // Samples added anywhere make an engine careful everywhere.
        let added = |&i: &usize| !self.scene.bodies[i].extra_samples.points().is_empty();
        digest.integer(u64::from(self.surroundings.standing.iter().any(added)));
        digest
    }

    /// The standing parts whose boxes meet a box, ascending, and the hash of what they are.
    fn witnesses(&self, looked_at: &[[f64; 3]; 2]) -> (Vec<usize>, [u8; 32]) {
        let [min, max] = looked_at.map(Point3::from);
        let parts = self.scene.broad_phase.meeting_of(&self.surroundings.standing, &Bounds { min, max });
        let mut digest = Digest::new();
        for &part in &parts {
            add_standing(&mut digest, self.scene, self.part, part);
            // Of parts of one size, the engine takes the one that is named first.
            digest.integer(u64::from(part < self.part));
            add_samples(&mut digest, &self.scene.bodies[part]);
        }
        (parts, digest.finish())
    }

    /// A motion to be remembered, unless it met what it did not look at.
    fn record(&self, motion: &Motion, looked_at: &Bounds) -> Option<MotionRecord> {
        let parts = self.witnesses(&[looked_at.min, looked_at.max].map(Into::into)).0;
        let place = |part: &usize| parts.binary_search(part).ok().map(|at| at as u32);
        let places = |list: &[usize]| list.iter().map(place).collect::<Option<Vec<u32>>>();
        let end = match &motion.end {
            End::Disassembled(_) => MotionEnd::Out,
            End::Collision { with } => MotionEnd::Collision { with: places(with)? },
            End::Undecided { reason, touched } => {
                MotionEnd::Undecided { reason: reason.to_string(), touched: places(touched)? }
            }
        };
        let path = motion.path.iter().map(pose_record).collect();
        Some(MotionRecord { path, asked: motion.asked.clone(), end })
    }

    /// A remembered motion among what stands today, whose witnesses are `parts`; `None` if it ended because
    /// the part was out, and is not any more.
    fn motion(&self, record: MotionRecord, parts: &[usize]) -> Option<Motion> {
        let mut path: Vec<Pose> = record.path.iter().map(pose_of).collect();
        let mut asked = record.asked;
        for i in 0..asked.len() {
            let at = asked[i] as usize;
            let hint = asked_again(&self.action, i);
            let out = exit_direction(self.scene, self.surroundings, self.part, path.get(at)?, hint);
            if let Some(direction) = out {
                path.truncate(at + 1);
                asked.truncate(i + 1);
                return Some(Motion { path, asked, end: End::Disassembled(direction), recalled: true });
            }
        }
        let part = |place: &u32| parts.get(*place as usize).copied();
        let parts = |list: &[u32]| list.iter().map(part).collect::<Option<Vec<usize>>>();
        let end = match record.end {
            MotionEnd::Out => return None,
            MotionEnd::Collision { with } => End::Collision { with: parts(&with)? },
            MotionEnd::Undecided { reason, touched } => {
                End::Undecided { reason: reason.into(), touched: parts(&touched)? }
            }
        };
        Some(Motion { path, asked, end, recalled: true })
    }
}

fn variant_digest(digest: &Digest, variant: &WitnessVariant) -> Digest {
    let mut digest = digest.clone();
    digest.numbers(variant.looked_at.iter().flatten().copied()).hash(&variant.witnesses);
    digest
}

/// A part that stands, and how deep another may get into it.
pub(super) fn add_standing(digest: &mut Digest, scene: &Scene, part: usize, standing: usize) {
    let body = &scene.bodies[standing];
    digest.hash(body.shape.content());
    add_pose(digest, &body.planning_from_shape);
    add_bounds(digest, &body.bounds);
    digest.numbers([scene.allowances.of(part, standing)]);
}

/// A box, bit by bit.
pub(super) fn add_bounds(digest: &mut Digest, bounds: &Bounds) {
    digest.numbers(bounds.min.iter().chain(bounds.max.iter()).copied());
}
