//! Releases: where a contact that holds a pull back lets go.
//!
//! A lug that comes before its slot stops the pull of a part that is pulled and turned at once, until it is in line;
//! one step may turn it from one rim of the slot to the other. Without inertia the part goes in where it first can.
//! So a step is searched for places where none of the contacts that hold the pull back does so, and the part is
//! pulled from the middle of these.

use nalgebra::{Translation3, Unit, Vector3, Vector6};

use crate::budgets::{RELEASE_LOOKS, RELEASE_PLACES};
use crate::contact::constraint::VelocityConstraint;
use crate::contact::sampled::{Contact, ContactSet, ContactSource, MovingBody};
use crate::termination::Interrupt;
use crate::tolerances::{CLEARANCE, DEPTH_TOLERANCE, FREE_PULL, OPPOSED_PULL};

use super::super::super::projection::Projected;
use super::{Attempt, Drive, Moved, Step};

/// A step that enters nothing.
pub(super) struct FreeStep<'a> {
    pub(super) mover: &'a MovingBody<'a>,
    pub(super) near: &'a ContactSet,
    pub(super) twist: &'a Vector6<f64>,
    pub(super) result: &'a Projected,
    /// Its constraints, and the contacts that they come from.
    pub(super) rows: &'a [VelocityConstraint],
    pub(super) contacts: &'a [Contact],
}

impl Drive {
    /// The direction of the pull of an action that pulls and turns at once.
    fn pull(&self) -> Option<Unit<Vector3<f64>>> {
        let (pull, turn) = (self.wanted.fixed_rows::<3>(0), self.wanted.fixed_rows::<3>(3));
        if turn == Vector3::zeros() { None } else { Unit::try_new(pull.into_owned(), 0.0) }
    }

    /// Whether a twist belongs to an action that pulls and turns at once, and goes at least half as far along the
    /// pull as wanted.
    pub(super) fn is_pulled(&self, twist: &Vector6<f64>) -> bool {
        let along = |twist: &Vector6<f64>, pull: &Vector3<f64>| twist.fixed_rows::<3>(0).dot(pull);
        self.pull().is_some_and(|pull| along(twist, &pull) > 0.5 * along(&self.wanted, &pull))
    }

    /// The same action without turning: the motion of a part that was released.
    fn pulling(&self, pull: Unit<Vector3<f64>>) -> Self {
        let pull = *pull * self.step;
        Self { wanted: Vector6::new(pull.x, pull.y, pull.z, 0.0, 0.0, 0.0), takes_long_steps: false, ..*self }
    }

    /// A step that only pulls, for an action that pulls and turns at once, if nothing near stops the pull.
    pub(super) fn pulled_free(
        &self,
        mover: &MovingBody<'_>,
        near: &ContactSet,
        around: &mut dyn ContactSource,
    ) -> Result<Option<Moved>, Interrupt> {
        let Some(pull) = self.pull() else { return Ok(None) };
        let pulling = self.pulling(pull);
        let known = pulling.constraints(mover, near)?;
        let got = pulling.solved(&known).map(|solved| solved.w.dot(&pulling.wanted));
        if got.is_none_or(|got| got < FREE_PULL * pulling.wanted.norm_squared()) {
            return Ok(None);
        }
        Ok(match pulling.attempt(mover, near, (&pulling.wanted, false), known, around)? {
            Attempt::Moved(pulled) => Some(pulled),
            Attempt::Stuck(_) | Attempt::Entered(_) => None,
        })
    }

    /// The step that pulls the part out of another step, which would turn it past the place where it can be pulled:
    /// first a share of the other step, then the pull.
    pub(super) fn released(
        &self,
        step: &FreeStep<'_>,
        around: &mut dyn ContactSource,
    ) -> Result<Option<Moved>, Interrupt> {
        let Some(pull) = self.pull() else { return Ok(None) };
        let opposes = |row: &VelocityConstraint| row.a.fixed_rows::<3>(0).dot(&pull) < -OPPOSED_PULL;
        if !step.result.active.iter().any(|(i, _)| opposes(&step.rows[*i])) {
            return Ok(None);
        }
        let lift = Translation3::from(*pull * CLEARANCE);
        let lifted = |place| MovingBody { pose: lift * self.at(step, place).0.pose, ..*step.mover };
        let lifted: Vec<MovingBody<'_>> = (0..=RELEASE_PLACES).map(lifted).collect();
        let known = step.rows.iter().zip(step.contacts).filter(|(row, _)| opposes(row)).map(|(_, c)| *c);
        let mut holding: Vec<Contact> = known.collect();
        let mut open: Vec<u32> = (0..=RELEASE_PLACES).collect();
        for _ in 0..RELEASE_LOOKS {
            for contact in holding.drain(..) {
                close(&mut open, &contact, &lifted, step.twist);
            }
            let Some(place) = middle_of_longest(&open) else { return Ok(None) };
            let up = &lifted[place as usize];
            let mut near = around.near(up)?;
            holding.extend(near.contacts.iter().filter(|c| c.gap < -DEPTH_TOLERANCE));
            if holding.is_empty()
                && let Step::Moved(pulled) = self.pulling(pull).advance(up, &mut near, around)?
                && let Some(turned) = self.turned_to(step, place, around)?
            {
                let start = (place > 0).then(|| self.at(step, place).0.pose);
                let via = start.into_iter().chain([up.pose]).collect();
                return Ok(Some(Moved { turned: turned + pulled.turned, via, ..pulled }));
            }
            open.retain(|&other| other != place);
        }
        Ok(None)
    }

