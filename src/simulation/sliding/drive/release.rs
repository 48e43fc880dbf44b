//! Where what holds a pull back lets go.
//!
//! Of a part that is pulled and turned at once, a lug that comes before its slot stops the pull until it is in
//! line, and a step may well turn it from one rim of the slot to the other. Without inertia the part goes in
//! where it first can: so a step is looked through for places where nothing that is known to hold the pull back
//! does so, and the part is pulled from the middle of these.

use nalgebra::{Translation3, Unit, Vector3, Vector6};

use crate::geometry::Pose;

use super::super::super::contact::{Contact, Mover, Near};
use super::super::super::projection::{Projected, Row};
use super::super::DEPTH_TOLERANCE;
use super::{Around, Drive, Moved, Step};

/// A contact holds a pull back if the part, moved so far along it, is too deep there. In a slot nothing is, whatever
/// its play.
const LIFT: f64 = 0.01;
/// What opposes a pull by less than this share does not hold it back: the part slides along it.
const LEAST_OPPOSED: f64 = 0.3;
/// Places of a step that are looked at: no slot with less play than an eighth of a step is found.
const PLACES: u32 = 16;
/// Looks at the surroundings before a step is made as it is.
const MOST_LOOKS: usize = 8;

/// A step that was found free of entry.
pub(super) struct Taken<'a> {
    pub(super) mover: &'a Mover<'a>,
    pub(super) near: &'a Near,
    pub(super) twist: &'a Vector6<f64>,
    pub(super) result: &'a Projected,
    /// Its constraints, and the contacts that they come from.
    pub(super) rows: &'a [Row],
    pub(super) contacts: &'a [Contact],
}

impl Drive {
    /// Which way it is pulled, if it is pulled and turned at once.
    fn pull(&self) -> Option<Unit<Vector3<f64>>> {
        let (pull, turn) = (self.wanted.fixed_rows::<3>(0), self.wanted.fixed_rows::<3>(3));
        if turn == Vector3::zeros() { None } else { Unit::try_new(pull.into_owned(), 0.0) }
    }

    /// The same without turning: what a part does that was let go.
    fn pulling(&self, pull: &Vector3<f64>) -> Self {
        let pull = pull * self.step;
        Self { wanted: Vector6::new(pull.x, pull.y, pull.z, 0.0, 0.0, 0.0), takes_long_steps: false, ..*self }
    }

    /// The step that pulls the part out of another one that would turn it past where it can be pulled: part of the way
    /// like that other one, then like a pull.
    pub(super) fn released(&self, step: &Taken<'_>, around: &mut dyn Around) -> Option<Moved> {
        let pull = self.pull()?;
        let (place, twist) = self.let_go(step, &pull, around)?;
        let mut near = around.near(&place);
        let from = (step.mover, step.near);
        let is_clear = near.contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE)
            && self.is_clear_between(from, (&place, &near), &twist, around);
        let is_up = |pose: &Pose| (pose * place.body.shape.mass.centre - place.centre()).dot(&pull) > LIFT;
        let Some(Step::Moved(pulled)) =
            is_clear.then(|| self.pulling(&pull).advance(&place, &mut near, around))
        else {
            return None;
        };
        let turned = pulled.turned + twist.fixed_rows::<3>(3).norm();
        is_up(&pulled.pose).then(|| Moved { turned, via: Some(place.pose), ..pulled })
    }

    /// Where on the way of a step, and after which twist, what held the pull back at its start does so no more; the
    /// start itself where nothing did.
    fn let_go<'m>(
        &self,
        step: &Taken<'m>,
        pull: &Vector3<f64>,
        around: &mut dyn Around,
    ) -> Option<(Mover<'m>, Vector6<f64>)> {
        let opposes = |row: &Row| row.a.fixed_rows::<3>(0).dot(pull) < -LEAST_OPPOSED;
        if !step.result.active.iter().any(|(i, _)| opposes(&step.rows[*i])) {
            return None;
        }
        let at = |place: u32| {
            let twist = step.twist * (f64::from(place) / f64::from(PLACES));
            (Mover { pose: self.displaced(step.mover, &twist), ..*step.mover }, twist)
        };
        let lifted = |place: u32| {
            let (mover, _) = at(place);
            Mover { pose: Translation3::from(pull * LIFT) * mover.pose, ..mover }
        };
        let lifted: Vec<Mover<'m>> = (0..=PLACES).map(lifted).collect();
        let holds = |contact: &Contact, place: u32| {
            let there = lifted[place as usize].remeasured(contact, 0.0);
            there.is_some_and(|c| c.gap < -DEPTH_TOLERANCE)
        };
        let known = step.rows.iter().zip(step.contacts).filter(|(row, _)| opposes(row)).map(|(_, c)| *c);
        let mut holding: Vec<Contact> = known.collect();
        let mut open: Vec<u32> = (0..=PLACES).collect();
        for _ in 0..MOST_LOOKS {
            for contact in holding.drain(..) {
                open.retain(|&place| !holds(&contact, place));
            }
            let place = middle_of_longest(&open)?;
            let there = around.near(&lifted[place as usize]);
            holding.extend(there.contacts.iter().filter(|c| c.gap < -DEPTH_TOLERANCE));
            if holding.is_empty() {
                return Some(at(place));
            }
            open.retain(|&other| other != place);
        }
        None
    }
}

/// Of places, ascending, the one in the middle of the longest row of them.
fn middle_of_longest(places: &[u32]) -> Option<u32> {
    let rows = places.chunk_by(|a, b| a + 1 == *b);
    // The first of those that are as long: where the part comes first.
    let longest = rows.reduce(|longest, row| if row.len() > longest.len() { row } else { longest })?;
    Some(longest[longest.len() / 2])
}
