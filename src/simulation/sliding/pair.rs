//! Static analysis with this engine: whether contact with one part alone stops another.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::budgets::{STATIC_PUSHES, STATIC_STEPS};
use crate::contact::region_cover::Halt;
use crate::contact::region_cover::shift::ShiftCover;
use crate::contact::region_cover::surface_pair::SurfacePair;
use crate::contact::sampled::{ContactCache, MovingBody, StartContacts};
use crate::geometry::Pose;
use crate::scene::{PosedPart, Scene};
use crate::termination::{Interrupt, Termination};
use crate::tolerances::FREE_STEP;

use super::super::Action;
use super::drive::{Drive, Moved, Step, contact_step};
use super::push::{self, Push};

/// For each action, whether `other` alone keeps `part` at `pose` from following it by more than `least`: the static
/// analysis for this engine, which excludes nothing that could slide.
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
    let mut start = MovingBody::new(scene, part, *pose).until(termination);
    let is_open = [start.body, &scene.bodies[other]].iter().any(|body| body.shape.surface.is_open());
    let is_exact = !is_open && actions.iter().all(|a| !a.turns());
    let around = if is_exact {
        StartContacts::gather(&start.exactly(), other, contact_step(&start.body.shape), (least, reach))?
    } else {
        None
    };
    let near = match &around {
        Some(around) => {
            start = start.exactly();
            around.near.within(reach)
        }
        None => start.near_first(other, reach)?,
    };
    if near.contacts.is_empty() && near.clearance > least {
        return Ok(vec![false; actions.len()]);
    }
    let blocked = |action: &Action| {
        let drive = Drive::new(scene, part, pose, *action);
        let mut contacts = ContactCache::new(other, reach, around.as_ref());
        let mut step = drive.advance(&start, &mut near.clone(), &mut contacts)?;
        for _ in 1..STATIC_STEPS {
            termination.check()?;
            let Step::Moved(Moved { pose: there, .. }) = step else { return Ok(true) };
            let mover = MovingBody { pose: there, ..start };
            if (mover.centre() - start.centre()).norm() > least {
                return Ok(false);
            }
            let mut near = contacts.at_start_of_step(&mover)?;
            step = drive.advance(&mover, &mut near, &mut contacts)?;
        }
        Ok(matches!(step, Step::Stuck { .. }))
    };
    // In parallel, one by one: two parts are but one pair, and some actions take several times as long as others.
    actions.par_iter().with_max_len(1).map(blocked).collect()
}

/// Derives in parallel what the queries need of both shapes, if it is missing: threads that come to one thing at the
/// same time would wait for each other, or do it twice.
fn derived(scene: &Scene, part: usize, other: usize, termination: &Termination) -> Result<(), Interrupt> {
    let [one, two] = [part, other].map(|i| &scene.bodies[i].shape);
    // The patch tree of the other part is seldom needed.
    let first = SurfacePair::coverable_sides(scene, part, other)
        .first()
        .map(|covers_part| if *covers_part { one } else { two });
    let (_, patches) = rayon::join(
        || rayon::join(|| one.surface.prepare(), || two.surface.prepare()),
        || first.map_or(Ok(()), |shape| shape.patches(termination).map(|_| ())),
    );
    patches
}

/// The same for translations, by a region cover.
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
    // The cover from which all pushes start is computed once, and not by each thread that comes to it at the same
    // time.
    let bounds = scene.bodies[part].shape.bounds().transformed(pose).grown(FREE_STEP);
    if !actions.is_empty() && !scene.broad_phase.meeting_of(&standing, &bounds).is_empty() {
        ShiftCover::new(scene, PosedPart::new(part, pose), termination).add(other, &Vector3::zeros())?;
    }
    let blocked = |action: &Action| {
        let mut push =
            Push::new(scene, &standing, PosedPart::new(part, pose), action.force(), termination).short();
        for _ in 0..STATIC_PUSHES {
            if let push::PushStep::Stuck { .. } = push.step()? {
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
