//! Static analysis by sliding: what contact with one part alone lets another do.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::geometry::Pose;
use crate::termination::{Interrupt, Termination};

use super::super::contact::{Extent, Mover, Near, Vicinity};
use super::super::{Action, Scene};
use super::cells::{Cells, Halt};
use super::drive::{self, Drive, FREE_STEP, Moved, Step, contact_step};
use super::facing::Facing;
use super::push::{self, Push};

/// Steps that the static analysis of a pair looks ahead (the paper's five extensions).
const STATIC_STEPS: usize = 5;
/// The same in steps that end where the next obstacle begins.
const PUSHES: usize = 32;

/// With more looks at either surface than this, fields are quicker: in the play of a thread nearly all samples are near.
const MOST_LOOKS: usize = 1200;

/// Around the start, samples are known as far as so many steps lead.
const START_STEPS: f64 = 2.0;
/// Of lengths, as a share of these.
const ROUNDING: f64 = 1e-9;

/// For each action, whether `other` alone keeps `part` at `pose` from following it by more than
/// `least`: the static analysis that suits this engine, which excludes nothing that could slide.
///
/// # Errors
/// The termination condition became true.
pub fn pair_blocks(
    scene: &Scene,
    part: usize,
    pose: &Pose,
    other: usize,
    actions: &[Action],
    least: f64,
    termination: &Termination,
) -> Result<Vec<bool>, Interrupt> {
    derived(scene, part, other, termination)?;
    if actions.iter().all(|a| !a.turns()) {
        match translations_blocked(scene, part, pose, other, actions, least, termination) {
            Ok(blocked) => return Ok(blocked),
            Err(Halt::Interrupted(interrupt)) => return Err(interrupt),
            Err(Halt::Lost | Halt::Blocked) => {}
        }
    }
    let Some(first) = actions.first() else { return Ok(Vec::new()) };
    let reach = Drive::new(scene, part, pose, *first).reach();
    let mut start = Mover::new(scene, part, *pose).until(termination);
    let is_open = [start.body, &scene.bodies[other]].iter().any(|body| body.shape.surface.is_open());
    let is_exact = !is_open && actions.iter().all(|a| !a.turns());
    let around = if is_exact { Around::of(&start.exactly(), other, (least, reach)) } else { None };
    termination.check()?;
    let near = match &around {
        Some(around) => {
            start = start.exactly();
            around.at_start.within(reach)
        }
        None => start.near_first(other, reach),
    };
    termination.check()?;
    if near.contacts.is_empty() && near.clearance > least {
        return Ok(vec![false; actions.len()]);
    }
    let blocked = |action: &Action| {
        let drive = Drive::new(scene, part, pose, *action);
        let shifted = around.as_ref().map(Shifted::new);
        let mut looks = Looks { other, reach, shifted, seen: Vec::new() };
        let mut step = drive.advance(&start, &mut near.clone(), &mut looks);
        for _ in 1..STATIC_STEPS {
            termination.check()?;
            let Step::Moved(Moved { pose: there, .. }) = step else { return Ok(true) };
            let mover = Mover { pose: there, ..start };
            if (mover.centre() - start.centre()).norm() > least {
                return Ok(false);
            }
            let mut near = looks.from(&mover);
            step = drive.advance(&mover, &mut near, &mut looks);
        }
        // What was found of a cut walk is not to be believed.
        termination.check()?;
        Ok(matches!(step, Step::Stuck { .. }))
    };
    // Side by side, one by one: two parts alone are but one pair, and some take several times as long as others.
    actions.par_iter().with_max_len(1).map(blocked).collect()
}

/// What is near some poses beside one part, each looked at once: a step that is stuck asks about the pose that is wanted
/// with constraints and without, and the next step begins where one ended.
struct Looks<'a> {
    other: usize,
    reach: f64,
    shifted: Option<Shifted<'a>>,
    /// In the step that is being made: where, how far was looked, and what is there.
    seen: Vec<(Pose, f64, Near)>,
}

impl Looks<'_> {
    /// What a step from a pose begins with.
    fn from(&mut self, mover: &Mover<'_>) -> Near {
        let mut near = self.within(self.reach, mover);
        if near.contacts.is_empty() {
            // How long the step may be is told by the clearance, which samples around the start tell less well.
            near = self.looked(self.reach, mover);
        }
        self.seen.clear();
        near
    }

    fn within(&mut self, reach: f64, mover: &Mover<'_>) -> Near {
        let is_seen = |(pose, by, _): &&(Pose, f64, Near)| *pose == mover.pose && *by == reach;
        if let Some((.., near)) = self.seen.iter().find(is_seen) {
            return near.clone();
        }
        let known = self.shifted.as_mut().and_then(|shifted| shifted.near(mover, reach));
        let near = known.unwrap_or_else(|| self.looked(reach, mover));
        self.seen.push((mover.pose, reach, near.clone()));
        near
    }

    fn looked(&self, reach: f64, mover: &Mover<'_>) -> Near {
        match &self.shifted {
            Some(shifted) => shifted.around.looked(mover, reach),
            None => {
                let mut near = Near { contacts: Vec::new(), clearance: f64::INFINITY };
                mover.near_pair(self.other, reach, &mut near);
                near
            }
        }
    }
}

