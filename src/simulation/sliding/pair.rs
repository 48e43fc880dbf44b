//! Static analysis by sliding: what contact with one part alone lets another do.

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

use crate::geometry::Pose;
use crate::termination::{Interrupt, Termination};

use super::super::contact::{Contact, Mover, Near};
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
    let start = Mover::new(scene, part, *pose).until(termination);
    let Some(first) = actions.first() else { return Ok(Vec::new()) };
    let reach = Drive::new(scene, part, pose, *first).reach();
    let (start, near) = first_look(&start, other, reach);
    termination.check()?;
    if near.contacts.is_empty() && near.clearance > least {
        return Ok(vec![false; actions.len()]);
    }
    let is_shifted = start.is_exact && actions.iter().all(|a| !a.turns());
    let around = is_shifted.then(|| Around::of(&start, other)).flatten();
    let blocked = |action: &Action| {
        let drive = Drive::new(scene, part, pose, *action);
        let mut looks = Looks { other, reach, around: around.as_ref(), seen: Vec::new() };
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
    around: Option<&'a Around>,
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
        let known = self.around.and_then(|around| around.near(mover, reach));
        let near = known.unwrap_or_else(|| self.looked(reach, mover));
        self.seen.push((mover.pose, reach, near.clone()));
        near
    }

    fn looked(&self, reach: f64, mover: &Mover<'_>) -> Near {
        let mut near = Near { contacts: Vec::new(), clearance: f64::INFINITY };
        mover.near_pair(self.other, reach, &mut near);
        near
    }
}

impl drive::Around for Looks<'_> {
    /// Whether a step can be made is told by what enters at its end alone; what is merely near there matters only if
    /// another step follows, and without fields costs next to nothing.
    fn near(&mut self, mover: &Mover<'_>) -> Near {
        self.within(if mover.is_exact { self.reach } else { 0.0 }, mover)
    }
}

/// The samples around a start, with their gaps there, which translations change by no more than their length: what is
/// near a pose not far away is among those that may be, and each is nearest to much the same triangle as before.
struct Around {
    from: Point3<f64>,
    /// All with a gap below this.
    radius: f64,
    contacts: Vec<Contact>,
}

impl Around {
    /// As far as steps of a part may lead.
    fn of(start: &Mover<'_>, other: usize) -> Option<Self> {
        let radius = START_STEPS * contact_step(&start.body.shape);
        let Near { contacts, .. } = start.near_in_few_looks(other, radius, usize::MAX)?;
        Some(Self { from: start.centre(), radius, contacts })
    }

    /// What is near a pose that is a translation away; none if that is too far.
    fn near(&self, mover: &Mover<'_>, reach: f64) -> Option<Near> {
        let way = (mover.centre() - self.from).norm() * (1.0 + 1e-9);
        let mut near = Near { contacts: Vec::new(), clearance: self.radius - way };
        if near.clearance < reach {
            return None;
        }
        for contact in &self.contacts {
            let mut gap = contact.gap - way;
            if gap < reach {
                let there = mover.remeasured(contact, f64::INFINITY)?;
                if there.gap < reach {
                    near.contacts.push(there);
                    continue;
                }
                gap = there.gap;
            }
            near.clearance = near.clearance.min(gap);
        }
        Some(near)
    }
}

/// What is near, and the mover that goes on to look as this did: without fields if that took few looks, which depends
/// on the question alone.
fn first_look<'a>(start: &Mover<'a>, other: usize, reach: f64) -> (Mover<'a>, Near) {
    let exact = start.exactly();
    let is_open = [start.body, &start.scene.bodies[other]].iter().any(|body| body.shape.surface.is_open());
    let near = if is_open { None } else { exact.near_in_few_looks(other, reach, MOST_LOOKS) };
    match near {
        Some(near) => (exact, near),
        None => (*start, start.near_first(other, reach)),
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
