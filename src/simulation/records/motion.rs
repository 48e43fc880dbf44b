//! Motions: f(s, a, p) is remembered with what it met, and not with the rest of the assembly.
//!
//! The record has the motion in contact, until contact stopped it, the engine gave up, or the part was out. Its
//! *witnesses* are the standing parts whose boxes meet the box of everything that the engine measured; no other part
//! had an influence. So the record holds among other parts if the same box meets the same witnesses in the same
//! order: the same meshes, poses, boxes, allowed penetrations and added samples. Whether and where the part is out
//! depends on the hull of all standing parts, so that is tested again at each pose where the engine had tested it. A
//! motion that ended because the part was out, but is not out now, is simulated again.
//!
//! The box is known only after the motion, so a look-up takes two steps: what the motion starts from leads to the boxes
//! and witnesses of known motions ([`WITNESS`]), and these lead to a motion ([`MOTION`]).

use std::sync::{Arc, Mutex, PoisonError};

use serde::{Deserialize, Serialize};

use super::{SOURCES, add_action};
use crate::budgets::MOTION_VARIANTS;
use crate::cache::{Digest, RecordKey, RecordKind, RequestCache, Storage};
use crate::geometry::{Bounds, Pose, add_bounds, add_pose};
use crate::scene::{Scene, StandingParts, add_samples, add_standing, exit_direction};
use crate::simulation::{Action, End, Motion, TransitionFunction, asked_again};
use crate::termination::{Interrupt, Termination};

/// The boxes of motions with one start, and the witnesses in them.
pub(crate) static WITNESS: RecordKind =
    RecordKind::of::<Vec<MotionWitnesses>>(3, "witness", Storage::MemoryAndDisk, SOURCES);
/// A motion of the transition function.
pub(crate) static MOTION: RecordKind =
    RecordKind::of::<MotionRecord>(4, "motion", Storage::MemoryAndDisk, SOURCES);

/// The surroundings of one motion. In a record, the ones used last come last.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MotionWitnesses {
    /// The box of everything that the engine measured.
    looked_at: Bounds,
    /// The hash of the parts whose boxes meet it.
    witnesses: [u8; 32],
}

/// A motion; parts are given by their index among its witnesses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct MotionRecord {
    path: Vec<Pose>,
    /// The indices in the path at which the engine tested whether the part is out.
    asked: Vec<u32>,
    end: MotionEnd,
}

/// How the motion in contact ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum MotionEnd {
    /// The part was out: how it would have gone on is not known.
    Out,
    Collision {
        with: Vec<u32>,
    },
    Undecided {
        reason: String,
        touched: Vec<u32>,
    },
}

/// One use of a transition function.
#[derive(Clone, Copy)]
pub struct MotionQuestion<'a> {
    /// The engine.
    pub engine: &'a dyn TransitionFunction,
    /// The bodies.
    pub scene: &'a Scene,
    /// What stands.
    pub surroundings: &'a StandingParts,
    /// What moves.
    pub part: usize,
    /// From where.
    pub start: Pose,
    /// How it is moved.
    pub action: Action,
}

