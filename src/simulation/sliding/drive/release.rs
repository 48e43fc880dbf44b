//! Where what holds a pull back lets go.
//!
//! Of a part that is pulled and turned at once, a lug that comes before its slot stops the pull until it is in
//! line, and a step may well turn it from one rim of the slot to the other. Without inertia the part goes in
//! where it first can; so a step is looked through for the places where nothing that is known to hold the pull
//! back does so, and ends in the middle of those.

use nalgebra::{Translation3, Unit, Vector3, Vector6};

use super::super::super::contact::{Contact, Mover, Near};
use super::super::super::projection::{Projected, Row};
use super::super::DEPTH_TOLERANCE;
use super::{Around, Drive};

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
    pub(super) twist: &'a Vector6<f64>,
    pub(super) result: &'a Projected,
    /// Its constraints, and the contacts that they come from.
    pub(super) rows: &'a [Row],
    pub(super) contacts: &'a [Contact],
}

impl Drive {
    /// The same without turning: what a part that was let go does next.
    pub(in super::super) fn pulling(&self) -> Self {
        let pull = self.pull().map_or(Vector3::zeros(), |pull| *pull * self.step);
        Self { wanted: Vector6::new(pull.x, pull.y, pull.z, 0.0, 0.0, 0.0), takes_long_steps: false, ..*self }
    }

    /// Which way it is pulled, if it is pulled and turned at once.
    fn pull(&self) -> Option<Unit<Vector3<f64>>> {
        let (pull, turn) = (self.wanted.fixed_rows::<3>(0), self.wanted.fixed_rows::<3>(3));
        if turn == Vector3::zeros() { None } else { Unit::try_new(pull.into_owned(), 0.0) }
    }

    /// The twist after which what held the pull back at the start of a step has let go, for a part of the step at
    /// least, and what is near there.
    pub(super) fn released<'m>(
        &self,
        step: &Taken<'m>,
        around: &mut dyn Around,
    ) -> Option<(Vector6<f64>, Mover<'m>, Near)> {
        let pull = self.pull()?;
        let opposes = |row: &Row| row.a.fixed_rows::<3>(0).dot(&pull) < -LEAST_OPPOSED;
        if !step.result.active.iter().any(|(i, _)| opposes(&step.rows[*i])) {
            return None;
        }
        let at = |place: u32| {
            let twist = step.twist * (f64::from(place) / f64::from(PLACES));
            (twist, Mover { pose: self.displaced(step.mover, &twist), ..*step.mover })
        };
        let lifted =
            |mover: &Mover<'m>| Mover { pose: Translation3::from(*pull * LIFT) * mover.pose, ..*mover };
        let lifted_at: Vec<Mover<'m>> = (0..=PLACES).map(|place| lifted(&at(place).1)).collect();
        let holds = |contact: &Contact, place: u32| {
            let there = lifted_at[place as usize].remeasured(contact, 0.0);
            there.is_some_and(|c| c.gap < -DEPTH_TOLERANCE)
        };
        let known = step.rows.iter().zip(step.contacts).filter(|(row, _)| opposes(row)).map(|(_, c)| *c);
        let mut holding: Vec<Contact> = known.collect();
        if !holding.iter().any(|c| holds(c, 0)) {
            return None;
        }
        let mut open: Vec<u32> = (1..=PLACES).collect();
        for _ in 0..MOST_LOOKS {
            for contact in holding.drain(..) {
                open.retain(|&place| !holds(&contact, place));
            }
            let place = middle_of_longest(&open)?;
            let there = around.near(&lifted_at[place as usize]);
            holding.extend(there.contacts.iter().filter(|c| c.gap < -DEPTH_TOLERANCE));
            if holding.is_empty() {
                let (twist, mover) = at(place);
                let near = around.near(&mover);
                let is_clear = near.contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE);
                return is_clear.then_some((twist, mover, near));
            }
            // What regions tell of a pose may be gone at a place beside it.
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
