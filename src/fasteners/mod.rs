//! Fasteners, recognised by their shapes: nuts and screws that a wrench or key of a hexagon turns.
//!
//! Data flow: a surface → `hexagons` (six equal flats around a line, outside or in a socket) → `round_faces` (cylinders
//! about that line: a nut's hole, a screw's shank) → [`Fastener`]. [`Fastener::is_screwed_to`] asks whether another part
//! has a cylinder that such a thread fits.
//!
//! CAD draws threads as plain cylinders, with play or without. So a nut is screwed on whatever round rod it is around, and
//! a screw into a hole that leaves it no play.

mod hexagons;
mod round_faces;

use nalgebra::{Point3, Unit, Vector3};

use crate::geometry::{Pose, Surface};
use crate::tolerances::{
    LEAST_ENGAGEMENT, ROD_OF_NUT, TAPPED_HOLE, THREAD_OF_HEXAGON, THREAD_OF_SOCKET, WIDEST_FASTENER,
};

use hexagons::{Hexagon, hexagons};
use round_faces::{RoundFace, round_faces};

/// The line about which a fastener turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentreLine {
    /// One of its points.
    pub point: Point3<f64>,
    /// Along it, either way.
    pub direction: Unit<Vector3<f64>>,
}

impl CentreLine {
    /// The line where its part stands.
    fn moved(&self, pose: &Pose) -> Self {
        Self { point: pose * self.point, direction: Unit::new_unchecked(pose.rotation * *self.direction) }
    }

    /// How far along the line a point is from [`Self::point`].
    fn along(&self, p: &Point3<f64>) -> f64 {
        (p - self.point).dot(&self.direction)
    }

    /// From the line to a point, at right angles.
    fn to(&self, p: &Point3<f64>) -> Vector3<f64> {
        let offset = p - self.point;
        offset - *self.direction * offset.dot(&self.direction)
    }
}

/// What turns a fastener.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Drive {
    /// A hexagon on the outside, for a wrench.
    Hexagon,
    /// A hexagon in a socket, for a key.
    HexagonSocket,
}

/// Whether a fastener is screwed on a rod or into a hole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FastenerKind {
    /// With an internal thread.
    Nut,
    /// With an external thread.
    Screw,
}

/// A nut or a screw, in the frame of its shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Fastener {
    /// Which of both.
    pub kind: FastenerKind,
    /// The line about which it turns.
    pub line: CentreLine,
    /// What turns it.
    pub drive: Drive,
    /// The distance of opposite flats of its hexagon: the size of its tool, in the shape's unit.
    pub across_flats: f64,
    /// Where the flats begin and end along the line, from its point.
    pub flats: [f64; 2],
    /// The cylinder that has the thread.
    thread: RoundFace,
}

impl Fastener {
    /// The fastener that has a surface, if it is one.
    #[must_use]
    pub fn of(surface: &Surface) -> Option<Self> {
        let widest =
            |hexagon: &Hexagon| WIDEST_FASTENER[usize::from(hexagon.is_socket)] * hexagon.across_flats / 2.0;
        let is_head = |hexagon: &Hexagon| {
            surface.vertices().iter().all(|p| hexagon.line.to(p).norm() <= widest(hexagon))
        };
        hexagons(surface).into_iter().filter(is_head).find_map(|hexagon| {
            let rounds = round_faces(surface, &hexagon.line);
            let found = nut(&hexagon, &rounds).or_else(|| screw(&hexagon, &rounds));
            found.map(|(kind, thread)| {
                let Hexagon { line, across_flats, along: flats, .. } = hexagon;
                let drive = if hexagon.is_socket { Drive::HexagonSocket } else { Drive::Hexagon };
                Self { kind, line, drive, across_flats, flats, thread }
            })
        })
    }

    /// The diameter of the cylinder that has the thread, in the shape's unit.
    #[must_use]
    pub fn diameter(&self) -> f64 {
        2.0 * self.thread.radius
    }

    /// Whether another part has what the thread fits: a nut a rod in it, a screw a hole around it that leaves no play.
    /// The pose maps the frame of the fastener's shape to that of the other surface.
    #[must_use]
    pub fn is_screwed_to(&self, other: &Surface, pose: &Pose) -> bool {
        let fits = |round: &RoundFace| {
            let (is_hole, [least, most]) = match self.kind {
                FastenerKind::Nut => (false, ROD_OF_NUT),
                FastenerKind::Screw => (true, TAPPED_HOLE),
            };
            round.is_hole == is_hole
                && (least..=most).contains(&(round.radius / self.thread.radius))
                && round.shared_length(&self.thread) >= LEAST_ENGAGEMENT * self.thread.radius
        };
        round_faces(other, &self.line.moved(pose)).iter().any(fits)
    }
}

/// The hole of a nut: through a hexagon for a wrench, of the size that nuts have.
fn nut(hexagon: &Hexagon, rounds: &[RoundFace]) -> Option<(FastenerKind, RoundFace)> {
    let is_thread = |round: &&RoundFace| {
        round.is_hole
            && is_of_size(round, hexagon)
            && 2.0 * round.shared_length(&hexagon.extent()) >= hexagon.length()
    };
    let hole = rounds.iter().find(is_thread).filter(|_| !hexagon.is_socket)?;
    // A screw with a hole along it has a shank as well.
    let has_shank = rounds.iter().any(|round| !round.is_hole && 2.0 * round.radius < hexagon.across_flats);
    (!has_shank).then_some((FastenerKind::Nut, *hole))
}

/// The shank of a screw: the longest cylinder beside its hexagon, or, of a set screw, around its socket.
fn screw(hexagon: &Hexagon, rounds: &[RoundFace]) -> Option<(FastenerKind, RoundFace)> {
    let middle = (hexagon.along[0] + hexagon.along[1]) / 2.0;
    let is_beside = |round: &RoundFace| !(round.along[0]..=round.along[1]).contains(&middle);
    let longer = |a: &&RoundFace, b: &&RoundFace| {
        is_beside(a).cmp(&is_beside(b)).then(a.length().total_cmp(&b.length()))
    };
    let shank = rounds.iter().filter(|round| !round.is_hole && is_of_size(round, hexagon)).max_by(longer)?;
    (hexagon.is_socket || is_beside(shank)).then_some((FastenerKind::Screw, *shank))
}

/// Whether threads on a cylinder are turned by hexagons of that size.
fn is_of_size(round: &RoundFace, hexagon: &Hexagon) -> bool {
    let [least, most] = if hexagon.is_socket { THREAD_OF_SOCKET } else { THREAD_OF_HEXAGON };
    (least..=most).contains(&(2.0 * round.radius / hexagon.across_flats))
}

#[cfg(test)]
mod tests;