impl MotionQuestion<'_> {
    /// The motion that answers the question, as remembered, or else as simulated, which is then remembered.
    ///
    /// # Errors
    /// The termination condition became true.
    pub fn answer(&self, cache: &RequestCache, termination: &Termination) -> Result<Motion, Interrupt> {
        let Self { engine, scene, surroundings, part, start, action } = *self;
        let Some(name) = engine.remembered_as().filter(|_| cache.remembers()) else {
            return engine.simulate(scene, surroundings, part, &start, action, termination);
        };
        let digest = self.digest(name);
        let mut known: Vec<MotionWitnesses> = cache.get(&digest.key(&WITNESS)).unwrap_or_default();
        if let Some(motion) = known.iter().rev().find_map(|v| self.found(cache, &digest, v)) {
            cache.count_reused(&MOTION);
            return Ok(motion);
        }
        let looked_at = Arc::new(Mutex::new(Bounds::EMPTY));
        let watched = Arc::new(scene.broad_phase.watched(Arc::clone(&looked_at)));
        let seen = Scene { broad_phase: watched, ..scene.clone() };
        let motion = engine.simulate(&seen, surroundings, part, &start, action, termination)?;
        let looked_at = *looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        let (parts, witnesses) = self.witnesses(&looked_at);
        if let Some(record) = record(&motion, &parts) {
            let variant = MotionWitnesses { looked_at, witnesses };
            cache.put(variant.key(&digest), &record);
            known.retain(|v| *v != variant);
            known.push(variant);
            known.drain(..known.len().saturating_sub(MOTION_VARIANTS));
            cache.put(digest.key(&WITNESS), &known);
        }
        Ok(motion)
    }

    /// A known motion, if it holds among the standing parts.
    fn found(&self, cache: &RequestCache, digest: &Digest, variant: &MotionWitnesses) -> Option<Motion> {
        let (parts, witnesses) = self.witnesses(&variant.looked_at);
        if witnesses != variant.witnesses {
            return None;
        }
        self.motion(cache.get(&variant.key(digest))?, &parts)
    }

    /// All that a motion starts from, without the standing parts.
    fn digest(&self, engine: &str) -> Digest {
        let body = &self.scene.bodies[self.part];
        let mut digest = Digest::new();
        digest.text(engine).hash(body.shape.content());
        add_pose(&mut digest, &body.planning_from_shape);
        add_bounds(&mut digest, &body.bounds);
        add_samples(&mut digest, body);
        add_pose(&mut digest, &self.start);
        add_action(&mut digest, &self.action);
        // Samples added to any standing part make an engine careful everywhere.
        let added = |&i: &usize| !self.scene.bodies[i].extra_samples.points().is_empty();
        digest.integer(u64::from(self.surroundings.standing.iter().any(added)));
        digest
    }

    /// The standing parts whose boxes meet a box, ascending, and the hash of what they are.
    fn witnesses(&self, looked_at: &Bounds) -> (Vec<usize>, [u8; 32]) {
        let parts = self.scene.broad_phase.meeting_of(&self.surroundings.standing, looked_at);
        let mut digest = Digest::new();
        for &part in &parts {
            add_standing(&mut digest, self.scene, self.part, part);
            // Of two parts of one size, the engine takes the one with the lower number.
            digest.integer(u64::from(part < self.part));
            add_samples(&mut digest, &self.scene.bodies[part]);
        }
        (parts, digest.finish())
    }

    /// A remembered motion among the standing parts, of which `parts` are the witnesses; `None` if it ended because the
    /// part was out, but is not out now.
    fn motion(&self, record: MotionRecord, parts: &[usize]) -> Option<Motion> {
        let MotionRecord { mut path, mut asked, end } = record;
        for i in 0..asked.len() {
            let at = asked[i] as usize;
            let hint = asked_again(&self.action, i);
            let out = exit_direction(self.scene, self.surroundings, self.part, path.get(at)?, hint);
            if let Some(direction) = out {
                path.truncate(at + 1);
                asked.truncate(i + 1);
                let end = End::Disassembled(direction);
                return Some(Motion { recalled: true, ..Motion::simulated(path, asked, end) });
            }
        }
        let part = |place: &u32| parts.get(*place as usize).copied();
        let parts = |list: &[u32]| list.iter().map(part).collect::<Option<Vec<usize>>>();
        let end = match end {
            MotionEnd::Out => return None,
            MotionEnd::Collision { with } => End::Collision { with: parts(&with)? },
            MotionEnd::Undecided { reason, touched } => {
                End::Undecided { reason: reason.into(), touched: parts(&touched)? }
            }
        };
        Some(Motion { recalled: true, ..Motion::simulated(path, asked, end) })
    }
}

/// The record of a motion with these witnesses, unless it met another part.
fn record(motion: &Motion, witnesses: &[usize]) -> Option<MotionRecord> {
    let place = |part: &usize| witnesses.binary_search(part).ok().map(|at| at as u32);
    let places = |list: &[usize]| list.iter().map(place).collect::<Option<Vec<u32>>>();
    let end = match &motion.end {
        End::Disassembled(_) => MotionEnd::Out,
        End::Collision { with } => MotionEnd::Collision { with: places(with)? },
        End::Undecided { reason, touched } => {
            MotionEnd::Undecided { reason: reason.to_string(), touched: places(touched)? }
        }
    };
    Some(MotionRecord { path: motion.path.clone(), asked: motion.asked.clone(), end })
}

impl MotionWitnesses {
    /// The key of the motion; `digest` is of what it starts from.
    fn key(&self, digest: &Digest) -> RecordKey {
        let mut digest = digest.clone();
        add_bounds(&mut digest, &self.looked_at);
        digest.hash(&self.witnesses).key(&MOTION)
    }
}