impl drive::Around for Looks<'_> {
    /// Whether a step can be made is told by what enters at its end alone; what is merely near there matters only if
    /// another step follows, and without fields costs next to nothing.
    fn near(&mut self, mover: &Mover<'_>) -> Near {
        self.within(if self.shifted.is_some() { self.reach } else { 0.0 }, mover)
    }
}

/// What is around the start of translations, told without fields.
struct Around {
    vicinity: Vicinity,
    from: Point3<f64>,
    /// All with a gap below this, …
    radius: f64,
    /// … as they are at the start.
    at_start: Near,
}

impl Around {
    /// Of a part that is moved by no more than a step further than `least`, and what is to be found is within `reach`;
    /// none if that takes many looks, which depends on the question alone.
    fn of(start: &Mover<'_>, other: usize, (least, reach): (f64, f64)) -> Option<Self> {
        let radius = START_STEPS * contact_step(&start.body.shape) + reach;
        let vicinity = Vicinity::new(start, other, least + FREE_STEP + reach);
        let at_start = vicinity.near(start, Extent { radius, reach, most: MOST_LOOKS })?;
        Some(Self { vicinity, from: start.centre(), radius, at_start })
    }

    fn looked(&self, mover: &Mover<'_>, reach: f64) -> Near {
        let extent = Extent { radius: reach, reach, most: usize::MAX };
        self.vicinity.near(mover, extent).unwrap_or_else(|| self.at_start.clone())
    }
}

/// What was around the start of a part that is shifted. Shifts change gaps by no more than their length: what is near a
/// pose not far away is among what may be, and nearest to much the same triangles as before.
struct Shifted<'a> {
    around: &'a Around,
    /// Where it was looked, by the part's centre.
    at: Vec<Point3<f64>>,
    /// Of each contact around the start, the gap as measured last, and at which of these.
    last: Vec<(f64, u32)>,
}

impl<'a> Shifted<'a> {
    fn new(around: &'a Around) -> Self {
        let last = around.at_start.contacts.iter().map(|c| (c.gap, 0)).collect();
        Self { around, at: vec![around.from], last }
    }

    /// What is near a pose, of what was around the start; none if that is too far.
    fn near(&mut self, mover: &Mover<'_>, reach: f64) -> Option<Near> {
        let Around { at_start, radius, .. } = self.around;
        let here = mover.centre();
        let ways: Vec<f64> = self.at.iter().map(|there| (here - there).norm() * (1.0 + ROUNDING)).collect();
        let mut near = Near { contacts: Vec::new(), clearance: at_start.clearance.min(*radius) - ways[0] };
        if near.clearance < reach {
            return None;
        }
        for (contact, last) in at_start.contacts.iter().zip(&mut self.last) {
            let mut gap = last.0 - ways[last.1 as usize];
            if gap < reach {
                let there = mover.remeasured(contact, f64::INFINITY)?;
                *last = (there.gap, self.at.len() as u32);
                if there.gap < reach {
                    near.contacts.push(there);
                    continue;
                }
                gap = there.gap;
            }
            near.clearance = near.clearance.min(gap);
        }
        self.at.push(here);
        Some(near)
    }
}

/// Derives what is asked of the shapes of two parts first, if it is not there, side by side: threads that come to one
/// thing at the same time would wait for each other, or do it twice.
fn derived(scene: &Scene, part: usize, other: usize, termination: &Termination) -> Result<(), Interrupt> {
    let [one, two] = [part, other].map(|i| &scene.bodies[i].shape);
    // The other one's patches are seldom asked.
    let first =
        Facing::asked_first(scene, part, other).first().map(|asks_part| if *asks_part { one } else { two });
    let (_, patches) = rayon::join(
        || rayon::join(|| one.surface.prepare(), || two.surface.prepare()),
        || first.map_or(Ok(()), |shape| shape.patches(termination).map(|_| ())),
    );
    patches
}

/// The same by regions, for translations.
fn translations_blocked(
    scene: &Scene,
    part: usize,
    pose: &Pose,
    other: usize,
    actions: &[Action],
    least: f64,
    termination: &Termination,
) -> Result<Vec<bool>, Halt> {
    let standing = [other];
    // What all pushes begin with is found once, and not by each thread that comes to it at the same time.
    let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(FREE_STEP);
    if !actions.is_empty() && !scene.broad_phase.meeting_of(&standing, &bounds).is_empty() {
        Cells::new(scene, (part, pose), termination).add(other, &Vector3::zeros())?;
    }
    let blocked = |action: &Action| {
        let mut push = Push::new(scene, &standing, (part, pose), action.force(), termination).short();
        for _ in 0..PUSHES {
            if let push::Step::Stuck { .. } = push.step()? {
                return Ok(true);
            }
            if push.travel() > least {
                return Ok(false);
            }
        }
        tracing::debug!(part, other, %action, travel = push.travel(), "no end of a short push");
        Err(Halt::Lost)
    };
    actions.par_iter().map(blocked).collect()
}