    /// The body at one of the places of a step, and the twist up to there.
    fn at<'m>(&self, step: &FreeStep<'m>, place: u32) -> (MovingBody<'m>, Vector6<f64>) {
        let twist = step.twist * (f64::from(place) / f64::from(RELEASE_PLACES));
        (MovingBody { pose: self.displaced(step.mover, &twist), ..*step.mover }, twist)
    }

    /// The angle by which a step turns the part up to one of its places, if the way there is clear.
    fn turned_to(
        &self,
        step: &FreeStep<'_>,
        place: u32,
        around: &mut dyn ContactSource,
    ) -> Result<Option<f64>, Interrupt> {
        let (mover, twist) = self.at(step, place);
        let near = around.near(&mover)?;
        let is_clear = near.contacts.iter().all(|c| c.gap >= -DEPTH_TOLERANCE)
            && self.is_clear_between((step.mover, step.near), (&mover, &near), &twist, around)?;
        Ok(is_clear.then(|| twist.fixed_rows::<3>(3).norm()))
    }
}

/// Removes those places (ascending) where a contact holds a lifted part.
fn close(open: &mut Vec<u32>, contact: &Contact, lifted: &[MovingBody<'_>], twist: &Vector6<f64>) {
    let mut next = 0;
    while let Some(&place) = open.get(next) {
        let there = &lifted[place as usize];
        let depth = there.remeasured(contact, 0.0).map_or(0.0, |c| -c.gap) - DEPTH_TOLERANCE;
        if depth > 0.0 {
            // A contact that is this deep holds for as long as it moves by less than its depth.
            let travel = there.displacement(contact, twist) / f64::from(RELEASE_PLACES);
            let held = (depth / travel) as u32;
            open.retain(|other| other.abs_diff(place) > held);
        }
        next = open.partition_point(|&other| other <= place);
    }
}

/// The middle of the longest run of places (ascending).
fn middle_of_longest(places: &[u32]) -> Option<u32> {
    let rows = places.chunk_by(|a, b| a + 1 == *b);
    // Of runs of equal length the first: the part comes there first.
    let longest = rows.reduce(|longest, row| if row.len() > longest.len() { row } else { longest })?;
    Some(longest[longest.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{cells, cuboid, moved, scene};
    use crate::geometry::Pose;
    use crate::scene::StandingParts;
    use crate::simulation::sliding::SlidingEngine;
    use crate::simulation::{Action, Axis, End, TransitionFunction};
    use crate::termination::Termination;

    /// A bar in a box, under a lid with a slot that leaves it so much play on either side, turned out of line by
    /// an angle.
    fn bar_under_slot(play: f64, angle: f64) -> [crate::geometry::SourceMesh; 2] {
        let (length, width) = (1.5 + play, 0.3 + play);
        let x = [-3.0, -2.0, -length, length, 2.0, 3.0];
        let y = [-3.0, -2.0, -width, width, 2.0, 3.0];
        let is_solid = |[x, y, z]: [usize; 3]| {
            let (is_inside, is_slot) = ((1..4).contains(&x) && (1..4).contains(&y), x == 2 && y == 2);
            z == 0 || z == 1 && !is_inside || z == 2 && !is_slot
        };
        let bar = cuboid([-1.5, -0.3, 0.0], [1.5, 0.3, 0.4]);
        [cells([&x, &y, &[-0.5, 0.0, 0.5, 1.0]], is_solid), moved(bar, &Pose::rotation(Vector3::z() * angle))]
    }

    #[test]
    fn a_bar_that_is_pulled_and_turned_goes_into_a_slot_that_one_step_turns_it_past() {
        for play in [0.02, 0.005] {
            for degrees in [-20.0, -20.7, -21.4, -60.0] {
                let (scene, verifier) = scene(bar_under_slot(play, f64::to_radians(degrees)));
                let around = StandingParts::new(&scene, vec![0]);
                let (start, t) = (scene.bodies[1].planning_from_shape, Termination::default());
                let action = Action::Screw(Axis::Z, true, true);
                let drive = Drive::new(&scene, 1, &start, action);
                // Either way until the bar touches the slot's wall.
                let in_line = 2.0 * play / 1.5;
                let turn = drive.wanted.fixed_rows::<3>(3).norm();
                assert!(in_line < 0.9 * turn, "in line for {in_line}, and a step turns by {turn}");
                let motion = SlidingEngine.simulate(&scene, &around, 1, &start, action, &t).unwrap();
                assert!(matches!(motion.end, End::Disassembled(_)), "{play} at {degrees}: {:?}", motion.end);
                let verifier = verifier.with_limit(2e-3);
                let verdict = verifier.check(&scene, &scene.allowed, &[0], 1, &motion.path, &t).unwrap();
                assert!(verdict.depth < 2e-3, "{play} at {degrees}: {}", verdict.depth);
            }
        }
    }

    #[test]
    fn the_first_of_the_longest_rows_of_places_is_the_one_whose_middle_is_taken() {
        assert_eq!(middle_of_longest(&[]), None);
        assert_eq!(middle_of_longest(&[4]), Some(4));
        assert_eq!(middle_of_longest(&[0, 2, 3, 4, 7, 8, 9]), Some(3));
    }
}
