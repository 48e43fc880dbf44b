//! The path of a step as a few moves.
//!
//! The displacement from one waypoint to the next is a turn about some axis in space with a shift along it
//! (Chasles); both are the same for all points of the part. Displacements in a row that are alike are one move.

use std::f64::consts::PI;

use nalgebra::Vector3;

use crate::document::StepDocument;
use crate::geometry::{Pose, pose_from_waypoint};

/// Turns below this (radians) are none.
const NO_TURN: f64 = 0.01;
/// cos of the angle within which two directions are one (3 degrees) …
const ALIKE: f64 = 0.9986;
/// … and within which one is an axis of the frame (2 degrees).
pub(super) const NEARLY: f64 = 0.9994;
/// Share of the larger one by which two lengths or turns of alike moves differ at most. Copies of a screw in holes of a
/// plate leave by paths that differ by a few hundredths. At half, each screw under a sloping cover gets a sentence of its
/// own; at double, sentences have ranges as wide as 5–10 mm.
const ALIKE_LENGTH: f64 = 0.25;
/// Moves shorter than this share of the whole way are left out.
const SLIGHT: f64 = 0.03;
/// Share of the whole way. The sentence of a turn leaves out a shift along the axis that is shorter: half a turn of a fine
/// thread before a way out a hundred times as long keeps its shift. At half, a bayonet's drift in its play becomes a shift;
/// at double, that thread loses its shift.
const NO_SHIFT: f64 = 2e-3;
/// Radians: half a turn, from which on a turn with a shift along its axis is a screw. At half, lids that are tilted out
/// by a right angle are screws; at double, caps with half a turn are none.
const SCREW: f64 = PI;
/// Turns. An angle this near to a quarter turn is written as one (7 degrees). At half, threads that end at a facet get
/// decimals; at double, 76 degrees become a quarter.
pub(super) const QUARTERLY: f64 = 0.02;

/// One move of a part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Move {
    /// Unit direction: of the way, or of the axis that the part turns about counter-clockwise.
    pub(super) along: Vector3<f64>,
    /// How far, along `along`; negative against it.
    pub(super) length: f64,
    /// How far it turns, radians; 0 for straight moves.
    pub(super) angle: f64,
}

/// The kinds of moves that have verbs of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MoveKind {
    Straight,
    Turn,
    Screw,
}

impl Move {
    fn between(a: &Pose, b: &Pose) -> Self {
        let shift = b * a.inverse();
        match shift.rotation.axis_angle() {
            Some((axis, angle)) if angle > NO_TURN => {
                Self { along: *axis, length: shift.translation.vector.dot(&axis), angle }
            }
            _ => {
                let way = b.translation.vector - a.translation.vector;
                let along = way.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::zeros);
                Self { along, length: way.norm(), angle: 0.0 }
            }
        }
    }

    /// Takes the next move in, if it goes on in the same way.
    fn goes_on(&mut self, next: &Self) -> bool {
        let same = self.along.dot(&next.along) > ALIKE && (self.angle > 0.0) == (next.angle > 0.0);
        if same {
            let way = self.along * self.length.abs() + next.along * next.length.abs();
            self.along = way.try_normalize(f64::MIN_POSITIVE).unwrap_or(self.along);
            self.length += next.length;
            self.angle += next.angle;
        }
        same
    }

    pub(super) fn kind(&self) -> MoveKind {
        match self.angle {
            0.0 => MoveKind::Straight,
            angle if self.length != 0.0 && angle > SCREW * (1.0 - QUARTERLY) => MoveKind::Screw,
            _ => MoveKind::Turn,
        }
    }

    /// Whether it is too short to be mentioned, of a way of some length.
    fn is_slight(&self, whole: f64) -> bool {
        self.length.abs() < whole * SLIGHT && self.angle < 0.1
    }

    /// Without the shift of a turn, if that is too short to be mentioned.
    fn without_slight_shift(&self, whole: f64) -> Self {
        let is_shift = self.length.abs() > (NO_SHIFT * whole).max(1e-6);
        let length = if self.angle == 0.0 || is_shift { self.length } else { 0.0 };
        Self { length, ..*self }
    }

    /// Whether it is along no axis of the frame, as ways are that only bring a part near from where it waits.
    fn is_oblique(&self) -> bool {
        self.along.amax() < NEARLY
    }

    /// The direction in which it brings the part.
    pub(super) fn sense(&self) -> Vector3<f64> {
        if self.length < 0.0 { -self.along } else { self.along }
    }

    /// Whether one sentence describes both.
    pub(super) fn is_alike(&self, other: &Self) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= ALIKE_LENGTH * a.max(b);
        self.kind() == other.kind()
            && self.along.dot(&other.along) > ALIKE
            && (self.length < 0.0) == (other.length < 0.0)
            && close(self.length.abs(), other.length.abs())
            && close(self.angle, other.angle)
    }
}

/// The moves of a path.
pub(super) fn moves(step: &StepDocument) -> Vec<Move> {
    let poses: Vec<Pose> = step.path.iter().map(pose_from_waypoint).collect();
    let mut moves: Vec<Move> = Vec::new();
    for pair in poses.windows(2) {
        let next = Move::between(&pair[0], &pair[1]);
        if (next.length == 0.0 && next.angle == 0.0) || moves.last_mut().is_some_and(|m| m.goes_on(&next)) {
            continue;
        }
        moves.push(next);
    }
    moves
}

fn whole(moves: &[Move]) -> f64 {
    moves.iter().map(|m| m.length.abs()).sum()
}

/// The moves that are long enough to be mentioned.
pub(super) fn telling(moves: &[Move]) -> Vec<Move> {
    let whole = whole(moves);
    let is_all_slight = moves.iter().all(|m| m.is_slight(whole));
    let telling = moves.iter().filter(|m| is_all_slight || !m.is_slight(whole));
    telling.map(|m| m.without_slight_shift(whole)).collect()
}

/// How many of the first moves only bring a part near from where it waits: those up to the last one that is along
/// no axis, as random ways are.
pub(super) fn brought_near(moves: &[Move]) -> usize {
    let whole = whole(moves);
    let before = &moves[..moves.len().saturating_sub(1)];
    before.iter().rposition(|m| m.is_oblique() && !m.is_slight(whole)).map_or(0, |last| last + 1)
}
